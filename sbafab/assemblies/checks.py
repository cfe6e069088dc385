"""Checks between two parts: tubes that are wrapped, lines in lumens and inlets, glued faces."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab.assemblies.build import Assembled, PlacedPart, PlacedSba, inlet_of
from sbafab.assemblies.records import AssemblyRules, Base, CheckName, Cup, Line, Magnet, Tube
from sbafab.assemblies.shapes import face, placed_surface
from sbafab.design.records import Discs
from sbafab.geometry.region import Region, rectangle
from sbafab.laminate.laminate import outline_diameter
from sbafab.meshing.surface import Surface, Vector
from sbafab.models.formulas import LOBES, deflated_diameter, folded_diameter, reached_diameter
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import holds, weakened

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

WHOLE = Place()


def found(
    rule: str,
    good: bool,
    limit: float | None,
    measured: float | None,
    message: str,
    unit: str = "mm",
) -> Finding:
    return Finding(rule, "pass" if good else "fail", limit, measured, unit, WHOLE, message)


def joints(assembled: Assembled) -> Iterator[tuple[PlacedPart, PlacedPart]]:
    """Each part that hangs on another, with that other."""
    for placed in assembled.parts:
        other = assembled.on(placed)
        if other is not None:
            yield placed, other


def tube_match(assembled: Assembled) -> Iterator[Finding]:
    """What is bent round a tube was made for it, or at least goes round it once."""
    tolerance = assembled.assembly.rules.tube_tolerance
    for placed, other in joints(assembled):
        if not isinstance(placed, PlacedSba) or not isinstance(other.part, Tube):
            continue
        if placed.radius is None:
            continue
        outer = other.part.outer_diameter
        wrap = placed.made.design.form.wrap
        if wrap is not None:
            own = wrap.tube_diameter
            off = abs(own - outer)
            good = holds(tolerance, off)
            message = (
                f"{placed.name}, made for a tube of {own:g}, goes round {other.name} of {outer:g}"
            )
            if not good:
                message += (
                    f"; set tube.outer_diameter = {outer:g} in its design, or change the tube"
                )
            yield found("tube-match", good, tolerance, off, message)
            continue
        walls = placed.made.laminate.layers[0].profile.turned(placed.turn)
        width, room = walls.bounds[2] - walls.bounds[0], math.pi * outer
        yield found(
            "tube-match",
            holds(room, width),
            room,
            width,
            f"{placed.name} takes {width:.2f} of the {room:.2f} round {other.name}, tabs included"
            + ("" if holds(room, width) else "; take a thicker tube or a smaller actuator"),
        )


def inlet_match(assembled: Assembled) -> Iterator[Finding]:
    """A line in an inlet goes into the strip that is opened to it."""
    for placed, other in joints(assembled):
        if placed.part.at != "inlet" or not isinstance(placed.part, Line):
            continue
        if not isinstance(other, PlacedSba):
            continue
        inlet = inlet_of(placed.name, placed.part, other)
        limit = 2 * inlet.width / math.pi
        outer = placed.part.outer_diameter
        yield found(
            "inlet-match",
            holds(limit, outer),
            limit,
            outer,
            f"{placed.name} has an outer diameter of {outer:g}, and the inlet of {inlet.chamber} "
            f"in {other.name}, {inlet.width:g} wide, opens to {limit:.3f}"
            + ("" if holds(limit, outer) else "; set inlet.tube_outer_diameter in its design"),
        )


def line_clearance(assembled: Assembled) -> Iterator[Finding]:
    """What is left round a line in the lumen or tube that it runs through."""
    limit = assembled.assembly.rules.line_clearance
    for placed, other in joints(assembled):
        if placed.part.at != "lumen" or not isinstance(placed.part, Line):
            continue
        lumen = _opening(other)
        if lumen is None:
            continue
        left = lumen - placed.part.outer_diameter
        good = holds(left, limit)
        yield found(
            "line-clearance",
            good,
            limit,
            left,
            f"{placed.name} of {placed.part.outer_diameter:g} in the lumen of {other.name}, "
            f"{lumen:g}, leaves {left:.3f} in diameter"
            + ("" if good else f"; take a line of at most {lumen - limit:g} or a wider lumen"),
        )


def _opening(placed: PlacedPart) -> float | None:
    """Diameter of what a line runs through, mm; None for a part without lumen."""
    if isinstance(placed.part, Tube):
        return placed.part.inner_diameter
    return placed.made.laminate.lumen if placed.made is not None else None


def seat(assembled: Assembled) -> Iterator[Finding]:
    """How much of the smaller of two glued faces lies on the other.

    What is laid round a tube must lie on it, and a line in a lumen must run through it; a line in
    an inlet is held by its strip.
    """
    limit = assembled.assembly.rules.seat_share
    for placed, other in joints(assembled):
        if placed.part.at == "lumen":
            yield _through(placed, other, limit)
        elif placed.part.at == "outside":
            yield _around(placed, other, limit)
        elif placed.part.at != "inlet":
            own, under = _lower_face(placed), _face_of(other, placed.part.at)
            share = (own & under).area / min(own.area, under.area)
            good = holds(share, limit)
            message = f"{share:.0%} of the smaller face of {placed.name} on {other.name} is glued"
            if not good:
                message += "; move it with offset, or use a larger part: an opening lies under it"
            yield found("seat", good, limit, share, message, "")


def _through(placed: PlacedPart, other: PlacedPart, limit: float) -> Finding:
    """A line in the lumen of another part, both along that part's axis."""
    start, end = placed.part.along, placed.part.along + placed.height
    inside = max(0.0, min(end, other.height) - max(start, 0.0))
    share = inside / min(placed.height, other.height)
    good = holds(share, limit)
    message = f"{inside:.3f} of {placed.name} lie in the lumen of {other.name}"
    if not good:
        message += (
            f", which reaches from 0 to {other.height:.3f}; along = {start:g} puts the line from "
            f"{start:g} to {end:g}"
        )
    return found("seat", good, limit, share, message, "")


