"""Results of CalculiX: the text ``.frd`` with fields at nodes, and ``.sta``.

The layout follows the CalculiX GraphiX manual: fixed columns, one record per line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import OutputError
from sbafab.geometry.region import disc
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.element_mesh import flat_triangles, skin
from sbafab.meshing.conforming.layup import Symmetry, images, sector
from sbafab.meshing.conforming.mesh import Mesh
from sbafab.meshing.formats import write_fields
from sbafab.meshing.surface import Surface
from sbafab.reports.canvas import AMBIENT, draw_length_bar, rasterize, view_of
from sbafab.reports.charts import ChartCurve, Panel, chart_svg
from sbafab.simulators.calculix.deck import DeckSettings
from sbafab.simulators.simulator import State
from sbafab.spreadsheet import csv_text

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL.ImageDraw import ImageDraw as Draw

COMPONENTS = {b"DISP": 3, b"STRESS": 6}
NODE, VALUE = 13, 12
"""Widths in columns of a line's key with node number, and of each value."""
BLOCK = re.compile(rb"\n  100CL.{6}(.{12})(.{12}).*\n -4  (\S+).*\n(?: -5.*\n)+")
"""Time, number of nodes and name of the block."""
SAME_TIME = 2e-5
"""Relative tolerance: times have six digits."""


@dataclass(frozen=True)
class Frame:
    """Fields at one time in s: displacement (n, 3) mm, stress (n, 6) MPa as xx yy zz xy yz zx."""

    time: float
    displacement: NDArray[np.float64]
    stress: NDArray[np.float64]

    @property
    def von_mises(self) -> NDArray[np.float64]:
        """Equivalent stress (n,) in MPa."""
        xx, yy, zz, xy, yz, zx = self.stress.T
        direct = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
        equivalent: NDArray[np.float64] = np.sqrt(direct / 2 + 3 * (xy**2 + yz**2 + zx**2))
        return equivalent


