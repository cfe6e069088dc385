"""The laminate: layers bottom to top, and the interfaces between its TPE layers.

The only model for rules, cut files, press schedule, meshes and pictures. Lengths are in mm; the
origin lies on the actuator's axis, and z points up from the press plate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal, get_args

from sbafab import plugins
from sbafab.errors import DesignError
from sbafab.geometry.edges import Bounds, Point, box_round
from sbafab.geometry.region import Region, union
from sbafab.laminate.films import Film, density_of, in_order
from sbafab.laminate.folding import flat_part, fold_roots, unfolded
from sbafab.laminate.joints import PRESS, FaceBond, Fold, Net, Port, Seam, chamber_gaps

Role = Literal["base", "wall", "cap", "sheet", "chamber-mask", "separator-mask"]
ROLES: tuple[Role, ...] = get_args(Role)

NOTHING = Region()
LOOSE = 0.2
"""Tolerance on place and diameter for a hole to belong to a pin, mm."""
IN_MOUTH = 0.1
"""Distance inward of its mouth at which a channel is searched, mm."""


@dataclass(frozen=True, repr=False)
class Layer:
    """One film cut to one profile.

    ``index`` and ``balloon`` count from 1 at the bottom (``balloon`` is None for a sheet and its
    mask); ``z`` is the height of the layer's lower face with every film at its nominal thickness.
    ``pieces`` is the number of separate parts of its role. ``pattern`` names the shape: equal
    profiles of one material share it. A ``turned`` layer lies with its upper face down.
    """

    index: int
    role: Role
    film: Film
    profile: Region
    balloon: int | None
    z: float
    pieces: int
    pattern: str
    turned: bool = False

    @property
    def name(self) -> str:
        """The file stem, for example ``003_TPE_wall``."""
        return f"{self.index:03d}_{self.film.material}_{self.role}"

    def __repr__(self) -> str:
        return f"Layer({self.name!r}, {self.pattern!r}, {self.profile.area:.3f} mm2)"

    @property
    def is_mask(self) -> bool:
        """True if nothing bonds to it."""
        return self.film.is_mask

    @property
    def faces(self) -> tuple[str, str]:
        """The materials of its faces as laid, upper face first."""
        plain = self.film.material.lower()
        upper, lower = self.film.faces or (plain, plain)
        return (lower, upper) if self.turned else (upper, lower)


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

    ``centres`` holds a point (x, y) in mm inside the pocket of every stack that the chamber feeds:
    several if a manifold joins pockets. ``balloons`` are the balloons with its pockets, counted
    from 1 at the bottom; all if empty.
    """

    name: str
    centres: tuple[Point, ...]
    balloons: tuple[int, ...] = ()

    def is_in(self, balloon: int) -> bool:
        """Return True if the chamber has a pocket in a balloon."""
        return not self.balloons or balloon in self.balloons


@dataclass(frozen=True)
class Inlet:
    """The mouth of a chamber's inlet strip at the tab's end, where its tube is inserted.

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

    def depth(self, p: Point) -> float:
        """Return the distance of a point inward from the mouth's line, mm."""
        (x, y), (dx, dy) = self.mouth, self.direction
        return (x - p[0]) * dx + (y - p[1]) * dy

    def offset(self, p: Point) -> float:
        """Return the distance of a point to the right of the mouth's middle, mm."""
        (x, y), (dx, dy) = self.mouth, self.direction
        return (p[0] - x) * dy - (p[1] - y) * dx


@dataclass(frozen=True)
class Pin:
    """A dowel pin of the press fixture; it holds every layer with an opening at its place.

    ``centre`` (x, y), ``diameter`` and ``clearance`` are in mm; the clearance is the excess of the
    hole's diameter over the pin's.
    """

    name: str
    centre: Point
    diameter: float
    clearance: float = 0.0

    @property
    def hole(self) -> float:
        """The diameter of the hole in the layers for the pin, mm."""
        return self.diameter + self.clearance


