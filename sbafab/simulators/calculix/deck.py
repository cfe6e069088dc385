"""The input of CalculiX for an actuator, ``actuator.inp``, its mesh, and the same for Abaqus.

Both read the same keywords but for what is to be written out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from sbafab.laminate.films import in_order
from sbafab.meshing.conforming.model import Mesh
from sbafab.meshing.conforming.write_inp import write_inp
from sbafab.simulators.calculix.imperfection import uneven
from sbafab.simulators.calculix.settings import DeckSettings
from sbafab.simulators.calculix.supports import supports

JOB = "actuator"
MESH_FILE = "mesh.inp"
ABAQUS_FILE = "abaqus.inp"
FIRST, LEAST = 0.1, 1e-7
"""First and least increment, as parts of the time between outputs and of the ramp."""
DAMPING = -0.3
"""Of high frequencies, by Hilber, Hughes and Taylor: the most there is."""
MOST_INCREMENTS = 100_000
ABAQUS_OUTPUTS = """\
*OUTPUT, FIELD, TIME POINTS=outputs
*NODE OUTPUT
U, RF
*ELEMENT OUTPUT
S
*OUTPUT, HISTORY, TIME POINTS=outputs
*ENERGY OUTPUT
ALLSE, ALLKE
"""


def write_deck(mesh: Mesh, settings: DeckSettings, folder: Path) -> list[Path]:
    """Write ``actuator.inp``, ``abaqus.inp`` and the ``mesh.inp`` they include into ``folder``.

    ``mesh`` is a flat volume mesh. The files are returned; run them with ``ccx -i actuator`` or
    ``abaqus job=abaqus``. The latter was written from Abaqus's manual and never run.
    """
    folder.mkdir(parents=True, exist_ok=True)
    run_mesh = started(mesh, settings)
    write_inp(run_mesh, folder / MESH_FILE)
    decks = {f"{JOB}.inp": _ccx_outputs(settings), ABAQUS_FILE: ABAQUS_OUTPUTS}
    for name, outputs in decks.items():
        with (folder / name).open("w", encoding="ascii", newline="\n") as file:
            file.writelines(_lines(run_mesh, settings))
            file.write(f"{outputs}*END STEP\n")
    return [*(folder / name for name in decks), folder / MESH_FILE]


def started(mesh: Mesh, settings: DeckSettings) -> Mesh:
    """The mesh that is run: the flat one with its imperfection."""
    return replace(mesh, points=uneven(mesh.points, settings.imperfection))


def _lines(mesh: Mesh, settings: DeckSettings) -> Iterator[str]:
    asked = ", ".join(f"{name} {value:g} kPa" for name, value in settings.pressures.items())
    yield "*HEADING\n"
    yield "Stacked balloon actuator; units mm, N, MPa, t, s\n"
    yield f"** Pressures at the end: {asked}\n"
    yield f"*INCLUDE, INPUT={MESH_FILE}\n"
    yield from _cavity_faces(mesh)
    yield from _sections(mesh, settings)
    yield from supports(mesh)
    for name in settings.pressures:
        yield f"*AMPLITUDE, NAME=ramp_{name}\n"
        yield "".join(f"{time:.9g}, {settings.share(time):.9g}\n" for time in settings.times())
    yield from _step(mesh, settings)


def _sections(mesh: Mesh, settings: DeckSettings) -> Iterator[str]:
    """The films' materials, and which elements are of each."""
    films = {"TPE": settings.film, **settings.others}
    used = in_order(mesh.materials.values()) or ["TPE"]
    for name in used:
        film, elements = films[name], "all_elements"
        if len(used) > 1:
            elements = f"material_{name}"
            yield f"*ELSET, ELSET={elements}\n"
            yield from (f"{part}\n" for part, of in mesh.materials.items() if of == name)
        yield f"*MATERIAL, NAME={name}\n"
        yield f"*ELASTIC\n{film.modulus:g}, {film.poisson:g}\n*DENSITY\n{film.density:g}\n"
        yield f"*SOLID SECTION, ELSET={elements}, MATERIAL={name}\n"


def _step(mesh: Mesh, settings: DeckSettings) -> Iterator[str]:
    between = settings.ramp / settings.outputs
    dynamic = f"*DYNAMIC, ALPHA={DAMPING:g}\n"
    yield "*TIME POINTS, NAME=outputs\n"
    yield "".join(f"{time:.9g}\n" for time in settings.times()[1:])
    yield f"*STEP, NLGEOM, INC={MOST_INCREMENTS}\n"
    yield dynamic if settings.procedure == "dynamic" else "*STATIC\n"
    yield (
        f"{FIRST * between:.6g}, {settings.ramp:.9g}, {LEAST * settings.ramp:.6g}, {between:.9g}\n"
    )
    for name, kilopascals in settings.pressures.items():
        yield f"*DLOAD, AMPLITUDE=ramp_{name}\n"
        for number in _face_numbers(mesh, name):
            yield f"faces_{name}_{number}, P{number}, {kilopascals / 1000:.9g}\n"


def _ccx_outputs(settings: DeckSettings) -> str:
    energies = "ELSE, ELKE" if settings.procedure == "dynamic" else "ELSE"
    return (
        "*NODE FILE, TIME POINTS=outputs\nU\n*EL FILE, TIME POINTS=outputs\nS\n"
        "*NODE PRINT, NSET=held, TOTALS=ONLY, TIME POINTS=outputs\nRF\n"
        f"*EL PRINT, ELSET=all_elements, TOTALS=ONLY, TIME POINTS=outputs\n{energies}\n"
    )


def _face_numbers(mesh: Mesh, chamber: str) -> list[int]:
    """Numbers, from 1, of the element faces that a chamber's air presses on."""
    faces = mesh.face_sets.get(f"cavity_{chamber}")
    return [] if faces is None else [int(n) + 1 for n in np.unique(faces[:, 1])]


def _cavity_faces(mesh: Mesh) -> Iterator[str]:
    """An element set for each chamber and face number: each face is in one of them, once."""
    for name, faces in mesh.face_sets.items():
        chamber = name.removeprefix("cavity_")
        for number in _face_numbers(mesh, chamber):
            cells = faces[faces[:, 1] == number - 1, 0] + 1
            yield f"*ELSET, ELSET=faces_{chamber}_{number}\n"
            yield "".join(f"{cell}\n" for cell in cells.tolist())
