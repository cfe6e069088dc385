"""What every family shares: balloons of given outlines and pockets become a stack of layers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

from sbafab.actuators.ears import (
    Ear,
    film_holes,
    film_setback,
    with_film_ears,
    with_mask_ears,
)
from sbafab.actuators.tails import Tail, with_tails
from sbafab.design.messages import listed, shown
from sbafab.design.records import Bore as BoreSection
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.geometry.boolean import union
from sbafab.geometry.edges import Point
from sbafab.geometry.offset import grow
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc
from sbafab.laminate.films import Film, in_order
from sbafab.laminate.laminate import ROLES, Layer, Pin, Role


@dataclass(frozen=True)
class BalloonShape:
    """One balloon seen from above, before bores and lumen are cut: its outline and pockets.

    The counts say how many separate parts outline and pockets are meant to have.
    """

    outline: Region
    pockets: Region
    outline_pieces: int
    pocket_pieces: int


@dataclass(frozen=True)
class BalloonStack:
    """Balloons bottom to top, what runs through them, and what holds them in register.

    ``shapes`` holds the distinct balloons and ``shape_of`` the index of each balloon's own;
    ``bottom`` is the first balloon with its inlet tabs and strips. ``axes`` are the channel axes.
    """

    bottom: BalloonShape
    shapes: tuple[BalloonShape, ...]
    shape_of: tuple[int, ...]
    axes: tuple[Point, ...]
    lumen: float | None = None
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
    """The films of a stack of balloons, base to cap (geometry of the laminate table)."""
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
        """The mask under a balloon: it reaches as far as any balloon of ``below`` faces that one.

        Past a smaller neighbour a film would meet the next but one, or the inlet tabs.
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
    """The dowel pin of a channel bore."""
    return Pin(name, centre, bore.pin, round(bore.diameter - bore.pin, 9))


def film_of(design: Design, role: Role) -> Film:
    """The film that a design's layup gives to the layers of a role.

    Raises DesignError where it names none, or one that cannot do the role's work.
    """
    key = role.replace("-", "_")
    name: str = getattr(design.layup, key)
    stock = design.films.stock
    wanted = "mask" if role.endswith("-mask") else "structural"
    fit = [known for known, film in stock.items() if film.kind == wanted]
    if name not in stock:
        raise DesignError(
            f"layup.{key} = {shown(name)} names no film; there are {listed(fit)} for it, and "
            "[films.NAME] adds one"
        )
    if name not in fit:
        raise DesignError(
            f"layup.{key} = {shown(name)} is a {stock[name].kind} film, and a {role} is cut from a "
            f"{wanted} one: {listed(fit)}"
        )
    return stock[name]


def used_films(design: Design) -> dict[str, Film]:
    """The films that a design's layup names, by material, TPE first. Raises DesignError."""
    named = {film.material: film for role in ROLES for film in [film_of(design, role)]}
    return {material: named[material] for material in in_order(named)}


def layers(cuts: Iterable[CutFilm], design: Design) -> tuple[Layer, ...]:
    """The films in their order, with heights and pattern names."""
    films = {role: film_of(design, role) for role in ROLES}
    patterns: dict[tuple[str, Region], str] = {}
    placed: list[Layer] = []
    z = 0.0
    for index, cut in enumerate(cuts, start=1):
        film = films[cut.role]
        shape = (film.material, cut.profile)
        pattern = patterns.setdefault(shape, f"P{len(patterns) + 1:02d}")
        placed.append(
            Layer(index, cut.role, film, cut.profile, cut.balloon, round(z, 9), cut.pieces, pattern)
        )
        z += film.thickness
    return tuple(placed)
