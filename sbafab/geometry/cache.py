"""Caches: values stored in records, and results of functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache, wraps
from typing import Any, ParamSpec, TypeVar

Value = TypeVar("Value")
Record = TypeVar("Record")
Arguments = ParamSpec("Arguments")

MOST = 256
"""Results kept per function, which bounds the memory over any number of designs."""


def stored(record: Record, name: str, compute: Callable[[Record], Value]) -> Value:
    """Return ``compute(record)``, computed once and stored in the record under ``name``.

    This is for values of a record that another module defines. The value must not hold the record.
    """
    values = record.__dict__
    if name not in values:
        values[name] = compute(record)
    value: Value = values[name]
    return value


class _Call:
    """Arguments of a function, compared by their exact numbers, since regions compare equal within
    a tolerance.
    """

    __slots__ = ("arguments", "hash", "named")

    def __init__(self, arguments: tuple[Any, ...], named: Mapping[str, Any]) -> None:
        self.arguments, self.named = arguments, named
        self.hash = hash((_hash(arguments), *named.items()))

    def __hash__(self) -> int:
        return self.hash

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, _Call)
            and self.named == other.named
            and _is_same(self.arguments, other.arguments)
        )


def _hash(value: Any) -> int:
    if isinstance(value, tuple):
        return hash(tuple(map(_hash, value)))
    return value.exact_hash if hasattr(value, "exact_hash") else hash(value)


def _is_same(a: Any, b: Any) -> bool:
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(_is_same, a, b))
    return bool(a.is_exactly(b) if hasattr(a, "is_exactly") else a == b)


def cached(function: Callable[Arguments, Value], most: int = MOST) -> Callable[Arguments, Value]:
    """Return the function with a cache of its last ``most`` results.

    Arguments are regions, tuples of them, and other hashable values. A result is shared between
    calls and must not be changed.
    """

    @lru_cache(maxsize=most)
    def computed(call: _Call) -> Value:
        return function(*call.arguments, **call.named)

    @wraps(function)
    def cached_function(*arguments: Arguments.args, **named: Arguments.kwargs) -> Value:
        return computed(_Call(arguments, named))

    return cached_function
