"""One ripple of a lone balloon in CalculiX: half a wave of its rim between two planes of symmetry.

``python -m docs.scripts.ripple_sector 10 11`` inflates the balloon of d = 10 with 11 waves round its
rim and prints stroke, air and ripples by pressure, in some minutes. A whole or quarter balloon jumps
between numbers of waves on the way and takes hours; a sector keeps its own. Both films are there,
in elements of second order (C3D20, C3D15 at the axis), free to wrinkle as often as the planes allow.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sbafab.simulators.calculix.frd import SAME_TIME, read_frd
from sbafab.simulators.calculix.run import run_ccx
from sbafab.simulators.calculix.settings import TPE

JOB = "sector"
PRESSURES = (0.1, 0.15, 0.25, 0.5, 1.0, 2.0, 4.0, 6.0, 10.0)
"""kPa."""
LIMIT = 3600.0
START = 0.010
"""mm that the rim is off flat by at the start, in the wanted waves; the films a fifth of it in shorter
ones, or neither would ever begin to buckle."""
POINTS = 40
"""Points of the ramp, along which the pressure rises with the cube of time."""


class Sector(NamedTuple):
    """A balloon of diameter ``pocket``, its ring and films in mm, ``waves`` round its rim.

    ``film``, ``rim`` and ``round`` are numbers of elements along the film, the rim and half a
    wave; ``ramp`` is the time in s to the last pressure.
    """

    pocket: float = 10.0
    waves: int = 11
    ring: float = 0.75
    thickness: float = 0.038
    film: int = 26
    rim: int = 5
    round: int = 8
    ramp: float = 0.2

    @property
    def radii(self) -> np.ndarray:
        """Of the columns of nodes, two an element, closer towards the pocket's edge."""
        even = np.linspace(0, 1, self.film + 1)
        film = self.pocket / 2 * (0.5 * even + 0.5 * np.sin(math.pi / 2 * even))
        rim = self.pocket / 2 + self.ring * np.linspace(0, 1, self.rim + 1)[1:]
        ends = np.concatenate([film, rim])
        found = np.empty(2 * len(ends) - 1)
        found[::2] = ends
        found[1::2] = (ends[1:] + ends[:-1]) / 2
        return found


class SectorMesh(NamedTuple):
    """Places of nodes (n, 3); elements by type and film; each film's inner faces by eight nodes (six
    at the axis), in the order of the element; the radial columns' and rounds' numbers of nodes.
    """

    points: np.ndarray
    elements: dict[tuple[str, str], list[list[int]]]
    sides: list[int]
    poles: tuple[int, int]
    held: int
    edge: list[int]
    outside: list[int]


def mesh(one: Sector) -> SectorMesh:
    """The mesh; node numbers start at 1."""
    numbers: dict[tuple[int, int, int, str], int] = {}
    places: list[tuple[float, float, float]] = []
    radii, last = one.radii, 2 * one.round

    def node(i: int, j: int, level: int, film: str) -> int:
        # Both films share their faces at 0 from the pocket's edge on, and a node on the axis all round.
        owner = "both" if level == 0 and i >= 2 * one.film else film
        key = (i, 0 if i == 0 else j, level, owner)
        if key not in numbers:
            turn = math.pi / one.waves * key[1] / last
            r = float(radii[i])
            off = _off(one, r, turn, film)
            places.append((r * math.cos(turn), r * math.sin(turn), level * one.thickness / 2 + off))
            numbers[key] = len(places)
        return numbers[key]

    elements: dict[tuple[str, str], list[list[int]]] = {}
    for film, low in (("upper", 0), ("lower", -2)):
        for i in range(0, 2 * (one.film + one.rim), 2):
            for j in range(0, last, 2):
                if i == 0:
                    ring = [(0, j), (2, j), (2, j + 2)]
                    between = [(1, j), (2, j + 1), (1, j + 2)]
                else:
                    ring = [(i, j), (i + 2, j), (i + 2, j + 2), (i, j + 2)]
                    between = [(i + 1, j), (i + 2, j + 1), (i + 1, j + 2), (i, j + 1)]
                row = [node(*at, low, film) for at in ring]
                row += [node(*at, low + 2, film) for at in ring]
                row += [node(*at, low, film) for at in between]
                row += [node(*at, low + 2, film) for at in between]
                row += [node(*at, low + 1, film) for at in ring]
                kind = "axis" if i == 0 else "wall" if i < 2 * one.film else "rim"
                elements.setdefault((film, kind), []).append(row)
    sides = [n for (i, j, _, _), n in numbers.items() if i and j in (0, last)]
    poles = numbers[0, 0, 2, "upper"], numbers[0, 0, -2, "lower"]
    middle = [numbers[2 * one.film, j, 0, "both"] for j in range(last + 1)]
    outside = [numbers[len(radii) - 1, j, 0, "both"] for j in range(last + 1)]
    return SectorMesh(np.array(places), elements, sides, poles, middle[one.round], middle, outside)


