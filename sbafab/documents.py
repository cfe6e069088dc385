"""Documents for programs: JSON and its published schema, from one declaration of the fields."""

from __future__ import annotations

import ast
import functools
import inspect
import textwrap
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Self

from pydantic import (
    AliasChoices,
    AliasPath,
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    PlainSerializer,
    TypeAdapter,
    WithJsonSchema,
)


class Described(BaseModel):
    """A table whose schema describes each key by its docstring.

    A validator is built when the first table is read, and docstrings of keys are read when a schema
    is requested, since a command needs only some tables. Therefore a default that is a table is
    made by ``model_construct()``, which needs no validator.
    """

    model_config = ConfigDict(defer_build=True)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: GetJsonSchemaHandler) -> Any:
        for field in cls.model_fields.values():
            if isinstance(field.default, BaseModel):
                # Pydantic before 2.14 writes a default including parts that its record has not
                # built yet.
                type(field.default).model_rebuild()
        schema = handler(core)
        keys = handler.resolve_ref_schema(schema).get("properties", {})
        for record in cls.__mro__[: cls.__mro__.index(Described)]:
            if issubclass(record, Described):
                for name, description in _descriptions(record):
                    key = cls.model_fields[name].alias or name
                    keys.get(key, {}).setdefault("description", description)
        return schema


@functools.cache
def _descriptions(record: type[Described]) -> tuple[tuple[str, str], ...]:
    """Return the keys of a record, without inherited ones, and their docstrings.

    Python parses the whole module to find a class, and many records inherit the same keys.
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


class Document(Described):
    """A document, or a table of one: its keys are the fields, which their docstrings describe.

    A key with a default may be missing.
    """

    model_config = ConfigDict(from_attributes=True)

    SCHEMA: ClassVar[str]
    """Id of a document that is written by itself."""

    def __init_subclass__(cls, schema: str = "", **settings: Any) -> None:
        cls.SCHEMA = schema
        super().__init_subclass__(**settings)

    @classmethod
    def read(cls, record: object, **more: object) -> Self:
        """Return the document of a record: its attributes by name, and ``more``."""
        return cls.model_validate(_Joined(record, more))

    @classmethod
    def of(cls, record: object, **more: object) -> dict[str, Any]:
        """Return the document of a record as JSON."""
        keys = cls.read(record, **more).model_dump(mode="json", by_alias=True, exclude_unset=True)
        return {"schema": cls.SCHEMA, **keys} if cls.SCHEMA else keys


def json_schema(record: Any, identity: str) -> dict[str, Any]:
    """Return the JSON schema of a record or document that is written below its id."""
    body = TypeAdapter(record).json_schema(mode="serialization")
    if "properties" not in body:
        return body
    required = [key for key in body.get("required", ()) if key != "schema"]
    keys = {**body["properties"], "schema": {"const": identity}}
    return {**body, "properties": keys, "required": ["schema", *required]}


class _Joined:
    """A record with additional attributes."""

    def __init__(self, record: object, more: dict[str, object]) -> None:
        self._record = record
        self.__dict__.update(more)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._record, name)


def attribute(path: str) -> Any:
    """Return a field with a value elsewhere in the record: a dotted path to it.

    It is None if an attribute on the path is.
    """
    first, *rest = path.split(".")
    places = [int(name) if name.isdigit() else name for name in rest]
    paths = (AliasPath(first, *places[:count]) for count in range(len(places), -1, -1))
    return Field(validation_alias=AliasChoices(*paths))


PlainNumber = Annotated[int | float, WithJsonSchema({"type": "number"})]
"""A number as it stands in the record: 6 is not written as 6.0."""


def _short(value: float) -> float:
    return float(f"{value:.7g}")


Short = Annotated[float, PlainSerializer(_short, return_type=float)]
"""A number that is written to seven digits."""
