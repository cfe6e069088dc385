"""Construction of assemblies: rigid poses, the tree of parts, their designs and places."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sbafab.actuators import build, records
from sbafab.assemblies.records import AnyPart, Assembly, Line, Sba, Seat, Tube, girth_and_height
from sbafab.design.files import (
    ASSEMBLY,
    add_waivers,
    design_path,
    hint,
    kit_names,
    listed,
    override,
    read_toml,
    rule_names,
    shown,
)
from sbafab.design.identity import design_sha256
from sbafab.design.records import Design, validated
from sbafab.errors import DesignError, GeometryError
from sbafab.geometry.edges import unit
from sbafab.laminate.laminate import Inlet, Laminate
from sbafab.meshing.solid import bent_point
from sbafab.meshing.surface import Vector

Rows = tuple[Vector, Vector, Vector]


class PartPose(NamedTuple):
    """A rigid pose: a point p of a part's frame maps to ``rows p + shift``."""

    rows: Rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    shift: Vector = (0.0, 0.0, 0.0)

    def at(self, p: Vector) -> Vector:
        return _vector(self.points(np.array([p]))[0])

    def then(self, inner: PartPose) -> PartPose:
        """Return the pose of a part whose pose in this frame is ``inner``."""
        return PartPose(_rows(np.array(self.rows) @ np.array(inner.rows)), self.at(inner.shift))

    def points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points (n, 3) in this pose."""
        moved: NDArray[np.float64] = points @ np.array(self.rows).T + np.array(self.shift)
        return moved


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def _rows(matrix: NDArray[np.float64]) -> Rows:
    a, b, c = map(_vector, matrix)
    return a, b, c


def shifted(x: float, y: float, z: float) -> PartPose:
    return PartPose(shift=(x, y, z))


def about_axis(degrees: float) -> PartPose:
    """Return a rotation about z; quarter turns are exact."""
    c, s = unit(degrees)
    return PartPose(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


FLIPPED = PartPose(((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)))
"""Upside down: half a turn about y."""
LYING = PartPose(((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)))
"""The axis along x, what pointed along x downward."""
OUTWARD = PartPose(((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
"""The axis along x, the part's x along y, its y along z: lying on a cylinder's side."""


def along(direction: Vector, at: Vector) -> PartPose:
    """Return a pose with its axis along a unit vector, at a point."""
    z = np.array(direction)
    x = np.cross(np.eye(3)[np.abs(z).argmin()], z)
    x /= np.linalg.norm(x)
    return PartPose(_rows(np.column_stack([x, np.cross(z, x), z])), at)


# The tree of parts: the order to build in, and allowed joints.


PLACES: Mapping[str, tuple[Seat, ...]] = {
    "sba": ("top", "bottom", "lumen", "inlet"),
    "tube": ("start", "end", "outside", "lumen"),
    "magnet": ("top", "bottom"),
    "base": ("top", "bottom"),
    "sheet": ("top", "bottom"),
    "cup": (),
    "line": (),
}
"""Places on a part of each kind where others may be fixed."""
FOR_LINES: tuple[Seat, ...] = ("lumen", "inlet")


def building_order(parts: Mapping[str, AnyPart]) -> tuple[str, ...]:
    """Return part names, the root first, each after its host; otherwise in the file's order.

    Raises DesignError unless there is exactly one root, and for a part fixed on an unknown part, in
    a cycle, or at a place that its host lacks.
    """
    roots = [name for name, part in parts.items() if part.on is None]
    for name, part in parts.items():
        if part.on is not None:
            _check_joint(name, part, parts)
        elif part.at is not None:
            raise DesignError(
                f'parts.{name}.at = "{part.at}" needs parts.{name}.on, the part that it is fixed on'
            )
    if len(roots) > 1:
        raise DesignError(
            f"{listed(roots)} have no key on; set on = NAME of the supporting part for all but "
            "one of them"
        )
    order = list(roots)
    for name in order:
        order += [hanging for hanging, part in parts.items() if part.on == name]
    if len(order) < len(parts):
        # Any part that does not hang on the root leads into a circle.
        walk = [next(name for name in parts if name not in order)]
        while (host := str(parts[walk[-1]].on)) not in walk:
            walk.append(host)
        circle = walk[walk.index(host) :]
        how = "are fixed on each other in a circle" if circle[1:] else "hangs on itself"
        raise DesignError(f"{listed(circle)} {how}; omit on and at in the root part")
    return tuple(order)


def _check_joint(name: str, part: AnyPart, parts: Mapping[str, AnyPart]) -> None:
    where = f"parts.{name}"
    host = parts.get(str(part.on))
    if host is None:
        known = hint(part.on, parts)
        raise DesignError(f"{where}.on = {shown(part.on)} is not a part of the assembly; {known}")
    allowed = places_for(part, host)
    if not allowed:
        raise DesignError(
            f'{where}.on = "{part.on}": no {part.kind} can be fixed on a {host.kind}; fix it on '
            "another part"
        )
    if part.at not in allowed:
        fault = "is missing" if part.at is None else f'= "{part.at}"'
        raise DesignError(
            f"{where}.at {fault}; a {part.kind} is fixed on a {host.kind} at one of "
            f"{listed(allowed)}"
        )


def places_for(part: AnyPart, host: AnyPart) -> tuple[Seat, ...]:
    """Return the places for a part on its host: lines run inside, all others sit outside."""
    is_line = isinstance(part, Line)
    return tuple(place for place in PLACES[host.kind] if (place in FOR_LINES) == is_line)


# Parts with their designs, laminates and places.


RESERVED = frozenset(
    {
        *("sheets", "mesh", "preview"),
        *("checks.json", "design.toml", "manifest.json"),
        *("findings.html", "traveller.html"),
    }
)
"""Names in an assembly's folder beside the folders of its designs."""


