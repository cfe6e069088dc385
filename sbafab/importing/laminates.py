"""Import laminates as designs of drawn layers, from an output folder or a ``laminate.json``.

Shapes refer to patterns of the ``laminate.json`` beside the design, so no edge changes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from sbafab.actuators import load_design
from sbafab.actuators.drawn import DRAWN, DrawnDesign
from sbafab.design.files import ASSEMBLY, checked, kit_names, listed, name_of, read_toml
from sbafab.design.films import FILM_NAME, HOTTEST, Films, OtherFilm, PtfeFilm, TpeFilm
from sbafab.design.laminate_file import FILE, laminate_json, read_laminate
from sbafab.design.outline import OUTLINE, seam_layer
from sbafab.design.polylines import is_closed
from sbafab.design.records import Design, plain_tables, without_kit, without_none
from sbafab.design.sections import Inlet as Inlets
from sbafab.design.toml_table import Section
from sbafab.errors import DesignError
from sbafab.geometry.edges import Edge, Line, Point, unit
from sbafab.importing.records import UNNAMED, Imported, key_name
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Chamber, Laminate

DESIGN = "design.toml"
OF_A_RUN = ("must not be built; failed:", "waived:", "limits lowered:")
"""Notes that come from a run's findings; a new run adds them again."""
NO_GLUE = "not stated"
OF_FAMILIES = frozenset({"chamber", "stack"})
"""Sections that families extend, or that drawn layers do not have."""


def import_folder(folder: Path) -> Imported:
    """Return the design of drawn layers for an output folder with a ``laminate.json``.

    Films, press, laser, rules and the other sections common to all families come from its
    ``design.toml``. Raises DesignError.
    """
    data = read_toml(folder / DESIGN)
    if data.get("family") == ASSEMBLY:
        parts = sorted(path.parent.name for path in folder.glob(f"*/{DESIGN}"))
        hint = f"import one of its designs: {listed(parts)} in {folder}"
        raise DesignError(f"{folder} holds an assembly, but drawn layers form one laminate; {hint}")
    laminate = read_laminate(_beside(folder))
    design = load_design(folder / DESIGN)
    tables = _shared_tables(design, laminate)
    drawings: dict[str, bytes] = {}
    if design.kit not in kit_names():
        drawings["kit.toml"] = (folder / design.kit).read_bytes()
        tables["kit"] = "kit.toml"
    calibration = folder / design.models.calibration
    if calibration.is_file():
        drawings["calibration.toml"] = calibration.read_bytes()
        tables["models"] = {**tables.get("models", {}), "calibration": "calibration.toml"}
    wrap = design.form.wrap
    tube = None if wrap is None else wrap.model_dump()
    remarks = []
    if isinstance(design, DrawnDesign) and design.mechanism is not None:
        tables["mechanism"] = plain_tables(design)["mechanism"]
    if design.family != DRAWN:
        remarks = [
            f"family {design.family}: its keys are not carried over, its layers as built are",
            "predictions: stroke, force and bending have no model of drawn layers",
        ]
    return _drawn(laminate, tables, design.films.stock, tube, drawings, remarks)


def import_laminate(path: Path) -> Imported:
    """Return the design of drawn layers for a ``laminate.json``. Raises DesignError.

    Press, laser, rules and sheets are not in the file and keep their defaults.
    """
    laminate = read_laminate(path)
    remarks: list[str] = []
    films, names = _film_tables(laminate, remarks)
    try:
        stock = checked(Films, films, {}, "films.").stock
    except DesignError as error:
        raise DesignError(f"{path.name} has a film that is invalid in a design: {error}") from None
    for film in dict.fromkeys(layer.film for layer in laminate.layers):
        if stock[names[film.material]].shade != film.shade:
            # Films of no layer still count when the other films get their colours.
            remarks.append(f"film {film.material}: has another colour in pictures")
    tubes = [inlet.tube_diameter for inlet in laminate.inlets]
    tubes += [port.tube_diameter for port in laminate.ports if port.tube_diameter is not None]
    tube = None
    if laminate.tube is not None:
        tube = {"outer_diameter": laminate.tube, "pitch": _pitch(laminate), "glue": NO_GLUE}
        remarks.append("tube.glue: a laminate.json does not say what holds the sheet; write it")
    keys = ("faces", "by", "temperature_c", "after")
    bonds = {bond.name: {key: getattr(bond, key) for key in keys} for bond in laminate.bonds}
    tables = {
        "name": name_of(laminate.name) or UNNAMED,
        "family": DRAWN,
        "kit": "paper",
        "films": films or None,
        "layup": _layup(laminate, names),
        "bore": {"diameter": laminate.bores[0].diameter} if laminate.bores else None,
        "inlet": {"tube_outer_diameter": tubes[0]} if tubes else None,
        "face_bonds": bonds or None,
        "registration": {
            "method": laminate.registration,
            "full_bond_pins": "in" if laminate.pins_in_full_bonds else None,
            "sequence": "middle-first" if laminate.middle_first else None,
        },
    }
    return _drawn(laminate, without_none(tables), stock, tube, {}, remarks)