def read_frd(path: Path, nodes: int, whole: bool = True) -> list[Frame]:
    """The frames of a result file in order of time.

    ``nodes`` is the mesh's number of nodes. Without ``whole`` the file may end anywhere, as after
    a stopped run; complete frames before the end are returned. Raises OutputError if the file
    cannot be read, belongs to another mesh or, with ``whole``, is truncated.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise OutputError(f"{path.name} cannot be read: {error.strerror}; run ccx again") from None
    if whole and not content.rstrip().endswith(b"9999"):
        raise _cut_short(path)
    frames: list[Frame] = []
    at: float | None = None
    moved = None
    for time, name, values in _blocks(path, content, nodes, whole):
        if name == b"DISP":
            at, moved = time, values
        elif moved is not None and time == at:
            frames.append(Frame(time, moved, values))
    if whole and not frames:
        raise OutputError(f"{path.name} holds no displacement and stress; run ccx again")
    return frames


def _cut_short(path: Path) -> OutputError:
    return OutputError(f"{path.name} is cut short: its last block is not whole; run ccx again")


def _blocks(
    path: Path, content: bytes, nodes: int, whole: bool
) -> Iterator[tuple[float, bytes, NDArray[np.float64]]]:
    """Time, name and values (n, components) of each block of a known name."""
    for head in BLOCK.finditer(content):
        size = COMPONENTS.get(head[3])
        if size is None:
            continue
        if int(head[2]) != nodes:
            raise OutputError(
                f"{path.name} is of a mesh of {int(head[2])} nodes, not of this one of {nodes}; "
                "run ccx again"
            )
        width = NODE + VALUE * size + 1
        rows = np.frombuffer(content[head.end() : head.end() + nodes * width], dtype="S1")
        if len(rows) < nodes * width or content[head.end() + len(rows) :][:3] != b" -3":
            if whole:
                raise _cut_short(path)
            return
        cells = rows.reshape(nodes, width)[:, NODE:-1]
        texts = np.ascontiguousarray(cells).view(f"S{VALUE}")
        try:
            yield float(head[1]), head[3], texts.astype(np.float64)
        except ValueError:
            raise OutputError(
                f"{path.name} holds something that is no number at time {float(head[1]):g} s; "
                "run ccx again"
            ) from None


def read_sta(path: Path) -> list[float]:
    """Times in s at which a run has converged so far; a partly written line is ignored."""
    times = []
    lines = path.read_text(encoding="ascii", errors="replace").split("\n") if path.is_file() else []
    for line in lines[2:-1]:
        fields = line.split()
        # A U after the number of attempts marks an increment that did not converge.
        if len(fields) == 7 and fields[2].isdigit():
            times.append(float(fields[4]))
    return times


# History of a run: stroke, air and wall stress against pressure.


SAME_PLACE = 1e-6
"""mm"""
NEAR = 0.5
"""mm from an axis within which a node of the tip represents it."""


@dataclass(frozen=True)
class LoadedState(State):
    """A state with the largest von Mises ``stress`` in MPa and the ``work`` of the air in uJ."""

    stress: float
    work: float


def history(
    mesh: Mesh,
    laminate: Laminate,
    symmetry: Symmetry,
    settings: DeckSettings,
    frames: Sequence[Frame],
) -> list[LoadedState]:
    """The states of a run from the unloaded one on; ``mesh`` is the mesh of the run."""
    tips, bases = (_poles(mesh, laminate, name) for name in ("tip", "base"))
    walls = {name: _walls(mesh, name) for name in settings.pressures}
    shares = {name: _share(laminate, name, symmetry) for name in settings.pressures}
    stand = images(laminate, symmetry)
    flat = float(mesh.points[tips, 2].mean() - mesh.points[bases, 2].mean())
    start = np.zeros_like(mesh.points)
    unloaded = Frame(0.0, start, np.zeros((len(start), 6)))
    states: list[LoadedState] = []
    for frame in (unloaded, *frames):
        points = mesh.points + frame.displacement
        moved = frame.displacement[tips].mean(axis=0) - frame.displacement[bases].mean(axis=0)
        part = settings.share(frame.time)
        pressures = {name: part * value for name, value in settings.pressures.items()}
        meshed = {name: _volume(points, walls[name]) / shares[name] for name in set(stand.values())}
        volumes = {name: meshed[stand[name]] for name in walls}
        work = states[-1].work + _work(states[-1], pressures, volumes) if states else 0.0
        states.append(
            LoadedState(
                frame.time,
                pressures,
                flat + float(moved[2]),
                (float(moved[0]), float(moved[1]), float(moved[2])),
                _tilt(mesh.points[tips], points[tips]),
                volumes,
                float(frame.von_mises.max()),
                work,
            )
        )
    return states


def films_meet(mesh: Mesh, chamber: str, frame: Frame) -> bool:
    """Return True if films that face each other across a chamber have passed through each other.

    ``mesh`` keeps the gaps between films; decks have no contact. Films of open chambers that lie on
    each other from the start are ignored.
    """
    nodes = np.unique(_walls(mesh, chamber))
    x, y, z = mesh.points[nodes].T
    order = np.lexsort((z, np.round(y, 6), np.round(x, 6)))
    ranked = nodes[order]
    start = mesh.points[ranked]
    facing = (np.abs(np.diff(start[:, :2], axis=0)) < SAME_PLACE).all(axis=1)
    facing &= np.diff(start[:, 2]) > SAME_PLACE
    apart = np.diff(start[:, 2] + frame.displacement[ranked, 2])
    return bool((apart[facing] < 0).any())


def _work(
    before: LoadedState, pressures: Mapping[str, float], volumes: Mapping[str, float]
) -> float:
    """Return the work of the air since a state, in uJ (kPa x ul)."""
    return sum(
        (before.pressures[name] + pressures[name]) / 2 * (volumes[name] - before.volumes[name])
        for name in volumes
    )


def _poles(mesh: Mesh, laminate: Laminate, name: str) -> NDArray[np.int64]:
    """The node of a set nearest to each stack's axis, if the axis lies in the mesh."""
    nodes = mesh.node_sets[name]
    nearest = []
    for chamber in laminate.chambers:
        for x, y in chamber.centres:
            apart = np.hypot(mesh.points[nodes, 0] - x, mesh.points[nodes, 1] - y)
            if apart.min() <= NEAR:
                nearest.append(nodes[apart.argmin()])
    return np.array(nearest) if nearest else nodes


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
    """Return the volume within triangles in mm3; open sides must be upright (symmetry planes)."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)[:, 2]
    return float(np.sum(across * (a + b + c)[:, 2]) / 6)


def _share(laminate: Laminate, chamber: str, symmetry: Symmetry) -> float:
    """The meshed fraction of a chamber; 1 if none of it is meshed."""
    part = sector(laminate, symmetry)
    if part is None:
        return 1.0
    (centres,) = (c.centres for c in laminate.chambers if c.name == chamber)
    discs = [disc(centre, NEAR) for centre in centres]
    meshed = sum((circle & part.region).area for circle in discs)
    return meshed / sum(circle.area for circle in discs) or 1.0


def history_csv(states: Sequence[LoadedState]) -> str:
    """The states as CSV, one row each; the headers contain the units."""
    first = states[0]
    head = ["time_s", *(f"pressure_{name}_kPa" for name in first.pressures)]
    head += ["stroke_mm", "tip_x_mm", "tip_y_mm"]
    head += ["tilt_deg"] if first.tilt is not None else []
    head += [*(f"volume_{name}_ul" for name in first.volumes), "von_mises_max_MPa", "work_uJ"]
    rows: list[Sequence[str]] = [head]
    for state in states:
        values = [state.time, *state.pressures.values(), state.stroke, *(state.tip or ())[:2]]
        values += [state.tilt] if state.tilt is not None else []
        values += [*state.volumes.values(), state.stress, state.work]
        # Adding 0.0 turns a rounded -0.0 into 0.0.
        rows.append([f"{round(value, 6) + 0.0:.6g}" for value in values])
    return csv_text(rows)


# The deformed mesh for ParaView, with the results at its nodes.


def write_deformed(mesh: Mesh, frame: Frame, path: Path) -> None:
    """Write the deformed shape: ``displacement`` in mm, ``stress`` and ``von_mises`` in MPa.

    To see the undeformed one, warp by the displacement with a factor of -1.
    """
    # VTK orders a symmetric tensor like CalculiX.
    fields = {
        "displacement": frame.displacement,
        "von_mises": frame.von_mises,
        "stress": frame.stress,
    }
    write_fields(path, mesh.kind, mesh.points + frame.displacement, mesh.cells, fields, {})


# A picture of the deformed actuator, coloured by its stress (Pillow).


SIZE = 1100, 900
MARGIN, FOOT = 60, 110
ENLARGED = 2
INK = (34, 34, 34)
SCALE = np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)])
"""Viridis: even steps of lightness, readable by colour-blind people and in grey."""
LAMP = (-0.35, 0.55, 0.76)
"""Direction to the light, in the view."""
DARKEST = 0.22
ELEVATION, AZIMUTH = 28.0, -35.0
"""View direction: degrees above the bench, and round it from x."""


def deformed_png(mesh: Mesh, frame: Frame, caption: str) -> bytes:
    """The deformed surface in oblique parallel view with a scale of von Mises stress."""
    from PIL import Image, ImageDraw

    triangles = flat_triangles(mesh.kind, mesh.cells, skin(mesh))
    surface = Surface(mesh.points + frame.displacement, triangles)
    width, height = (side * ENLARGED for side in SIZE)
    edge, foot = MARGIN * ENLARGED, FOOT * ENLARGED
    view = view_of([surface], ELEVATION, AZIMUTH, (edge, edge, width - edge, height - edge - foot))
    buffer = rasterize([surface], view, width, height, LAMP)
    stress = frame.von_mises
    most = float(stress.max()) or 1.0
    colours = _coloured(stress[surface.faces].mean(axis=1) / most)
    # Darken steep faces slightly: this shows wrinkles and keeps the colour readable.
    shade = 1 - DARKEST * (1 - buffer.light) / (1 - AMBIENT)
    rgb = np.where((buffer.body < 0)[..., None], 255, colours[buffer.face] * shade[..., None])
    picture = Image.fromarray(rgb.round().astype(np.uint8), "RGB").reduce(ENLARGED)
    _write_key(ImageDraw.Draw(picture), caption, most, view.scale / ENLARGED)
    out = BytesIO()
    picture.save(out, "PNG", compress_level=6)
    return out.getvalue()


def _coloured(share: NDArray[np.float64]) -> NDArray[np.float64]:
    """The scale's red, green and blue (n, 3) for shares of the largest stress."""
    steps = np.linspace(0, 1, len(SCALE))
    return np.column_stack([np.interp(share, steps, channel) for channel in SCALE.T])


