"""Stacks of balloons as layers, and the pockets, tabs and strips of all families."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Annotated, Any

from pydantic import Field

from sbafab.actuators.ears import (
    NOTE,
    Ear,
    Holder,
    Ray,
    Tail,
    film_holes,
    film_setback,
    placed,
    tails,
    with_film_ears,
    with_mask_ears,
    with_tails,
)
from sbafab.design.files import listed, shown
from sbafab.design.outline import read_outline
from sbafab.design.records import Design, Discs, Drawn, Free
from sbafab.design.sections import Bore as BoreSection
from sbafab.design.sections import Chamber as ChamberSection
from sbafab.design.units import Length
from sbafab.errors import DesignError
from sbafab.geometry.edges import Point, unit
from sbafab.geometry.offset import fillet, grow
from sbafab.geometry.region import Region, disc, strip, union
from sbafab.geometry.spatial_index import boxes_meet
from sbafab.laminate.films import Film, in_order
from sbafab.laminate.laminate import (
    ROLES,
    Bore,
    Chamber,
    Inlet,
    Laminate,
    Layer,
    Pin,
    Role,
)


@dataclass(frozen=True)
class BalloonShape:
    """One balloon seen from above, before bores and lumen are cut: its outline and pockets.

    The counts are the expected numbers of separate parts of outline and pockets.
    """

    outline: Region
    pockets: Region
    outline_pieces: int
    pocket_pieces: int


@dataclass(frozen=True)
class BalloonStack:
    """Balloons bottom to top, their channels, and their registration.

    ``shapes`` holds the distinct balloons and ``shape_of`` each balloon's index in it; ``bottom``
    is the first balloon with its inlet tabs and strips. ``axes`` are the channel axes.
    """

    bottom: BalloonShape
    shapes: tuple[BalloonShape, ...]
    shape_of: tuple[int, ...]
    axes: tuple[Point, ...]
    lumen: float | None = None
    lumen_pin: float = 0.0
    ears: tuple[Ear, ...] = ()
    tails: tuple[Tail, ...] = ()


@dataclass(frozen=True)
class CutFilm:
    """One film with its profile, not yet placed in a laminate."""

    role: Role
    profile: Region
    balloon: int | None
    pieces: int


def balloon_cuts(stack: BalloonStack, design: Design) -> list[CutFilm]:
    """Return the films of a stack of balloons, base to cap (geometry of the laminate table)."""
    count = len(stack.shape_of)
    back, ears = film_setback(design), stack.ears
    radius = design.bore.diameter / 2

    def round_axes(r: float) -> Region:
        return union(disc(axis, r) for axis in stack.axes) if count > 1 else Region()

    def lumen(r: float) -> Region:
        return disc((0.0, 0.0), stack.lumen / 2 + r) if stack.lumen else Region()

    # Shape 0 stands for the bottom balloon, shape i + 1 for stack.shapes[i].
    shapes = (stack.bottom, *stack.shapes)

    @cache
    def eared(shape: int) -> Region:
        return with_film_ears(shapes[shape].outline, ears, design.fillet.radius)

    @cache
    def plate(shape: int) -> Region:
        return eared(shape) - union([lumen(back), film_holes(ears)])

    @cache
    def wall(shape: int) -> Region:
        return plate(shape) - round_axes(radius + back)

    @cache
    def chamber_mask(shape: int) -> Region:
        pockets = shapes[shape].pockets
        return (pockets if shape else with_tails(pockets, stack.tails)) - round_axes(radius)

    @cache
    def separator_mask(below: frozenset[int], above: int) -> Region:
        """Return the mask under a balloon, which covers the contact with every balloon of
        ``below``.

        Beyond a smaller neighbour a film would otherwise meet the next but one, or the inlet tabs.
        """
        shared = eared(above)
        # The bottom balloon covers a plain one of its size.
        if above not in below and above != stack.shape_of[0] + 1:
            shared = shared & union(eared(shape) for shape in sorted(below))
        rings = round_axes(radius + back + design.bond.width)
        grown = grow(shared, design.mask.overhang)
        return with_mask_ears(grown, ears, design.mask.overhang) - union([lumen(0.0), rings])

    cuts: list[CutFilm] = []
    below = frozenset([0])
    for number in range(1, count + 1):
        shape = 0 if number == 1 else stack.shape_of[number - 1] + 1
        parts = shapes[shape].outline_pieces
        if number == 1:
            cuts.append(CutFilm("base", plate(shape), number, parts))
        else:
            cuts.append(CutFilm("wall", wall(shape), number, parts))
        cuts.append(
            CutFilm("chamber-mask", chamber_mask(shape), number, shapes[shape].pocket_pieces)
        )
        if number == count:
            cuts.append(CutFilm("cap", plate(shape), number, parts))
        else:
            cuts.append(CutFilm("wall", wall(shape), number, parts))
            below = below | {shape}
            mask = separator_mask(below, stack.shape_of[number] + 1)
            cuts.append(CutFilm("separator-mask", mask, number, stack.shapes[0].outline_pieces))
    return cuts


def channel_pin(name: str, centre: Point, bore: BoreSection) -> Pin:
    """Return the dowel pin of a channel bore."""
    return Pin(name, centre, bore.pin, round(bore.diameter - bore.pin, 9))


def film_of(design: Design, role: Role, index: int = 0) -> Film:
    """Return the film of a role in a design, or of the layer with this index.

    Raises DesignError if there is none, or if it is of the wrong kind.
    """
    key = f"layup.{role.replace('-', '_')}"
    name: str = getattr(design.layup, role.replace("-", "_"))
    if index in design.layer_films:
        key, name = f"film of layer {index}", design.layer_films[index]
    stock = design.films.stock
    kind = "mask" if role.endswith("-mask") else "structural"
    fit = [name_of_film for name_of_film, film in stock.items() if film.kind == kind]
    if name not in stock:
        raise DesignError(
            f"{key} = {shown(name)} is not a film; use {listed(fit)}, or add it as [films.NAME]"
        )
    if name not in fit:
        raise DesignError(
            f"{key} = {shown(name)} is a {stock[name].kind} film, but a {role} needs a {kind} "
            f"film: {listed(fit)}"
        )
    return stock[name]


def used_films(design: Design) -> dict[str, Film]:
    """Return the films that a design names, by material, TPE first. Raises DesignError."""
    listed_roles = enumerate(design.layer_roles, start=1)
    films = [film_of(design, role, index) for index, role in listed_roles if role in ROLES]
    films = films or [film_of(design, role) for role in ROLES]
    named = {film.material: film for film in films}
    return {material: named[material] for material in in_order(named)}


def layers(cuts: Iterable[CutFilm], design: Design) -> tuple[Layer, ...]:
    """Return the films as layers, with heights and pattern names."""
    film_for = cache(partial(film_of, design))
    patterns: dict[tuple[str, Region], str] = {}
    placed: list[Layer] = []
    z = 0.0
    for index, cut in enumerate(cuts, start=1):
        film = film_for(cut.role, index if index in design.layer_films else 0)
        shape = (film.material, cut.profile)
        pattern = patterns.setdefault(shape, f"P{len(patterns) + 1:02d}")
        placed.append(
            Layer(index, cut.role, film, cut.profile, cut.balloon, round(z, 9), cut.pieces, pattern)
        )
        z += film.thickness
    return tuple(placed)


def stacked(
    design: Design,
    stack: BalloonStack,
    chambers: Sequence[Chamber],
    inlets: tuple[Inlet, ...],
    carrier: Sequence[CutFilm] = (),
    channel: str = "chamber",
) -> Laminate:
    """Return the laminate of a stack of balloons on its ``carrier`` films, with bores and pins.

    Pins in bores are named ``channel`` and a number; with ears the lumen has no pin.
    """
    balloons = len(stack.shape_of)
    bores = tuple(
        Bore(chamber.name, centre, design.bore.diameter)
        for chamber in chambers
        for centre in chamber.centres
        if balloons > 1
    )
    pins = [channel_pin(f"{channel}{n}", b.centre, design.bore) for n, b in enumerate(bores, 1)]
    if stack.lumen is not None and not stack.ears:
        pins.append(Pin("lumen", (0.0, 0.0), stack.lumen_pin, stack.lumen - stack.lumen_pin))
    pins += [ear.pin for ear in stack.ears]
    pins += [pin for tail in stack.tails for pin in tail.pins]
    return Laminate(
        **of_every_family(design),
        layers=layers([*carrier, *balloon_cuts(stack, design)], design),
        chambers=tuple(chambers),
        bores=bores,
        inlets=inlets,
        pins=tuple(pins),
        lumen=stack.lumen,
        balloons=balloons,
        notes=(NOTE,) if stack.ears else (),
    )


def of_every_family(design: Design) -> dict[str, Any]:
    """Return the facts of a laminate from sections that all families share."""
    return {
        "name": design.name,
        "family": design.family,
        "registration": design.registration.method,
        "pins_in_full_bonds": design.registration.full_bond_pins == "in",
        "middle_first": design.registration.is_middle_first,
        "bonds": design.stated_bonds,
    }


# Pockets of discs or of a drawn outline, tapered or not, and their inlet strips and tabs.


MOST_SIZES = 40
"""Most different pockets in a stack: twice the balloons built so far (paper Sec. 6)."""


class RoundChamber(ChamberSection):
    """The chamber of a family whose pockets are discs, or one drawn outline."""

    diameter: Length | Annotated[tuple[Length, ...], Field(strict=False, min_length=1)] = 5.0
    """Pocket diameter; a list gives one per balloon, bottom to top (a tapered stack)."""


def free_of_round(chamber: RoundChamber, further: tuple[Free, ...]) -> tuple[Free, ...]:
    """Return the search variables of a round chamber, followed by ``further`` ones.

    The diameter is that of all balloons, or the largest of a list, whose length is fixed.
    """
    if chamber.outline is not None:
        return further
    is_list = not isinstance(chamber.diameter, float)
    return (
        Free("chamber.diameter", 2.6, 16.0, 0.1, widens=True),
        *(free for free in further if not (is_list and free.key == "stack.balloons")),
    )


def diameters(design: Design, chamber: RoundChamber) -> tuple[float, ...]:
    """Return the pocket diameter of every balloon, bottom to top. Raises DesignError."""
    if isinstance(chamber.diameter, float):
        return (chamber.diameter,) * design.stack.balloons
    if len(chamber.diameter) != design.stack.balloons:
        raise DesignError(
            f"chamber.diameter lists {len(chamber.diameter)} balloons but stack.balloons = "
            f"{design.stack.balloons}; give one diameter per balloon, bottom to top"
        )
    return chamber.diameter


def round_pockets(design: Design, chamber: RoundChamber) -> Discs | Drawn:
    """Return the form of these pockets."""
    return Drawn() if chamber.outline is not None else Discs(diameters(design, chamber))


def pocket_shapes(design: Design, chamber: RoundChamber) -> tuple[list[Region], tuple[int, ...]]:
    """Return the distinct pockets around (0, 0), and the index of each balloon's.

    Raises DesignError if a pocket has no room for bore and neck ring.
    """
    if chamber.outline is not None and not isinstance(chamber.diameter, float):
        raise DesignError(
            "chamber.outline and a list in chamber.diameter exclude each other; remove one"
        )
    if design.drawing is not None:
        drawn = read_outline(design.drawing)
        check_neck(design, [drawn])
        return [drawn], (0,) * design.stack.balloons
    sizes = diameters(design, chamber)
    distinct = list(dict.fromkeys(sizes))
    if len(distinct) > MOST_SIZES:
        raise DesignError(
            f"chamber.diameter lists {len(distinct)} different diameters; the limit is "
            f"{MOST_SIZES}; use equal diameters for neighbouring balloons"
        )
    pockets = [disc((0.0, 0.0), size / 2) for size in distinct]
    check_neck(design, pockets)
    return pockets, tuple(distinct.index(size) for size in sizes)


def check_neck(design: Design, pockets: list[Region]) -> None:
    """Raise DesignError if bore and neck ring leave no free film in the smallest pocket."""
    if design.stack.balloons == 1:
        return
    ring = design.bore.diameter / 2 + film_setback(design) + design.bond.width
    room = min(pocket.distance_to_edge((0.0, 0.0)) for pocket in pockets)
    if ring >= room:
        largest = design.bore.diameter - 2 * (ring - room)
        remedy = f"widen the chamber by more than {2 * (ring - room):.3f}"
        remedy += f", or make the bore less than {largest:.3f}" if largest > 0 else ""
        raise DesignError(
            f"bore.diameter = {design.bore.diameter:g} with a neck ring of bond.width = "
            f"{design.bond.width:g} around it (outer radius {ring:.3f}) does not fit a pocket "
            f"that leaves {room:.3f} around the channel; {remedy}"
        )


def tab_and_strip(
    design: Design, chamber: str, pocket: Region, start: Point, direction: Point, edge: float
) -> tuple[Region, Region, Inlet]:
    """Return inlet tab, mask strip and inlet of a chamber.

    The strip starts at ``start`` inside the pocket and runs along ``direction``; the outline ends
    ``edge`` mm from there. The strip reaches one overhang past the tab's end. Raises DesignError if
    the strip is wider than the pocket.
    """
    width = design.strip_width
    for side in (1, -1):
        corner = (
            start[0] - side * direction[1] * width / 2,
            start[1] + side * direction[0] * width / 2,
        )
        if not pocket.contains(corner):
            raise DesignError(
                f"inlet.width = {width:g} is wider than the pocket of {chamber} where the strip "
                "leaves it; reduce inlet.width or enlarge the chamber"
            )
    length = edge + design.inlet.tab_length

    def along(distance: float) -> Point:
        return start[0] + direction[0] * distance, start[1] + direction[1] * distance

    tab = strip(start, along(length), width + 2 * design.bond.width)
    mask = strip(start, along(length + design.mask.overhang), width)
    inlet = Inlet(
        chamber,
        along(length),
        direction,
        width,
        design.inlet.tab_length,
        design.inlet.tube_outer_diameter,
    )
    return tab, mask, inlet


def bonded(pockets: Region, width: float) -> Region:
    """Return the outline of pockets with a bonded ring around them, filled inside."""
    return Region(grow(pockets, width).outers)


# Balloons in one piece seen from above: their footprint, and the laminate built from it.


EARS: tuple[tuple[str, Holder], ...] = (
    ("film1", "film"),
    ("film2", "film"),
    ("mask1", "mask"),
    ("mask2", "mask"),
)


@dataclass(frozen=True)
class Footprint:
    """Balloons in one piece seen from above, mm.

    ``pockets`` holds one pocket per chamber for each distinct balloon, and ``shape_of`` each
    balloon's index in it, bottom to top. Chambers have ``axes``, and inlets run from these along
    unit ``directions``; without its tab the film ends ``edge`` mm from the axis. ``hub`` joins the
    lobes of several chambers. ``lumen`` and ``lumen_pin`` are diameters. ``ears`` are start and
    angle (degrees) of two film ears and two mask ears.
    """

    pockets: Sequence[Sequence[Region]]
    shape_of: tuple[int, ...]
    axes: tuple[Point, ...]
    directions: Sequence[Point]
    edge: float
    ears: Sequence[tuple[Point, float]]
    hub: Region | None = None
    lumen: float | None = None
    lumen_pin: float = 0.0
    notes: tuple[str, ...] = ()


def build_footprint(design: Design, footprint: Footprint) -> Laminate:
    """Return the laminate of a footprint. Raises DesignError if parts do not fit."""
    chambers = [Chamber(f"chamber{n}", (axis,)) for n, axis in enumerate(footprint.axes, start=1)]
    shapes = tuple(_plate(design, footprint.hub, pockets) for pockets in footprint.pockets)
    first = footprint.pockets[footprint.shape_of[0]]
    outlines = [bonded(pocket, design.bond.width) for pocket in first]
    feeds = [
        tab_and_strip(design, chamber.name, pocket, axis, direction, footprint.edge)
        for chamber, pocket, axis, direction in zip(
            chambers, first, footprint.axes, footprint.directions, strict=True
        )
    ]
    _check_tabs(design, outlines, feeds)
    hub = () if footprint.hub is None else (footprint.hub,)
    bottom = BalloonShape(
        fillet(union([*hub, *outlines, *(tab for tab, _, _ in feeds)]), design.fillet.radius),
        union([*first, *(strip for _, strip, _ in feeds)]),
        1,
        len(chambers),
    )
    inlets = tuple(inlet for _, _, inlet in feeds)
    plates = union(shape.outline for shape in shapes)
    ears: tuple[Ear, ...] = ()
    body = plates
    if design.registration.method == "ears":
        body = bottom.outline | plates
        ears = placed(_rays(footprint, design), body, plates, design)
    stack = BalloonStack(
        bottom,
        shapes,
        footprint.shape_of,
        footprint.axes,
        footprint.lumen,
        footprint.lumen_pin,
        ears,
        tails(inlets, body, ears, design),
    )
    laminate = stacked(design, stack, chambers, inlets)
    return replace(laminate, notes=(*footprint.notes, *laminate.notes), outline=plates)


def _plate(design: Design, hub: Region | None, pockets: Sequence[Region]) -> BalloonShape:
    """Return a balloon without its inlets; the hub joins its lobes, with filleted corners."""
    lobes = [bonded(pocket, design.bond.width) for pocket in pockets]
    if hub is None:
        return BalloonShape(lobes[0], pockets[0], 1, 1)
    outline = fillet(union([hub, *lobes]), design.fillet.radius)
    return BalloonShape(Region(outline.outers), union(pockets), 1, len(pockets))


def _rays(footprint: Footprint, design: Design) -> list[Ray]:
    """Return the rays of the ears; a single balloon has no separator mask to hold."""
    return [
        Ray(name, holder, start, unit(angle), name.endswith("2"))
        for (name, holder), (start, angle) in zip(EARS, footprint.ears, strict=True)
        if holder == "film" or design.stack.balloons > 1
    ]


def _check_tabs(
    design: Design, outlines: Sequence[Region], feeds: Sequence[tuple[Region, Region, Inlet]]
) -> None:
    """Raise DesignError if a tab is closer than one overhang to another lobe or tab."""
    for (tab, _, inlet), outline in zip(feeds, outlines, strict=True):
        free = grow(tab - outline, design.mask.overhang) if len(feeds) > 1 else Region()
        for other, (other_tab, _, neighbour) in zip(outlines, feeds, strict=True):
            if neighbour is not inlet and any(_overlap(free, part) for part in (other, other_tab)):
                raise DesignError(
                    f"the inlet tab of {inlet.chamber} ({inlet.width + 2 * design.bond.width:g} "
                    f"wide) meets the lobe or tab of {neighbour.chamber}; make inlet.width "
                    "smaller, chamber.axis_radius larger or chamber.count smaller"
                )


def _overlap(a: Region, b: Region) -> bool:
    return boxes_meet(a.bounds, b.bounds) and not (a & b).is_empty
