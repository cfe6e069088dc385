"""tube-fit: the flat inlet strip, as cut at worst, opens to the tube, inside bonded film.

A channel w wide opens to a perimeter of 2 w. In it lie the tube and, along one side of it, the PTFE
strip: the tube's half circle there is one strip's thickness farther out, so w must be pi / 2 times
the sum of the tube's diameter and the strip's thickness. Both edges of the strip may be cut off by
the cutting error, and a kerf that is not compensated makes it narrower by its width. Between two
seams it is narrower by their errors of place; a failure by these alone is a warning.

A port that is a hole has its tube glued on the film round it: the tube must cover the hole as cut
at its widest, and the film go on past the hole for a bond's width.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sbafab.design.records import Design
from sbafab.geometry.edges import Edge, Line, Point
from sbafab.geometry.nearby import EdgeIndex, boxes_meet
from sbafab.geometry.region import Region, strip
from sbafab.geometry.width import Width
from sbafab.laminate.joints import Port
from sbafab.laminate.laminate import Inlet, Interface, Laminate, Layer
from sbafab.rules.boundary import Reach, outward_reach
from sbafab.rules.finding import Finding, Place, Verdict
from sbafab.rules.limits import TOLERANCE, at, holds
from sbafab.rules.measures import Measures, distinct_interfaces
from sbafab.rules.rule import Explanation, Rule
from sbafab.rules.void_edges import VoidEdges
from sbafab.rules.voids import PAST_MOUTH, mouth_openings

NAME = "tube-fit"
BOND = "the bond beside the strip"
MOUTH = "the mouth"
UNLIKE = 2 * PAST_MOUTH
"""mm by which a strip may be wider or narrower than its inlet states."""


class _Fit(NamedTuple):
    """One measure of an inlet: the feature, its value at worst and its least value, mm.

    ``drawn`` is the width as drawn; ``firm`` the width left at worst with seams on their paths.
    """

    inlet: Inlet
    interface: Interface | None
    feature: str
    value: float
    limit: float
    at: Point
    remedy: str
    drawn: float = 0.0
    firm: float = 0.0


def check(measures: Measures) -> list[Finding]:
    """The strip's width at the mouth and along its run, and its bonds; tubes on holes of films."""
    laminate, design = measures.laminate, measures.design
    fits = [fit for inlet in laminate.inlets for fit in _fits(inlet, laminate, design)]
    on_holes = [
        fit
        for port in laminate.ports
        if port.kind == "hole"
        for fit in _on_hole(port, laminate, design)
    ]
    if on_holes and not fits:
        return [_of_holes(on_holes)]
    if not fits:
        message = "the laminate has no inlet, so no tube can be fitted; give every chamber one"
        return [Finding(NAME, "fail", None, None, "mm", Place(), message)]
    short = [fit for fit in fits if not holds(fit.value, fit.limit)]
    worst = min(short or [fit for fit in fits if fit.feature != BOND], key=_margin)
    good = not short
    if worst.feature == BOND:
        message = (
            f"{worst.feature} of {worst.inlet.chamber} is {worst.value:.3f} mm wide, "
            f"{at(worst.at)}; to hold the tube it needs {worst.limit:.3f}"
        )
    else:
        message = (
            f"{worst.feature} of {worst.inlet.chamber} is drawn {worst.drawn:.3f} mm wide, "
            f"{at(worst.at)}, and {_made(worst.interface)} {worst.value:.3f} at worst "
            f"({_edges(worst.interface, design).words()}); a tube of "
            f"{worst.inlet.tube_diameter:g} beside its strip needs {worst.limit:.3f}"
        )
    # What only the seams' places take from a strip leaves it open, if narrow for its tube.
    by_seams = worst.value > 0 and all(holds(fit.firm, fit.limit) for fit in short)
    verdict: Verdict = "pass" if good else "warn" if by_seams else "fail"
    if verdict == "fail":
        message += f": {worst.remedy}"
    elif verdict == "warn":
        message = f"{worst.remedy}: {message}"
    place = Place(None, (), *worst.at)
    if worst.interface is not None:
        place = Place(worst.interface.index, worst.interface.layer_indices, *worst.at)
    remedy = worst.remedy if verdict == "warn" else ""
    finding = Finding(NAME, verdict, worst.limit, worst.value, "mm", place, message, remedy=remedy)
    holes = [_of_holes(on_holes)] if on_holes else []
    return [finding, *(_unlike(fits) if good else ()), *holes]


