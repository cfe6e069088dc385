"""The laminate: layers bottom to top, and the interfaces between its TPE layers.

The one model that rules, cut files, press schedule, meshes and pictures read. Lengths are mm,
the origin lies on the actuator's axis, z points up from the press plate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from sbafab.geometry.edges import Bounds, Point
from sbafab.geometry.once import once
from sbafab.geometry.region import Region
from sbafab.laminate.films import Film, in_order
from sbafab.laminate.interfaces import Interface, InterfaceKind, interface_regions
from sbafab.laminate.panel import SheetPanel

Role = Literal["base", "wall", "cap", "sheet", "chamber-mask", "separator-mask"]
ROLES: tuple[Role, ...] = get_args(Role)

NOTHING = Region()
LOOSE = 0.2
"""mm by which a hole may miss its pin in place or diameter and still be the pin's."""


@dataclass(frozen=True, repr=False)
class Layer:
    """One film cut to one profile.

    ``index`` counts from 1 at the bottom; ``balloon`` likewise (None for a sheet and its mask);
    ``z`` is the height of the layer's lower face with every film at its nominal thickness.
    ``pieces`` is how many separate parts the role asks for. ``pattern`` names the shape: equal
    profiles of one material share it.
    """

    index: int
    role: Role
    film: Film
    profile: Region
    balloon: int | None
    z: float
    pieces: int
    pattern: str

    @property
    def name(self) -> str:
        """File stem, for example ``003_TPE_wall``."""
        return f"{self.index:03d}_{self.film.material}_{self.role}"

    def __repr__(self) -> str:
        return f"Layer({self.name!r}, {self.pattern!r}, {self.profile.area:.3f} mm2)"

    @property
    def is_mask(self) -> bool:
        """Whether nothing bonds to it."""
        return self.film.is_mask

    def _repr_html_(self) -> str:
        from sbafab.laminate.picture import layer_html

        return layer_html(self)


@dataclass(frozen=True)
class Bore:
    """A channel bore: the opening that joins the balloons of one chamber, held by a dowel pin.

    ``centre`` (x, y) and ``diameter`` are mm.
    """

    chamber: str
    centre: Point
    diameter: float


@dataclass(frozen=True)
class Chamber:
    """A chamber: balloons that share one inlet.

    ``centres`` holds a point (x, y) in mm inside the pocket of every stack the chamber feeds: one,
    or several where pockets are joined by a manifold.
    """

    name: str
    centres: tuple[Point, ...]


@dataclass(frozen=True)
class Inlet:
    """Where the tube of a chamber goes in: the strip's mouth at the tab's end.

    ``mouth`` is the middle of the tab's end, ``direction`` the unit vector outward, ``length``
    the straight run of the strip inward from the mouth, ``width`` the strip's, ``tube_diameter``
    the tube's outer diameter, all mm.
    """

    chamber: str
    mouth: Point
    direction: Point
    width: float
    length: float
    tube_diameter: float


@dataclass(frozen=True)
class Pin:
    """A dowel pin of the press fixture; it holds every layer with an opening at its place.

    ``centre`` (x, y) and ``diameter`` are mm, like ``clearance``, by how much the layers' hole for
    it is wider than the pin.
    """

    name: str
    centre: Point
    diameter: float
    clearance: float = 0.0

    @property
    def hole(self) -> float:
        """Diameter of the layers' hole for the pin, mm."""
        return self.diameter + self.clearance