def _write_key(draw: Draw, caption: str, most: float, pixels_per_mm: float) -> None:
    from PIL import ImageFont

    font = ImageFont.load_default(20)
    width, height = SIZE
    draw_length_bar(draw, width - MARGIN, height - 40, width / 4, pixels_per_mm, font)
    draw.text((MARGIN, height - 100), caption, fill=INK, font=font)
    start, end, top = MARGIN, MARGIN + 400, height - 64
    for x, colour in enumerate(_coloured(np.linspace(0, 1, end - start)).round().astype(int)):
        draw.line((start + x, top, start + x, top + 18), fill=tuple(colour.tolist()))
    for part in (0.0, 0.5, 1.0):
        at = start + part * (end - start)
        draw.text((at, top + 24), f"{part * most:.3g}", fill=INK, font=font, anchor="ma")
    draw.text((end + 20, top - 3), "von Mises stress, MPa", fill=INK, font=font)


# Stroke, air and wall stress against pressure as one SVG, for screen and print.


def history_svg(title: str, states: Sequence[LoadedState]) -> str:
    """Three panels side by side; x is the chamber pressure farthest from 0."""
    last = states[-1]
    fullest = max(last.pressures, key=lambda name: abs(last.pressures[name]))
    x = [state.pressures[fullest] for state in states]
    is_even = len(set(last.pressures.values())) == 1
    x_label = "pressure, kPa" if is_even else f"pressure in {fullest}, kPa"
    several = len(last.volumes) > 1

    def curve(label: str, values: Sequence[float]) -> ChartCurve:
        return ChartCurve(label, x, values, dotted=True)

    volumes = [
        curve(name if several else "", [state.volumes[name] for state in states])
        for name in last.volumes
    ]
    stroke = [curve("", [state.stroke for state in states])]
    stress = [curve("", [state.stress for state in states])]
    return chart_svg(
        title,
        [
            Panel("stroke of the tip", x_label, "stroke, mm", stroke),
            Panel("air in the chambers", x_label, "volume, ul", volumes),
            Panel("largest von Mises stress", x_label, "stress, MPa", stress),
        ],
    )
