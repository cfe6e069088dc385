"""A table of a design file, an assembly file or a kit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from pydantic import ConfigDict, field_validator, model_validator

from sbafab.documents import Described

_UNWRITABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Control characters but tab and line end, and what XML 1.0 does not allow at all."""
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"
PART_PATTERN = r"^[A-Za-z][A-Za-z0-9_-]{0,31}$"
FACE_PATTERN = r"^[a-z][a-z0-9_-]{0,31}$"
BATCH_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9.]{0,11}$"
DATE_PATTERN = r"^\d{4}-\d{2}-\d{2}$"
PATTERNS = {
    NAME_PATTERN: "must be 1 to 64 letters, digits, dots, dashes or underscores, beginning with a "
    "letter or digit",
    PART_PATTERN: "must be 1 to 32 letters, digits, dashes or underscores, beginning with a letter",
    FACE_PATTERN: "must be 1 to 32 small letters, digits, dashes or underscores, beginning with a "
    "letter",
    BATCH_PATTERN: "must be 1 to 12 letters, digits or dots, beginning with a letter or digit",
    DATE_PATTERN: "must be a date such as 2026-03-31",
}
"""Descriptions of texts that must match a pattern."""


class Section(Described):
    """A frozen table of a design file with a fixed set of keys.

    Texts appear in pictures, pages and tables, so characters that these cannot show are not
    allowed.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @field_validator("*")
    @classmethod
    def _can_be_written(cls, value: object) -> object:
        return writable(value)


class NamedTables(Section):
    """A table with keys chosen by the user; their type is in ``__pydantic_extra__``."""

    model_config = ConfigDict(extra="allow")
    what: ClassVar[str]
    """The thing that a name names, for messages."""
    names: ClassVar[str]
    """Pattern of a name."""
    names_are: ClassVar[str]
    """Its description."""
    most: ClassVar[int] = 200

    @model_validator(mode="after")
    def _names_can_be_written(self) -> Self:
        for name in self.by_name:
            if not re.fullmatch(self.names, name):
                raise ValueError(
                    f"has a {self.what} named {name[:40]!r}; a name is {self.names_are}"
                )
        if len(self.by_name) > self.most:
            count = len(self.by_name)
            raise ValueError(f"has {count} {self.what}s; the limit is {self.most}")
        return self

    @property
    def by_name(self) -> Mapping[str, Any]:
        return self.__pydantic_extra__ or {}


def writable(value: object) -> object:
    """Return the value. Raises ValueError for a text that pages and pictures cannot show."""
    match = _UNWRITABLE.search(value) if isinstance(value, str) else None
    if match is not None:
        raise ValueError(
            f"must be plain text; remove the character U+{ord(match[0]):04X} "
            f"at position {match.start() + 1}"
        )
    return value
