"""Holding a JSON document against the schema of its format."""

from __future__ import annotations

from functools import cache
from typing import Any

from jsonschema import Draft202012Validator

from sbafab.cli.formats import schema_of


def hold(name: str, document: Any) -> None:
    """Fails where the document is not of its schema, says more than that, or could say less."""
    closed, plain = _validators(name)
    closed.validate(document)
    for key in plain.schema.get("required", ()):
        less = {other: value for other, value in document.items() if other != key}
        assert not plain.is_valid(less), f"{name} could leave out {key}"


@cache
def _validators(name: str) -> tuple[Draft202012Validator, Draft202012Validator]:
    """Validators of a format with every object closed, and as it is: each schema is one."""
    schema = schema_of(name)
    # First what is required, so that a document without it is refused before it is read whole.
    plain = {key: schema[key] for key in sorted(schema, key=lambda key: key != "required")}
    validators = Draft202012Validator(_closed(schema)), Draft202012Validator(plain)
    for validator in validators:
        validator.check_schema(validator.schema)
    return validators


def _closed(schema: Any) -> Any:
    """The schema with every object closed, so that no key goes undescribed."""
    if isinstance(schema, list):
        return [_closed(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    closed = {key: _closed(value) for key, value in schema.items()}
    if isinstance(schema.get("properties"), dict) and schema.get("type") == "object":
        closed.setdefault("additionalProperties", False)
    return closed
