"""Settings of a CalculiX run, its film, and the input deck.

Units are mm, N, MPa, t and s; pressures are given in kPa.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from sbafab.laminate.films import PAPER_TPE, density_of, in_order
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.mesh import Mesh
from sbafab.meshing.formats import write_inp
from sbafab.meshing.surface import Floats
from sbafab.simulators.shell_model import elastic_of
from sbafab.simulators.simulator import (
    LARGEST_VACUUM,
    SimulationRequest,
    chamber_pressures,
    rendered,
    write_files,
)

Procedure = Literal["dynamic", "static"]

PAPER_PRESSURE = 6.0
"""kPa to which the paper's model of one balloon is inflated (Fig. 7c)."""


class Elastic(NamedTuple):
    """A film: Young's modulus in MPa, Poisson's ratio, density in t/mm3."""

    modulus: float
    poisson: float
    density: float


TPE = Elastic(*PAPER_TPE, 1.122e-9)
"""The paper's film."""


@dataclass(frozen=True)
class DeckSettings:
    """Load and procedure.

    ``pressures`` in kPa by chamber are reached after ``ramp`` seconds, with ``outputs`` results on
    the way. They rise with the square of time, because a flat film yields quickly at first and then
    less and less. Films start ``imperfection`` mm off flat, since Newton's iteration cannot pass
    wrinkling as a bifurcation. "static" omits the inertia that carries a film from one wrinkle
    pattern to the next, and usually stops there. ``films`` are given by material.
    """

    pressures: Mapping[str, float]
    procedure: Procedure = "dynamic"
    ramp: float = 1.0
    outputs: int = 24
    imperfection: float = 0.010
    films: Mapping[str, Elastic] = field(default_factory=lambda: {"TPE": TPE})
    is_free: bool = False
    is_glued: bool = False

    def times(self) -> list[float]:
        """Start and output times, in s."""
        return [self.ramp * n / self.outputs for n in range(self.outputs + 1)]

    def share(self, time: float) -> float:
        """The fraction of the pressures applied at a time; linear between outputs."""
        at = min(max(time / self.ramp, 0.0), 1.0) * self.outputs
        n = min(int(at), self.outputs - 1)
        return (n**2 + (at - n) * (2 * n + 1)) / self.outputs**2

    @property
    def largest(self) -> float:
        """The pressure in kPa that is farthest from 0."""
        return max(self.pressures.values(), key=abs)

    @property
    def has_vacuum(self) -> bool:
        return min(self.pressures.values()) < 0


def deck_settings(
    laminate: Laminate, request: SimulationRequest | None = None, procedure: Procedure = "dynamic"
) -> DeckSettings:
    """Settings for a laminate; pressures as in ``chamber_pressures``, the paper's by default."""
    names = [chamber.name for chamber in laminate.chambers]
    pressures = chamber_pressures(
        names, request or SimulationRequest(), PAPER_PRESSURE, least=-LARGEST_VACUUM
    )
    films = {"TPE": TPE}
    for film in (layer.film for layer in laminate.tpe_layers):
        density = 1e-12 * density_of(film, "CalculiX")
        films[film.material] = Elastic(*elastic_of(film, "CalculiX"), density)
    is_stack = any(interface.kind == "separator" for interface in laminate.interfaces)
    # A balloon's outline excludes its tabs, and the paper's model has no tube.
    is_glued = not is_stack and laminate.outline.is_empty
    return DeckSettings(pressures, procedure, films=films, is_free=not is_stack, is_glued=is_glued)


# A start slightly off flat, which decides the direction of wrinkles.


WAVES = tuple((0.2 + 0.52 * n, (1.0, 1.7, 2.9)[n % 3], 2.4 * n**2) for n in range(12))
"""Direction, wavelength in mm, and phase of the waves that add up to it: lengths that a mesh of
0.35 mm resolves and films of 0.038 mm wrinkle at, in directions off a round pocket's symmetries."""


