"""tube-fit: the flat inlet strip opens to the tube in the worst case of cutting, within bonded
film.

A channel w wide opens to a perimeter of 2 w. It contains the tube and, along one side of it, the
PTFE strip: the tube's half circle is larger by the strip's thickness there, so w must be pi / 2
times the sum of the tube's diameter and the strip's thickness. Inextensible films of thickness t,
bent sharply at both edges of the channel and back around the tube, would need (pi - 2) t more: 3 %
for the paper's film, 7 % for one of 0.1 mm. An elastomer stretches by that, so it is neglected.
Both edges of the strip may deviate by the cutting error, and an uncompensated kerf makes it
narrower by its width. Between two seams it is narrower by their position errors; a failure due to
these alone is a warning.

A tube at a port hole is glued to the surrounding film: the tube must cover the hole at its widest,
and the film must extend past the hole by a bond width.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.edges import Line, Point
from sbafab.geometry.region import Region, strip
from sbafab.geometry.spatial_index import EdgeIndex, boxes_meet
from sbafab.geometry.width import Width
from sbafab.laminate.joints import Port
from sbafab.laminate.laminate import Inlet, Interface, Laminate
from sbafab.rules.boundary import outward_reach
from sbafab.rules.finding import Finding, Place, Verdict, judged
from sbafab.rules.limits import TOLERANCE, holds
from sbafab.rules.measures import Measures, distinct_interfaces, place_in
from sbafab.rules.narrow_voids import VoidEdges
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained, say
from sbafab.rules.voids import PAST_MOUTH, mouth_openings

NAME = "tube-fit"
UNLIKE = 2 * PAST_MOUTH
"""mm by which a strip may be wider or narrower than its inlet states."""


class _Fit(NamedTuple):
    """A measure of an inlet (mouth, strip or bond): its worst-case and required values, mm.

    ``drawn`` is the drawn width; ``firm`` the worst-case width with seams on their paths.
    """

    inlet: Inlet
    interface: Interface | None
    feature: str
    limit: float
    at: Point
    value: float = 0.0
    drawn: float = 0.0
    firm: float = 0.0

    @property
    def spare(self) -> float:
        return self.value - self.limit


def check(measures: Measures) -> list[Finding]:
    """Return the least width of strips and their bonds, and the fit of tubes on film holes."""
    laminate, design = measures.laminate, measures.design
    fits = [fit for inlet in laminate.inlets for fit in _fits(inlet, laminate, design)]
    on_holes = [fit for port in laminate.tube_holes for fit in _on_hole(port, laminate, design)]
    findings: list[Finding] = []
    if fits:
        findings.append(_of_inlets(fits, design))
        findings += _unlike(fits) if findings[0].verdict == "pass" else ()
    if on_holes:
        findings.append(min(on_holes, key=lambda fit: (fit.measured or 0.0) - (fit.limit or 0.0)))
    return findings or [judged(NAME, False, None, None, "mm", Place(), "no-inlet")]


RULE = Rule(NAME, check, explained(NAME))


def _of_inlets(fits: Sequence[_Fit], design: Design) -> Finding:
    short = [fit for fit in fits if not holds(fit.value, fit.limit)]
    worst = min(short or [fit for fit in fits if fit.feature != "bond"], key=lambda fit: fit.spare)
    # What only the seams' places take from a strip leaves it open, if narrow for its tube.
    by_seams = worst.value > 0 and all(holds(fit.firm, fit.limit) for fit in short)
    verdict: Verdict = "pass" if not short else "warn" if by_seams else "fail"
    gap, edges = worst.interface, _edges(worst.interface, design)
    sentence = "seams" if edges.seams else "width"
    if worst.feature == "bond":
        sentence = "bond"
    elif gap is None:
        sentence = worst.feature
    is_cut = gap is None or gap.pressed
    facts = {
        "feature": say("tube-fit.strip" if worst.feature == "strip" else "tube-fit.mouth"),
        "chamber": worst.inlet.chamber,
        "as_drawn": worst.drawn,
        "how": say("tube-fit.cut" if is_cut else "tube-fit.welded"),
        "edges": edges.causes(),
        "tube": worst.inlet.tube_diameter,
        # Rounded up to the micrometre.
        "needed": math.ceil(round((worst.limit + worst.drawn - worst.value) * 1000, 6)) / 1000,
    }
    place = Place(None, (), *worst.at) if gap is None else place_in(gap, worst.at)
    return judged(NAME, verdict, worst.limit, worst.value, "mm", place, sentence, **facts)


def _unlike(fits: Sequence[_Fit]) -> Iterator[Finding]:
    """Yield a warning for each mouth whose drawn width differs from the inlet's stated width."""
    for fit in fits:
        stated, gap = fit.inlet.width, fit.interface
        if fit.feature == "mouth" and gap is not None and abs(fit.drawn - stated) > UNLIKE:
            place, chamber = place_in(gap, fit.at), fit.inlet.chamber
            yield judged(NAME, "warn", stated, fit.drawn, "mm", place, "unlike", chamber=chamber)


# Ports that are holes of an outer film.