@dataclass(frozen=True, repr=False)
class Laminate:
    """A stack of layers, bottom to top, with its chambers, inlets and pins.

    ``outline`` is the union of the films of all balloons, without inlet tabs and ears; empty if
    only the layers are known. ``pins_in_full_bonds``: the pins in the ears stay in place while TPE
    melts. ``middle_first``: all layers between base and cap are tacked on the pins before any other
    bond. ``tube`` is the outer diameter in mm of the tube that its sheet wraps, if any; ``lumen``
    the diameter of the channel through all layers, mm. ``seams`` are bonds of a moving tool,
    ``folds`` join halves of one film, and ``nets`` lists the ``ports`` that are meant to be
    connected. ``bonds`` lists the faces that bond, with the process; without entries, all
    structural faces bond in the press except those bonded by seams.
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
    middle_first: bool = False
    tube: float | None = None
    seams: tuple[Seam, ...] = ()
    folds: tuple[Fold, ...] = ()
    ports: tuple[Port, ...] = ()
    nets: tuple[Net, ...] = ()
    bonds: tuple[FaceBond, ...] = ()

    def __repr__(self) -> str:
        return f"Laminate({self.name!r}, {self.family!r}, {len(self.layers)} layers)"

    @cached_property
    def interfaces(self) -> tuple[Interface, ...]:
        """The interfaces between consecutive TPE layers, bottom to top."""
        regions: dict[tuple[object, ...], Regions] = {}
        interfaces: list[Interface] = []
        films = [place for place, layer in enumerate(self.layers) if not layer.is_mask]
        for low, high in pairwise(films):
            below, *masks, above = self.layers[low : high + 1]
            seams, pressed = self.seams_between(below, above), self.presses(below, above)
            key = *(layer.pattern for layer in (below, *masks, above)), pressed, seams
            if key not in regions:
                profiles = [mask.profile for mask in masks]
                regions_between = interface_regions(below.profile, above.profile, profiles)
                regions[key] = regions_between if pressed else _seamed(regions_between, seams)
            roles = [layer.role for layer in (below, *masks, above)]
            kind: InterfaceKind = "bond"
            if masks or not pressed:
                (chamber,) = chamber_gaps(roles, [(1, len(roles))] if seams else ()).values()
                kind = "chamber" if chamber else "separator"
            pair = below.index, above.index
            folds = tuple(fold for fold in self.folds if (fold.lower, fold.upper) == pair)
            joints = seams, pressed, folds
            number = len(interfaces) + 1
            interfaces.append(
                Interface(number, kind, below, above, tuple(masks), *regions[key], *joints)
            )
        return tuple(interfaces)

    def seams_between(self, below: Layer, above: Layer) -> tuple[Seam, ...]:
        """Return the seams that bond two structural layers, in order of making."""
        pair = below.index, above.index
        seams = (seam for seam in self.seams if (seam.below, seam.above) == pair)
        return tuple(sorted(seams, key=lambda seam: seam.order))

    def bond_of(self, below: Layer, above: Layer, by: str) -> FaceBond | None:
        """Return the entry of ``bonds`` for the faces of two layers and a process, if any."""
        faces = below.faces[0], above.faces[1]
        return next((b for b in self.bonds if b.by == by and b.joins(*faces)), None)

    def presses(self, below: Layer, above: Layer) -> bool:
        """Return True if the facing faces of two structural layers bond in the press.

        Without an entry in ``bonds`` all do, except faces bonded by seams.
        """
        if self.bonds:
            return self.bond_of(below, above, PRESS) is not None
        return not self.seams_between(below, above)

    @property
    def tube_holes(self) -> tuple[Port, ...]:
        """Ports that are holes of an outer film, each with a glued tube."""
        return tuple(port for port in self.ports if port.kind == "hole")

    @property
    def tube_count(self) -> int:
        """The number of tubes: one for each inlet and each hole."""
        return len(self.inlets) + len(self.tube_holes)

    def mouth_gap(self, inlet: Inlet) -> Interface | None:
        """Return the interface whose void begins at an inlet's mouth, or None."""
        (x, y), (u, v) = inlet.mouth, inlet.direction
        inside = x - IN_MOUTH * u, y - IN_MOUTH * v
        return next((gap for gap in self.interfaces if gap.unbonded.contains(inside)), None)

    @property
    def glued_films(self) -> tuple[Film, ...]:
        """The structural films with glued tubes: at mouths, and around holes."""
        outer = self.tpe_layers[0], self.tpe_layers[-1]
        layers = [
            layer
            for port in self.tube_holes
            for layer in outer
            if layer.index in (port.below, port.above)
        ]
        for inlet in self.inlets:
            gap = self.mouth_gap(inlet)
            layers += self.tpe_layers if gap is None else (gap.below, gap.above)
        return tuple(dict.fromkeys(layer.film for layer in layers))

    @cached_property
    def tpe_layers(self) -> tuple[Layer, ...]:
        """The layers that bond: all structural films, TPE or others."""
        return tuple(layer for layer in self.layers if not layer.is_mask)

    @property
    def bonded_materials(self) -> str:
        """The materials of the bonding films, as text."""
        return ", ".join(in_order(layer.film.material for layer in self.tpe_layers))

    @cached_property
    def patterns(self) -> dict[str, tuple[Layer, ...]]:
        """One layer of each distinct pattern, in stacking order."""
        groups: dict[str, list[Layer]] = {}
        for layer in self.layers:
            groups.setdefault(layer.pattern, []).append(layer)
        return {pattern: tuple(layers) for pattern, layers in groups.items()}

    @property
    def thickness(self) -> float:
        """Nominal thickness in mm: the plain sum of the films (paper Sec. 2 measures less)."""
        top = self.layers[-1]
        return top.z + top.film.thickness

    @cached_property
    def bounds(self) -> Bounds:
        """Least x, least y, largest x, largest y of all layers, mm."""
        return box_round([layers[0].profile.bounds for layers in self.patterns.values()])

    def layer(self, index: int) -> Layer:
        """Return the layer with this index, counted from 1 at the bottom. Raises DesignError."""
        if not 1 <= index <= len(self.layers):
            raise DesignError(f"there is no layer {index}; give 1 to {len(self.layers)}")
        return self.layers[index - 1]

    def as_cut(self, layer: Layer) -> Region:
        """Return the region in a layer's cut file.

        Layers of a folded film are cut as one flat part, in the file of the lowest layer. All films
        are cut upper face up, so a layer laid turned over is drawn turned over.
        """
        flat, lowest = layer.profile, layer
        if self.folds:
            root = self.cut_with(layer)
            lowest = self.layer(root)
            if any(fold.lower == root for fold in self.folds):
                flat = flat_part(root, self.folds, [layer.profile for layer in self.layers])
        return flat.mirrored() if lowest.turned else flat

    def cut_with(self, layer: Layer) -> int:
        """Return the index of the layer whose cut file holds this one: its own, unless folded."""
        return self._fold_roots.get(layer.index, layer.index)

    @cached_property
    def _fold_roots(self) -> dict[int, int]:
        return fold_roots(self.folds)

    def pins_holding(self, layer: Layer) -> tuple[Pin, ...]:
        """The pins for which the layer has a fitting hole; a wider opening does not hold it."""
        return self.pins_in(layer.profile)

    def pins_in(self, part: Region) -> tuple[Pin, ...]:
        """Return the pins for which this part of a layer has a fitting hole."""
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
        # By name: pictures stand above laminates.
        picture = str(plugins.load("sbafab.reports.layers_svg:layers_svg")(self))
        return picture.partition("?>\n")[2]


