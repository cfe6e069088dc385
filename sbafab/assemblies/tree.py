"""Which part hangs on which: the order to build in, and what may be fixed where."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping

from sbafab.assemblies.records import AnyPart, Line, Seat
from sbafab.design.messages import listed, shown
from sbafab.errors import DesignError

PLACES: Mapping[str, tuple[Seat, ...]] = {
    "sba": ("top", "bottom", "lumen", "inlet"),
    "tube": ("start", "end", "outside", "lumen"),
    "magnet": ("top", "bottom"),
    "base": ("top", "bottom"),
    "sheet": ("top", "bottom"),
    "cup": (),
    "line": (),
}
"""Where parts are fixed on a part of each kind."""
FOR_LINES: tuple[Seat, ...] = ("lumen", "inlet")


def building_order(parts: Mapping[str, AnyPart]) -> tuple[str, ...]:
    """Part names, the root first, each after what it is fixed on; else in the file's order.

    Raises DesignError where there is not exactly one root, a part hangs on an unknown one or in a
    circle, or at a place that is not there.
    """
    roots = [name for name, part in parts.items() if part.on is None]
    for name, part in parts.items():
        if part.on is not None:
            _check_joint(name, part, parts)
        elif part.at is not None:
            raise DesignError(
                f'parts.{name}.at = "{part.at}" needs parts.{name}.on, the part that it is fixed on'
            )
    if len(roots) > 1:
        raise DesignError(
            f"{listed(roots)} are fixed on nothing; give all but one of them on = the part that "
            "each is fixed on"
        )
    order = list(roots)
    for name in order:
        order += [other for other, part in parts.items() if part.on == name]
    if len(order) < len(parts):
        circle = _circle(parts, order)
        how = "are fixed on each other in a circle" if circle[1:] else "hangs on itself"
        raise DesignError(
            f"{listed(circle)} {how}; leave out on and at in the part that all others are fixed on"
        )
    return tuple(order)


def _circle(parts: Mapping[str, AnyPart], hanging: Iterable[str]) -> list[str]:
    """The parts of one circle among those that do not hang on the root."""
    name = next(name for name in parts if name not in set(hanging))
    walk: list[str] = []
    while name not in walk:
        walk.append(name)
        name = str(parts[name].on)
    return walk[walk.index(name) :]


def _check_joint(name: str, part: AnyPart, parts: Mapping[str, AnyPart]) -> None:
    where = f"parts.{name}"
    other = parts.get(str(part.on))
    if other is None:
        near = difflib.get_close_matches(str(part.on), parts, 1)
        hint = f"did you mean {near[0]}?" if near else f"the parts are {', '.join(parts)}"
        raise DesignError(f"{where}.on = {shown(part.on)} is not a part of the assembly; {hint}")
    allowed = places_for(part, other)
    if not allowed:
        raise DesignError(
            f'{where}.on = "{part.on}": no {part.kind} can be fixed on a {other.kind}; fix it on '
            "another part"
        )
    if part.at not in allowed:
        said = "is missing" if part.at is None else f'= "{part.at}"'
        raise DesignError(
            f"{where}.at {said}; a {part.kind} is fixed on a {other.kind} at one of "
            f"{listed(allowed)}"
        )


def places_for(part: AnyPart, other: AnyPart) -> tuple[Seat, ...]:
    """Where a part may be fixed on another: lines run inside, all else sits outside."""
    is_line = isinstance(part, Line)
    return tuple(place for place in PLACES[other.kind] if (place in FOR_LINES) == is_line)
