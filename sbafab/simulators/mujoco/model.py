"""The actuator as a MuJoCo model (MJCF): one body per node, one flex per group of films."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

from sbafab.laminate.films import density_of
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Vector
from sbafab.simulators.coarse.rounds import why_not_round
from sbafab.simulators.coarse.shell import CoarseActuator, Triangle, actuator, area, nearly_flat

DT = 0.01
"""Time step, s. The integrator is implicit; a step four times as long works too."""
SOLVER_STEPS = 1000
"""Solver iterations per time step; the default of 100 is too few for long stacks."""
LENGTH = 10.0
"""Model length unit, mm. MuJoCo's film contact keeps films a thousandth of a unit apart and treats
them as at rest below a twentieth of a unit per second: with cm the gap is 0.01 mm, a quarter of a
film; with mm the solver needs forty times the iterations."""
START = "inflated"
COLOURS = {
    "lower": "0.35 0.60 0.85 1",
    "upper": "0.55 0.75 0.95 1",
    "web": "0.20 0.35 0.60 1",
    "necks": "0.90 0.60 0.25 1",
}


def model_text(actuator: CoarseActuator) -> str:
    """The model as a file: node i is body ``n<i>``, which is flat unless the keyframe is loaded."""
    root = ET.Element("mujoco", {"model": actuator.stack.name})
    option = ET.SubElement(
        root,
        "option",
        {
            "timestep": _number(DT),
            "gravity": "0 0 0",
            "integrator": "discrete",
            "iterations": str(SOLVER_STEPS),
        },
    )
    contact = {"ipc": "enable"} if has_contact(actuator) else {"contact": "disable"}
    ET.SubElement(option, "flag", {**contact, "autoreset": "disable"})
    height = actuator.mesh.height
    centre = {
        "center": f"0 0 {_number(height / 2 / LENGTH)}",
        "extent": _number(max(height, 5.0) / LENGTH),
    }
    ET.SubElement(root, "statistic", centre)
    _add_nodes(ET.SubElement(root, "worldbody"), actuator)
    _add_films(ET.SubElement(root, "deformable"), actuator)
    _add_start(ET.SubElement(root, "keyframe"), actuator)
    ET.indent(root, " ")
    body = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0"?>\n<!--\n{_note(actuator)}\n-->\n{body}\n'


def has_contact(actuator: CoarseActuator) -> bool:
    """Return True if films touch: films of chambers with a lower pressure than others do."""
    return len({pressure for _, pressure in actuator.pressures}) > 1


def fixed_nodes(actuator: CoarseActuator) -> frozenset[int]:
    """Fixed nodes: the base, or the centre of a lone balloon, so that it bulges both ways.

    The CalculiX deck holds them in the same way.
    """
    mesh = actuator.mesh
    return frozenset(mesh.roots if actuator.balloons == 1 else mesh.fixed)


def _add_nodes(world: ET.Element, actuator: CoarseActuator) -> None:
    still = fixed_nodes(actuator)
    masses = _masses(actuator)
    for node, place in enumerate(actuator.mesh.rest):
        body = ET.SubElement(world, "body", {"name": f"n{node}", "pos": _lengths(place)})
        if node in still:
            continue
        mass = _number(masses[node])
        # It never turns, but MuJoCo requires a moment of inertia.
        ET.SubElement(
            body,
            "inertial",
            {"pos": "0 0 0", "mass": mass, "diaginertia": f"{mass} {mass} {mass}"},
        )
        for axis in ("1 0 0", "0 1 0", "0 0 1"):
            ET.SubElement(body, "joint", {"type": "slide", "axis": axis})


def _add_films(deformable: ET.Element, actuator: CoarseActuator) -> None:
    for name, triangles, films in film_groups(actuator):
        nodes = sorted({node for triangle in triangles for node in triangle})
        place = {node: i for i, node in enumerate(nodes)}
        thickness = films * actuator.stack.film.thickness
        flex = ET.SubElement(
            deformable,
            "flex",
            {
                "name": name,
                "dim": "2",
                "radius": _number(thickness / 2 / LENGTH),
                "rgba": COLOURS[name],
                "body": " ".join(f"n{node}" for node in nodes),
                "element": " ".join(str(place[node]) for t in triangles for node in t),
            },
        )
        touches = {"selfcollide": "auto", "contype": "1", "conaffinity": "1"}
        apart = {"selfcollide": "none", "contype": "0", "conaffinity": "0"}
        ET.SubElement(flex, "contact", touches if has_contact(actuator) else apart)
        elasticity = {
            "young": _number(actuator.young * LENGTH),
            "poisson": _number(actuator.poisson),
            "thickness": _number(thickness / LENGTH),
            "elastic2d": "both",
        }
        ET.SubElement(flex, "elasticity", elasticity)


def _add_start(keyframe: ET.Element, actuator: CoarseActuator) -> None:
    still = fixed_nodes(actuator)
    mesh = actuator.mesh
    moved = (
        q - p
        for node, (rest, position) in enumerate(zip(mesh.rest, mesh.position, strict=True))
        if node not in still
        for p, q in zip(rest, position, strict=True)
    )
    ET.SubElement(keyframe, "key", {"name": START, "qpos": _lengths(moved)})


def film_groups(actuator: CoarseActuator) -> list[tuple[str, Sequence[Triangle], int]]:
    """Flexes with the number of films bonded in each. They share bodies where films are bonded.

    An edge may have at most two triangles in one flex, so several are needed.
    """
    mesh = actuator.mesh
    groups = [
        ("lower", mesh.lower, 1),
        ("upper", mesh.upper, 1),
        ("web", mesh.web, 2),
        ("necks", mesh.necks, 2),
    ]
    return [group for group in groups if group[1]]


def _masses(actuator: CoarseActuator) -> list[float]:
    """True mass in kg of each node: a third of each triangle's."""
    film = actuator.stack.film
    dense = density_of(film, "a simulation")
    masses = [0.0] * len(actuator.mesh.rest)
    for _, triangles, films in film_groups(actuator):
        for triangle in triangles:
            surface = area(actuator.mesh.rest, triangle)
            for node in triangle:
                masses[node] += surface / 3 * films * film.thickness * dense * 1e-9
    return masses


