"""The supply tubes of actuators: how far tabs and tubes stand out once folded, and where they run.

The paper says nothing of them. Tabs fold back over the edge that they leave; their tubes then lie
along what the actuator stands on, away from it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sbafab.assemblies.build import Assembled, PlacedPart
from sbafab.assemblies.fits import WHOLE, found
from sbafab.assemblies.records import Tube
from sbafab.meshing.surface import Vector
from sbafab.rules.finding import Finding


@dataclass(frozen=True)
class SupplyRun:
    """A supply tube along the outside of a tube, ``angle`` degrees round it from its marked line.

    ``over`` are the parts whose balloons it would lie on.
    """

    chamber: str
    angle: float
    over: tuple[str, ...]


def folded_diameter_with_tubes(placed: PlacedPart, assembled: Assembled) -> float | None:
    """Diameter in mm over tabs that are folded back with a tube in each; None without an inlet.

    Inside lies what they fold over: the outline where a tab leaves it, or the tube below if that
    is wider. On it lie the tab's two films, with the supply tube and the strip's mask between them;
    what of the strip stands out of the tab is snipped off when the tube goes in.
    """
    if placed.made is None or not placed.made.laminate.inlets:
        return None
    laminate = placed.made.laminate
    inside = placed.radius or 0.0
    if placed.radius is None:
        other = assembled.on(placed)
        if other is not None and isinstance(other.part, Tube):
            inside = other.part.outer_diameter / 2
        roots = [math.hypot(*inlet.mouth) - inlet.length for inlet in laminate.inlets]
        inside = max(inside, *roots)
    strip = max(layer.film.thickness for layer in laminate.layers if layer.is_mask)
    films = 2 * laminate.tpe_layers[0].film.thickness + strip
    return 2 * (inside + films + max(inlet.tube_diameter for inlet in laminate.inlets))


def reach(placed: PlacedPart) -> float:
    """Diameter in mm of the circle that holds an actuator with its tabs and strips unfolded."""
    assert placed.made is not None
    layers = [layers[0] for layers in placed.made.laminate.patterns.values()]
    edges = (edge for layer in layers for edge in layer.profile.edges)
    return 2 * max(edge.farthest_from((0.0, 0.0)) for edge in edges)


def runs(placed: PlacedPart, assembled: Assembled) -> tuple[SupplyRun, ...]:
    """Where the supply tubes of an actuator on a tube's end or start run along that tube."""
    tube = assembled.on(placed)
    if placed.made is None or tube is None or not isinstance(tube.part, Tube):
        return ()
    if placed.radius is not None:
        return ()
    around = tube.part.outer_diameter / 2
    covered = list(_covered(tube, assembled))
    found_runs = []
    for inlet in placed.made.laminate.inlets:
        angle = _angle(tube, placed.at((*inlet.mouth, 0.0)))
        half = math.degrees(inlet.tube_diameter / 2 / around)
        over = [name for name, middle, own in covered if _apart(angle, middle) < own + half]
        found_runs.append(SupplyRun(inlet.chamber, angle, tuple(dict.fromkeys(over))))
    return tuple(found_runs)


def _covered(tube: PlacedPart, assembled: Assembled) -> Iterator[tuple[str, float, float]]:
    """Parts round a tube: name, and the middle and half of the angle that each stack takes."""
    for other in assembled.parts:
        if other.made is None or other.radius is None or other.part.on != tube.name:
            continue
        for piece in other.made.laminate.layers[-1].profile.pieces:
            low_x, low_y, high_x, high_y = piece.turned(other.turn).bounds
            # A part's own turn comes first when it is placed, and is taken off again here.
            x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
            own = math.radians(-other.turn)
            middle = (
                x * math.cos(own) - y * math.sin(own),
                x * math.sin(own) + y * math.cos(own),
                0.0,
            )
            half = math.degrees((high_x - low_x) / 2 / other.radius)
            yield other.name, _angle(tube, other.at(middle)), half


def _angle(tube: PlacedPart, p: Vector) -> float:
    """Degrees of a point round a tube, anti-clockwise from its marked line."""
    origin = tube.at((0.0, 0.0, 0.0))
    x, y = (
        sum((b - a) * (d - a) for a, b, d in zip(origin, tube.at(unit), p, strict=True))
        for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    )
    return math.degrees(math.atan2(y, x)) % 360


def _apart(one: float, other: float) -> float:
    off = abs(one - other) % 360
    return min(off, 360 - off)


def supply_tubes(assembled: Assembled) -> Iterator[Finding]:
    """Whether supply tubes stay off balloons that press on the wall of a lumen."""
    if assembled.assembly.deploy.lumen_diameter is None:
        return
    for placed in assembled.parts:
        own = runs(placed, assembled)
        if not own:
            continue
        crossing = [run for run in own if run.over]
        if not crossing:
            message = f"the supply tubes of {placed.name} run past all balloons"
            yield found("supply-tubes", True, 0, 0, message, "tubes")
            continue
        names = ", ".join(dict.fromkeys(name for run in crossing for name in run.over))
        message = (
            f"{len(crossing)} of {len(own)} supply tubes of {placed.name} would lie on balloons of "
            f"{names} and be squeezed against the lumen; {_remedy(placed, assembled, own)}"
        )
        yield Finding("supply-tubes", "fail", 0, len(crossing), "tubes", WHOLE, message)


def _remedy(placed: PlacedPart, assembled: Assembled, own: Sequence[SupplyRun]) -> str:
    """The turn, in whole degrees, that keeps every tube farthest from balloons."""
    tube = assembled.on(placed)
    assert tube is not None
    covered = list(_covered(tube, assembled))

    def room(turn: int) -> float:
        """Degrees between the nearest tube and balloon."""
        return min(
            _apart(run.angle + turn, middle) - half for run in own for _, middle, half in covered
        )

    best = max(range(360), key=lambda turn: (round(room(turn), 6), -turn))
    if room(best) <= 0:
        return "lead them through the tube, or use narrower chambers"
    return f"turn = {(placed.turn + best) % 360:g} leads them between"