@dataclass(frozen=True)
class PartDesign:
    """A design from which parts are made; ``design.order.quantity`` counts all of them."""

    design: Design
    laminate: Laminate
    parts: tuple[str, ...]


@dataclass(frozen=True)
class PlacedPart:
    """A part in its place: ``turn`` about its own axis comes first, ``pose`` last.

    Only an SBA is ``made`` from a design or bent to a ``radius`` in mm.
    """

    name: str
    part: AnyPart
    pose: PartPose
    made: PartDesign | None = None
    radius: float | None = None

    @property
    def turn(self) -> float:
        """The rotation about its own axis, degrees."""
        return self.part.turn

    @property
    def height(self) -> float:
        """The size along its own axis, mm; for an SBA, from the nominal films."""
        if self.made is not None:
            return self.made.laminate.thickness
        return girth_and_height(self.part)[1]

    def at(self, p: Vector) -> Vector:
        """Return the place in the assembly of a point (x, y, z) in mm of the part's own frame."""
        p = about_axis(self.turn).at(p)
        return self.pose.at(p if self.radius is None else bent_point(p, self.radius))

    def turned(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) in mm rotated about the part's own axis, before bending and placing."""
        return about_axis(self.turn).points(points)

    def upright(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (n, 3) in mm of the part's frame in the assembly, without bending.

        A part on a tube stands on the tangent.
        """
        turned = self.turned(points)
        if self.radius is not None:
            x, y, z = turned.T
            turned = np.column_stack([self.radius + z, x, y])
        return self.pose.points(turned)


@dataclass(frozen=True)
class PlacedSba(PlacedPart):
    """An SBA in its place."""

    made: PartDesign


@dataclass(frozen=True)
class Assembled:
    """An assembly with its parts in place, each after its host."""

    assembly: Assembly
    designs: tuple[PartDesign, ...]
    parts: tuple[PlacedPart, ...]

    def __getitem__(self, name: str) -> PlacedPart:
        return next(part for part in self.parts if part.name == name)

    def on(self, placed: PlacedPart) -> PlacedPart | None:
        """Return the host of a part; None for the root."""
        return None if placed.part.on is None else self[placed.part.on]


def assemble(assembly: Assembly) -> Assembled:
    """Every part with its laminate and its place. Raises DesignError if that is impossible."""
    order = building_order(assembly.parts)
    designs = _designs(assembly)
    design_of = {name: design for design in designs for name in design.parts}
    placed: dict[str, PlacedPart] = {}
    for name in order:
        part, part_design, radius = assembly.parts[name], design_of.get(name), None
        if part.on is None:
            _check_root(name, part_design)
            pose = LYING if assembly.pose == "lying" else PartPose()
        else:
            pose, radius = _joined(name, part, part_design, placed[part.on])
        placed[name] = (
            PlacedPart(name, part, pose)
            if part_design is None
            else PlacedSba(name, part, pose, part_design, radius)
        )
    return Assembled(assembly, designs, tuple(placed.values()))


def _designs(assembly: Assembly) -> tuple[PartDesign, ...]:
    """Return the distinct designs of the parts, in the file's order, with unique names."""
    by_hash: dict[str, tuple[Design, list[str]]] = {}
    for name, part in assembly.parts.items():
        if isinstance(part, Sba):
            design = _read_part(assembly, name, part)
            by_hash.setdefault(design_sha256(design), (design, []))[1].append(name)
    if not by_hash:
        raise DesignError(
            'an assembly needs a stacked balloon actuator; add a part of kind = "sba"'
        )
    # Some file systems ignore the case of letters.
    taken = Counter(design.name.lower() for design, _ in by_hash.values())
    taken += Counter({*RESERVED, assembly.name.lower()})
    part_designs = []
    for design, parts in by_hash.values():
        name = f"{design.name}-{parts[0]}" if taken[design.name.lower()] > 1 else design.name
        order = assembly.order.model_copy(update={"copies": len(parts) * assembly.order.copies})
        named = design.model_copy(update={"name": name, "order": order})
        try:
            part_designs.append(PartDesign(named, build(named), tuple(parts)))
        except (DesignError, GeometryError) as error:
            raise DesignError(f"parts.{parts[0]}: {error}") from None
    return tuple(part_designs)


def _read_part(assembly: Assembly, name: str, part: Sba) -> Design:
    """Return the design of an SBA part, with the part's and the assembly's keys applied.

    Raises DesignError that names the part.
    """
    try:
        path = design_path(design_source(part.design, assembly.folder))
        table = read_toml(path)
        if table.get("family") == ASSEMBLY:
            raise DesignError(
                f"design = {shown(part.design)} is an assembly; use the design of a single actuator"
            )
        data = override(table, [part.set, assembly.shared])
        data.setdefault("name", path.stem)
        _keep_files(data, part, assembly)
        waived = data["rules"].get("waive") if isinstance(data.get("rules"), dict) else None
        rules = [r for r in assembly.rules.waive if r in rule_names() and r not in (waived or ())]
        return validated(add_waivers(data, rules), records(), path.parent)
    except DesignError as error:
        raise DesignError(f"parts.{name}: {error}") from None


def design_source(design: str, folder: Path) -> str | Path:
    """Return the source of a design: a plain word is a template, a path is relative to the file."""
    return folder / design if Path(design).name != design or "." in design else design


def _keep_files(data: dict[str, Any], part: Sba, assembly: Assembly) -> None:
    """Resolve an outline and a kit's file named in the assembly's file against its folder, not the
    design's.
    """
    chamber, kit = part.set.get("chamber"), data.get("kit")
    if isinstance(chamber, dict) and isinstance(chamber.get("outline"), str):
        data["chamber"]["outline"] = str((assembly.folder / chamber["outline"]).absolute())
    is_named_here = assembly.kit is not None or "kit" in part.set
    if is_named_here and isinstance(kit, str) and kit not in kit_names():
        data["kit"] = str((assembly.folder / kit).absolute())


def _check_root(name: str, source: PartDesign | None) -> None:
    if source is not None and source.design.form.wrap is not None:
        raise DesignError(
            f'parts.{name} is a radial design; wrap it around a tube: on = a tube, at = "outside"'
        )


def _joined(
    name: str, part: AnyPart, source: PartDesign | None, host: PlacedPart
) -> tuple[PartPose, float | None]:
    """Return the pose of a part on its host, and the radius to which an SBA is bent."""
    _check_kinds(name, part, source, host)
    if isinstance(part, Line) and host.made is not None and part.at == "inlet":
        return _at_inlet(name, part, host, host.made.laminate), None
    frame = host.pose.then(about_axis(host.turn))
    if part.at != "outside":
        return frame.then(_on_axis(part, host)), None
    assert isinstance(host.part, Tube)
    radius, side = host.part.outer_diameter / 2, frame.then(about_axis(part.angle))
    if source is not None:
        return side.then(shifted(0.0, 0.0, part.along)), radius
    return side.then(shifted(radius, 0.0, part.along)).then(OUTWARD), None


def _on_axis(part: AnyPart, host: PlacedPart) -> PartPose:
    x, y = part.offset
    if part.at == "lumen":
        return shifted(0.0, 0.0, part.along)
    if part.at in ("top", "end"):
        return shifted(x, y, host.height)
    return shifted(x, y, 0.0).then(FLIPPED)


def _at_inlet(name: str, line: Line, host: PlacedPart, laminate: Laminate) -> PartPose:
    """Return the pose at the mouth of a chamber's inlet, pointing outward."""
    inlet = inlet_of(name, line, host.name, laminate)
    (x, y), (u, v) = inlet.mouth, inlet.direction
    height = laminate.layers[0].film.thickness
    start, beyond = host.at((x, y, height)), host.at((x + 1e-4 * u, y + 1e-4 * v, height))
    way = (np.array(beyond) - start) / 1e-4
    return along(_vector(way / np.linalg.norm(way)), start)


def inlet_of(name: str, line: Line, host: str, laminate: Laminate) -> Inlet:
    """Return the inlet of a line. Raises DesignError if there is none."""
    inlets: Mapping[str, Inlet] = {inlet.chamber: inlet for inlet in laminate.inlets}
    if line.chamber not in inlets:
        known = ", ".join(inlets)
        raise DesignError(
            f'parts.{name}.chamber = "{line.chamber}" has no inlet in {host}; it has {known}'
        )
    return inlets[line.chamber]


def _check_kinds(name: str, part: AnyPart, source: PartDesign | None, host: PlacedPart) -> None:
    """Refuse joints allowed for the kinds but not for a design's family. Raises DesignError."""
    if source is not None and source.design.form.wrap is not None:
        if part.at != "outside":
            _check_root(name, source)
        if part.turn % 180 != 0:
            raise DesignError(
                f"parts.{name}.turn = {part.turn:g} misaligns a radial design with its tube; it "
                "must be 0 or 180"
            )
    if host.radius is not None and part.at != "inlet":
        raise DesignError(
            f'parts.{name}.on = "{host.name}", which is bent around a tube and has no flat face; '
            "fix it on another part"
        )
    if part.at == "lumen" and host.made is not None and host.made.laminate.lumen is None:
        raise DesignError(
            f'parts.{name}.on = "{host.name}", which has no lumen; only lobed designs have one'
        )
