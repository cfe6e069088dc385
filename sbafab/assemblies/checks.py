"""Checks of assemblies as findings: joints, supply tubes, clearance in holes, collisions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sbafab.assemblies.build import Assembled, PlacedPart, about_axis, inlet_of
from sbafab.assemblies.records import AssemblyRules, Cup, Line, Seat, Tube, girth_and_height
from sbafab.assemblies.shapes import face, placed_surface
from sbafab.design.records import Discs
from sbafab.geometry.region import Region, rectangle
from sbafab.laminate.laminate import outline_diameter, overall_diameter
from sbafab.meshing.surface import Vector
from sbafab.models.calibration import factors_of
from sbafab.models.closed_forms import LOBES, folded_diameter
from sbafab.models.sizes import deflated_diameter
from sbafab.models.sizes import sizes as sizes_of
from sbafab.rules.deck import weakened
from sbafab.rules.finding import Finding, Place, Verdict, judged, marked
from sbafab.rules.limits import holds
from sbafab.rules.sentences import Clause, say

if TYPE_CHECKING:
    import manifold3d


def _judged(
    rule: str,
    verdict: Verdict | bool,
    limit: float,
    measured: float | None,
    sentence: str,
    parts: Iterable[PlacedPart],
    unit: str = "mm",
    /,
    **facts: Any,
) -> Finding:
    """Return a finding about parts; its sentence names the first part and its host."""
    names = tuple(part.name for part in parts)
    facts = {**dict(zip(("part", "host"), names, strict=False)), **facts}
    finding = judged(rule, verdict, limit, measured, unit, Place(), sentence, **facts)
    return replace(finding, parts=names)


def joints(assembled: Assembled, *at: Seat) -> Iterator[tuple[PlacedPart, PlacedPart]]:
    """Yield each part that is fixed on another (at these places, if named), and its host."""
    for placed in assembled.parts:
        host = assembled.on(placed)
        if host is not None and (not at or placed.part.at in at):
            yield placed, host


def tube_match(assembled: Assembled) -> Iterator[Finding]:
    """Check that an SBA bent around a tube was made for it, or at least goes around it once."""
    tolerance = assembled.assembly.rules.tube_tolerance
    for both in joints(assembled, "outside"):
        placed, tube = both[0], both[1].part
        if placed.made is None or not isinstance(tube, Tube):
            continue
        outer, wrap = tube.outer_diameter, placed.made.design.form.wrap
        if wrap is None:
            walls = placed.made.laminate.layers[0].profile.turned(placed.turn)
            width, room = walls.bounds[2] - walls.bounds[0], math.pi * outer
            yield _judged("tube-match", holds(room, width), room, width, "round", both)
            continue
        off, facts = abs(wrap.outer_diameter - outer), {"tube": wrap.outer_diameter, "outer": outer}
        good = holds(tolerance, off)
        yield _judged("tube-match", good, tolerance, off, "made-for", both, **facts)


def inlet_match(assembled: Assembled) -> Iterator[Finding]:
    """Check that a line in an inlet fits the opened strip."""
    for both in joints(assembled, "inlet"):
        (placed, host), line = both, both[0].part
        if isinstance(line, Line) and host.made is not None:
            inlet = inlet_of(placed.name, line, host.name, host.made.laminate)
            limit, outer = 2 * inlet.width / math.pi, line.outer_diameter
            facts = {"chamber": inlet.chamber, "width": inlet.width}
            good = holds(limit, outer)
            yield _judged("inlet-match", good, limit, outer, "opens", both, **facts)


def line_clearance(assembled: Assembled) -> Iterator[Finding]:
    """Check the clearance around a line in its lumen or tube."""
    limit = assembled.assembly.rules.line_clearance
    for both in joints(assembled, "lumen"):
        line, host = both[0].part, both[1]
        lumen = host.made.laminate.lumen if host.made is not None else None
        if isinstance(host.part, Tube):
            lumen = host.part.inner_diameter
        if isinstance(line, Line) and lumen is not None:
            clearance = lumen - line.outer_diameter
            facts = {"outer": line.outer_diameter, "lumen": lumen, "most": lumen - limit}
            good = holds(clearance, limit)
            yield _judged("line-clearance", good, limit, clearance, "leaves", both, **facts)


def seat(assembled: Assembled) -> Iterator[Finding]:
    """Check the contact share of the smaller of two glued faces.

    A part around a tube must lie on it, and a line in a lumen must run through it; a line in an
    inlet is fixed by its strip.
    """
    limit = assembled.assembly.rules.seat_share
    for placed, host in joints(assembled):
        match placed.part.at:
            case "lumen":
                yield _through(placed, host, limit)
            case "outside":
                yield _around(placed, host, limit)
            case "top" | "bottom" | "start" | "end":
                lower, under = _lower_face(placed), _face_of(host, placed.part.at)
                share = (lower & under).area / min(lower.area, under.area)
                good = holds(share, limit)
                yield _judged("seat", good, limit, share, "glued", (placed, host), "")


def _through(placed: PlacedPart, host: PlacedPart, limit: float) -> Finding:
    """Check a line in the lumen of another part, both along that part's axis."""
    start, end = placed.part.along, placed.part.along + placed.height
    inside = max(0.0, min(end, host.height) - max(start, 0.0))
    share = inside / min(placed.height, host.height)
    facts = {"length": inside, "height": host.height, "start": start, "end": end}
    both = placed, host
    return _judged("seat", holds(share, limit), limit, share, "inside", both, "", **facts)


