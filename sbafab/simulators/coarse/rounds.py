"""Round pockets on their axes, taken from a laminate's profiles, for the coarse mesh."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from sbafab.errors import DesignError
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Arc, Point
from sbafab.geometry.region import disc
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Interface, Laminate

ON_AXIS = 1e-6
SUPPORTED = "the coarse shell is made for stacks of round pockets on common plates"
NECK_SHARE, BORE_SHARE = 0.5, 0.2
"""Neck ring and bore of the paper's 5 mm pocket, for a single balloon, which lacks both."""


@dataclass(frozen=True)
class RoundStack:
    """A stack of round balloons; radii in mm.

    ``pockets`` and ``rims`` (pocket and outline) are given by balloon, bottom to top; ``axes``
    by chamber; ``hub`` is the outline's radius between two lobes, ``lumen`` the radius of the hole
    in the films; both are 0 for a single axis. ``elastic`` are the film's Young's modulus in MPa
    and Poisson's ratio.
    """

    name: str
    chambers: tuple[str, ...]
    axes: tuple[Point, ...]
    pockets: tuple[float, ...]
    rims: tuple[float, ...]
    neck: float
    bore: float
    hub: float
    lumen: float
    film: Film
    elastic: tuple[float, float]

    @property
    def radius(self) -> float:
        """Distance of the chamber axes from the actuator's."""
        return math.hypot(*self.axes[0])

    @property
    def lobes(self) -> int:
        return len(self.axes)


def round_stack(laminate: Laminate) -> RoundStack:
    """The stack of a laminate. Raises DesignError if its pockets are not round."""
    if any(layer.role == "sheet" for layer in laminate.layers):
        raise DesignError(
            f"{SUPPORTED}; the pockets of {laminate.name} lie on a sheet and need the conforming "
            "shell mesh"
        )
    if not laminate.chambers:
        raise DesignError(f"{SUPPORTED}; {laminate.name} has no chamber")
    films = sorted({layer.film.material for layer in laminate.tpe_layers})
    if len(films) > 1:
        raise DesignError(
            f"{SUPPORTED} of one film; {laminate.name} has films of {', '.join(films)} and needs "
            "the conforming shell mesh"
        )
    film = laminate.tpe_layers[0].film
    elastic = elastic_of(film)
    axes = tuple(chamber.centres[0] for chamber in laminate.chambers)
    rooms = [gap for gap in laminate.interfaces if gap.kind == "chamber"]
    necks = [gap for gap in laminate.interfaces if gap.kind == "separator"]
    first = axes[0]
    pockets = tuple(_pocket(gap, first) for gap in rooms)
    rims = tuple(_rim(gap, first, pocket) for gap, pocket in zip(rooms, pockets, strict=True))
    if necks:
        neck = min(_hole(gap.mask.holes, first, gap) for gap in necks)
        bore = max(_hole(gap.below.profile.holes, first, gap) for gap in necks)
    else:
        neck, bore = NECK_SHARE * pockets[0], BORE_SHARE * pockets[0]
    lumen = 0.0
    if laminate.lumen is not None:
        lumen = max(_hole(gap.below.profile.holes, (0.0, 0.0), gap) for gap in rooms)
    hub = 0.0
    if len(axes) > 1:
        radius = math.hypot(*first)
        hub = max(
            lumen + rims[0] - pockets[0],
            radius - min(pockets),
            radius * math.cos(math.pi / len(axes)),
        )
    return RoundStack(
        name=laminate.name,
        chambers=tuple(chamber.name for chamber in laminate.chambers),
        axes=axes,
        pockets=pockets,
        rims=rims,
        neck=neck,
        bore=bore,
        hub=hub,
        lumen=lumen,
        film=film,
        elastic=elastic,
    )


def elastic_of(film: Film) -> tuple[float, float]:
    """Young's modulus in MPa and Poisson's ratio. Raises DesignError if they are not known."""
    if film.elastic is None:
        raise DesignError(
            f"a simulation needs Young's modulus of {film.material}; add "
            f"films.{film.material.lower()}.modulus, in MPa, and poisson, its ratio"
        )
    return film.elastic


def equal_area(stack: RoundStack, sectors: int) -> RoundStack:
    """The stack with radii such that rings of ``sectors`` corners have the area of its circles.

    An inscribed octagon would have 10 % less area than the pocket.
    """
    turn = math.tau / sectors
    grown = math.sqrt(turn / math.sin(turn))
    return replace(
        stack,
        pockets=tuple(radius * grown for radius in stack.pockets),
        rims=tuple(radius * grown for radius in stack.rims),
        neck=stack.neck * grown,
        bore=stack.bore * grown,
    )


def pocket_radii(laminate: Laminate) -> list[float]:
    """Half the least width of every pocket, in mm."""
    radii = []
    for gap in laminate.interfaces:
        if gap.kind == "chamber":
            # Seams bound a chamber without a mask.
            for contour in (gap.mask if gap.masks else gap.unbonded).outers:
                low_x, bottom, right, top = contour.bounds
                radii.append(min(right - low_x, top - bottom) / 2)
    return radii


def why_not_round(laminate: Laminate) -> str | None:
    """The reason why a laminate has no coarse shell, or None."""
    try:
        round_stack(laminate)
    except DesignError as reason:
        return str(reason)
    return None


def _pocket(gap: Interface, axis: Point) -> float:
    radius = _radius_about(gap.mask.outers, axis)
    bore = max((_fitting(gap.mask.holes, axis)), default=0.0)
    if radius is None or (disc(axis, radius) - gap.mask - disc(axis, bore + ON_AXIS)).area > 1e-4:
        x, y = axis
        raise DesignError(
            f"{SUPPORTED}; the pocket below layer {gap.above.index} at x {x:.3f}, y {y:.3f} is "
            "drawn otherwise: use a chamber.diameter in place of chamber.outline"
        )
    return radius


def _rim(gap: Interface, axis: Point, pocket: float) -> float:
    radius = _radius_about(gap.contact.outers, axis)
    if radius is None or radius <= pocket:
        x, y = axis
        raise DesignError(
            f"{SUPPORTED}; the outline of layer {gap.above.index} at x {x:.3f}, y {y:.3f} does "
            "not run round its pocket"
        )
    return radius


def _radius_about(contours: Iterable[Contour], axis: Point) -> float | None:
    """The predominant radius of arcs round an axis; lobes and tabs leave only part of a circle."""
    turned: dict[float, float] = {}
    for contour in contours:
        for edge in contour.edges:
            if isinstance(edge, Arc) and math.dist(edge.centre, axis) < ON_AXIS:
                radius = round(edge.radius, 6)
                turned[radius] = turned.get(radius, 0.0) + abs(edge.sweep)
    return max(turned, key=lambda r: (turned[r], r)) if turned else None


def _fitting(holes: Iterable[Contour], axis: Point) -> Iterable[float]:
    for hole in holes:
        if hole.circle is not None and math.dist(hole.circle[0], axis) < ON_AXIS:
            yield hole.circle[1]


def _hole(holes: Iterable[Contour], axis: Point, gap: Interface) -> float:
    radius = max(_fitting(holes, axis), default=None)
    if radius is None:
        x, y = axis
        raise DesignError(
            f"{SUPPORTED}; interface {gap.index} has no round hole at x {x:.3f}, y {y:.3f}"
        )
    return radius
