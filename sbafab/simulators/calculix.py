"""CalculiX: settings of a run, its film and deck; the run, its results in one folder, and the
interface of a simulator.

Units are mm, N, MPa, t and s; pressures are given in kPa. The layout of the result file follows the
CalculiX GraphiX manual: fixed columns, one record a line.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, NamedTuple, cast

import numpy as np

from sbafab.errors import DesignError, OutputError, VoidError
from sbafab.laminate.films import PAPER_TPE, density_of, in_order
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.layup import (
    MeshSettings,
    Symmetry,
    images,
    layup,
    meshed_shares,
    sector,
)
from sbafab.meshing.conforming.mesh import Mesh
from sbafab.meshing.conforming.meshes import volume_mesh
from sbafab.meshing.formats import write_fields, write_inp
from sbafab.meshing.surface import Floats, Ints
from sbafab.runtime import Progress
from sbafab.simulators.shell_model import elastic_of
from sbafab.simulators.simulator import (
    LARGEST_VACUUM,
    Result,
    SimulationRequest,
    State,
    Stop,
    chamber_pressures,
    impossible,
    pass_on_interrupt,
    program_path,
    rendered,
    run_program,
    tilt_of,
    write_files,
)
from sbafab.spreadsheet import csv_text

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

    ``pressures`` in kPa by chamber are reached after ``ramp`` seconds, with ``outputs``
    intermediate results. They rise with the square of time, because a flat film is compliant at
    first and stiffens. Films start ``imperfection`` mm off flat, since Newton's iteration cannot
    pass the bifurcation of wrinkling. "static" omits the inertia that carries a film from one
    wrinkle pattern to the next, and usually stops there. ``films`` are given by material.
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
        """The pressure in kPa with the largest magnitude."""
        return max(self.pressures.values(), key=abs)

    @property
    def has_vacuum(self) -> bool:
        return min(self.pressures.values()) < 0


def deck_settings(
    laminate: Laminate, request: SimulationRequest | None = None, procedure: Procedure = "dynamic"
) -> DeckSettings:
    """Settings for a laminate; pressures as in ``chamber_pressures``, by default the paper's."""
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
    """Return points (n, 3) of a stack laid on a wavy plate, up to ``height`` mm up or down.

    Films and bonds above each other move together, so their thicknesses and gaps do not change.
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
    """Return the node set ``held``, and lines of ``*BOUNDARY`` and ``*EQUATION``.

    A stack stands on its base. A lone balloon bulges both ways, and its ring may ripple, as in the
    paper's model: only the ring of its two films can hold it, of which a few nodes prevent
    rigid-body motion. The same applies if the deck ``is_free``. If it ``is_glued``, inlets are
    closed by their tubes.
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
    """Tie both lips of a mouth together, as for a tube glued between them.

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
    """Keep the nodes of one symmetry plane on it."""
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


JOB = "actuator"
MESH_FILE = "mesh.inp"
ABAQUS_FILE = "abaqus.inp"


def write_deck(mesh: Mesh, settings: DeckSettings, folder: Path) -> list[Path]:
    """Write ``actuator.inp``, ``abaqus.inp`` and the ``mesh.inp`` they include into ``folder``.

    ``mesh`` is a flat volume mesh. Return the files; run them with ``ccx -i actuator`` or ``abaqus
    job=abaqus``. The latter follows Abaqus's manual and is untested.
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
    texts = {name: rendered("deck.inp.j2", program=of, **values) for name, of in programs.items()}
    return [*write_files(texts, folder), folder / MESH_FILE]


def started(mesh: Mesh, settings: DeckSettings) -> Mesh:
    """Return the mesh to run: the flat mesh with its imperfection."""
    return replace(mesh, points=uneven(mesh.points, settings.imperfection))


def _films(mesh: Mesh, settings: DeckSettings) -> Iterator[tuple[str, Elastic, list[str]]]:
    """Return the name of each film, its material, and its parts of the mesh."""
    for name in in_order(mesh.materials.values()):
        parts = [part for part, of in mesh.materials.items() if of == name]
        yield name, settings.films[name], parts


def _cavity_faces(mesh: Mesh) -> Iterator[tuple[str, int, list[int]]]:
    """Yield chamber, number of an element's face, and the elements with air on it, all from 1."""
    for name, faces in mesh.face_sets.items():
        for number in np.unique(faces[:, 1]).tolist():
            cells = faces[faces[:, 1] == number, 0] + 1
            yield name.removeprefix("cavity_"), number + 1, cells.tolist()