def _around(placed: PlacedPart, host: PlacedPart, limit: float) -> Finding:
    """Check a part on the side of a tube, whose face extends from ``along`` both ways."""
    lower = _face_of(placed, "bottom").turned(placed.turn)
    x0, y0, x1, y1 = lower.bounds
    along, length = placed.part.along, host.height
    low, high = max(y0, -along), min(y1, length - along)
    share = (lower & rectangle((x0, low), (x1, high))).area / lower.area if low < high else 0.0
    verdict: Verdict = "warn"
    sentence = "overhangs"
    if not holds(share, limit):
        verdict, sentence = "fail", "off-tube"
    elif placed.radius is None:
        sentence, share = "stiff", 0.0
    elif holds(share, 1.0):
        verdict, sentence = "pass", "lies"
    facts = {"along": along, "start": along + y0, "end": along + y1, "length": length}
    return _judged("seat", verdict, limit, share, sentence, (placed, host), "", **facts)


def _lower_face(placed: PlacedPart) -> Region:
    """Return the glued face, in its position on the host's face."""
    part = placed.part
    region = _face_of(placed, "bottom").turned(part.turn)
    if part.at in ("bottom", "start"):
        region = region.mirrored()
    return region.moved(*part.offset)


def _face_of(placed: PlacedPart, at: str | None) -> Region:
    if placed.made is None:
        return face(placed.part)
    layers = placed.made.laminate.layers
    return layers[-1 if at == "top" else 0].profile


# Supply tubes: the size of folded tabs with tubes in them, and the tubes' runs.
#
# The paper does not describe them. Tabs fold back over the edge that they leave; their tubes then
# lie along the actuator's host, away from the actuator.


@dataclass(frozen=True)
class SupplyRun:
    """A supply tube along the outside of a tube, ``angle`` degrees from the tube's marked line.

    ``over`` are the parts with balloons under it.
    """

    chamber: str
    angle: float
    over: tuple[str, ...]


