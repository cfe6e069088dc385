"""Messages of rules and checks, by their catalogue ids, and their text.

A finding holds the id of its sentence and the facts that fill it; only readers use the text.
"""

from __future__ import annotations

import string
from collections.abc import Mapping
from typing import Any, NamedTuple

from sbafab.catalogue import catalogue
from sbafab.geometry.edges import Point
from sbafab.laminate.laminate import Layer

WORDS = "words"
"""Table of the words that several rules use."""
FAIL, REMEDY = "-fail", "-remedy"
"""Endings of the sentences for a failure, and for what a warning asks to do."""


class Explanation(NamedTuple):
    """The condition that ``holds`` if a rule passes, ``why`` it matters, how to ``mend`` it.

    ``keys`` of a design file set the limit or the measured value. ``at_most``: the limit of a check
    is the largest value allowed; a rule states this in its ``Rule``.
    """

    holds: str
    why: str
    mend: str
    keys: tuple[str, ...] = ()
    at_most: bool = False


class Clause(NamedTuple):
    """A sentence or part of one: its id, "rule.sentence", and the facts that fill it, by name."""

    id: str
    facts: tuple[tuple[str, Any], ...] = ()

    def __str__(self) -> str:
        return tell(self, {})

    def also(self, **facts: Any) -> Clause:
        """Return the clause with facts added or replaced."""
        return say(self.id, **{**dict(self.facts), **facts})


def explained(name: str) -> Explanation:
    """Return the explanation of a rule or check."""
    table = catalogue()[name]
    keys, at_most = tuple(table["keys"]), table.get("at_most", False)
    return Explanation(table["holds"], table["why"], table["mend"], keys, at_most)


def is_said(sentence: str) -> bool:
    """Return True if the catalogue has the sentence."""
    rule, name = sentence.split(".")
    return name in catalogue()[rule]["says"]


def say(sentence: str, **facts: Any) -> Clause:
    """Return a clause; lists become tuples, so that it can be hashed."""
    rows = ((name, tuple(fact) if isinstance(fact, list) else fact) for name, fact in facts.items())
    return Clause(sentence, tuple(rows))


def layer_name(layer: Layer) -> Clause:
    return say("words.layer", index=layer.index, name=layer.name)


def tell(clause: Clause, outer: Mapping[str, Any]) -> str:
    """Return the text of a clause; missing facts come from the enclosing sentence."""
    rule, name = clause.id.split(".")
    text: str = catalogue()[rule]["says"][name]
    return _Teller(rule).vformat(text, (), {**outer, **dict(clause.facts)}) if "{" in text else text


def at(p: Point) -> str:
    """Return a point in the format of messages."""
    return f"x {round(p[0], 3) + 0.0:.3f}, y {round(p[1], 3) + 0.0:.3f}"


class _Teller(string.Formatter):
    """Fills a sentence of a rule with facts, other sentences of the rule, and words."""

    def __init__(self, rule: str) -> None:
        self.rule = rule

    def get_value(self, key: int | str, args: Any, kwargs: Mapping[str, Any]) -> Any:
        if key in kwargs:
            fact = kwargs[str(key)]
        else:
            value = f"{self.rule}.{key}"
            fact = Clause(value if is_said(value) else f"{WORDS}.{key}")
        return tell(fact, kwargs) if isinstance(fact, Clause) else fact

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, tuple):
            is_text = value and isinstance(value[0], str | Clause)
            return " and ".join(map(str, value)) if is_text else at(value)
        if isinstance(value, int) and format_spec[:2].isalpha():
            return f"{value} {format_spec}{'' if value == 1 else 's'}"
        return str(super().format_field(value, format_spec))