def uneven(points: Floats, height: float) -> Floats:
    """Points (n, 3) of a stack laid on a wavy plate, up to ``height`` mm up or down.

    Films and bonds above each other move together: their thicknesses and gaps do not change.
    """
    x, y = points[:, 0], points[:, 1]
    waves = np.zeros(len(points))
    for direction, length, phase in WAVES:
        along = x * np.cos(direction) + y * np.sin(direction)
        waves += np.cos(2 * np.pi * along / length + phase)
    moved = points.copy()
    # The sum rarely approaches the sum of all crests: half of that counts as its height.
    moved[:, 2] += height * np.clip(2 * waves / len(WAVES), -1.0, 1.0)
    return moved


# Supports: the base, or a lone balloon's ring, and planes of symmetry.


BASE = "base"
RING = "bond_001"
INLET = "inlet_"
FLAT = 1e-6


def supports(mesh: Mesh, settings: DeckSettings) -> Iterator[str]:
    """The node set ``held``, and lines of ``*BOUNDARY`` and ``*EQUATION``.

    A stack stands on its base. A lone balloon bulges both ways, and its ring may ripple, as in the
    paper's model: only the ring of its two films can hold it, of which a few nodes prevent
    rigid-body motion. The same applies if the deck ``is_free``. If it ``is_glued``, inlets are shut
    by their tubes.
    """
    is_lone = sum(name.startswith("film_") for name in mesh.cell_sets) == 2
    is_free = settings.is_free or is_lone
    if is_free:
        fixed = list(_fixed_freedoms(mesh))
        nodes = sorted({node for node, _ in fixed})
        yield "*NSET, NSET=held\n" + "".join(f"{node}\n" for node in nodes)
        yield "*BOUNDARY\n" + "".join(f"{node}, {axis}\n" for node, axis in fixed)
    else:
        yield f"*NSET, NSET=held\n{BASE}\n*BOUNDARY\n{BASE}, 1, 3\n"
    for name in _planes(mesh):
        yield from _on_plane(mesh, name, is_free)
    if settings.is_glued:
        yield from _glued_lips(mesh)


def _glued_lips(mesh: Mesh) -> Iterator[str]:
    """Tie both lips of a mouth together, as a tube is glued in between them.

    This closes the chamber: otherwise the air in an opening mouth would push the films off.
    """
    bonds = [nodes for name, nodes in mesh.node_sets.items() if name.startswith("bond_")]
    on_planes = {int(node) for name in _planes(mesh) for node in mesh.node_sets[name]}
    for name, mouth in mesh.node_sets.items():
        if not name.startswith(INLET):
            continue
        # A mouth's ends are already bonded; with gaps kept, they have a node between them.
        lips: dict[tuple[float, float], list[int]] = {}
        for node in np.setdiff1d(mouth, np.concatenate(bonds)).tolist():
            x, y = np.round(mesh.points[node, :2], 6).tolist()
            lips.setdefault((x, y), []).append(node)
        for column in lips.values():
            column.sort(key=lambda node: (mesh.points[node, 2], node))
            for lower, upper in zip(column[::2], column[1::2], strict=False):
                # A plane of symmetry holds its nodes in its normal direction.
                for axis in (3,) if lower in on_planes else (1, 2, 3):
                    yield f"*EQUATION\n2\n{upper + 1}, {axis}, 1, {lower + 1}, {axis}, -1\n"


def _planes(mesh: Mesh) -> list[str]:
    return [name for name in mesh.node_sets if name.startswith("symmetry_")]


def _fixed_freedoms(mesh: Mesh) -> Iterator[tuple[int, int]]:
    """Nodes, from 1, and axes that fix the rigid-body motions left by the symmetry planes."""
    ring = mesh.node_sets[RING]
    x, y = mesh.points[ring, 0], mesh.points[ring, 1]
    far = float(np.abs(y).max())
    corners = [
        int(ring[np.hypot(x - px, y - py).argmin()]) + 1
        for px, py in ((-far, 0.0), (0.0, far), (0.0, -far))
    ]
    planes = _planes(mesh)
    for node in corners[: 3 - len(planes)]:
        yield node, 3
    in_plane = list(zip(corners, (2, 1, 1), strict=True))
    if planes == ["symmetry_y"]:
        in_plane = in_plane[1:2]
    elif planes:
        in_plane = in_plane[: 2 - len(planes)]
    yield from in_plane