def folded_diameter_with_tubes(placed: PlacedPart, assembled: Assembled) -> float | None:
    """Return the diameter in mm over folded tabs with a tube in each; None without an inlet.

    The tabs fold over the outline where they leave it, or over the tube below if that is wider. On
    it lie the tab's two films, with the supply tube and the strip's mask between them; the strip's
    end outside the tab is snipped off when the tube is inserted.
    """
    if placed.made is None or not placed.made.laminate.inlets:
        return None
    laminate = placed.made.laminate
    inside = placed.radius or 0.0
    if placed.radius is None:
        host = assembled.on(placed)
        if host is not None and isinstance(host.part, Tube):
            inside = host.part.outer_diameter / 2
        roots = [math.hypot(*inlet.mouth) - inlet.length for inlet in laminate.inlets]
        inside = max(inside, *roots)
    strip = max(layer.film.thickness for layer in laminate.layers if layer.is_mask)
    films = 2 * laminate.tpe_layers[0].film.thickness + strip
    return 2 * (inside + films + max(inlet.tube_diameter for inlet in laminate.inlets))


def supply_runs(placed: PlacedPart, assembled: Assembled) -> tuple[SupplyRun, ...]:
    """Return the runs along a tube of the supply tubes of an actuator on its end or start."""
    tube = assembled.on(placed)
    is_flat = placed.made is not None and placed.radius is None
    if not is_flat or tube is None or not isinstance(tube.part, Tube):
        return ()
    assert placed.made is not None
    around = tube.part.outer_diameter / 2
    covered = list(_covered(tube, assembled))
    supply = []
    for inlet in placed.made.laminate.inlets:
        angle = _angle(tube, placed.at((*inlet.mouth, 0.0)))
        half_tube = math.degrees(inlet.tube_diameter / 2 / around)
        over = dict.fromkeys(
            name
            for name, middle, half_stack in covered
            if _angle_between(angle, middle) < half_stack + half_tube
        )
        supply.append(SupplyRun(inlet.chamber, angle, tuple(over)))
    return tuple(supply)


def _covered(tube: PlacedPart, assembled: Assembled) -> Iterator[tuple[str, float, float]]:
    """Yield the parts around a tube: name, and the middle and half of each stack's angle."""
    for sba in assembled.parts:
        if sba.made is None or sba.radius is None or sba.part.on != tube.name:
            continue
        for piece in sba.made.laminate.layers[-1].profile.pieces:
            low_x, low_y, high_x, high_y = piece.turned(sba.turn).bounds
            # A part's own turn comes first when it is placed, and is taken off again here.
            x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
            middle = about_axis(-sba.turn).at((x, y, 0.0))
            half = math.degrees((high_x - low_x) / 2 / sba.radius)
            yield sba.name, _angle(tube, sba.at(middle)), half


def _angle(tube: PlacedPart, p: Vector) -> float:
    """Return the angle of a point around a tube, degrees anti-clockwise from its marked line."""
    origin, x, y = np.array([tube.at(at) for at in ((0, 0, 0), (1, 0, 0), (0, 1, 0))])
    across, up = np.array([x - origin, y - origin]) @ (np.array(p) - origin)
    return math.degrees(math.atan2(up, across)) % 360


def _angle_between(a: float, b: float) -> float:
    off = abs(a - b) % 360
    return min(off, 360 - off)


def supply_tubes(assembled: Assembled) -> Iterator[Finding]:
    """Check that supply tubes stay clear of balloons that press on the wall of a lumen."""
    if assembled.assembly.deploy.lumen_diameter is None:
        return
    for placed in assembled.parts:
        supply = supply_runs(placed, assembled)
        if not supply:
            continue
        crossing = [run for run in supply if run.over]
        over = list(dict.fromkeys(name for run in crossing for name in run.over))
        count, parts = len(crossing), (placed, *map(assembled.__getitem__, over))
        facts: dict[str, Any] = {"crossing_count": count, "count": len(supply)}
        facts["over"] = ", ".join(over)
        if crossing:
            facts["mending"] = _remedy(placed, assembled, supply)
        sentence = "crossing" if crossing else "past"
        yield _judged("supply-tubes", not count, 0, count, sentence, parts, "tubes", **facts)