def _around(placed: PlacedPart, other: PlacedPart, limit: float) -> Finding:
    """A part on the side of a tube, whose face lies from ``along`` both ways."""
    own = _face_of(placed, "bottom").turned(placed.turn)
    x0, y0, x1, y1 = own.bounds
    along, length = placed.part.along, other.height
    low, high = max(y0, -along), min(y1, length - along)
    share = (own & rectangle((x0, low), (x1, high))).area / own.area if low < high else 0.0
    if not holds(share, limit):
        message = (
            f"{share:.0%} of {placed.name} lies on {other.name}, which is {length:g} long; "
            f"along = {along:g} puts it from {along + y0:.2f} to {along + y1:.2f}"
        )
        return found("seat", False, limit, share, message, "")
    if placed.radius is None:
        remedy = f"build the joint of {placed.name} up with adhesive"
        message = f"{remedy}: it is stiff and touches the round {other.name} in a line only"
        return Finding("seat", "warn", limit, 0.0, "", WHOLE, message, remedy=remedy)
    message = f"{share:.0%} of {placed.name} lies on {other.name}"
    if holds(share, 1.0):
        return found("seat", True, limit, share, message, "")
    remedy = f"move {placed.name} along {other.name}, or glue well what lies on it"
    message = (
        f"{remedy}: {message}, the rest hangs past its end; along = {along:g} puts it from "
        f"{along + y0:.2f} to {along + y1:.2f} of {length:g}"
    )
    return Finding("seat", "warn", limit, share, "", WHOLE, message, remedy=remedy)


def _lower_face(placed: PlacedPart) -> Region:
    """The face that is glued on, as it lies on the other part's."""
    part = placed.part
    own = _face_of(placed, "bottom").turned(part.turn)
    if part.at in ("bottom", "start"):
        own = own.mirrored()
    return own.moved(*part.offset)


def _face_of(placed: PlacedPart, at: str | None) -> Region:
    if placed.made is None:
        return face(placed.part)
    layers = placed.made.laminate.layers
    return layers[-1 if at == "top" else 0].profile


# The supply tubes of actuators: how far tabs and tubes stand out once folded, and where they run.
#
# The paper says nothing of them. Tabs fold back over the edge that they leave; their tubes then lie
# along what the actuator stands on, away from it.


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


# Checks of the whole against its way: through an aperture, into a lumen, against the wall.


PRESSED = 0.95 / 1.865
"""Measured over nominal thickness of the paper's 15-balloon 3-DoF actuator (Sec. 4)."""


class _Passage(NamedTuple):
    """What a part needs of a hole: as nominal films add up, and as the paper's pressed ones do."""

    name: str
    nominal: float
    pressed: float
    how: str


def aperture(assembled: Assembled) -> Iterator[Finding]:
    """Whether each part passes the aperture, lobes folded and all else as it is.

    Folded sizes are predicted: where only the thinner, pressed laminate passes, or the paper says
    nothing of how a part folds, the verdict is a warning.
    """
    hole = assembled.assembly.deploy.aperture_diameter
    if hole is None:
        return
    needs = [_passage(placed) for placed in assembled.parts]
    worst = max(needs, key=lambda need: (need.pressed > hole, need.nominal))
    message = f"{worst.name} {worst.how} needs {worst.nominal:.2f} of the aperture's {hole:g}"
    if holds(hole, worst.nominal):
        yield found("aperture", True, hole, worst.nominal, message)
    elif holds(hole, worst.pressed):
        remedy = "try it in the aperture first"
        message = (
            f"{remedy}: {message}, or {worst.pressed:.2f} if pressed as thin as the paper's, which "
            "passed 9.25"
        )
        yield Finding("aperture", "warn", hole, worst.nominal, "mm", WHOLE, message, remedy=remedy)
    else:
        message += "; use fewer balloons, smaller chambers or a smaller part"
        yield found("aperture", False, hole, worst.pressed, message)