def _on_plane(mesh: Mesh, name: str, is_free: bool) -> Iterator[str]:
    """The nodes of one symmetry plane stay on it."""
    nodes = mesh.node_sets[name]
    places = mesh.points[nodes, :2]
    # The unit normal of the upright plane through the axis and these points.
    x, y = places[np.hypot(*places.T).argmax()]
    normal = np.array([-y, x]) / np.hypot(x, y)
    if min(abs(normal)) < FLAT:
        yield f"*BOUNDARY\n{name}, {1 if abs(normal[0]) > FLAT else 2}\n"
        return
    fixed = np.empty(0, dtype=np.int64) if is_free else mesh.node_sets[BASE]
    on_axis = nodes[np.hypot(*places.T) < FLAT]
    for node in np.setdiff1d(on_axis, fixed):
        yield f"*BOUNDARY\n{node + 1}, 1, 2\n"
    # The first term is eliminated, so it needs the larger factor.
    first, second = (1, 2) if abs(normal[0]) >= abs(normal[1]) else (2, 1)
    for node in np.setdiff1d(nodes, np.concatenate([fixed, on_axis])):
        yield (
            f"*EQUATION\n2\n{node + 1}, {first}, {normal[first - 1]:.12g}, "
            f"{node + 1}, {second}, {normal[second - 1]:.12g}\n"
        )


# The input of CalculiX for an actuator, ``actuator.inp``, its mesh, and the same for Abaqus.
#
# Both read the same keywords, except for output requests.


TEMPLATE = Path(__file__).parent / "templates" / "deck.inp.j2"
JOB = "actuator"
MESH_FILE = "mesh.inp"
ABAQUS_FILE = "abaqus.inp"


def write_deck(mesh: Mesh, settings: DeckSettings, folder: Path) -> list[Path]:
    """Write ``actuator.inp``, ``abaqus.inp`` and the ``mesh.inp`` they include into ``folder``.

    ``mesh`` is a flat volume mesh. Return the files; run them with ``ccx -i actuator`` or
    ``abaqus job=abaqus``. The latter follows Abaqus's manual and has never been run.
    """
    folder.mkdir(parents=True, exist_ok=True)
    run_mesh = started(mesh, settings)
    write_inp(run_mesh, folder / MESH_FILE)
    values = {
        "settings": settings,
        "mesh_file": MESH_FILE,
        "faces": list(_cavity_faces(run_mesh)),
        "films": list(_films(run_mesh, settings)),
        "supports": "".join(supports(run_mesh, settings)),
    }
    programs = {f"{JOB}.inp": "ccx", ABAQUS_FILE: "abaqus"}
    texts = {name: rendered(TEMPLATE, program=of, **values) for name, of in programs.items()}
    return [*write_files(texts, folder), folder / MESH_FILE]


def started(mesh: Mesh, settings: DeckSettings) -> Mesh:
    """The mesh to run: the flat one with its imperfection."""
    return replace(mesh, points=uneven(mesh.points, settings.imperfection))


def _films(mesh: Mesh, settings: DeckSettings) -> Iterator[tuple[str, Elastic, list[str]]]:
    """The name of each film, its material, and the parts of the mesh that are of it."""
    for name in in_order(mesh.materials.values()):
        parts = [part for part, of in mesh.materials.items() if of == name]
        yield name, settings.films[name], parts


def _cavity_faces(mesh: Mesh) -> Iterator[tuple[str, int, list[int]]]:
    """Chamber, number of an element's face, and the elements with air on it, all from 1."""
    for name, faces in mesh.face_sets.items():
        for number in np.unique(faces[:, 1]).tolist():
            cells = faces[faces[:, 1] == number, 0] + 1
            yield name.removeprefix("cavity_"), number + 1, cells.tolist()