def _off(one: Sector, r: float, turn: float, film: str) -> float:
    out = r / (one.pocket / 2 + one.ring)
    short = sum(math.cos(k * one.waves * turn + k * (film == "upper")) for k in (2, 3, 4)) / 3
    return START * out**2 * (math.cos(one.waves * turn) + short / 5 * (r < one.pocket / 2))


def deck(one: Sector, made: SectorMesh, pressures: Sequence[float]) -> Iterator[str]:
    """The input of ccx."""
    yield "*HEADING\nOne ripple of a balloon; units mm, N, MPa, t, s\n*NODE\n"
    for number, (x, y, z) in enumerate(made.points.tolist(), start=1):
        yield f"{number}, {x:.10g}, {y:.10g}, {z:.10g}\n"
    count = 0
    for (film, kind), rows in made.elements.items():
        name = "C3D15" if kind == "axis" else "C3D20"
        yield f"*ELEMENT, TYPE={name}, ELSET={film}_{kind}\n"
        for row in rows:
            count += 1
            cells = [str(cell) for cell in (count, *row)]
            yield ", ".join(cells[:12]) + ",\n" + ", ".join(cells[12:]) + "\n"
    yield f"*ELSET, ELSET=whole, GENERATE\n1, {count}\n"
    yield "*NSET, NSET=sides\n" + "".join(f"{number}\n" for number in made.sides)
    yield "*TRANSFORM, NSET=sides, TYPE=C\n0, 0, 0, 0, 0, 1\n"
    yield f"*MATERIAL, NAME=TPE\n*ELASTIC\n{TPE.modulus:g}, {TPE.poisson:g}\n"
    yield f"*DENSITY\n{TPE.density:g}\n*SOLID SECTION, ELSET=whole, MATERIAL=TPE\n"
    yield "*BOUNDARY\nsides, 2, 2\n"
    axis = np.hypot(made.points[:, 0], made.points[:, 1]) < 1e-9
    for number in np.flatnonzero(axis) + 1:
        yield f"{number}, 1, 2\n"
    yield f"{made.held}, 3, 3\n*AMPLITUDE, NAME=ramp\n"
    times = _times(one, pressures)
    ramp = sorted({*times, *(one.ramp * n / POINTS for n in range(POINTS + 1))})
    yield "".join(f"{time:.9g}, {(time / one.ramp) ** 3:.9g}\n" for time in ramp)
    yield "*TIME POINTS, NAME=outputs\n" + "".join(f"{time:.9g}\n" for time in times)
    yield "*STEP, NLGEOM, INC=100000\n*DYNAMIC, ALPHA=-0.3\n"
    yield f"{one.ramp / 400:.6g}, {one.ramp:.9g}, {1e-7 * one.ramp:.6g}, {one.ramp / 40:.6g}\n"
    yield "*DLOAD, AMPLITUDE=ramp\n"
    for film, face in (("upper", "P1"), ("lower", "P2")):
        for kind in ("axis", "wall"):
            yield f"{film}_{kind}, {face}, {pressures[-1] / 1000:.9g}\n"
    yield "*NODE FILE, TIME POINTS=outputs\nU\n*EL FILE, TIME POINTS=outputs\nS\n*END STEP\n"


def _times(one: Sector, pressures: Sequence[float]) -> list[float]:
    return [one.ramp * (pressure / pressures[-1]) ** (1 / 3) for pressure in pressures]


class SectorState(NamedTuple):
    """Pressure in kPa, stroke in mm and air in ul of the whole balloon; by how much the pocket's edge
    and the rim's outside rise and fall from crest to trough, mm; mean radius of the edge.
    """

    pressure: float
    stroke: float
    air: float
    edge: float
    outside: float
    radius: float


