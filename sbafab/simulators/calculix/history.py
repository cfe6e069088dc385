"""What a run found: stroke, air and wall stress against pressure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from sbafab.geometry.shapes import disc
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.cavities import flat_triangles
from sbafab.meshing.conforming.model import Mesh
from sbafab.meshing.conforming.settings import Symmetry
from sbafab.meshing.conforming.symmetry import images, sector
from sbafab.simulators.calculix.frd import Frame
from sbafab.simulators.calculix.settings import DeckSettings
from sbafab.spreadsheet import csv_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

NEAR = 0.5
"""mm from an axis within which a node of the tip stands for it."""


@dataclass(frozen=True)
class State:
    """The actuator at one moment.

    ``pressures`` kPa and ``volumes`` ul of air by chamber; ``tip`` is how far the tip has moved
    from the base, in mm; ``tilt`` in degrees, None where tip or model have one axis only;
    ``stress`` is the largest von Mises stress in MPa, ``work`` what the air has done, in uJ.
    """

    time: float
    pressures: Mapping[str, float]
    tip: tuple[float, float, float]
    tilt: float | None
    volumes: Mapping[str, float]
    stress: float
    work: float

    @property
    def stroke(self) -> float:
        """Growth in height in mm."""
        return self.tip[2]

    def as_dict(self) -> dict[str, object]:
        """For a JSON file."""
        return asdict(self)


def history(
    mesh: Mesh,
    laminate: Laminate,
    symmetry: Symmetry,
    settings: DeckSettings,
    frames: Sequence[Frame],
) -> list[State]:
    """The states of a run from the unloaded one on; ``mesh`` is the one that was run."""
    tips, bases = (_poles(mesh, laminate, name) for name in ("tip", "base"))
    walls = {name: _walls(mesh, name) for name in settings.pressures}
    shares = {name: _share(laminate, name, symmetry) for name in settings.pressures}
    stand = images(laminate, symmetry)
    start = np.zeros_like(mesh.points)
    unloaded = Frame(0.0, start, np.zeros((len(start), 6)))
    states: list[State] = []
    for frame in (unloaded, *frames):
        points = mesh.points + frame.displacement
        moved = frame.displacement[tips].mean(axis=0) - frame.displacement[bases].mean(axis=0)
        part = settings.share(frame.time)
        pressures = {name: part * value for name, value in settings.pressures.items()}
        meshed = {name: _volume(points, walls[name]) / shares[name] for name in set(stand.values())}
        volumes = {name: meshed[stand[name]] for name in walls}
        work = states[-1].work + _work(states[-1], pressures, volumes) if states else 0.0
        states.append(
            State(
                frame.time,
                pressures,
                (float(moved[0]), float(moved[1]), float(moved[2])),
                _tilt(mesh.points[tips], points[tips]),
                volumes,
                float(frame.von_mises.max()),
                work,
            )
        )
    return states


def _work(before: State, pressures: Mapping[str, float], volumes: Mapping[str, float]) -> float:
    """What the air has done since a state, in uJ (kPa x ul)."""
    return sum(
        (before.pressures[name] + pressures[name]) / 2 * (volumes[name] - before.volumes[name])
        for name in volumes
    )


def _poles(mesh: Mesh, laminate: Laminate, name: str) -> NDArray[np.int64]:
    """The node of a set nearest to each stack's axis, if that lies in the mesh."""
    nodes = mesh.node_sets[name]
    found = []
    for chamber in laminate.chambers:
        for x, y in chamber.centres:
            apart = np.hypot(mesh.points[nodes, 0] - x, mesh.points[nodes, 1] - y)
            if apart.min() <= NEAR:
                found.append(nodes[apart.argmin()])
    return np.array(found) if found else nodes


def _tilt(before: NDArray[np.float64], after: NDArray[np.float64]) -> float | None:
    """Angle in degrees between the planes of three or more poles, before and after."""
    if len(before) < 3:
        return None
    normals = [np.linalg.svd(points - points.mean(axis=0))[2][2] for points in (before, after)]
    return math.degrees(math.acos(min(1.0, abs(float(normals[0] @ normals[1])))))


def _walls(mesh: Mesh, chamber: str) -> NDArray[np.int64]:
    """Triangles (k, 3) round the air, counter-clockwise seen from outside of it."""
    if chamber in mesh.cavities:
        return mesh.cavities[chamber]
    faces = mesh.face_sets.get(f"cavity_{chamber}", np.empty((0, 2), dtype=np.int64))
    return flat_triangles(mesh.kind, mesh.cells, faces)[:, ::-1]


def _volume(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> float:
    """What triangles enclose, in mm3; sides that are open must be upright (symmetry planes)."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)[:, 2]
    return float(np.sum(across * (a + b + c)[:, 2]) / 6)


def _share(laminate: Laminate, chamber: str, symmetry: Symmetry) -> float:
    """The part of a chamber that is meshed; 1 where none of it is."""
    part = sector(laminate, symmetry)
    if part is None:
        return 1.0
    (centres,) = (c.centres for c in laminate.chambers if c.name == chamber)
    discs = [disc(centre, NEAR) for centre in centres]
    meshed = sum((one & part.region).area for one in discs)
    return meshed / sum(one.area for one in discs) or 1.0


def history_csv(states: Sequence[State]) -> str:
    """The states as text, a row each; units stand in the heads."""
    first = states[0]
    head = ["time_s", *(f"pressure_{name}_kPa" for name in first.pressures)]
    head += ["stroke_mm", "tip_x_mm", "tip_y_mm"]
    head += ["tilt_deg"] if first.tilt is not None else []
    head += [*(f"volume_{name}_ul" for name in first.volumes), "von_mises_max_MPa", "work_uJ"]
    rows: list[Sequence[str]] = [head]
    for state in states:
        values = [state.time, *state.pressures.values(), state.stroke, *state.tip[:2]]
        values += [state.tilt] if state.tilt is not None else []
        values += [*state.volumes.values(), state.stress, state.work]
        # Adding 0.0 turns a rounded -0.0 into 0.0.
        rows.append([f"{round(value, 6) + 0.0:.6g}" for value in values])
    return csv_text(rows)
