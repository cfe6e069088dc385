"""A table of a design file, of an assembly's or of a kit's."""

from __future__ import annotations

import re

from pydantic import BaseModel, ConfigDict, field_validator

_UNWRITABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Control characters but tab and line end, and what XML 1.0 does not allow at all."""


class Section(BaseModel):
    """A frozen table of a design file that knows all its keys.

    Texts stand in pictures, pages and tables, so they hold no character that cannot be written
    there.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    @field_validator("*")
    @classmethod
    def _can_be_written(cls, value: object) -> object:
        return writable(value)


def writable(value: object) -> object:
    """The same value. Raises ValueError for a text that pages and pictures cannot hold."""
    found = _UNWRITABLE.search(value) if isinstance(value, str) else None
    if found is not None:
        raise ValueError(
            f"must be plain text; remove the character U+{ord(found[0]):04X} "
            f"at place {found.start() + 1}"
        )
    return value