def _remedy(placed: PlacedPart, assembled: Assembled, supply: Sequence[SupplyRun]) -> Clause:
    """Return the remedy: the rotation, in whole degrees, with every tube farthest from balloons."""
    tube = assembled.on(placed)
    assert tube is not None
    covered = list(_covered(tube, assembled))

    def room(turn: int) -> float:
        """Return the degrees between the nearest tube and balloon."""
        return min(
            _angle_between(run.angle + turn, middle) - half
            for run in supply
            for _, middle, half in covered
        )

    best = max(range(360), key=lambda turn: (round(room(turn), 6), -turn))
    if room(best) <= 0:
        return say("supply-tubes.through")
    return say("supply-tubes.turn", turn=(placed.turn + best) % 360)


# Ways of the whole: through an aperture, into a lumen, against its wall.


class _Passage(NamedTuple):
    """The diameter in mm that a part needs, with films as bought and at its folded height."""

    part: PlacedPart
    nominal: float
    pressed: float
    how: str


def aperture(assembled: Assembled) -> Iterator[Finding]:
    """Check that each part passes through the aperture with lobes folded.

    Folded sizes are predicted: if only the thinner, pressed laminate passes, or the paper gives no
    folded size of a part, the verdict is a warning.
    """
    hole = assembled.assembly.deploy.aperture_diameter
    if hole is None:
        return
    needs = [_passage(placed) for placed in assembled.parts]
    worst = max(needs, key=lambda need: (need.pressed > hole, need.nominal))
    facts = {"pressed_mm": worst.pressed, "how": say(f"aperture.{worst.how}")}
    verdict: Verdict = "pass" if holds(hole, worst.nominal) else "warn"
    size, sentence = worst.nominal, "needs" if verdict == "pass" else "pressed"
    if not holds(hole, min(worst.nominal, worst.pressed)):
        verdict, sentence, size = "fail", "needs", worst.pressed
    part, nominal = (worst.part,), worst.nominal
    yield _judged("aperture", verdict, hole, size, sentence, part, nominal=nominal, **facts)


def _passage(placed: PlacedPart) -> _Passage:
    if placed.made is None:
        size, is_soft = girth_and_height(placed.part)[0], isinstance(placed.part, Cup)
        pressed, how = (0.0, "squeezed") if is_soft else (size, "as-it-is")
        return _Passage(placed, size, pressed, how)
    design, laminate = placed.made.design, placed.made.laminate
    form = design.form
    if form.wrap is not None:
        size = deflated_diameter(form.wrap, laminate.thickness)
        return _Passage(placed, size, size, "deflated")
    if not form.is_parallel or form.stacks != LOBES or not isinstance(form.pockets, Discs):
        return _Passage(placed, outline_diameter(laminate), 0.0, "unfolded")
    lobe = max(form.pockets.diameters) + 2 * design.bond.width
    folded = folded_diameter(lobe, factors_of(design).folded(laminate).height)
    return _Passage(placed, folded_diameter(lobe, laminate.thickness), folded, "folded")


def lumen_pass(assembled: Assembled) -> Iterator[Finding]:
    """Check that the deflated assembly, with tabs folded back, passes through the lumen."""
    lumen = assembled.assembly.deploy.lumen_diameter
    if lumen is None:
        return
    sizes = [(_deflated(placed), placed, False) for placed in assembled.parts]
    sizes += [
        (folded, placed, True)
        for placed in assembled.parts
        if (folded := folded_diameter_with_tubes(placed, assembled)) is not None
    ]
    widest, part, is_folded = max(
        sizes, key=lambda entry: (round(entry[0], 6), entry[1].radius is None)
    )
    tabs, thinner = "no-tabs", "no-tabs"
    unfolded = 0.0
    if is_folded and part.made is not None:
        unfolded = overall_diameter(part.made.laminate)
        is_untied = part.radius is None and unfolded > lumen
        tabs, thinner = "tabs-tied" if is_untied else "tabs-folded", "thinner-tubes"
    facts: dict[str, Any] = {"thinner": say(f"lumen-pass.{thinner}")}
    facts["tabs"] = say(f"lumen-pass.{tabs}", unfolded=unfolded)
    yield _judged("lumen-pass", widest < lumen, lumen, widest, "widest", (part,), **facts)