def sector_states(one: Sector, pressures: Sequence[float] = PRESSURES) -> list[SectorState]:
    """Inflates a sector. Says how far it came where ccx does not finish."""
    made = mesh(one)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        text = "".join(deck(one, made, pressures))
        (folder / f"{JOB}.inp").write_text(text, encoding="ascii", newline="\n")
        ending = run_ccx(folder, JOB, one.ramp, LIMIT)
        frames = read_frd(folder / f"{JOB}.frd", len(made.points), whole=ending.stopped is None)
    if ending.stopped is not None:
        print(f"ccx stopped at {pressures[-1] * (ending.time / one.ramp) ** 3:g} kPa")
    found = []
    times = np.array([frame.time for frame in frames])
    for pressure, time in zip(pressures, _times(one, pressures), strict=True):
        near = np.flatnonzero(np.abs(times - time) <= 10 * SAME_TIME * time)
        if len(near):
            found.append(_state(one, made, pressure, frames[near[0]].displacement))
    return found


def _state(one: Sector, made: SectorMesh, pressure: float, moved: np.ndarray) -> SectorState:
    top, bottom = (moved[pole - 1, 2] for pole in made.poles)
    places = made.points + moved
    held = _air(one, made, places) - _air(one, made, made.points)
    edge, outside = (places[np.array(row) - 1] for row in (made.edge, made.outside))
    return SectorState(
        pressure,
        float(top - bottom),
        2 * one.waves * held,
        float(np.ptp(edge[:, 2])),
        float(np.ptp(outside[:, 2])),
        float(np.hypot(edge[:, 0], edge[:, 1]).mean()),
    )


def _air(one: Sector, made: SectorMesh, places: np.ndarray) -> float:
    """A third of the flux of the place through the inner faces; the planes of symmetry hold the axis
    and add nothing.
    """
    x, weight = np.polynomial.legendre.leggauss(3)
    total = 0.0
    for film, sign in (("upper", 1.0), ("lower", -1.0)):
        for kind in ("axis", "wall"):
            rows = np.array(made.elements[film, kind])
            corners = 3 if kind == "axis" else 4
            low = film == "upper"
            own = rows[:, :corners] if low else rows[:, corners : 2 * corners]
            start = 2 * corners if low else 3 * corners
            between = rows[:, start : start + corners]
            if kind == "axis":
                # A triangle is a square whose fourth side has shrunk to the axis.
                pole = own[:, :1]
                own = np.concatenate([pole, own[:, 1:], pole], axis=1)
                between = np.concatenate([between, pole], axis=1)
            nodes = places[np.concatenate([own, between], axis=1) - 1]
            for s, ws in zip(x, weight, strict=True):
                for t, wt in zip(x, weight, strict=True):
                    shape, by_s, by_t = _serendipity(s, t)
                    at = np.einsum("k,ekc->ec", shape, nodes)
                    normal = np.cross(
                        np.einsum("k,ekc->ec", by_s, nodes), np.einsum("k,ekc->ec", by_t, nodes)
                    )
                    total += sign * ws * wt * float((at * normal).sum()) / 3
    return total


def _serendipity(s: float, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shape functions of a square of eight nodes and their slopes by s and t."""
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    a, b = corner[:, 0], corner[:, 1]
    u, v = 1 + a * s, 1 + b * t
    shape = [*(u * v * (a * s + b * t - 1) / 4)]
    by_s = [*(a * v * (2 * a * s + b * t) / 4)]
    by_t = [*(b * u * (a * s + 2 * b * t) / 4)]
    for c, d in ((0, -1), (1, 0), (0, 1), (-1, 0)):
        if c == 0:
            shape.append((1 - s * s) * (1 + d * t) / 2)
            by_s.append(-s * (1 + d * t))
            by_t.append((1 - s * s) * d / 2)
        else:
            shape.append((1 - t * t) * (1 + c * s) / 2)
            by_s.append((1 - t * t) * c / 2)
            by_t.append(-t * (1 + c * s))
    return np.array(shape), np.array(by_s), np.array(by_t)


def main() -> None:
    pocket, waves = float(sys.argv[1]), int(sys.argv[2])
    last = float(sys.argv[3]) if len(sys.argv) > 3 else PRESSURES[-1]
    pressures = [pressure for pressure in PRESSURES if pressure <= last]
    print("kPa   stroke   air      edge    outside  radius of the edge")
    for state in sector_states(Sector(pocket=pocket, waves=waves), pressures):
        print("  ".join(f"{value:.4f}" for value in state), flush=True)


if __name__ == "__main__":
    main()