def _beside(folder: Path) -> Path:
    path = folder / FILE
    if not path.is_file():
        raise DesignError(
            f"{folder} has no {FILE}, which this version writes in every run; generate it again"
        )
    return path


def _shared_tables(design: Design, laminate: Laminate) -> dict[str, Any]:
    """Return sections common to all families, if they differ from the kit and the defaults."""
    rest = without_kit(plain_tables(design), design)
    shared = {
        key: rest[key]
        for key in Design.model_fields
        if key in rest and key not in OF_FAMILIES and rest[key] != {}
    }
    if "films" in shared:
        # Another product does not share the defaults, so its table is written in full.
        shared["films"] = {name: plain_tables(design)["films"][name] for name in shared["films"]}
    if "inlet" in shared:
        shared["inlet"] = {k: v for k, v in shared["inlet"].items() if k in Inlets.model_fields}
    return {**shared, "name": laminate.name, "family": DRAWN, "kit": design.kit}


def _drawn(
    laminate: Laminate,
    tables: Mapping[str, Any],
    stock: Mapping[str, Film],
    tube: dict[str, Any] | None,
    drawings: dict[str, bytes],
    remarks: list[str],
) -> Imported:
    """Add the laminate, as keys of drawn layers, to ``tables``."""
    shapes = {pattern.lower(): {"file": FILE, "layer": pattern} for pattern in laminate.patterns}
    design = dict(tables)
    design["layers"] = list(_layer_rows(laminate, stock, design.get("layup", {})))
    design["chambers"] = [_chamber_row(laminate, chamber) for chamber in laminate.chambers]
    if not laminate.outline.is_empty:
        design["body"] = OUTLINE
        shapes[OUTLINE] = {"file": FILE, "layer": OUTLINE}
    _add_joints(laminate, design, shapes, remarks)
    pins = [
        {"name": p.name, "at": [*p.centre], "diameter": p.diameter, "clearance": p.clearance}
        for p in laminate.pins
    ]
    notes = [note for note in laminate.notes if not note.startswith(OF_A_RUN)]
    design |= {"pins": pins, "shapes": shapes}
    others = {"lumen": laminate.lumen, "notes": notes or None, "tube": tube}
    text = laminate_json(laminate).encode()
    return Imported(design | without_none(others), {FILE: text, **drawings}, tuple(remarks))


def _layer_rows(
    laminate: Laminate, stock: Mapping[str, Film], layup: Mapping[str, str]
) -> Iterator[dict[str, Any]]:
    folded = {fold.upper for fold in laminate.folds}
    for layer in laminate.layers:
        usual = layup.get(layer.role.replace("-", "_"), "ptfe" if layer.is_mask else "tpe")
        table = layer.film.material.lower()
        row = {
            "role": layer.role,
            "shape": layer.pattern.lower(),
            "film": table if table in stock and usual != table else None,
            "pieces": layer.pieces if layer.pieces != 1 else None,
            "turned": True if layer.turned and layer.index not in folded else None,
        }
        yield without_none(row)


def _chamber_row(laminate: Laminate, chamber: Chamber) -> dict[str, Any]:
    inlets = [inlet for inlet in laminate.inlets if inlet.chamber == chamber.name]
    if len(inlets) != 1:
        raise DesignError(
            f"chamber {chamber.name} has {len(inlets)} inlets, but a chamber of drawn layers has "
            "one; give each inlet a chamber, or join them"
        )
    (inlet,) = inlets
    row = {
        "name": chamber.name,
        "centres": [[*centre] for centre in chamber.centres],
        "mouth": [*inlet.mouth],
        "angle": angle_of(inlet.direction),
        "width": inlet.width,
        "length": inlet.length,
    }
    return row | ({"balloons": [*chamber.balloons]} if chamber.balloons else {})


