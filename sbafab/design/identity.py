"""Identity of a design: its hashes, and its kit with the deviations from it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from typing import Any

from sbafab.design.files import FITS, override
from sbafab.design.films import UNCALIBRATED
from sbafab.design.kits import Kit, load_kit
from sbafab.design.records import Design, dotted, with_unused, without_none
from sbafab.design.sections import Models
from sbafab.laminate.films import Film


def design_sha256(design: Design) -> str:
    """Return the hash of all inputs of the output, with the contents of named files."""
    return tables_sha256(_with_files(with_unused(design), design) | {"kit": kit_of(design).sha256})


def actuator_sha256(design: Design) -> str:
    """Return the hash of an actuator of the design, regardless of quantity and tools.

    It includes shapes, the films' kind, product and thickness, tube and adhesive, registration and
    bonding of films, and whether a kerf is compensated: uncompensated parts are narrower. It
    excludes name, kit, order, sheets, rules, tolerances, tools, and the width of the kerf.
    """
    table = _with_files(with_unused(design), design)
    for section in NO_ACTUATOR:
        table.pop(section, None)
    films = _films(design)
    table["layup"] = {role: films.get(name) for role, name in table["layup"].items()}
    table["bore"] = {"diameter": design.bore.diameter}
    method = design.registration.method
    table["registration"] = [
        method,
        *(getattr(design.registration, key) for key in PINNED if method != "channel-pin"),
        *(("middle-first",) if design.registration.is_middle_first else ()),
    ]
    table["press"] = [getattr(design.press, key) for key in BONDED]
    return tables_sha256(table)


NO_ACTUATOR = (
    *("name", "kit", "films", "laser", "sheets", "order", "rules", "models", "acceptance"),
    "seam_tools",
    FITS,
)
"""Sections that do not change the actuator; for films and laser, the layup decides what counts."""


PINNED = ("pin_diameter", "pin_clearance", "full_bond_pins")
BONDED = (
    *("temperature_c", "pressure_kpa", "platen_width", "platen_length", "flash_bottom_minutes"),
    *("bond_bottom_minutes", "flash_middle_minutes", "bond_all_minutes"),
)


def _films(design: Design) -> dict[str, list[object]]:
    """Return films by table name: kind, product, thickness, and True if the kerf is measured."""
    kerfs = {name: film.kerf for name, film in design.films.by_name.items()}
    kerfs |= {"tpe": design.laser.kerf_tpe, "ptfe": design.laser.kerf_ptfe}
    return {
        name: [film.kind, film.product, film.thickness, kerfs[name] != UNCALIBRATED]
        for name, film in design.films.stock.items()
    }


def _with_files(table: dict[str, Any], design: Design) -> dict[str, Any]:
    """The table with file contents in place of the paths of drawn outlines and calibration."""
    files = dict(design.drawings)
    calibration = design.folder / design.models.calibration
    if design.models != Models() and calibration.is_file():
        files["models.calibration"] = calibration
    contents = {key: hashlib.sha256(file.read_bytes()).hexdigest() for key, file in files.items()}
    return override(table, [contents])


def tables_sha256(table: Any) -> str:
    """Return the hash of tables, regardless of the order of their keys."""
    text = json.dumps(table, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


OTHER_TUBE = "tubing of your choice"
"""Name of a tube whose name means another size in the kit."""


def kit_of(design: Design) -> Kit:
    """Return the kit that a design names. Raises DesignError."""
    return load_kit(design.kit, design.folder)


def departures(design: Design) -> list[str]:
    """Return the dotted keys that a design sets differently from its kit."""
    kit = kit_of(design)
    tubes, adhesives = kit.record.tubes, kit.record.adhesives
    values, usual = with_unused(design), without_none(kit.record.model_dump(mode="json"))
    keys = [key for key, _ in dotted(kit.tables) if _at(values, key) != _at(usual, key)]
    tube = tubes.get(design.inlet.tube)
    if tubes and tube is None:
        keys.append("inlet.tube")
    elif tube is not None and tube.outer_diameter != design.inlet.tube_outer_diameter:
        keys.append("inlet.tube_outer_diameter")
    if adhesives and design.inlet.adhesive not in adhesives:
        keys.append("inlet.adhesive")
    return keys


def tube_name(design: Design) -> str:
    """Return the design's tubing, unless the kit has a tube of that name with another size."""
    tube = kit_of(design).record.tubes.get(design.inlet.tube)
    if tube is not None and tube.outer_diameter != design.inlet.tube_outer_diameter:
        return OTHER_TUBE
    return design.inlet.tube


def adhesive_for(design: Design, films: Iterable[Film]) -> str | None:
    """Return the adhesive that bonds tubes to these films; None if it is the kit's and they are not
    listed.

    An adhesive outside the kit is the designer's choice.
    """
    adhesive = kit_of(design).record.adhesives.get(design.inlet.adhesive)
    if adhesive is None or all(film.product in adhesive.bonds for film in films):
        return design.inlet.adhesive
    return None


def cure_hours(design: Design) -> float | None:
    """Return the cure time in hours of the tubes' adhesive: the order's, the kit's, else None."""
    if design.order.cure_hours is not None:
        return design.order.cure_hours
    adhesive = kit_of(design).record.adhesives.get(design.inlet.adhesive)
    return None if adhesive is None else adhesive.cure_hours


def _at(table: Any, key: str) -> object:
    for part in key.split("."):
        table = table.get(part) if isinstance(table, dict) else None
    return table


def citation(design: Design) -> dict[str, Any]:
    """Return the kit's entry in manifest and checks: name, version, hash, departures."""
    kit = kit_of(design)
    return {
        "name": kit.record.name,
        "version": kit.record.version,
        "sha256": kit.sha256,
        "departures": departures(design),
    }


def cited(design: Design) -> str:
    """Return the kit's name, version and hash as text."""
    kit = kit_of(design)
    return f"kit {kit.record.name}, version {kit.record.version} (sha256 {kit.sha256[:12]})"
