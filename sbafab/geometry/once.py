"""Values of records that do not change, worked out once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

Made = TypeVar("Made")
Record = TypeVar("Record")


def keeping(kind: type[Record]) -> type[Record]:
    """Says that records of this class keep values: compiled, too, each has its dictionary."""
    return kind


class once(Generic[Made]):  # noqa: N801
    """An attribute that is worked out when it is first asked for, and then stays with its record.

    As ``functools.cached_property``, but without the lock that it takes before Python 3.12.
    """

    def __init__(self, make: Callable[[Any], Made]) -> None:
        self.make = make
        self.__doc__ = make.__doc__

    def __set_name__(self, kind: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, record: None, kind: type) -> once[Made]: ...
    @overload
    def __get__(self, record: object, kind: type) -> Made: ...
    def __get__(self, record: object | None, kind: type) -> once[Made] | Made:
        if record is None:
            return self
        found = record.__dict__[self.name] = self.make(record)
        return found