# The result file of ccx.


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
    displacement: Floats
    stress: Floats

    @property
    def von_mises(self) -> Floats:
        """The von Mises stress (n,) in MPa."""
        xx, yy, zz, xy, yz, zx = self.stress.T
        direct = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
        equivalent: Floats = np.sqrt(direct / 2 + 3 * (xy**2 + yz**2 + zx**2))
        return equivalent


def read_frd(path: Path, nodes: int, whole: bool = True) -> list[Frame]:
    """Return the frames of a result file in order of time.

    ``nodes`` is the mesh's number of nodes. Without ``whole`` the file may end anywhere, as after a
    stopped run; complete frames before the end are returned. Raises OutputError if the file cannot
    be read, belongs to another mesh or, with ``whole``, is truncated.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise _unread(path, f"cannot be read: {error.strerror}") from None
    if whole and not content.rstrip().endswith(b"9999"):
        raise _unread(path, CUT_SHORT)
    frames: list[Frame] = []
    at: float | None = None
    moved = None
    for time, name, values in _blocks(path, content, nodes, whole):
        if name == b"DISP":
            at, moved = time, values
        elif moved is not None and time == at:
            frames.append(Frame(time, moved, values))
    if whole and not frames:
        raise _unread(path, "holds no displacement and stress")
    return frames


CUT_SHORT = "is cut short: its last block is not whole"


def _unread(path: Path, fault: str) -> OutputError:
    return OutputError(f"{path.name} {fault}; run ccx again")


def _blocks(
    path: Path, content: bytes, nodes: int, whole: bool
) -> Iterator[tuple[float, bytes, Floats]]:
    """Yield time, name and values (n, components) of each block of a known name."""
    for head in BLOCK.finditer(content):
        size = COMPONENTS.get(head[3])
        if size is None:
            continue
        if int(head[2]) != nodes:
            raise _unread(path, f"is of a mesh of {int(head[2])} nodes, not of this one of {nodes}")
        width = NODE + VALUE * size + 1
        rows = np.frombuffer(content[head.end() : head.end() + nodes * width], dtype="S1")
        if len(rows) < nodes * width or content[head.end() + len(rows) :][:3] != b" -3":
            if whole:
                raise _unread(path, CUT_SHORT)
            return
        cells = rows.reshape(nodes, width)[:, NODE:-1]
        try:
            values = np.ascontiguousarray(cells).view(f"S{VALUE}").astype(np.float64)
        except ValueError:
            fault = f"holds something that is not a number at time {float(head[1]):g} s"
            raise _unread(path, fault) from None
        yield float(head[1]), head[3], values


def read_sta(path: Path) -> float:
    """Return the time in s that a run has reached; a partly written line is ignored."""
    reached = 0.0
    lines = path.read_text(encoding="ascii", errors="replace").split("\n") if path.is_file() else []
    for line in lines[2:-1]:
        fields = line.split()
        # A U after the number of attempts marks an increment that did not converge.
        if len(fields) == 7 and fields[2].isdigit():
            reached = max(reached, float(fields[4]))
    return reached


# History of a run: stroke, air and wall stress against pressure.


SAME_PLACE = 1e-6
"""mm"""
NEAR = 0.5
"""mm from an axis within which a node of the tip represents it."""


def history(
    mesh: Mesh,
    laminate: Laminate,
    symmetry: Symmetry,
    settings: DeckSettings,
    frames: Sequence[Frame],
) -> list[State]:
    """Return the states of a run from the unloaded one; ``mesh`` is the mesh of the run."""
    tips, bases = (_poles(mesh, laminate, name) for name in ("tip", "base"))
    walls = {name: _walls(mesh, name) for name in settings.pressures}
    shares = meshed_shares(laminate, sector(laminate, symmetry))
    stand = images(laminate, symmetry)
    flat = float(mesh.points[tips, 2].mean() - mesh.points[bases, 2].mean())
    start = np.zeros_like(mesh.points)
    states: list[State] = []
    for frame in (Frame(0.0, start, np.zeros((len(start), 6))), *frames):
        points = mesh.points + frame.displacement
        moved = frame.displacement[tips].mean(axis=0) - frame.displacement[bases].mean(axis=0)
        x, y, z = moved.tolist()
        part = settings.share(frame.time)
        pressures = {name: part * value for name, value in settings.pressures.items()}
        meshed = {name: _volume(points, walls[name]) / shares[name] for name in set(stand.values())}
        volumes = {name: meshed[stand[name]] for name in walls}
        work = 0.0
        if states:
            # The work of the air since the state before, in uJ (kPa x ul).
            before = states[-1]
            work = before.work + sum(
                (before.pressures[name] + pressures[name]) / 2 * (ul - before.volumes[name])
                for name, ul in volumes.items()
            )
        states.append(
            State(
                time=frame.time,
                pressures=pressures,
                height=flat + z,
                tip=(x, y, z),
                tilt=tilt_of(mesh.points[tips], points[tips]),
                volumes=volumes,
                stress=float(frame.von_mises.max()),
                work=work,
            )
        )
    return states


def films_meet(mesh: Mesh, chamber: str, frame: Frame) -> bool:
    """Return True if films that face each other across a chamber have passed through each other.

    ``mesh`` keeps the gaps between films; decks have no contact. Films of open chambers that touch
    from the start are ignored.
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