def _passage(placed: PlacedPart) -> _Passage:
    part = placed.part
    if not isinstance(placed, PlacedSba):
        size = _girth(placed)
        soft = isinstance(part, Cup)
        return _Passage(
            placed.name, size, 0.0 if soft else size, "squeezed" if soft else "as it is"
        )
    form, laminate = placed.made.design.form, placed.made.laminate
    if form.wrap is not None:
        size = deflated_diameter(form.wrap, laminate)
        return _Passage(placed.name, size, size, "deflated")
    lobe = _lobe_width(placed)
    if lobe is not None:
        return _Passage(
            placed.name,
            folded_diameter(lobe, laminate.thickness),
            folded_diameter(lobe, PRESSED * laminate.thickness),
            "folded",
        )
    return _Passage(placed.name, _flat_diameter(placed), 0.0, "unfolded")


def _lobe_width(placed: PlacedSba) -> float | None:
    """Width in mm of a lobe of a three-lobed actuator; None for others."""
    design = placed.made.design
    form = design.form
    if not form.is_parallel or form.stacks != LOBES or not isinstance(form.pockets, Discs):
        return None
    return max(form.pockets.diameters) + 2 * design.bond.width


def _flat_diameter(placed: PlacedSba) -> float:
    """Circle round an SBA's axis that holds its widest film, tabs and ears taken off, mm."""
    return outline_diameter(placed.made.laminate)


def _girth(placed: PlacedPart) -> float:
    """Diameter of the smallest round hole that a bought part passes, mm."""
    part = placed.part
    if isinstance(part, Tube | Line):
        return part.outer_diameter
    if isinstance(part, Magnet | Cup):
        return part.diameter
    assert isinstance(part, Base)
    short, middle, _ = sorted((part.width, part.length, part.thickness))
    return float((short**2 + middle**2) ** 0.5)


def lumen_pass(assembled: Assembled) -> Iterator[Finding]:
    """Whether the deflated assembly passes the lumen, tabs folded back with a tube in each."""
    lumen = assembled.assembly.deploy.lumen_diameter
    if lumen is None:
        return
    sizes = [(_deflated(placed, assembled), placed, "") for placed in assembled.parts]
    sizes += [
        (folded, placed, "tabs folded back with their tubes")
        for placed in assembled.parts
        if (folded := folded_diameter_with_tubes(placed, assembled)) is not None
    ]
    widest, part, how = max(sizes, key=lambda entry: (round(entry[0], 6), entry[1].radius is None))
    good = widest < lumen
    message = f"deflated, {part.name} is the widest part, {widest:.2f} in a lumen of {lumen:g}"
    if how:
        message += f", {how}"
        if part.radius is None and reach(part) > lumen:
            message += f" (unfolded they reach {reach(part):.2f}: tie them before it goes in)"
    if not good:
        message += "; make it narrower or its laminate thinner"
        message += ", or take thinner supply tubes" if how else ""
    yield found("lumen-pass", good, lumen, widest, message)


def _deflated(placed: PlacedPart, assembled: Assembled) -> float:
    if not isinstance(placed, PlacedSba):
        return _girth(placed)
    wrap, laminate = placed.made.design.form.wrap, placed.made.laminate
    if wrap is not None:
        return deflated_diameter(wrap, laminate)
    if placed.radius is not None:
        return 2 * (placed.radius + laminate.thickness)
    return _flat_diameter(placed)


def lumen_brace(assembled: Assembled) -> Iterator[Finding]:
    """Whether inflated radial parts reach the lumen's wall."""
    lumen = assembled.assembly.deploy.lumen_diameter
    if lumen is None:
        return
    sizes = [
        (reached, placed.name)
        for placed in assembled.parts
        if placed.made is not None
        and (reached := reached_diameter(placed.made.design.form, placed.made.laminate))
    ]
    if not sizes:
        message = (
            f"no part expands against a lumen of {lumen:g}; add a radial design, or leave out "
            "deploy.lumen_diameter"
        )
        yield found("lumen-brace", False, lumen, None, message)
        return
    widest, name = max(sizes)
    good = holds(widest, lumen)
    message = f"inflated, {name} reaches {widest:.2f} free (lens of two arcs), and the lumen is "
    message += f"{lumen:g}"
    if not good:
        message += "; use wider or longer chambers, more balloons or a thicker tube"
    yield found("lumen-brace", good, lumen, widest, message)


# Parts that run into each other: solids in place, deflated, their pockets filled.


