"""Holding a JSON document against the schema of its format."""

from __future__ import annotations

from typing import Any

import jsonschema
import pytest

from sbafab.cli.formats import schema_of


def hold(name: str, document: Any) -> None:
    """Fails where the document is not of its schema, says more than that, or could say less."""
    schema = schema_of(name)
    jsonschema.validate(document, _closed(schema))
    for key in schema.get("required", ()):
        less = {other: value for other, value in document.items() if other != key}
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(less, schema)


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