# Interfaces between consecutive TPE layers: bonded and open areas.


InterfaceKind = Literal["chamber", "separator", "bond"]
"""``bond`` means pressed without a mask: the films bond all over."""


@dataclass(frozen=True)
class Interface:
    """Two TPE layers, below and above, and the masks between them.

    contact: the overlap of both layers; bond: contact without a mask; unbonded: contact under a
    mask. ``seams`` bond only within their regions; an interface that is not ``pressed`` bonds only
    in them. At ``folds`` one film continues from below to above.
    """

    index: int
    kind: InterfaceKind
    below: Layer
    above: Layer
    masks: tuple[Layer, ...]
    mask: Region
    contact: Region
    bond: Region
    unbonded: Region
    seams: tuple[Seam, ...] = ()
    pressed: bool = True
    folds: tuple[Fold, ...] = ()

    @property
    def fold_lines(self) -> tuple[tuple[Point, Point], ...]:
        """The lines at which one film continues from below to above."""
        return tuple(fold.line for fold in self.folds)

    @cached_property
    def whole_bond(self) -> Region:
        """The bond, plus the bond of the unfolded film beyond each fold, where it has no edge."""
        beyond = [unfolded(self.bond, [line]) for line in self.fold_lines]
        return union([self.bond, *beyond]) if beyond else self.bond

    @property
    def masked(self) -> Region:
        """The contact that the press would weld without masks."""
        return (
            (self.contact & self.mask if self.seams else self.unbonded) if self.pressed else NOTHING
        )

    @property
    def gap(self) -> float:
        """The height in mm between the two layers: the mask thickness, or the laid height."""
        if not self.masks:
            return round(self.above.z - self.z, 9)
        return sum(mask.film.thickness for mask in self.masks)

    @property
    def z(self) -> float:
        """The height of the gap's lower face."""
        return self.below.z + self.below.film.thickness

    @property
    def layer_indices(self) -> tuple[int, ...]:
        return (self.below.index, *(mask.index for mask in self.masks), self.above.index)

    @cached_property
    def pattern(self) -> tuple[str, ...]:
        """A key that is equal for interfaces with equal profiles and seams."""
        return (
            self.below.pattern,
            *(mask.pattern for mask in self.masks),
            self.above.pattern,
            *(f"{seam.width} {seam.tool} {seam.path}" for seam in self.seams),
            *(() if self.pressed else ("not pressed",)),
            *(f"folded at {line}" for line in self.fold_lines),
        )