def _unlike(fits: Sequence[_Fit]) -> Iterator[Finding]:
    """Yield a warning for each mouth that is drawn with another width than its inlet states."""
    for fit in fits:
        stated = fit.inlet.width
        if fit.feature != MOUTH or fit.interface is None or abs(fit.drawn - stated) <= UNLIKE:
            continue
        remedy = f"write {fit.drawn:.3f} as the width of {fit.inlet.chamber}, or draw it so"
        message = (
            f"{remedy}: the strip of {fit.inlet.chamber} is stated {stated:.3f} mm wide and drawn "
            f"{fit.drawn:.3f}, {at(fit.at)}"
        )
        place = Place(fit.interface.index, fit.interface.layer_indices, *fit.at)
        yield Finding(NAME, "warn", stated, fit.drawn, "mm", place, message, remedy=remedy)


RULE = Rule(
    NAME,
    check,
    Explanation(
        "the inlet strip, cut at its narrowest, opens to the tube and its own film",
        "A flat channel opens to half the perimeter of what goes in; less, and the tube tears it.",
        "Leave inlet.width out, so that it follows the tube, draw strips of drawn layers wider, or "
        "use a thinner tube.",
        ("inlet.width", "inlet.tube_outer_diameter", "laser.unknown_kerf"),
    ),
)


# Ports that are holes of an outer film.


class _HoleFit(NamedTuple):
    """A measure of a tube on a hole: value and least value, mm, and the sentence that tells it."""

    layer: Layer
    port: Port
    value: float
    limit: float
    words: str
    remedy: str


def _of_holes(fits: Sequence[_HoleFit]) -> Finding:
    """The finding of the worst tube on a hole."""
    worst = min(fits, key=lambda fit: fit.value - fit.limit)
    good = holds(worst.value, worst.limit)
    message = worst.words if good else f"{worst.words}: {worst.remedy}"
    place = Place(None, (worst.layer.index,), *worst.port.at)
    verdict: Verdict = "pass" if good else "fail"
    return Finding(NAME, verdict, worst.limit, worst.value, "mm", place, message)


def _on_hole(port: Port, laminate: Laminate, design: Design) -> Iterator[_HoleFit]:
    """Yield the tube's overlap round the hole, and the width of film round it.

    Both are measured from the port's place, where the tube's middle is glued.
    """
    ends = {layer.index: layer for layer in (laminate.tpe_layers[0], laminate.tpe_layers[-1])}
    beside = [ends[index] for index in (port.below, port.above) if index in ends]
    here = f"the hole of {port.name}, {at(port.at)},"
    for layer in beside:
        hole = next((hole for hole in layer.profile.holes if hole.winding(port.at)), None)
        if hole is not None:
            break
    else:
        words = f"{here} is in no outer film, so no tube can be glued there"
        yield _HoleFit(beside[0], port, 0.0, design.rules.bond_width, words, "draw it in the film")
        return
    reach = max(_farthest(edge, port.at) for edge in hole.edges)
    if port.tube_diameter is not None:
        is_known = design.kerf_widths.get(layer.film.material) is not None
        kerf = 0.0 if is_known else design.laser.unknown_kerf
        cut = 2 * (reach + design.registration.cutting_error) + kerf
        words = (
            f"{here} is drawn {2 * reach:.3f} mm wide and cut {cut:.3f} at worst; a tube of "
            f"{port.tube_diameter:g} is glued on it"
        )
        remedy = "make the hole smaller, or take a wider tube (inlet.tube_outer_diameter)"
        yield _HoleFit(layer, port, port.tube_diameter, cut, words, remedy)
    others = Region(tuple(other for other in layer.profile.contours if other is not hole))
    film = others.distance_to_edge(port.at) - reach
    words = (
        f"{here} has {film:.3f} mm of film round it; to glue its tube on it needs "
        f"{design.rules.bond_width:g}"
    )
    yield _HoleFit(
        layer, port, film, design.rules.bond_width, words, "move what is cut beside it away"
    )


def _farthest(edge: Edge, p: Point) -> float:
    """The greatest distance of an edge from a point, mm; an arc counts as its whole circle."""
    if isinstance(edge, Line):
        return max(math.dist(edge.start, p), math.dist(edge.end, p))
    return math.dist(edge.centre, p) + edge.radius


# Inlets between two films.


