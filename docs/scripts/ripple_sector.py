"""One ripple of a lone balloon in CalculiX: half a wave of its rim, or a quarter.

``python -m docs.scripts.ripple_sector 10 11`` inflates the balloon of d = 10 with 11 waves round its
rim and prints stroke, air and ripples by pressure, in some minutes. A whole or quarter balloon jumps
between numbers of waves on the way and takes hours; a sector keeps its own. Both films are there,
in elements of second order (C3D20, C3D15 at the axis), free to wrinkle as often as symmetry allows.

Half a wave lies between two planes of symmetry; its rim may also roll to one side. With ``even`` as
third argument a quarter ends where the rim crosses the middle plane, on an axis about which half a
turn changes nothing: what goes up before it goes down behind it, and the rim as a whole stays level.
A balloon with a neck is an inner one of a stack: its necks stay level, and the air in the bore pulls.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sbafab.simulators.calculix import SAME_TIME, TPE, read_frd, run_ccx

JOB = "sector"
PRESSURES = (0.1, 0.15, 0.25, 0.5, 1.0, 2.0, 4.0, 6.0, 10.0)
"""kPa."""
LIMIT = 3600.0
START = 0.010
"""mm that the rim is off flat by at the start, in the wanted waves; the films a fifth of it in shorter
ones, or neither would ever begin to buckle."""
NECK = 2
POINTS = 40
"""Points of the ramp, along which the pressure rises with the cube of time."""


class Sector(NamedTuple):
    """A balloon of diameter ``pocket``, its ring and films in mm, ``waves`` round its rim; ``neck`` and
    ``bore`` are the diameters of an inner one's.

    ``film``, ``rim`` and ``round`` are numbers of elements along the film, the rim and round the
    sector; ``ramp`` is the time in s to the last pressure; ``even`` that a quarter of a wave is
    taken.
    """

    pocket: float = 10.0
    waves: int = 11
    ring: float = 0.75
    thickness: float = 0.038
    film: int = 26
    rim: int = 5
    round: int = 8
    ramp: float = 0.2
    even: bool = False
    neck: float = 0.0
    bore: float = 0.0

    @property
    def necks(self) -> int:
        """Number of elements along the neck."""
        return NECK if self.neck else 0

    @property
    def share(self) -> int:
        """The whole turn over the sector's."""
        return (4 if self.even else 2) * self.waves

    @property
    def radii(self) -> np.ndarray:
        """Of the columns of nodes, two an element, closer towards the pocket's edge."""
        even = np.linspace(0, 1, self.film + 1)
        film = self.pocket / 2 * (0.5 * even + 0.5 * np.sin(math.pi / 2 * even))
        if self.neck:
            even = np.linspace(0, 1, self.film - NECK + 1)
            free = (self.pocket - self.neck) / 2
            film = self.neck / 2 + free * (0.5 * even + 0.25 * (1 - np.cos(math.pi * even)))
            held = np.linspace(self.bore / 2, self.neck / 2, NECK + 1)[:-1]
            film = np.concatenate([held, film])
        rim = self.pocket / 2 + self.ring * np.linspace(0, 1, self.rim + 1)[1:]
        ends = np.concatenate([film, rim])
        found = np.empty(2 * len(ends) - 1)
        found[::2] = ends
        found[1::2] = (ends[1:] + ends[:-1]) / 2
        return found


class SectorMesh(NamedTuple):
    """Places of nodes (n, 3); elements by film and part; numbers of nodes on the ``sides``, of
    ``pairs`` on the axis of an even ripple that move alike, of the ``poles``, of both ``necks``
    (outer faces) and ``bores`` (inner faces), the one ``held``, and those of the pocket's ``edge``
    and of the ``outside``.
    """

    points: np.ndarray
    elements: dict[tuple[str, str], list[list[int]]]
    sides: list[int]
    pairs: list[tuple[int, int]]
    poles: tuple[int, int]
    necks: tuple[list[int], list[int]]
    bores: tuple[list[int], list[int]]
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
        key = (i, 0 if i == 0 and not one.bore else j, level, owner)
        if key not in numbers:
            turn = math.tau / one.share * key[1] / last
            r = float(radii[i])
            off = _off(one, r, turn, film)
            places.append((r * math.cos(turn), r * math.sin(turn), level * one.thickness / 2 + off))
            numbers[key] = len(places)
        return numbers[key]

    elements: dict[tuple[str, str], list[list[int]]] = {}
    for film, low in (("upper", 0), ("lower", -2)):
        for i in range(0, 2 * (one.film + one.rim), 2):
            for j in range(0, last, 2):
                if i == 0 and not one.bore:
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
                kind = "wall" if i < 2 * one.film else "rim"
                if i < 2 * max(one.necks, 1):
                    kind = "neck" if one.neck else "axis"
                elements.setdefault((film, kind), []).append(row)
    pairs = []
    if one.even:
        for (i, j, level, owner), n in numbers.items():
            if j == (0 if i == 0 and not one.bore else last) and level >= 0 and owner != "lower":
                other = owner if owner == "both" and level == 0 else "lower"
                pairs.append((n, numbers[i, j, -level, other]))
    sides = [n for (i, j, _, _), n in numbers.items() if (i or one.bore) and j in (0, last)]
    begin = last if one.bore else 0
    poles = numbers[0, begin, 2, "upper"], numbers[0, begin, -2, "lower"]
    necks, bores = (
        (
            [n for (i, _, k, film), n in numbers.items() if i <= reach and (k, film) == upper],
            [n for (i, _, k, film), n in numbers.items() if i <= reach and (k, film) == lower],
        )
        for reach, upper, lower in (
            (2 * one.necks if one.neck else -1, (2, "upper"), (-2, "lower")),
            (0 if one.bore else -1, (0, "upper"), (0, "lower")),
        )
    )
    middle = [numbers[2 * one.film, j, 0, "both"] for j in range(last + 1)]
    outside = [numbers[len(radii) - 1, j, 0, "both"] for j in range(last + 1)]
    return SectorMesh(
        np.array(places),
        elements,
        sides,
        pairs,
        poles,
        necks,
        bores,
        middle[one.round],
        middle,
        outside,
    )


