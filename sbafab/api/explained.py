"""Meanings of rules, keys of design files, quantities and terms."""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from sbafab.api.designs import ROW, JsonSchema, family_tables, schema, schema_keys
from sbafab.documents import Document
from sbafab.errors import DesignError
from sbafab.rules.deck import EXPLAINED
from sbafab.rules.sentences import Explanation
from sbafab.search.quantities import QUANTITIES, QuantityName

MEASURED = "a text with its unit"
TERMS: Mapping[str, str] = {
    "extrapolation": (
        "A flag of a figure: its film, diameter or number of balloons is so far from what was "
        "measured that more than the evidence is assumed, and its interval is wide. Take it for a "
        "first guess, and measure one actuator."
    ),
    "near-burst": (
        "A flag of a figure: its pressure is above half of the estimated burst pressure, which is "
        "of three actuators. Work at less pressure, or take smaller pockets or a thicker film."
    ),
    "calibration": (
        "Values of what models do not know, such as modulus, pressed height and pocket size, "
        "fitted to measurements; they give figures their 90 % intervals. models.calibration names "
        'the paper\'s, "none", or a file that sbafab calibrate wrote from yours.'
    ),
    "press-factor": (
        "The thickness of films after the press over that before, of those that melt in it "
        "(press_factor of predict.json). The calibration gives 0.204 for the paper's film; any "
        "other counts as bought until you calibrate on folded heights of it."
    ),
    "pocket-loss": (
        "By how many mm the radius of a pocket comes out smaller than drawn, since molten film "
        "creeps under the mask (pocket_loss of predict.json). The calibration gives it; values "
        "that you measured on an actuator narrow it."
    ),
}
"""Flags of figures, and factors of predictions, each in two sentences."""


@dataclass(frozen=True)
class DesignKey:
    """A key of design files, of one or several families, as text for readers."""

    key: str
    meaning: str
    default: str
    allowed: str
    families: tuple[str, ...] = ()


class ExplainDocument(Document, schema="sbafab/explain@1"):
    """The output of ``explain NAME --json``: a rule, keys, quantities or a term."""

    rule: str = ""
    holds: str = ""
    why: str = ""
    mend: str = ""
    keys: tuple[str, ...] | tuple[DesignKey, ...] = ()
    quantities: tuple[QuantityName, ...] = ()
    term: str = ""
    meaning: str = ""


class ExplainedDocument(Document, schema="sbafab/explained@1"):
    """The output of ``explain --json``: all rules."""

    rules: dict[str, Explanation]


def explained(name: str) -> dict[str, Any]:
    """Return the keys of ExplainDocument for a name. Raises DesignError with the nearest one."""
    if name in EXPLAINED:
        return {"rule": name, **EXPLAINED[name]._asdict()}
    if (term := name.replace("_", "-")) in TERMS:
        return {"term": term, "meaning": TERMS[term]}
    written = name.partition("@")[0].replace("-", "_")
    if quantities := [row for row in QUANTITIES if row.name == written]:
        return {"quantities": quantities}
    keys = design_keys()
    section = [row for row in keys if row.key.startswith(f"{name}.")]
    if chosen := section or [row for row in keys if row.key == name]:
        return {"keys": chosen}
    near = difflib.get_close_matches(name, explainable_names(), 1)
    hint = f"did you mean {near[0]}?" if near else "sbafab explain lists all rules"
    raise DesignError(f"{name!r} is not a rule, key or quantity; {hint}")


def explainable_names() -> list[str]:
    """Return the names of all rules, checks, keys, quantities and terms."""
    keys = dict.fromkeys(row.key for row in design_keys())
    return [*EXPLAINED, *keys, *(row.name for row in QUANTITIES), *TERMS]


def design_keys(document: JsonSchema | None = None) -> list[DesignKey]:
    """Return every key of design files from their JSON schema, in the order of the file.

    A key that is equal in two families is listed once, with both names.
    """
    document = document or schema()
    families: dict[DesignKey, list[str]] = {}
    for name, record in family_tables(document):
        for key, rule in schema_keys(record, document):
            meaning = " ".join(rule.get("description", "").replace("``", "").split())
            default = "required" if "const" in rule else _default(rule)
            allowed = rule["const"] if "const" in rule and key != "family" else _allowed(rule)
            row = DesignKey(key.replace(ROW, ""), meaning, default, allowed)
            families.setdefault(row, []).append(name)
    return [replace(row, families=tuple(names)) for row, names in families.items()]


def _default(value: Mapping[str, Any]) -> str:
    if "default" not in value:
        return "required"
    default = value["default"]
    return "none" if default in (None, {}, []) else json.dumps(default, ensure_ascii=False)


def _allowed(value: Mapping[str, Any]) -> str:
    """Return the choices, kinds and limits of a key."""
    choices = value.get("anyOf", (value,))
    is_length = any("mm" in choice.get("pattern", "") for choice in choices)
    if any(choice.get("type") == "number" for choice in choices):
        # A text that stands for a number is one with its unit.
        choices = [{**row, "type": MEASURED} if "pattern" in row else row for row in choices]
    kinds = [_kind(choice, is_length) for choice in choices if choice.get("type") != "null"]
    return ", or ".join(dict.fromkeys(filter(None, kinds))) or "see its meaning"


def _kind(value: Mapping[str, Any], is_length: bool) -> str:
    if "enum" in value:
        return ", ".join(map(str, value["enum"]))
    kind = str(value.get("type"))
    if kind == "array":
        return "a list of them" if is_length or "items" in value else "a list"
    if kind == MEASURED:
        return "a length with its unit" if is_length else MEASURED
    words = {"boolean": "true or false", "string": "text", "integer": "a whole number"}
    words["number"] = "mm" if is_length else "a number"
    low = value.get("minimum", value.get("exclusiveMinimum"))
    high = value.get("maximum", value.get("exclusiveMaximum"))
    above = "" if low is None else f" {'above' if 'exclusiveMinimum' in value else 'from'} {low:g}"
    below = "" if high is None else f" {'below' if 'exclusiveMaximum' in value else 'to'} {high:g}"
    return words.get(kind, "") + above + below