def _deflated(placed: PlacedPart) -> float:
    if placed.made is None:
        return girth_and_height(placed.part)[0]
    wrap, laminate = placed.made.design.form.wrap, placed.made.laminate
    if wrap is not None:
        return deflated_diameter(wrap, laminate.thickness)
    if placed.radius is not None:
        return 2 * (placed.radius + laminate.thickness)
    return outline_diameter(laminate)


def lumen_brace(assembled: Assembled) -> Iterator[Finding]:
    """Check that inflated radial parts reach the lumen's wall."""
    lumen = assembled.assembly.deploy.lumen_diameter
    if lumen is None:
        return
    sizes = [
        (sizes_of(placed.made.design, placed.made.laminate).get("reached_diameter"), placed.name)
        for placed in assembled.parts
        if placed.made is not None
    ]
    widest, name = max((size for size in sizes if size[0]), default=(None, ""))
    if widest is None:
        yield _judged("lumen-brace", False, lumen, None, "none", ())
        return
    part, good = (assembled[name],), holds(widest, lumen)
    yield _judged("lumen-brace", good, lumen, widest, "reaches", part)


# Collisions of solids in place, deflated, their pockets filled.


TOUCH = 0.05
"""Overlap in mm3 up to which two parts only touch: arcs are chords here."""


def collision(assembled: Assembled) -> Iterator[Finding]:
    """Check that no two parts intersect: one finding per intersecting pair, or one for none.

    An SBA bent around a tube lies on it by construction; this pair is not compared.
    """
    solids = {p.name: placed_surface(p, filled=True).manifold() for p in assembled.parts}
    lying = {(p.name, p.part.on) for p in assembled.parts if p.part.at == "outside"}
    worst = 0.0
    for number, a in enumerate(assembled.parts):
        for b in assembled.parts[:number]:
            solid, second_solid = solids[a.name], solids[b.name]
            if {(a.name, b.name), (b.name, a.name)} & lying or box_gap(solid, second_solid) >= 0:
                continue
            shared = solid ^ second_solid
            volume = float(shared.volume())
            worst = max(worst, volume)
            if volume > TOUCH:
                x, y, z = np.reshape(shared.bounding_box(), (2, 3)).mean(axis=0).tolist()
                facts = {"x": x, "y": y, "z": z}
                yield _judged("collision", False, TOUCH, volume, "share", (a, b), "mm3", **facts)
    if worst <= TOUCH:
        yield _judged("collision", True, TOUCH, worst, "clear", (), "mm3")


def box_gap(a: manifold3d.Manifold, b: manifold3d.Manifold) -> float:
    """Return the distance between the boxes of two solids, mm; 0 or less if they meet."""
    box_a, box_b = (np.reshape(solid.bounding_box(), (2, 3)) for solid in (a, b))
    return float(np.maximum(box_a[0] - box_b[1], box_b[0] - box_a[1]).max())


# All checks, by stable names.


CHECKS: Mapping[str, Callable[[Assembled], Iterator[Finding]]] = {
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


def run_checks(assembled: Assembled) -> tuple[Finding, ...]:
    """Return the findings of all checks, in their order, with failures that the assembly waives."""
    rules = assembled.assembly.rules
    return tuple(
        marked(finding, lowered_checks(rules, name), "the assembly" if name in rules.waive else "")
        for name, check in CHECKS.items()
        for finding in check(assembled)
    )


def lowered_checks(rules: AssemblyRules, name: str | None = None) -> tuple[str, ...]:
    """Return each relaxed limit (of one check) of an assembly, with its value and the default."""
    usual = AssemblyRules()
    limits = (
        ("line_clearance", "line-clearance", rules.line_clearance < usual.line_clearance),
        ("tube_tolerance", "tube-match", rules.tube_tolerance > usual.tube_tolerance),
        ("seat_share", "seat", rules.seat_share < usual.seat_share),
    )
    return tuple(
        weakened(key, getattr(rules, key), getattr(usual, key), "default")
        for key, check, is_weak in limits
        if is_weak and name in (None, check)
    )
