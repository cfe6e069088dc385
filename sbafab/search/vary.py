"""Which keys are varied over which values, and the designs that come of it."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

from sbafab.design.files import key_paths, keys_of, override, shown
from sbafab.design.records import Design, Free
from sbafab.design.units import millimetres
from sbafab.errors import DesignError
from sbafab.search.trial import numbers_of

MOST_DESIGNS = 100_000
MOST_VALUES = 10_000
DIGITS = 6

Values = Mapping[str, Any]
"""A value for each key that is varied, by dotted key."""


@dataclass(frozen=True)
class Varied:
    """A key with the values that it takes; without values, all numbers from ``low`` to ``high``."""

    key: str
    values: tuple[Any, ...] = ()
    low: float = 0.0
    high: float = 0.0

    @property
    def is_continuous(self) -> bool:
        return not self.values


def read_varied(text: str, option: str = "--vary") -> Varied:
    """``KEY=START:STOP:STEP``, ``KEY=START:STOP`` or ``KEY=a,b,c``. Raises DesignError."""
    key, equals, said = text.partition("=")
    key = key.strip()
    if not equals or not key or not said.strip():
        raise DesignError(f"{option} {shown(text)} is not KEY=VALUES; {_how(option)}")
    if ":" in said:
        return _range(key, said.split(":"), text, option)
    # A list in brackets is one value; what else a comma parts are several.
    table = override({}, [f"values=[{said}]"])["values"]
    if not isinstance(table, list):
        table = [override({}, [f"value={one.strip()}"])["value"] for one in said.split(",")]
    if any(isinstance(one, float) for one in table):
        table = [float(one) if type(one) is int else one for one in table]
    return _distinct(Varied(key, tuple(table)), text, option)


def _how(option: str) -> str:
    more = " or --vary stack.balloons=3,6,9" if option == "--vary" else ""
    return f"write for example {option} chamber.diameter=4:8:0.5{more}"


def _range(key: str, parts: Sequence[str], text: str, option: str) -> Varied:
    try:
        ends = [_exact(part) for part in parts]
    except ValueError as error:
        raise DesignError(f"{option} {shown(text)}: START, STOP and STEP {error}") from None
    if len(ends) not in (2, 3):
        raise DesignError(f"{option} {shown(text)} is not START:STOP:STEP; {_how(option)}")
    start, stop = ends[:2]
    if stop < start:
        raise DesignError(
            f"{option} {shown(text)} stops below its start; write the smaller number first"
        )
    if len(ends) == 2:
        return Varied(key, (), float(start), float(stop))
    step = ends[2]
    if step <= 0:
        raise DesignError(f"{option} {shown(text)}: STEP = {step} must be above 0")
    count = int((stop - start) / step) + 1
    if count > MOST_VALUES:
        raise DesignError(
            f"{option} {shown(text)} gives {count:,} values, and at most {MOST_VALUES:,} are "
            "allowed; make STEP larger"
        )
    steps = [start + number * step for number in range(count)]
    is_whole = all(one == one.to_integral_value() for one in (start, step))
    return Varied(key, tuple(int(one) if is_whole else float(one) for one in steps))


def _exact(text: str) -> Decimal:
    """The number, mm where it has a unit. Raises ValueError."""
    return Decimal(repr(millimetres(text)))


def _distinct(varied: Varied, text: str, option: str) -> Varied:
    seen: list[Any] = []
    for value in varied.values:
        if value in seen:
            raise DesignError(f"{option} {shown(text)} names {shown(value)} twice; once is enough")
        seen.append(value)
    return varied


def refuse_unknown(design: Design, varied: Sequence[Varied], option: str = "--vary") -> None:
    """Raises DesignError for a key that the design does not know, and for one varied twice."""
    keys = [one.key for one in varied]
    for one in varied:
        if keys.count(one.key) > 1:
            raise DesignError(f"{option} {one.key} is given twice; put all its values into one")
        if one.key not in key_paths(type(design)):
            # Says which key may be meant.
            design.with_({one.key: one.values[0] if one.values else one.low})
        problems = []
        for value in one.values or (one.low, one.high):
            try:
                design.with_({one.key: value})
            except DesignError as error:
                problems.append(error)
            else:
                break
        else:
            raise problems[0]


def grid(varied: Sequence[Varied]) -> Iterator[Values]:
    """Every value of every key with every other's, the last key the fastest. Raises DesignError."""
    for one in varied:
        if one.is_continuous:
            raise DesignError(
                f"--vary {one.key}={one.low:g}:{one.high:g} has no step; add one, "
                f"--vary {one.key}={one.low:g}:{one.high:g}:STEP, or draw from it with --samples N"
            )
    count = 1
    for one in varied:
        count *= len(one.values)
    if count > MOST_DESIGNS:
        raise DesignError(
            f"the grid has {count:,} designs, and at most {MOST_DESIGNS:,} are allowed; take "
            "fewer values, or --samples N"
        )
    names = [one.key for one in varied]
    every = itertools.product(*(one.values for one in varied))
    return (dict(zip(names, values, strict=True)) for values in every)


