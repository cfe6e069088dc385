"""Caches: values stored in records, results of functions."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from threading import Lock
from typing import Generic, ParamSpec, TypeVar

Value = TypeVar("Value")
Record = TypeVar("Record")
Arguments = ParamSpec("Arguments")
Several = TypeVar("Several", bound=tuple[object, ...])

MOST = 256
"""Results kept per function, which bounds the memory over any number of designs."""


def stored(record: Record, name: str, compute: Callable[[Record], Value]) -> Value:
    """Return ``compute(record)``, computed once and stored in the record under ``name``.

    For values of a record that another module defines. The value must not hold the record.
    """
    values = record.__dict__
    if name not in values:
        values[name] = compute(record)
    value: Value = values[name]
    return value


class Exact:
    """A record that compares equal within a tolerance, but is a cache key by its exact numbers.

    Not an abstract base class: the cache tests every key against it, which would be slow.
    """

    def exact_hash(self) -> int:
        """Return a hash of the exact numbers."""
        raise NotImplementedError

    def is_exactly(self, other: object) -> bool:
        """Return True if the other record holds exactly the same numbers."""
        raise NotImplementedError


class _Key:
    """The arguments of a call: Exact records, tuples of them, and other values that hash."""

    __slots__ = ("_hash", "arguments")

    def __init__(self, arguments: tuple[object, ...]) -> None:
        self.arguments = arguments
        self._hash = hash(tuple([_hash(value) for value in arguments]))

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and _are_same(self.arguments, other.arguments)


def _hash(value: object) -> int:
    if isinstance(value, Exact):
        return value.exact_hash()
    if isinstance(value, tuple) and value and isinstance(value[0], Exact):
        return hash(tuple([_hash(item) for item in value]))
    return hash(value)


def _are_same(a: tuple[object, ...], b: tuple[object, ...]) -> bool:
    return len(a) == len(b) and all(map(_is_same, a, b))


def _is_same(a: object, b: object) -> bool:
    if isinstance(a, Exact):
        return a.is_exactly(b)
    if isinstance(a, tuple) and a and isinstance(a[0], Exact):
        return isinstance(b, tuple) and _are_same(a, b)
    return a == b


class _Results(Generic[Value]):
    """The last results of a function, by the arguments of their calls."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.by_key: dict[_Key, Value] = {}
        self.lock = Lock()

    def add(self, key: _Key, value: Value) -> None:
        with self.lock:
            self.by_key[key] = value
            if len(self.by_key) > self.most:
                del self.by_key[next(iter(self.by_key))]


def cached(function: Callable[Arguments, Value], most: int = MOST) -> Callable[Arguments, Value]:
    """Return the function with a cache of its last ``most`` results.

    Arguments are regions, tuples of them, and other values that hash. A result is shared between
    calls and must not be changed.
    """
    results: _Results[tuple[Value]] = _Results(most)
    by_key = results.by_key

    @wraps(function)
    def cached_function(*arguments: Arguments.args, **named: Arguments.kwargs) -> Value:
        key = _Key((*arguments, *named.items()) if named else arguments)
        result = by_key.get(key)
        if result is None:
            result = (function(*arguments, **named),)
            results.add(key, result)
        return result[0]

    return cached_function