Regions = tuple[Region, Region, Region, Region]
"""Mask, contact, bond and unbonded region of an interface."""


def interface_regions(below: Region, above: Region, masks: Sequence[Region]) -> Regions:
    """Return mask, contact, bond and unbonded region of two TPE profiles with masks between."""
    mask = union(masks)
    contact = below if below.contours == above.contours else below & above
    return mask, contact, contact - mask, contact & mask


def _seamed(regions: Regions, seams: Sequence[Seam]) -> Regions:
    """The regions of an interface bonded by seams only; a seam bonds nothing through a mask."""
    mask, contact, bare, _ = regions
    bond = bare & union([seam.region for seam in seams]) if seams else NOTHING
    return mask, contact, bond, contact - bond


# Diameters and mass.


def outline_diameter(laminate: Laminate) -> float:
    """Return the diameter of the circle about the axis around all films without tabs and ears.

    The paper's 3-DoF actuator fits 15 mm (Sec. 2). It is measured on the part of each film within
    the laminate's outline.
    """
    films = {layer.pattern: layer.profile for layer in laminate.tpe_layers}
    return _round_axis(Region(film.outers) & laminate.outline for film in films.values())


def overall_diameter(laminate: Laminate) -> float:
    """The diameter of the circle about the axis around every layer, with tabs, tails and ears."""
    return _round_axis(layers[0].profile for layers in laminate.patterns.values())


def beyond_the_outline(laminate: Laminate) -> str:
    """Return the parts outside the outline that increase the overall diameter: "3 inlet tabs"."""
    count = len(laminate.inlets)
    tabs = f"{count} inlet tab{'s' if count > 1 else ''}"
    return f"{tabs} and the ears" if laminate.registration == "ears" else tabs


def film_mass(laminate: Laminate) -> float:
    """Return the mass in g of all films, including tabs and ears; without tubing, glue and fluid.

    Raises DesignError if the density of a film is unknown.
    """
    return sum(
        layer.profile.area * layer.film.thickness * density_of(layer.film) * 1e-6
        for layer in laminate.layers
    )


def _round_axis(regions: Iterable[Region]) -> float:
    return 2 * max(
        (edge.farthest_from((0.0, 0.0)) for region in regions for edge in region.edges), default=0.0
    )