def _add_joints(
    laminate: Laminate, design: dict[str, Any], shapes: dict[str, Any], remarks: list[str]
) -> None:
    """Add seams, folds, ports and nets to a design's tables, and the seams' paths to its shapes."""
    seams = []
    for seam in sorted(laminate.seams, key=lambda seam: seam.order):
        row: dict[str, Any] = {"name": seam.name, "layers": [seam.below, seam.above]}
        if all(is_closed(chain) for chain in seam.path):
            row["shape"] = key_name(seam_layer(seam.name), shapes)
            shapes[row["shape"]] = {"file": FILE, "layer": seam_layer(seam.name)}
        elif len(seam.path) == 1:
            row["path"] = _corners(seam.path[0])
        else:
            remarks.append(f"seam {seam.name}: it has several open paths, and is left out; draw it")
            continue
        seams.append(row | {"width": seam.width, "tool": seam.tool, "kind": seam.kind})
    folds = [
        {"layers": [fold.lower, fold.upper], "line": [[*end] for end in fold.line]}
        for fold in laminate.folds
    ]
    ports = [
        {"name": p.name, "layers": [p.below, p.above], "at": [*p.at], "kind": p.kind}
        for p in laminate.ports
    ]
    nets = {net.name: [*net.ports] for net in laminate.nets}
    for key, rows in (("seams", seams), ("folds", folds), ("ports", ports), ("nets", nets)):
        if rows:
            design[key] = rows


def _corners(chain: Sequence[Edge]) -> list[list[float]]:
    """Return the corners of an open chain: x, y, and the bulge of an arc to the next corner."""
    corners = [
        [*edge.start] if isinstance(edge, Line) else [*edge.start, edge.bulge] for edge in chain
    ]
    return [*corners, [*chain[-1].end]]


def angle_of(direction: Point) -> float:
    """Return the angle in degrees from x of a unit vector, reproducible to the last bit."""
    plain = math.degrees(math.atan2(direction[1], direction[0]))
    candidates = [round(plain, 9), plain]
    low = high = plain
    for _ in range(8):
        low, high = math.nextafter(low, -math.inf), math.nextafter(high, math.inf)
        candidates += [low, high]
    for angle in candidates:
        for turned in (angle, angle + 360, angle - 360):
            if abs(turned) <= 360 and unit(turned) == direction:
                return turned
    return plain


def _pitch(laminate: Laminate) -> float:
    """The distance between stacks along the sheet, or around the whole tube for one stack."""
    centres = sorted(centre for chamber in laminate.chambers for centre in chamber.centres)
    if len(centres) > 1:
        return centres[1][0] - centres[0][0]
    return math.pi * (laminate.tube or 0.0)


# Films of a laminate.json as tables of a design.


def _film_tables(
    laminate: Laminate, remarks: list[str]
) -> tuple[dict[str, dict[str, Any]], dict[str, str]]:
    """Return the tables of films other than the paper's, and each material's table."""
    usual = Films().stock
    tables: dict[str, dict[str, Any]] = {}
    names: dict[str, str] = {}
    for film in dict.fromkeys(layer.film for layer in laminate.layers):
        name = film.material.lower()
        if not re.fullmatch(FILM_NAME, name):
            name = key_name(name, names.values(), "film").replace("-", "")[:16]
            remarks.append(f"film {film.material}: named {name.upper()} here")
        names[film.material] = name
        if usual.get(name) != film:
            tables[name] = _film_table(name, film)
    return tables, names


def _film_table(name: str, film: Film) -> dict[str, Any]:
    records: dict[str, type[Section]] = {"tpe": TpeFilm, "ptfe": PtfeFilm}
    modulus, poisson = film.elastic or (None, None)
    upper, lower = film.faces or (None, None)
    keys = {
        "kind": film.kind,
        "product": film.product,
        "thickness": film.thickness,
        "density": film.density,
        "melting_point": None if film.is_mask else film.softens_above,
        "temperature_limit": film.limit if film.is_mask or film.limit != HOTTEST else None,
        "modulus": modulus,
        "poisson": poisson,
        "faces": {"upper": upper, "lower": lower} if film.faces else None,
        "warning": film.warning or None,
    }
    record = records.get(name, OtherFilm)
    return without_none({key: keys[key] for key in keys if key in record.model_fields})


def _layup(laminate: Laminate, names: Mapping[str, str]) -> dict[str, str]:
    """Return the film of each role's first layer, unless it is the default."""
    layup: dict[str, str] = {}
    for layer in laminate.layers:
        layup.setdefault(layer.role.replace("-", "_"), names[layer.film.material])
    usual = {role: "ptfe" if role.endswith("mask") else "tpe" for role in layup}
    return {role: film for role, film in layup.items() if film != usual[role]}
