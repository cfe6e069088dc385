"""A table of a design file, of an assembly's or of a kit's."""

from __future__ import annotations

import ast
import functools
import inspect
import re
import textwrap
from itertools import pairwise
from typing import Any

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler, field_validator

_UNWRITABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Control characters but tab and line end, and what XML 1.0 does not allow at all."""


class Section(BaseModel):
    """A frozen table of a design file that knows all its keys.

    Texts appear in pictures, pages and tables, so characters that cannot be written there are not
    allowed. A validator is built when the first table is read, and docstrings of keys are read when
    a schema is requested: a command needs the tables of one family only. So a default that is a
    table is made by ``model_construct()``, which needs no validator.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, defer_build=True
    )

    @field_validator("*")
    @classmethod
    def _can_be_written(cls, value: object) -> object:
        return writable(value)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: GetJsonSchemaHandler) -> Any:
        """With each key's docstring as its description."""
        for field in cls.model_fields.values():
            if isinstance(field.default, BaseModel):
                # Pydantic before 2.14 writes a default including parts that its record has not
                # built yet.
                type(field.default).model_rebuild()
        schema = handler(core)
        keys = handler.resolve_ref_schema(schema).get("properties", {})
        for record in (base for base in cls.__mro__ if base is not Section):
            if issubclass(record, Section):
                for name, description in _descriptions(record):
                    key = cls.model_fields[name].alias or name
                    keys.get(key, {}).setdefault("description", description)
        return schema


@functools.cache
def _descriptions(record: type[Section]) -> tuple[tuple[str, str], ...]:
    """The keys of a record, without inherited ones, and their docstrings.

    Python parses the whole module to find a class, and many records inherit the same.
    """
    (body,) = ast.parse(textwrap.dedent(inspect.getsource(record))).body
    assert isinstance(body, ast.ClassDef)
    descriptions = []
    for key, description in pairwise(body.body):
        if isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name):
            match description:
                case ast.Expr(value=ast.Constant(value=str(text))):
                    if key.target.id in record.model_fields:
                        descriptions.append((key.target.id, inspect.cleandoc(text)))
    return tuple(descriptions)


def writable(value: object) -> object:
    """Return the value. Raises ValueError for a text that pages and pictures cannot hold."""
    match = _UNWRITABLE.search(value) if isinstance(value, str) else None
    if match is not None:
        raise ValueError(
            f"must be plain text; remove the character U+{ord(match[0]):04X} "
            f"at place {match.start() + 1}"
        )
    return value