def _poles(mesh: Mesh, laminate: Laminate, name: str) -> Ints:
    """Return the node of a set nearest to each stack's axis, if the axis lies in the mesh."""
    nodes = mesh.node_sets[name]
    nearest = []
    for chamber in laminate.chambers:
        for x, y in chamber.centres:
            apart = np.hypot(mesh.points[nodes, 0] - x, mesh.points[nodes, 1] - y)
            if apart.min() <= NEAR:
                nearest.append(nodes[apart.argmin()])
    return np.array(nearest) if nearest else nodes


def _walls(mesh: Mesh, chamber: str) -> Ints:
    """Return triangles (k, 3) around the air, counter-clockwise seen from outside."""
    if chamber in mesh.cavities:
        return mesh.cavities[chamber]
    faces = mesh.face_sets.get(f"cavity_{chamber}", np.empty((0, 2), dtype=np.int64))
    return mesh.flat_triangles(faces)[:, ::-1]


def _volume(points: Floats, triangles: Ints) -> float:
    """Return the volume within triangles in mm3; open sides must be vertical (symmetry planes)."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)[:, 2]
    return float(np.sum(across * (a + b + c)[:, 2]) / 6)


def history_csv(states: Sequence[State]) -> str:
    """Return the states as CSV, one row each; the headers contain the units."""
    rows: list[dict[str, float]] = []
    for state in states:
        row = {"time_s": state.time}
        row |= {f"pressure_{name}_kPa": kpa for name, kpa in state.pressures.items()}
        row |= {"stroke_mm": state.stroke}
        row |= dict(zip(("tip_x_mm", "tip_y_mm"), state.tip or (), strict=False))
        row |= {} if state.tilt is None else {"tilt_deg": state.tilt}
        row |= {f"volume_{name}_ul": ul for name, ul in state.volumes.items()}
        rows.append(row | {"von_mises_max_MPa": state.stress, "work_uJ": state.work})
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    cells = ([f"{round(value, 6) + 0.0:.6g}" for value in row.values()] for row in rows)
    return csv_text([[*rows[0]], *cells])


# The deformed mesh for ParaView, with the results at its nodes.


def write_deformed(mesh: Mesh, frame: Frame, path: Path) -> None:
    """Write the deformed shape: ``displacement`` in mm, ``stress`` and ``von_mises`` in MPa.

    For the undeformed shape, warp by the displacement with a factor of -1.
    """
    # VTK orders a symmetric tensor like CalculiX.
    fields = {
        "displacement": frame.displacement,
        "von_mises": frame.von_mises,
        "stress": frame.stress,
    }
    write_fields(path, mesh.kind, mesh.points + frame.displacement, mesh.cells, fields, {})


# The program.


LOG = "ccx.log"
DIVERGED = Stop("diverged", "its iterations no longer converge, however small the step")


def find_ccx() -> str:
    """Return the path of the solver. Raises OutputError if it is not installed."""
    return program_path(
        "ccx",
        "install CalculiX; on Debian and Ubuntu: apt install calculix-ccx",
    )


def run_ccx(
    folder: Path,
    job: str,
    end: float,
    timeout: float,
    report: Callable[[float], None] | None = None,
) -> tuple[float, Stop | None]:
    """Run a deck in its folder to the time ``end``, for at most ``timeout`` seconds.

    Return the last converged time in s, and the reason if the run was stopped. The output of ccx
    goes to ``ccx.log`` there; ``report`` is called with the time reached, in s.
    """
    sta = folder / f"{job}.sta"

    def look() -> None:
        if report is not None:
            report(read_sta(sta))

    code, stopped = run_program([find_ccx(), "-i", job], folder / LOG, timeout, look)
    reached = read_sta(sta)
    is_there = reached >= end * (1 - SAME_TIME)
    return reached, stopped or _complaint(folder / LOG, code, is_there)


def _complaint(log: Path, code: int, is_there: bool) -> Stop | None:
    """Return the failure, if any; ccx's exit code may be 0 in spite of a failure.

    A diverging step that is retried with a smaller increment is not a failure.
    """
    text = log.read_text(encoding="utf-8", errors="replace")
    if is_there and code == 0 and "Job finished" in text:
        return None
    if re.search(r"diverge|increment size smaller than minimum", text):
        return DIVERGED
    error = re.search(r"\*ERROR[^:\n]*:?\s*(.+)", text)
    if error is not None:
        return Stop("failed", f"it reports: {error[1].strip().rstrip('.:')}")
    return Stop("failed", f"it ended with code {code} and without a word")


# A whole run in one folder: mesh, deck, ccx and results.


HISTORY = "history.csv"
KEPT = (".inp", ".frd", ".sta", ".dat")
DATED = re.compile(rb"(?m)^(    1U(?:DATE|TIME|HOST|USER|DIR)).*$")


def deck_mesh(laminate: Laminate, settings: MeshSettings) -> Mesh:
    """Return the flat volume mesh for a deck. Raises DesignError and OutputError like meshing."""
    return volume_mesh(layup(laminate, settings))


def simulate(
    laminate: Laminate,
    mesh_settings: MeshSettings,
    settings: DeckSettings,
    folder: Path,
    timeout: float,
    progress: Progress,
) -> Result:
    """Inflate a laminate in CalculiX; ``folder`` receives deck, results and table.

    ``timeout`` is in seconds. A run that diverges or takes too long keeps its results so far.
    Raises OutputError if ccx is not installed or gives no results.
    """
    progress("mesh", 0, 1)
    mesh = deck_mesh(laminate, mesh_settings)
    find_ccx()
    _warn_of_hours(mesh, timeout)
    write_deck(mesh, settings, folder)
    top = settings.largest

    def report(reached: float) -> None:
        # Time does not show the load, which rises with its square, or the remaining duration:
        # steps get shorter when films wrinkle.
        progress(f"ccx, {top * settings.share(reached) + 0.0:.3g} of {top:g} kPa", 0, 1)

    report(0.0)
    reached, stop = run_ccx(folder, JOB, settings.ramp, timeout, report)
    progress("results", 0, 1)
    run_mesh, frd = started(mesh, settings), folder / f"{JOB}.frd"
    place = f"{reached:.4g} s, {top * settings.share(reached):.3g} of {top:g} kPa"
    frames = []
    if stop is None or frd.exists():
        # ccx adds an unconverged frame when it gives up.
        every = read_frd(frd, len(mesh.points), whole=stop is None)
        frames = [frame for frame in every if frame.time <= reached * (1 + SAME_TIME)]
    if not frames:
        stop = stop or Stop("failed", "it wrote no result")
        pass_on_interrupt(stop)
        raise OutputError(
            f"ccx stopped at {place}, before the first result: {stop.words}; "
            f"{_advice(stop, settings)}"
        )
    states = history(run_mesh, laminate, mesh_settings.symmetry, settings, frames)
    wrong = _first_wrong(run_mesh, laminate, settings, frames, states)
    if wrong is not None:
        number, reason = wrong
        if number == 0:
            raise VoidError(
                f"the first result, at {_largest(states[1]):.3g} kPa, is impossible: {reason}; "
                "reduce the pressure in one chamber, or the vacuum"
            )
        frames, states = frames[:number], states[: number + 1]
    write_files({HISTORY: history_csv(states)}, folder)
    write_deformed(run_mesh, frames[-1], folder / "deformed.vtu")
    _tidy(folder)
    stopped, last = None, f"{_largest(states[-1]):.3g} kPa"
    if wrong is not None:
        stopped = f"beyond {last} the result cannot be: {wrong[1]}; results up to there are kept"
    elif stop is not None:
        stopped = (
            f"ccx stopped at {place}: {stop.words}; results up to {last} are kept; "
            f"{_advice(stop, settings)}"
        )
    return Result.of_run("calculix", states, {}, stopped)


MEASURED_EQUATIONS, MEASURED_SECONDS, GROWTH = 147_513, 6.4, 1.5
"""Equations of a mesh, processor time in s of one iteration (CalculiX 2.20 with SPOOLES on one core
of a Xeon), and the exponent of the number of equations in that time: six meshes of 21,663 to
380,757 equations took 0.8 to 1.8 times the estimate from these three."""
LEAST_ITERATIONS = 100
"""Per run: a quarter of one balloon took 109, a quarter of fifteen 136; wrinkles take more."""
LONG = 3600.0
"""s"""


def _warn_of_hours(mesh: Mesh, timeout: float) -> None:
    """Warn before a run that cannot finish within an hour; ``timeout`` is in s."""
    equations = 3 * len(mesh.points)
    iteration = MEASURED_SECONDS * (equations / MEASURED_EQUATIONS) ** GROWTH
    least = LEAST_ITERATIONS * iteration
    if least > LONG:
        warnings.warn(
            f"ccx will not end in an hour: {len(mesh.cells):,} elements have some {equations:,} "
            f"equations, for which {LEAST_ITERATIONS} iterations of {iteration:.0f} s take "
            f"{least / 3600:.1f} hours, right within a factor of 2, and films that wrinkle take "
            f"several times as many. It is stopped after {timeout / 60:g} minutes. A larger --h, "
            "--symmetry and the other simulators take less",
            stacklevel=2,
        )


def _first_wrong(
    mesh: Mesh,
    laminate: Laminate,
    settings: DeckSettings,
    frames: Sequence[Frame],
    states: Sequence[State],
) -> tuple[int, str] | None:
    """Return the index of the first impossible frame, and the reason; decks have no contact."""
    drawn_in = [name for name, pressure in settings.pressures.items() if pressure < 0]
    for number, (frame, state) in enumerate(zip(frames, states[1:], strict=True)):
        if any(films_meet(mesh, name, frame) for name in drawn_in):
            return number, "the films meet, and the deck has no contact and no loose sheets"
        reason = impossible(laminate, state)
        if reason is not None:
            return number, reason
    return None


def _largest(state: State) -> float:
    """Return the pressure in kPa with the largest magnitude."""
    return max(state.pressures.values(), key=abs)


def _advice(stop: Stop, settings: DeckSettings) -> str:
    if stop.kind == "interrupt":
        return "run it again for the rest"
    if stop.kind == "failed":
        return "see whether ccx runs on this machine; a larger --h takes less memory"
    if stop.kind == "time":
        return "give it more --minutes or a larger --h, or less to do with --symmetry"
    if settings.procedure == "static":
        return "take --procedure dynamic, which gets past wrinkles"
    return "ask for less pressure or a smaller --h"


def _tidy(folder: Path) -> None:
    """Remove ccx's working files, and dates and names from its result file."""
    frd = folder / f"{JOB}.frd"
    frd.write_bytes(DATED.sub(rb"\1", frd.read_bytes()))
    of_ccx = [path for path in folder.glob(f"{JOB}.*") if path.suffix not in KEPT]
    for path in (*of_ccx, folder / "spooles.out", folder / LOG):
        path.unlink(missing_ok=True)