def _note(actuator: CoarseActuator) -> str:
    mesh = actuator.mesh
    triangles = len(mesh.single) + len(mesh.double)
    contact = "the flag ipc is on" if has_contact(actuator) else "all are told the same here"
    # Two hyphens in a row would end an XML comment.
    name = actuator.stack.name.replace("--", "- -")
    return f"""\
{name}: a stack of balloons for MuJoCo 4.0 or newer. Up to 3.17 a flex of dimension 2
stretches with a quarter of its modulus: do not run it there.
Units: cm, kg, s; so force cN, pressure and modulus mbar, volume ml.
Mesh: {len(mesh.rest)} nodes, {triangles} triangles, rings of {actuator.sectors} nodes: not mesh
converged. Node i is the body n<i>. It stands flat, where the film is free of stress; the key
"{START}" is where runs start.
Pressure is not in this file: inflate.py puts it on the cavities that actuator.json lists.
Not scaled: mass ({actuator.mass:.3g} kg), modulus and thickness are the film's. No damping is set,
but steps of {DT:g} s of an implicit integrator damp all that is faster: transients and settling
times mean nothing, only the state at rest.
Films of chambers that are told less than others touch: {contact}.
Not in it: gravity, inlet tabs and strips. Not validated by a measurement."""


def _number(value: float) -> str:
    """Format with nine digits, and no minus before a zero."""
    return f"{value + 0.0:.9g}"


def _lengths(values: Iterable[float] | Vector) -> str:
    return " ".join(_number(round(value / LENGTH, 9)) for value in values)


# The model of a design as files.


MODEL, DATA, PYTHON = "actuator.xml", "actuator.json", "inflate.py"
SECTORS = 16
"""Nodes per ring. Eight, as in SOFA's scenes, take a quarter of the time and rise 13 % less."""


def why_no_model(laminate: Laminate) -> str | None:
    """The reason why no model can be written for a laminate, or None."""
    return why_not_round(laminate)


def write_model(
    laminate: Laminate,
    folder: Path,
    pressures: Mapping[str, float] | None = None,
    sectors: int = SECTORS,
) -> list[Path]:
    """Writes the model, its cavities, and an example script; returns the files, the model first.

    ``pressures`` in kPa by chamber, 0 for omitted ones, or 5 kPa everywhere; ``sectors`` is the
    number of nodes per ring. Raises DesignError if the pockets are not round or a chamber is
    unknown.
    """
    coarse = actuator(laminate, pressures, sectors)
    if has_contact(coarse):
        # Films that fall far onto each other need many iterations.
        coarse = replace(coarse, start=nearly_flat)
    texts = {
        MODEL: model_text(coarse),
        DATA: json.dumps(_data(coarse), separators=(",", ":")) + "\n",
        PYTHON: files("sbafab.simulators.mujoco").joinpath("inflate.py.txt").read_text("utf-8"),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in texts]


def _data(coarse: CoarseActuator) -> dict[str, object]:
    mesh = coarse.mesh
    return {
        "schema": "sbafab/mujoco@1",
        "name": coarse.stack.name,
        "units": {"length": "mm", "mass": "kg", "time": "s", "pressure": "kPa", "volume": "ul"},
        "length": LENGTH,
        "start": START,
        "pressures": dict(coarse.pressures),
        "films": 2 * coarse.balloons * coarse.stack.film.thickness,
        "cavities": dict(mesh.cavities),
        "tip": mesh.tip,
        "roots": mesh.roots,
        "poles": mesh.poles,
    }