def _fits(inlet: Inlet, laminate: Laminate, design: Design) -> list[_Fit]:
    for distinct in distinct_interfaces(laminate):
        interface = distinct.interface
        if interface.kind != "chamber":
            continue
        needed = _needed(inlet, interface)
        openings = mouth_openings(inlet, interface)
        if openings:
            # A tube goes into one opening; bond between two of them holds it out of both.
            low, high = max(openings, key=lambda ends: ends[1] - ends[0])
            (x, y), (dx, dy) = inlet.mouth, inlet.direction
            ends = [(x + dy * offset, y - dx * offset) for offset in (low, high)]
            opening = _Fit(inlet, interface, MOUTH, 0.0, needed, inlet.mouth, "")
            run = _along_run(inlet, interface, needed, design)
            return [_at_worst(opening, ends[0], ends[1], design), *run]
    message = "open a mask strip to the tab's end"
    gaps = [interface for interface in laminate.interfaces if interface.kind == "chamber"]
    if gaps and not any(interface.pressed for interface in gaps):
        message = "open the path of the seam at the tab's end, as wide as that"
    needed = math.pi * inlet.tube_diameter / 2
    return [_Fit(inlet, None, MOUTH, 0.0, needed, inlet.mouth, message)]


def _along_run(inlet: Inlet, interface: Interface, needed: float, design: Design) -> list[_Fit]:
    if inlet.length < TOLERANCE:
        return []
    x, y = inlet.mouth
    dx, dy = inlet.direction
    inner = (x - dx * inlet.length, y - dy * inlet.length)
    beside = strip(inner, inlet.mouth, 2 * inlet.width)
    near = [piece for piece in interface.unbonded.pieces if boxes_meet(piece.bounds, beside.bounds)]
    if not interface.pressed:
        # Films continue beside a seam; their other side does not belong to the strip.
        near = [piece for piece in near if piece.contains((x - dx * TOLERANCE, y - dy * TOLERANCE))]
    every = Region(tuple(contour for piece in near for contour in piece.contours))
    run = every & beside
    sides = [edge for edge in run.edges if _is_side(edge, inlet)]
    widths = [
        outward_reach(edge.reversed(), EdgeIndex([e for e in run.edges if e is not edge]))
        for edge in sides
    ]
    rims = interface.contact.index if interface.pressed else EdgeIndex(())
    bonds = [outward_reach(edge, rims) for edge in sides]
    fits = []
    wide = _least(sides, widths)
    if wide is not None:
        edge, reach = wide
        strip_fit = _Fit(inlet, interface, "the strip", 0.0, needed, reach.at, "")
        fits.append(_at_worst(strip_fit, edge.nearest(reach.at), reach.at, design))
    bonded = _least(sides, bonds)
    if bonded is not None:
        value, place = bonded[1]
        remedy = "make the tab wider, by bond.width or in the shape of a drawn layer"
        limit = design.rules.bond_width
        fits.append(_Fit(inlet, interface, BOND, value, limit, place, remedy, value, value))
    return fits


def _least(edges: Sequence[Edge], reaches: Sequence[Reach | None]) -> tuple[Edge, Reach] | None:
    both = ((edge, reach) for edge, reach in zip(edges, reaches, strict=True) if reach is not None)
    return min(both, key=lambda pair: pair[1].value, default=None)


def _edges(interface: Interface | None, design: Design) -> VoidEdges:
    if interface is None:
        return VoidEdges(design.registration.cutting_error, design.laser.unknown_kerf, ())
    return VoidEdges.of(interface, design)


def _at_worst(fit: _Fit, p: Point, q: Point, design: Design) -> _Fit:
    """Return the fit of a strip between two points of its edges, with the width left at worst."""
    drawn = Width(math.dist(p, q), p, q)
    edges = _edges(fit.interface, design)
    value = edges.left(drawn).value
    least = math.ceil(round((fit.limit + drawn.value - value) * 1000, 6)) / 1000
    remedy = f"make it {least:.3f} mm wide, by inlet.width or in the shape of a drawn layer"
    if edges.seams:
        remedy = f"lay the seams beside the inlet of {fit.inlet.chamber} {least:.3f} mm apart"
    firm = edges.with_seams_in_place.left(drawn).value
    return fit._replace(value=value, remedy=remedy, drawn=drawn.value, firm=firm)


def _needed(inlet: Inlet, interface: Interface) -> float:
    """Width that opens to the tube with the strip beside it."""
    strip = max((mask.film.thickness for mask in interface.masks), default=0.0)
    return math.pi / 2 * (inlet.tube_diameter + strip)


def _made(interface: Interface | None) -> str:
    return "cut" if interface is None or interface.pressed else "welded"


def _margin(fit: _Fit) -> float:
    return fit.value - fit.limit


def _is_side(edge: Edge, inlet: Inlet) -> bool:
    """Return True if an edge of the run is one of the strip's sides, not an end of the run."""
    depth = inlet.depth(edge.at(0.5))
    return TOLERANCE < depth < inlet.length - TOLERANCE