def _off(one: Sector, r: float, turn: float, film: str) -> float:
    out = r / (one.pocket / 2 + one.ring)
    wave = one.waves * turn
    short = math.cos(3 * wave) + math.cos(2 * wave) * (1 if film == "upper" else -1)
    rolled = 0.0 if one.even else 0.1
    return START * out**2 * (math.cos(wave) + rolled + short / 10 * (r < one.pocket / 2))


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
    yield from _supports(one, made)
    yield from _step(one, pressures)


def _supports(one: Sector, made: SectorMesh) -> Iterator[str]:
    """What is held, and what moves alike."""
    # On the axis of an even ripple what moves round above moves back below.
    mirrored = {node for pair in made.pairs if pair[0] != pair[1] for node in pair}
    yield "*BOUNDARY\n" + "".join(f"{n}, 2, 2\n" for n in made.sides if n not in mirrored)
    axis = np.hypot(made.points[:, 0], made.points[:, 1]) < 1e-9
    for number in np.flatnonzero(axis) + 1:
        yield f"{number}, 1, 2\n"
    if not one.even:
        yield f"{made.held}, 3, 3\n"
    on_axis = set((np.flatnonzero(axis) + 1).tolist())
    for node, other in made.pairs:
        if node == other:
            yield f"*BOUNDARY\n{node}, 3, 3\n"
            continue
        if node not in on_axis:
            yield f"*EQUATION\n2\n{node}, 1, 1., {other}, 1, -1.\n"
            yield f"*EQUATION\n2\n{node}, 2, 1., {other}, 2, 1.\n"
        yield f"*EQUATION\n2\n{other}, 3, 1., {node}, 3, 1.\n"
    below = {other for _, other in made.pairs}
    for pole, neck in zip(made.poles, made.necks, strict=True):
        for node in neck:
            if node != pole and node not in below:
                yield f"*EQUATION\n2\n{node}, 3, 1., {pole}, 3, -1.\n"


def _step(one: Sector, pressures: Sequence[float]) -> Iterator[str]:
    """The pressure, in time."""
    yield "*AMPLITUDE, NAME=ramp\n"
    times = _times(one, pressures)
    ramp = sorted({*times, *(one.ramp * n / POINTS for n in range(POINTS + 1))})
    yield "".join(f"{time:.9g}, {(time / one.ramp) ** 3:.9g}\n" for time in ramp)
    yield "*TIME POINTS, NAME=outputs\n" + "".join(f"{time:.9g}\n" for time in times)
    yield "*STEP, NLGEOM, INC=100000\n*DYNAMIC, ALPHA=-0.3\n"
    yield f"{one.ramp / 400:.6g}, {one.ramp:.9g}, {1e-7 * one.ramp:.6g}, {one.ramp / 40:.6g}\n"
    yield "*DLOAD, AMPLITUDE=ramp\n"
    for film, face in (("upper", "P1"), ("lower", "P2")):
        for kind in ("neck" if one.neck else "axis", "wall"):
            yield f"{film}_{kind}, {face}, {pressures[-1] / 1000:.9g}\n"
    if one.bore:
        # The air in the bore presses on the ends of the stack, and the necks hold it.
        pull = one.bore**2 / (one.neck**2 - one.bore**2) * pressures[-1] / 1000
        yield f"upper_neck, P2, {-pull:.9g}\nlower_neck, P1, {-pull:.9g}\n"
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
        reached, stopped = run_ccx(folder, JOB, one.ramp, LIMIT)
        frames = read_frd(folder / f"{JOB}.frd", len(made.points), whole=stopped is None)
    if stopped is not None:
        print(f"ccx stopped at {pressures[-1] * (reached / one.ramp) ** 3:g} kPa")
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
        one.share * held,
        _swing(one, edge),
        _swing(one, outside),
        float(np.hypot(edge[:, 0], edge[:, 1]).mean()),
    )


def _swing(one: Sector, line: np.ndarray) -> float:
    """From crest to trough."""
    return float(2 * np.abs(line[:, 2]).max() if one.even else np.ptp(line[:, 2]))


def _air(one: Sector, made: SectorMesh, places: np.ndarray) -> float:
    """A third of the flux of the place through the inner faces; the planes of symmetry hold the axis
    and add nothing.
    """
    x, weight = np.polynomial.legendre.leggauss(3)
    total = 0.0
    for film, sign in (("upper", 1.0), ("lower", -1.0)):
        for kind in ("neck" if one.neck else "axis", "wall"):
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
    for bore, sign in zip(made.bores, (1.0, -1.0), strict=True):
        if bore:
            x, y, z = places[np.array(bore) - 1].T
            total += sign * math.pi * float(np.mean(x**2 + y**2) * np.mean(z)) / 3 / one.share
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
    even = "even" in sys.argv[3:]
    neck, bore = (2.54, 1.04) if "stack" in sys.argv[3:] else (0.0, 0.0)
    one = Sector(pocket, waves, round=5 if even else 8, even=even, neck=neck, bore=bore)
    print("kPa   stroke   air      edge    outside  radius of the edge")
    for state in sector_states(one):
        print("  ".join(f"{value:.4f}" for value in state), flush=True)


if __name__ == "__main__":
    main()
