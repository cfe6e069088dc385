"""Balloons of two unlike films against an axisymmetric mesh of both, solved by CalculiX."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sbafab
from sbafab.models.balloon import inflate
from sbafab.models.film_elements import Balloon
from sbafab.simulators.calculix import read_frd, run_ccx

SMOOTH = Balloon(wrinkles=False)
THICK = replace(SMOOTH, thickness=0.050, modulus=40_000.0)
RIM, POCKET = 12, 40
"""Elements along the rim and along the pocket."""


def deck(films: tuple[Balloon, Balloon], pressures: list[float]) -> tuple[str, int, int, int]:
    """Two layers of CAX8R over each other that share their nodes from the pocket's edge on; and
    the numbers of the poles on top and below, and of all nodes.
    """
    radii = np.concatenate(
        [np.linspace(0, 2.5, 2 * POCKET + 1), np.linspace(2.5, 3.25, 2 * RIM + 1)[1:]]
    )
    numbers: dict[tuple[int, int], int] = {}
    places: list[tuple[float, float]] = []

    def node(column: int, level: int) -> int:
        # Levels -2, -1, 0 are the lower film's, 0, 1, 2 the upper one's; inside the pocket each
        # has a node of its own at 0, the lower one's called 9.
        if level == 9 and column >= 2 * POCKET:
            level = 0
        if (column, level) not in numbers:
            thick = films[0 if level in (0, 1, 2) else 1].thickness
            z = 0.0 if level == 9 else thick * level / 2
            places.append((float(radii[column]), z))
            numbers[column, level] = len(places)
        return numbers[column, level]

    rows: dict[str, list[list[int]]] = {"upper": [], "lower": []}
    for element in range(POCKET + RIM):
        a, m, b = 2 * element, 2 * element + 1, 2 * element + 2
        for name, (low, half, high) in (("upper", (0, 1, 2)), ("lower", (-2, -1, 9))):
            corners = [node(a, low), node(b, low), node(b, high), node(a, high)]
            between = [node(m, low), node(b, half), node(m, high), node(a, half)]
            rows[name].append([*corners, *between])
    text = "*HEADING\ntwo films\n*NODE\n"
    text += "".join(f"{n}, {r:.10g}, {z:.10g}\n" for n, (r, z) in enumerate(places, start=1))
    number = 0
    faces = []
    for name, film in zip(rows, films, strict=True):
        text += f"*ELEMENT, TYPE=CAX8R, ELSET={name}\n"
        for place, row in enumerate(rows[name]):
            number += 1
            text += ", ".join(map(str, [number, *row])) + "\n"
            if place < POCKET:
                faces.append(f"{number}, {'P1' if name == 'upper' else 'P3'}, ")
        text += f"*MATERIAL, NAME={name}\n*ELASTIC\n{film.modulus / 1000:g}, {film.poisson:g}\n"
        text += f"*SOLID SECTION, ELSET={name}, MATERIAL={name}\n"
    text += "*BOUNDARY\n" + "".join(f"{n}, 1\n" for (c, _), n in numbers.items() if c == 0)
    text += f"{numbers[len(radii) - 1, 0]}, 2\n"
    before = 0.0
    for kpa in pressures:
        span = kpa - before
        text += f"*STEP, NLGEOM, INC=1000\n*STATIC\n{span / 100:g}, {span:g}, {span * 1e-7:g}\n"
        text += "*DLOAD\n" + "".join(f"{face}{kpa / 1000:g}\n" for face in faces)
        text += "*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n"
        before = kpa
    return text, numbers[0, 2], numbers[0, -2], len(places)


@pytest.mark.long
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
@pytest.mark.parametrize("other", [THICK, replace(THICK, modulus=400_000.0)])
def test_strokes_of_unlike_films_are_those_of_an_axisymmetric_mesh(
    tmp_path: Path, other: Balloon
) -> None:
    pressures = [0.5, 2.0, 6.0]
    text, top, bottom, count = deck((SMOOTH, other), pressures)
    (tmp_path / "two.inp").write_text(text, encoding="ascii")
    _, stopped = run_ccx(tmp_path, "two", pressures[-1], 300.0)
    assert stopped is None
    frames = read_frd(tmp_path / "two.frd", count)
    times = np.array([frame.time for frame in frames])
    moved = [frames[np.abs(times - p).argmin()].displacement[:, 1] for p in pressures]
    mesh = np.array([each[top - 1] - each[bottom - 1] for each in moved])
    own = inflate(replace(SMOOTH, mate=other), pressures).height
    assert own == pytest.approx(mesh, rel=0.04)


def test_alike_films_are_one() -> None:
    plain = Balloon(neck=1.25, bore=0.5)
    pressures, heights = [0.5, 5.0, 5.0], [0.4, 0.8, 1.5]
    one = inflate(plain, pressures, heights, tied=True)
    two = inflate(replace(plain, mate=plain), pressures, heights, tied=True)
    for name in ("volume", "force", "energy"):
        assert getattr(two, name) == pytest.approx(getattr(one, name), rel=1e-4)
    assert inflate(replace(SMOOTH, mate=SMOOTH), 2.0).height == pytest.approx(
        inflate(SMOOTH, 2.0).height
    )


TPU = {
    "films": {
        "tpu": {
            "kind": "structural",
            "product": "TPU",
            "thickness": 0.05,
            "density": 1200.0,
            "melting_point": 120.0,
            "modulus": 40.0,
            "poisson": 0.2,
        }
    },
    "layup": {"base": "tpu"},
    "stack": {"balloons": 2},
}


def test_a_stack_with_another_base_has_one_balloon_of_both_films() -> None:
    made = sbafab.stack("1dof-5mm", TPU, "models.calibration=none")
    second = made.maps[1].balloon
    assert second.mate is None
    first = replace(second, thickness=0.05, modulus=40_000.0, mate=second)
    risen = float(inflate(first, 5.0).height[0] + inflate(second, 5.0).height[0])
    assert made.pose((5,)).height == pytest.approx(made.flat_height + risen, rel=0.01)
    # In series both push alike; the stiffer one is lower.
    held = made.pose((5,), plate=made.flat_height + 0.9 * risen)
    assert held.gaps[0, 0] < held.gaps[1, 0]
    pushes = [one.force(5.0, gap) for one, gap in zip(made.maps, held.gaps[:, 0], strict=True)]
    assert pushes[0] == pytest.approx(pushes[1], rel=0.01, abs=0.1)