TOUCH = 0.05
"""mm3 of overlap up to which two parts touch: arcs are chords here."""
NAME = "collision"


def collision(assembled: Assembled) -> Iterator[Finding]:
    """A finding for every two parts that share space, or one that says none do.

    What is bent round a tube lies on it by construction and is not held against it.
    """
    surfaces = {p.name: placed_surface(p, filled=True) for p in assembled.parts}
    boxes = {name: _box(surface) for name, surface in surfaces.items()}
    solids: dict[str, Any] = {}
    worst = 0.0
    hit = False
    for number, one in enumerate(assembled.parts):
        for other in assembled.parts[:number]:
            if _lies_on(one, other) or not _meet(boxes[one.name], boxes[other.name]):
                continue
            for name in (one.name, other.name):
                if name not in solids:
                    solids[name] = _solid(surfaces[name])
            shared = solids[one.name] ^ solids[other.name]
            volume = float(shared.volume())
            worst = max(worst, volume)
            if volume > TOUCH:
                hit = True
                yield _hit(one, other, volume, _box_of(shared))
    if not hit:
        message = "no two parts run into each other, deflated, at nominal film thickness"
        yield found(NAME, True, TOUCH, worst, message, "mm3")


def _hit(one: PlacedPart, other: PlacedPart, volume: float, at: NDArray[np.float64]) -> Finding:
    x, y, z = at
    return found(
        NAME,
        False,
        TOUCH,
        volume,
        f"{one.name} and {other.name} share {volume:.2f} mm3 round x {x:.1f}, y {y:.1f}, "
        f"z {z:.1f}; move one of them (along, angle, offset, turn) or make it smaller",
        "mm3",
    )


def _lies_on(one: PlacedPart, other: PlacedPart) -> bool:
    return any(
        upper.part.at == "outside" and upper.part.on == lower.name
        for upper, lower in ((one, other), (other, one))
    )


def _box(surface: Surface) -> NDArray[np.float64]:
    import numpy as np

    return np.array([surface.points.min(axis=0), surface.points.max(axis=0)])


def _meet(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    return bool((a[0] < b[1]).all() and (b[0] < a[1]).all())


def _box_of(solid: Any) -> NDArray[np.float64]:
    import numpy as np

    low, high = np.array(solid.bounding_box()).reshape(2, 3)
    middle: NDArray[np.float64] = (low + high) / 2
    return middle


def _solid(surface: Surface) -> Any:
    import numpy as np
    from manifold3d import Manifold, Mesh64

    return Manifold(
        Mesh64(
            vert_properties=np.ascontiguousarray(surface.points),
            tri_verts=surface.faces.astype(np.uint64),
        )
    )


# The checks between the parts of an assembly, as findings; each has a stable name.


CHECKS: Mapping[CheckName, Callable[[Assembled], Iterator[Finding]]] = {
    "tube-match": tube_match,
    "inlet-match": inlet_match,
    "line-clearance": line_clearance,
    "seat": seat,
    "collision": collision,
    "aperture": aperture,
    "lumen-pass": lumen_pass,
    "lumen-brace": lumen_brace,
    "supply-tubes": supply_tubes,
}

AT_MOST: frozenset[CheckName] = frozenset(
    ("tube-match", "inlet-match", "collision", "aperture", "lumen-pass", "supply-tubes")
)
"""Checks whose limit is the most that may be measured; of all others it is the least."""


def run_checks(assembled: Assembled) -> tuple[Finding, ...]:
    """What every check finds, in their order; failures that the assembly waives say so."""
    rules = assembled.assembly.rules
    return tuple(
        _waived(finding) if name in rules.waive and finding.verdict == "fail" else finding
        for name, check in CHECKS.items()
        for finding in (_against(lowered_checks(rules, name), found) for found in check(assembled))
    )


def lowered_checks(rules: AssemblyRules, name: str | None = None) -> tuple[str, ...]:
    """Each limit (of one check) that an assembly weakens, with its value and the usual one."""
    usual = AssemblyRules()
    keys = (
        ("line-clearance", "line_clearance", rules.line_clearance < usual.line_clearance),
        ("tube-match", "tube_tolerance", rules.tube_tolerance > usual.tube_tolerance),
        ("seat", "seat_share", rules.seat_share < usual.seat_share),
    )
    return tuple(
        weakened(key, getattr(rules, key), getattr(usual, key), "default")
        for check, key, is_weaker in keys
        if is_weaker and name in (None, check)
    )


def _against(weak: tuple[str, ...], finding: Finding) -> Finding:
    if not weak:
        return finding
    return replace(finding, message=f"{finding.message}; limits lowered: {', '.join(weak)}")


def _waived(finding: Finding) -> Finding:
    message = f"waived by the assembly: {finding.message}"
    return replace(finding, verdict="waived", by_user=True, message=message)