def _on_hole(port: Port, laminate: Laminate, design: Design) -> Iterator[Finding]:
    """Yield the tube's overlap around the hole, and the width of film around it.

    Both are measured from the port's position, the centre of the glued tube.
    """
    ends = {layer.index: layer for layer in (laminate.tpe_layers[0], laminate.tpe_layers[-1])}
    beside = [ends[index] for index in (port.below, port.above) if index in ends]
    holes = [(layer, h) for layer in beside for h in layer.profile.holes if h.winding(port.at)]
    layer, hole = holes[0] if holes else (beside[0], None)

    def fit(value: float, limit: float, sentence: str, **facts: Any) -> Finding:
        place, good = Place(None, (layer.index,), *port.at), holds(value, limit)
        return judged(NAME, good, limit, value, "mm", place, sentence, port=port.name, **facts)

    if hole is None:
        yield fit(0.0, design.rules.bond_width, "no-hole")
        return
    # An arc counts as its whole circle.
    reach = max(
        max(math.dist(edge.start, port.at), math.dist(edge.end, port.at))
        if isinstance(edge, Line)
        else math.dist(edge.centre, port.at) + edge.radius
        for edge in hole.edges
    )
    if port.tube_diameter is not None:
        is_known = design.kerf_widths.get(layer.film.material) is not None
        kerf = 0.0 if is_known else design.laser.unknown_kerf
        cut = 2 * (reach + design.registration.cutting_error) + kerf
        yield fit(port.tube_diameter, cut, "covered", as_drawn=2 * reach)
    remaining = Region(tuple(contour for contour in layer.profile.contours if contour is not hole))
    film = remaining.distance_to_edge(port.at) - reach
    yield fit(film, design.rules.bond_width, "film")


# Inlets between two films.


def _fits(inlet: Inlet, laminate: Laminate, design: Design) -> list[_Fit]:
    gaps = [distinct.interface for distinct in distinct_interfaces(laminate)]
    gaps = [gap for gap in gaps if gap.kind == "chamber"]
    for gap in gaps:
        openings = mouth_openings(inlet, gap)
        if openings:
            # A tube goes into one opening; bond between two of them holds it out of both.
            low, high = max(openings, key=lambda ends: ends[1] - ends[0])
            (x, y), (dx, dy) = inlet.mouth, inlet.direction
            ends = [(x + dy * offset, y - dx * offset) for offset in (low, high)]
            mouth = _at_worst(inlet, gap, "mouth", inlet.mouth, ends, design)
            return [mouth, *_along_run(inlet, gap, design)]
    is_seamed = gaps and not any(gap.pressed for gap in gaps)
    needed = math.pi * inlet.tube_diameter / 2
    return [_Fit(inlet, None, "closed-seamed" if is_seamed else "closed", needed, inlet.mouth)]


def _along_run(inlet: Inlet, interface: Interface, design: Design) -> Iterator[_Fit]:
    """Yield the narrowest place of the strip, and of the bond beside it."""
    if inlet.length < TOLERANCE:
        return
    (x, y), (dx, dy) = inlet.mouth, inlet.direction
    inner = (x - dx * inlet.length, y - dy * inlet.length)
    beside = strip(inner, inlet.mouth, 2 * inlet.width)
    near = [piece for piece in interface.unbonded.pieces if boxes_meet(piece.bounds, beside.bounds)]
    if not interface.pressed:
        # Films continue beside a seam; their other side does not belong to the strip.
        near = [piece for piece in near if piece.contains((x - dx * TOLERANCE, y - dy * TOLERANCE))]
    run = Region(tuple(contour for piece in near for contour in piece.contours)) & beside
    ends = TOLERANCE, inlet.length - TOLERANCE
    sides = [edge for edge in run.edges if ends[0] < inlet.depth(edge.at(0.5)) < ends[1]]
    rims = interface.contact.index if interface.pressed else EdgeIndex(())
    widths, bonds = [], []
    for edge in sides:
        facing = EdgeIndex([side for side in run.edges if side is not edge])
        across, outward = outward_reach(edge.reversed(), facing), outward_reach(edge, rims)
        widths += [(across.value, across.at, edge.nearest(across.at))] if across else []
        bonds += [outward] if outward else []
    if widths:
        _, p, q = min(widths, key=lambda width: width[0])
        yield _at_worst(inlet, interface, "strip", p, (q, p), design)
    if bonds:
        value, p = min(bonds, key=lambda bond: bond.value)
        limit = design.rules.bond_width
        yield _Fit(inlet, interface, "bond", limit, p, value, value, value)


def _edges(interface: Interface | None, design: Design) -> VoidEdges:
    if interface is None:
        return VoidEdges(design.registration.cutting_error, design.laser.unknown_kerf, ())
    return VoidEdges.of(interface, design)


def _at_worst(
    inlet: Inlet,
    interface: Interface,
    feature: str,
    p: Point,
    ends: Sequence[Point],
    design: Design,
) -> _Fit:
    """Return the worst-case width between two points of a strip's edges."""
    drawn, edges = Width(math.dist(*ends), *ends), VoidEdges.of(interface, design)
    thickness = max((mask.film.thickness for mask in interface.masks), default=0.0)
    needed = math.pi / 2 * (inlet.tube_diameter + thickness)
    value, firm = edges.left(drawn).value, edges.with_seams_in_place.left(drawn).value
    return _Fit(inlet, interface, feature, needed, p, value, drawn.value, firm)