# The interface of a simulator.


USES = ("h", "symmetry", "procedure")


def why_not(laminate: Laminate) -> str | None:
    """Return None: every laminate can be meshed."""
    return None


def export(laminate: Laminate, request: SimulationRequest, folder: Path) -> None:
    """Write the deck, and the mesh that it includes."""
    mesh, settings = _settings(laminate, request)
    write_deck(deck_mesh(laminate, mesh), settings, folder)


def run(laminate: Laminate, request: SimulationRequest, folder: Path, progress: Progress) -> Result:
    """Run the deck; the folder holds deck, results and table."""
    mesh, settings = _settings(laminate, request)
    return simulate(laminate, mesh, settings, folder, 60 * request.minutes, progress)


def _settings(laminate: Laminate, request: SimulationRequest) -> tuple[MeshSettings, DeckSettings]:
    defaults = MeshSettings()
    mesh = MeshSettings(
        h=defaults.h if request.h is None else request.h,
        symmetry=cast(Symmetry, request.symmetry or defaults.symmetry),
        wrapped=False,
    )
    settings = deck_settings(laminate, request, cast(Procedure, request.procedure or "dynamic"))
    if settings.has_vacuum:
        # Films that lie on each other leave no gap for drawing them together.
        mesh = replace(mesh, gaps=True)
    for name, meshed in images(laminate, mesh.symmetry).items():
        if settings.pressures[name] != settings.pressures[meshed]:
            raise DesignError(
                f"symmetry {mesh.symmetry} computes {meshed} in place of {name}; use equal "
                "pressures for both, or symmetry full"
            )
    return mesh, settings