@dataclass(frozen=True, repr=False)
class Laminate:
    """A stack of layers, bottom to top, with what the layers alone do not tell.

    ``outline`` is that of the films of all balloons laid over each other, without inlet tabs and
    ears; empty where only the layers are known. ``pins_in_full_bonds``: whether the pins of ears
    stay in while TPE melts. ``panel``: the registered sheets that it is made in, if it is.
    ``tube``: outer diameter in mm of the tube that its sheet is wrapped round, if it is; ``lumen``
    that of the channel through all layers, mm.
    """

    name: str
    family: str
    layers: tuple[Layer, ...]
    chambers: tuple[Chamber, ...]
    bores: tuple[Bore, ...]
    inlets: tuple[Inlet, ...]
    pins: tuple[Pin, ...]
    lumen: float | None
    balloons: int
    registration: str
    notes: tuple[str, ...] = ()
    outline: Region = NOTHING
    pins_in_full_bonds: bool = False
    panel: SheetPanel | None = None
    tube: float | None = None

    def __repr__(self) -> str:
        return f"Laminate({self.name!r}, {self.family!r}, {len(self.layers)} layers)"

    @once
    def interfaces(self) -> tuple[Interface, ...]:
        """One between every two consecutive TPE layers, bottom to top."""
        known: dict[tuple[str, str, tuple[str, ...]], tuple[Region, Region, Region, Region]] = {}
        found: list[Interface] = []
        below: Layer | None = None
        masks: list[Layer] = []
        for layer in self.layers:
            if layer.is_mask:
                masks.append(layer)
                continue
            if below is not None:
                key = below.pattern, layer.pattern, tuple(mask.pattern for mask in masks)
                if key not in known:
                    known[key] = interface_regions(
                        below.profile, layer.profile, [mask.profile for mask in masks]
                    )
                found.append(Interface.between(len(found) + 1, below, layer, masks, known[key]))
            below, masks = layer, []
        return tuple(found)

    @once
    def tpe_layers(self) -> tuple[Layer, ...]:
        """The layers that bond: all of structural films, TPE or further ones."""
        return tuple(layer for layer in self.layers if not layer.is_mask)

    @property
    def bonded_materials(self) -> str:
        """The materials of the films that bond, in words."""
        return ", ".join(in_order(layer.film.material for layer in self.tpe_layers))

    @once
    def patterns(self) -> dict[str, tuple[Layer, ...]]:
        """The layers of every distinct pattern, in stacking order."""
        groups: dict[str, list[Layer]] = {}
        for layer in self.layers:
            groups.setdefault(layer.pattern, []).append(layer)
        return {pattern: tuple(layers) for pattern, layers in groups.items()}

    @property
    def thickness(self) -> float:
        """Nominal thickness in mm: the plain sum of the films (paper Sec. 2 measures less)."""
        top = self.layers[-1]
        return top.z + top.film.thickness

    @once
    def bounds(self) -> Bounds:
        """Least x, least y, largest x, largest y of all layers, mm."""
        boxes = [layers[0].profile.bounds for layers in self.patterns.values()]
        return (
            min(box[0] for box in boxes),
            min(box[1] for box in boxes),
            max(box[2] for box in boxes),
            max(box[3] for box in boxes),
        )

    def layer(self, index: int) -> Layer:
        """The layer with this index, counted from 1 at the bottom."""
        return self.layers[index - 1]

    def first_cut(self, layer: Layer) -> Region:
        """What the cut file of a layer cuts: its profile, or its registered sheet.

        A mask sheet is laid face down, so it is cut turned over.
        """
        if self.panel is None:
            return layer.profile
        sheet = self.panel.sheets[layer.index - 1]
        return sheet.mirrored() if layer.is_mask else sheet

    def pins_holding(self, layer: Layer) -> tuple[Pin, ...]:
        """The pins on which the layer has a hole that fits; a wider opening does not hold it."""
        return self.pins_in(layer.profile)

    def pins_in(self, part: Region) -> tuple[Pin, ...]:
        """The pins on which this part of a layer, or its registered sheet, has a hole that fits."""
        if self.panel is not None:
            return self.pins
        circles = [hole.circle for hole in part.holes if hole.circle is not None]
        return tuple(
            pin
            for pin in self.pins
            if any(
                math.dist(centre, pin.centre) < LOOSE and abs(2 * radius - pin.hole) < LOOSE
                for centre, radius in circles
            )
        )

    def _repr_html_(self) -> str:
        from sbafab.laminate.picture import laminate_html

        return laminate_html(self)


__all__ = [
    "Bore",
    "Chamber",
    "Inlet",
    "Interface",
    "InterfaceKind",
    "Laminate",
    "Layer",
    "ROLES",
    "Pin",
    "Role",
]
