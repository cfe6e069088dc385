"""Caches: values stored in records, results of functions."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, ParamSpec, TypeVar

Value = TypeVar("Value")
Record = TypeVar("Record")
Arguments = ParamSpec("Arguments")

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
    """A record that is told from others by its exact numbers."""

    __slots__ = ("record",)

    def __init__(self, record: Exact) -> None:
        self.record = record

    def __hash__(self) -> int:
        return self.record.exact_hash()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self.record.is_exactly(other.record)


def _key(value: Any) -> Any:
    if isinstance(value, Exact):
        return _Key(value)
    is_of_records = isinstance(value, tuple) and value and isinstance(value[0], Exact)
    return tuple(map(_key, value)) if is_of_records else value


def _value(key: Any) -> Any:
    if isinstance(key, _Key):
        return key.record
    is_of_records = isinstance(key, tuple) and key and isinstance(key[0], _Key)
    return tuple(map(_value, key)) if is_of_records else key


def cached(function: Callable[Arguments, Value], most: int = MOST) -> Callable[Arguments, Value]:
    """Return the function with a cache of its last ``most`` results.

    Arguments are regions, tuples of them, and other values that hash. A result is shared between
    calls and must not be changed.
    """

    @lru_cache(maxsize=most)
    def computed(arguments: tuple[Any, ...], named: tuple[tuple[str, Any], ...]) -> Value:
        values: Any = [_value(key) for key in arguments]
        return function(*values, **dict(named))

    @wraps(function)
    def cached_function(*arguments: Arguments.args, **named: Arguments.kwargs) -> Value:
        return computed(tuple([_key(value) for value in arguments]), tuple(named.items()))

    return cached_function