def latin_hypercube(varied: Sequence[Varied], samples: int, seed: int) -> Iterator[Values]:
    """``samples`` designs that take each key's range in equal parts, each part once.

    The same seed draws the same designs. Raises DesignError for more than are allowed.
    """
    if samples > MOST_DESIGNS:
        raise DesignError(f"--samples {samples:,} must be at most {MOST_DESIGNS:,}")
    dice = random.Random(seed)
    columns = []
    for one in varied:
        order = list(range(samples))
        dice.shuffle(order)
        columns.append([_at(one, (place + dice.random()) / samples) for place in order])
    names = [one.key for one in varied]
    seen = set()
    for values in zip(*columns, strict=True):
        # Few values leave few combinations: each is one design.
        if repr(values) not in seen:
            seen.add(repr(values))
            yield dict(zip(names, values, strict=True))


def _at(varied: Varied, share: float) -> Any:
    if varied.is_continuous:
        return round(varied.low + share * (varied.high - varied.low), DIGITS)
    return varied.values[int(share * len(varied.values))]


# Which keys a search may change, as people say it: ``KEY=LOW:HIGH:STEP``.


def read_free(
    design: Design, texts: Sequence[str], fixed: Sequence[str] = (), given: Sequence[str] = ()
) -> tuple[Free, ...]:
    """The family's own keys without those ``fixed``, and those of the ``texts`` in their place.

    Keys that are ``given`` by hand stay as they are, but for lists, which are scaled as a whole;
    what the design must fit gives its chamber. Raises DesignError.
    """
    keys = {key: value for key, value, _ in keys_of(design)}
    given = [key for key in given if not numbers_of(keys.get(key))]
    varied = [_stepped(text) for text in texts]
    refuse_unknown(design, [read_varied(text, "--free") for text in texts], "--free")
    own = {one.key: one for one in design.free}
    if any(key.startswith("fits.") for key in given):
        own.pop("chamber.diameter", None)
    for key in given:
        own.pop(key, None)
    for key in dict.fromkeys(fixed):
        if key in given:
            continue
        if key not in own:
            raise DesignError(
                f"--fix {shown(key)}: a search changes only {', '.join(own) or 'nothing'} by itself"
            )
        del own[key]
    # What is named is free whatever the requirements name.
    own |= {one.key: one for one in varied}
    if "stack.balloons" in own and numbers_of(keys.get("chamber.diameter")):
        raise DesignError(
            "--free stack.balloons: chamber.diameter lists a diameter for each balloon, and a "
            "search scales that list; leave it out, or give one diameter"
        )
    return tuple(own.values())


def _stepped(text: str) -> Free:
    found = read_varied(text, "--free")
    numbers = [one for one in found.values if isinstance(one, int | float)]
    parts = text.partition("=")[2].split(":")
    if len(parts) != 3 or len(numbers) != len(found.values):
        raise DesignError(
            f"--free {shown(text)} is not KEY=LOW:HIGH:STEP; write for example "
            "--free chamber.diameter=3:12:0.1"
        )
    step = numbers[1] - numbers[0] if len(numbers) > 1 else 1
    return replace(Free(found.key, numbers[0], numbers[-1], 1), step=round(step, 9))
