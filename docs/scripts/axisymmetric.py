"""One round balloon as a section through its axis: the paper's model in a second of computing.

Axisymmetric elements of second order (CAX8R) cannot wrinkle. Before wrinkles come, what any 3D
mesh says must agree with this. Each film mirrors the other, so that one is enough; an inner
balloon of a stack mirrors the next one at its neck.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.errors import OutputError
from sbafab.simulators.calculix import TPE, Elastic, read_frd, run_ccx

if TYPE_CHECKING:
    from numpy.typing import NDArray

JOB = "balloon"
ELEMENTS = 26
LIMIT = 600.0


class MeridianSection(NamedTuple):
    """A round balloon, lengths in mm: diameters of pocket, neck and bore, width of the ring.

    Without a neck both films are whole discs.
    """

    pocket: float = 5.0
    ring: float = 0.75
    thickness: float = 0.038
    neck: float = 0.0
    bore: float = 0.0

    @property
    def radii(self) -> list[float]:
        """Of the columns of nodes, two an element, with one at each edge."""
        edges = [self.bore / 2, self.neck / 2, self.pocket / 2, self.pocket / 2 + self.ring]
        outside = edges[3] - edges[0]
        counts = [round(ELEMENTS * (b - a) / outside) for a, b in pairwise(edges)]
        radii_at = [edges[0]]
        for (start, end), count in zip(pairwise(edges), counts, strict=True):
            radii_at += [start + (end - start) * n / (2 * count) for n in range(1, 2 * count + 1)]
        return radii_at

    @property
    def nodes(self) -> list[tuple[float, float]]:
        """Radius and height of every node: columns outward, three or (halfway) two in each."""
        return [
            (radius, self.thickness * level / 2)
            for column, radius in enumerate(self.radii)
            for level in ((0, 1, 2) if column % 2 == 0 else (0, 2))
        ]


class SectionState(NamedTuple):
    """A balloon at a pressure (kPa): its stroke in mm and its air in ul."""

    pressure: float
    stroke: float
    volume: float


def axisymmetric_strokes(
    pressures: Sequence[float], section: MeridianSection | None = None, film: Elastic = TPE
) -> list[float]:
    """Stroke in mm of one balloon at rising pressures in kPa; raises as ``axisymmetric_states``."""
    return [state.stroke for state in axisymmetric_states(pressures, section, film)]


def axisymmetric_states(
    pressures: Sequence[float], section: MeridianSection | None = None, film: Elastic = TPE
) -> list[SectionState]:
    """One balloon at rising pressures in kPa (paper Fig. 7c).

    Raises OutputError where ccx is not installed or does not finish.
    """
    section = section or MeridianSection()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        deck = "".join(_deck(pressures, section, film))
        (folder / f"{JOB}.inp").write_text(deck, encoding="ascii", newline="\n")
        reached, stopped = run_ccx(folder, JOB, pressures[-1], LIMIT)
        if stopped is not None:
            raise OutputError(f"ccx stopped at {reached:g} kPa: {stopped.words}")
        frames = read_frd(folder / f"{JOB}.frd", len(section.nodes))
    times = np.array([frame.time for frame in frames])
    flat = np.array(section.nodes)
    states = []
    for kilopascals in pressures:
        moved = frames[np.abs(times - kilopascals).argmin()].displacement
        # The third node is the innermost one on top: the pole, or the neck's edge.
        stroke = 2 * float(moved[2, 1])
        states.append(SectionState(kilopascals, stroke, _air(section, flat + moved[:, :2])))
    return states


def _air(section: MeridianSection, nodes: NDArray[np.float64]) -> float:
    """Air in ul between both films, whose sections (n, 2) have moved to radius and height.

    The inner faces turned round the axis; a bore is counted as far as the necks' inner faces.
    """
    faces = 2 * np.count_nonzero(np.array(section.radii[1::2]) < section.pocket / 2)
    # Five nodes an element, three in its first column: the lower ones are nodes 0, 3, 5, 8 ...
    lower = np.array([5 * (n // 2) + 3 * (n % 2) for n in range(faces + 1)])
    r, z = nodes[lower].T
    # Of each side of second order r^2 dz is a polynomial of degree 5: three points are exact.
    along, weights = np.polynomial.legendre.leggauss(3)
    shape = np.stack([along * (along - 1) / 2, 1 - along**2, along * (along + 1) / 2])
    slope = np.stack([along - 0.5, -2 * along, along + 0.5])
    sides = np.stack([np.arange(0, faces, 2) + n for n in range(3)], axis=1)
    swept = (r[sides] @ shape) ** 2 * (z[sides] @ slope) @ weights
    return -2 * math.pi * float(swept.sum())


def _deck(pressures: Sequence[float], section: MeridianSection, film: Elastic) -> Iterator[str]:
    """The model; its time is the pressure in kPa."""
    nodes = section.nodes
    elements = (len(section.radii) - 1) // 2
    yield "*HEADING\nOne film of a balloon; units mm, N, MPa; time is kPa\n*NODE\n"
    yield "".join(f"{n}, {r:.10g}, {z:.10g}\n" for n, (r, z) in enumerate(nodes, start=1))
    yield "*ELEMENT, TYPE=CAX8R, ELSET=film\n"
    for number in range(elements):
        a = 5 * number + 1
        b = a + 5
        corners = (a, b, b + 2, a + 2)
        yield ", ".join(map(str, (number + 1, *corners, a + 3, b + 1, a + 4, a + 1))) + "\n"
    inner = sum(r < section.pocket / 2 for r in section.radii[1::2])
    yield f"*ELSET, ELSET=wall, GENERATE\n1, {inner}\n"
    if section.bore:
        bonded = sum(r < section.neck / 2 for r in section.radii[1::2])
        yield f"*ELSET, ELSET=neck, GENERATE\n1, {bonded}\n"
    yield f"*MATERIAL, NAME=TPE\n*ELASTIC\n{film.modulus:g}, {film.poisson:g}\n"
    yield "*SOLID SECTION, ELSET=film, MATERIAL=TPE\n*BOUNDARY\n"
    if not section.bore:
        yield "1, 1\n2, 1\n3, 1\n"
    for number, (r, z) in enumerate(nodes, start=1):
        if z == 0 and r >= section.pocket / 2:
            yield f"{number}, 2\n"
    yield from _neck(nodes, section)
    pull = _pull(section)
    reached = 0.0
    for kilopascals in pressures:
        span = kilopascals - reached
        yield "*STEP, NLGEOM, INC=1000\n"
        yield f"*STATIC\n{span / 200:.6g}, {span:.9g}, {span * 1e-7:.6g}\n"
        yield f"*DLOAD\nwall, P1, {kilopascals / 1000:.9g}\n"
        if section.bore:
            yield f"neck, P3, {-pull * kilopascals / 1000:.9g}\n"
        # Stress only because the reader wants whole frames.
        yield "*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n"
        reached = kilopascals


def _pull(section: MeridianSection) -> float:
    """Return the pull on necks as a share of the pressure on them.

    Air in the bore presses on the ends of the stack, and the bonded rings hold it.
    """
    if not section.bore:
        return 0.0
    return section.bore**2 / (section.neck**2 - section.bore**2)


def _neck(nodes: Sequence[tuple[float, float]], section: MeridianSection) -> Iterator[str]:
    """Yield the lines that keep a neck bonded to the next balloon in one plane."""
    for number, (r, z) in enumerate(nodes, start=1):
        if number > 3 and z == section.thickness and r <= section.neck / 2:
            yield f"*EQUATION\n2\n{number}, 2, 1., 3, 2, -1.\n"
