"""Vary keys over values: grids and Latin hypercubes of designs."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from sbafab.design.files import as_in_a_file, override, shown
from sbafab.design.records import Design, Free, keys_of
from sbafab.design.units import millimetres
from sbafab.errors import DesignError

MOST_DESIGNS = 100_000
MOST_VALUES = 10_000
DIGITS = 6
NOTHING = "-"
"""Text of a value that is not there."""

Values = Mapping[str, Any]
"""A value for each varied key, by dotted key."""


@dataclass(frozen=True)
class KeyDifference:
    """A key that differs, and its two values; None if a design has no such key."""

    key: str
    values: tuple[Any, Any]


def key_values(design: Design) -> dict[str, Any]:
    """Return the value of every key of a design."""
    return {key: value for key, value, _ in keys_of(design)}


def format_value(value: Any) -> str:
    """Return the value of a key for display, a list in brackets."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(format_value, value))}]"
    if value is None:
        return NOTHING
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def format_keys(values: Values) -> str:
    """Return keys with their values for display."""
    return ", ".join(f"{key} = {format_value(value)}" for key, value in values.items())


def varied_keys(vary: Mapping[str, str | Iterable[Any]] | Sequence[str]) -> tuple[Free, ...]:
    """Return the varied keys of texts such as ``"stack.balloons=3,6"``, or of values by key:
    several, one, or the text after the equals sign. Raises DesignError.
    """
    if not isinstance(vary, Mapping):
        return tuple(read_varied(text) for text in ([vary] if isinstance(vary, str) else vary))
    return tuple(
        read_varied(f"{key}={values}") if isinstance(values, str) else _of_values(key, values)
        for key, values in vary.items()
    )


def _of_values(key: str, values: Iterable[Any]) -> Free:
    is_one = isinstance(values, Mapping) or not isinstance(values, Iterable)
    table = as_in_a_file([values] if is_one else list(values))
    if not table:
        raise DesignError(f"vary has no values for {key}; give at least one")
    return _listed(key, table, key, "vary")


def read_varied(text: str, option: str = "--vary") -> Free:
    """``KEY=START:STOP:STEP``, ``KEY=START:STOP``, whose step is 0, or ``KEY=a,b,c``. Raises
    DesignError.
    """
    key, equals, values = text.partition("=")
    key = key.strip()
    more = " or --vary stack.balloons=3,6,9" if option == "--vary" else ""
    example = f"write for example {option} chamber.diameter=4:8:0.5{more}"
    if not equals or not key or not values.strip():
        raise DesignError(f"{option} {shown(text)} is not KEY=VALUES; {example}")
    if ":" in values:
        return _range(key, values.split(":"), f"{option} {shown(text)}", example)
    # A list in brackets is one value; otherwise commas separate values.
    table = override({}, [f"values=[{values}]"])["values"]
    if not isinstance(table, list):
        table = [override({}, [f"value={value.strip()}"])["value"] for value in values.split(",")]
    return _listed(key, table, text, option)


def _range(key: str, parts: Sequence[str], words: str, example: str) -> Free:
    try:
        # The number in mm if it has a unit.
        start, stop, *steps = (Decimal(repr(millimetres(part))) for part in parts)
    except ValueError as error:
        raise DesignError(f"{words}: START, STOP and STEP {error}") from None
    if len(steps) > 1:
        raise DesignError(f"{words} is not START:STOP:STEP; {example}")
    if stop < start:
        raise DesignError(f"{words} ends below its start; write the smaller number first")
    if not steps:
        return Free(key, float(start), float(stop), 0.0)
    (step,) = steps
    if step <= 0:
        raise DesignError(f"{words}: STEP = {step} must be above 0")
    count = int((stop - start) / step) + 1
    if count > MOST_VALUES:
        raise DesignError(
            f"{words} gives {count:,} values; the limit is {MOST_VALUES:,}; increase STEP"
        )
    return Free(key, float(start), float(start + (count - 1) * step), float(step))


def _listed(key: str, values: Sequence[Any], text: str, option: str) -> Free:
    if any(isinstance(value, float) for value in values):
        values = [float(value) if type(value) is int else value for value in values]
    if len(values) > MOST_VALUES:
        raise DesignError(
            f"{option} {key} has {len(values):,} values; the limit is {MOST_VALUES:,}"
        )
    for number, value in enumerate(values):
        if value in values[:number]:
            raise DesignError(f"{option} {shown(text)} lists {shown(value)} twice; remove one")
    return Free.of_choices(key, values)


def refuse_unknown(design: Design, varied: Sequence[Free], option: str = "--vary") -> None:
    """Raise DesignError for a key unknown to the design, and for a key varied twice."""
    keys = [free.key for free in varied]
    for free in varied:
        if keys.count(free.key) > 1:
            raise DesignError(
                f"{option} {free.key} is given twice; combine its values in one option"
            )
        problems = []
        for value in free.values:
            try:
                design.with_({free.key: value})
                break
            except DesignError as error:
                problems.append(error)
        else:
            raise problems[0]


def grid(varied: Sequence[Free]) -> Iterator[Values]:
    """All combinations of the keys' values, the last key varying fastest. Raises DesignError."""
    for free in varied:
        if not free.step:
            option = f"--vary {free.key}={free.low:g}:{free.high:g}"
            raise DesignError(
                f"{option} has no step; add one, {option}:STEP, or sample it with --samples N"
            )
    count = math.prod(len(free.values) for free in varied)
    if count > MOST_DESIGNS:
        raise DesignError(
            f"the grid has {count:,} designs; the limit is {MOST_DESIGNS:,}; use fewer values, "
            "or --samples N"
        )
    names = [free.key for free in varied]
    every = itertools.product(*(free.values for free in varied))
    return (dict(zip(names, values, strict=True)) for values in every)


def latin_hypercube(varied: Sequence[Free], samples: int, seed: int) -> Iterator[Values]:
    """Return ``samples`` designs that divide each key's range into equal parts and use each part
    once.

    The same seed gives the same designs. Raises DesignError for more than the limit.
    """
    if samples > MOST_DESIGNS:
        raise DesignError(f"--samples {samples:,} must be at most {MOST_DESIGNS:,}")
    dice = random.Random(seed)
    columns = []
    for free in varied:
        order = list(range(samples))
        dice.shuffle(order)
        columns.append([_drawn(free, (place + dice.random()) / samples) for place in order])
    names = [free.key for free in varied]
    # Few values give few combinations: each is used for one design.
    drawn = {repr(values): values for values in zip(*columns, strict=True)}
    return (dict(zip(names, values, strict=True)) for values in drawn.values())


def _drawn(free: Free, share: float) -> Any:
    if not free.step:
        return round(free.low + share * (free.high - free.low), DIGITS)
    return free.at(int(share * len(free.values)))
