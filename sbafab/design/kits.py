"""Kits: a lab's films, tubes, press, laser and limits, in one file with a source for every number.

A kit gives a design every key of films, layup, registration, press, acceptance, laser, sheets and
rules that the design omits, and the tube and adhesive of its inlets.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from sbafab.design.files import (
    KITS,
    checked,
    is_file,
    kit_names,
    listed,
    read_toml,
    shown,
    templates_folder,
    write_copy,
)
from sbafab.design.films import FaceBondings, Films, LayerFilms, without_other_products
from sbafab.design.sections import (
    MINUTES,
    Acceptance,
    Laser,
    Models,
    Press,
    Registration,
    Rules,
    SeamTools,
    Sheets,
)
from sbafab.design.toml_table import NAME_PATTERN, Section, writable
from sbafab.design.units import Length, is_measured
from sbafab.errors import DesignError
from sbafab.laminate.films import PAPER_PRODUCT, PAPER_THICKNESS

DEFAULT = "paper"
SCHEMA = "sbafab/kit@1"
FILE = "kit.toml"
"""A kit's copy in the output folder of a design."""
VALUE, SOURCE = "value", "source"
SECTIONS = (
    *("films", "layup", "face_bonds", "registration", "seam_tools", "press", "acceptance"),
    *("laser", "sheets", "rules", "models"),
)
"""Sections of a design that a kit fills in."""
OF_A_DESIGN = (
    "registration.method",
    "acceptance.working_pressure_kpa",
    "rules.waive",
    "rules.target_yield",
    "rules.yield_builds",
)
"""Keys of these sections that a kit must not set."""
TEXTS = ("product", "use", "warning", "plate_material", "release_film", "fitting", "machine")
"""Keys that never count as numbers."""
BONDS = "bonds"
"""The films that an adhesive bonds, which need a source as numbers do."""
Product = Annotated[str, Field(min_length=1, max_length=120)]


class Tube(Section):
    """Supply tubing."""

    outer_diameter: Length
    """Outer diameter."""
    inner_diameter: Length | None = None
    """Inner diameter."""


class Adhesive(Section):
    """Adhesive that seals an inlet."""

    use: str = Field(default="", max_length=400)
    """Instructions for use."""
    bonds: Annotated[tuple[Product, ...], Field(max_length=50, strict=False)] = ()
    """Products of the films that it bonds. Where tubes are glued to any other, the traveller leaves
    a blank."""
    cure_hours: float | None = Field(default=None, gt=0, le=1000)
    """Hours until it holds, on the traveller and in a batch's plan."""


class KitFile(Section):
    """All tables of a kit's file, without sources."""

    schema_name: Literal["sbafab/kit@1"] = Field(alias="schema")
    name: str = Field(pattern=NAME_PATTERN)
    version: str = Field(min_length=1, max_length=40)
    about: str = Field(default="", max_length=400)
    films: Films = Films.model_construct()
    layup: LayerFilms = LayerFilms.model_construct()
    face_bonds: FaceBondings | None = None
    registration: Registration = Registration.model_construct()
    seam_tools: SeamTools | None = None
    press: Press = Press.model_construct()
    acceptance: Acceptance = Acceptance.model_construct()
    laser: Laser = Laser.model_construct()
    sheets: Sheets = Sheets.model_construct()
    rules: Rules = Rules.model_construct()
    models: Models = Models.model_construct()
    tubes: dict[Product, Tube] = Field(default_factory=dict)
    adhesives: dict[Product, Adhesive] = Field(default_factory=dict)


@dataclass(frozen=True)
class Kit:
    """A loaded kit.

    ``tables`` holds its sections with plain values; ``sha256`` is the hash of all tables, and
    ``text`` the unchanged file.
    """

    record: KitFile
    tables: Mapping[str, Any]
    sha256: str
    text: bytes


def kit_path(kit: object, folder: Path) -> Path:
    """Return the file of the kit named by a design in ``folder``. Raises DesignError."""
    if not isinstance(kit, str):
        raise DesignError(f"kit = {shown(kit)} must be a quoted text: the name or file of a kit")
    try:
        writable(kit)
    except ValueError as error:
        raise DesignError(f"kit = {shown(kit)} {error}") from None
    if kit in kit_names():
        return templates_folder() / KITS / f"{kit}.toml"
    path = folder / kit
    if not is_file(path):
        raise DesignError(
            f"kit = {shown(kit)} is neither a bundled kit ({', '.join(kit_names())}) nor a file "
            "beside the design; sbafab new kit writes a first one"
        )
    return path


def read_kit(path: Path) -> Kit:
    """Return the kit in a file. Raises DesignError with one sentence if the file is invalid."""
    tables = read_toml(path)
    plain = _without_sources(tables, "", path)
    for key in OF_A_DESIGN:
        section, _, name = key.partition(".")
        table = plain.get(section)
        if isinstance(table, dict) and name in table:
            raise DesignError(f"{path}: {key} belongs in a design, not in a kit; remove it")
    try:
        record = checked(KitFile, plain, {}, file="kit")
    except DesignError as error:
        raise DesignError(f"{path}: {error}") from None
    _complete_press(plain.get("press", {}), record.press, path)
    text = json.dumps(tables, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    sha256 = hashlib.sha256(text.encode()).hexdigest()
    return Kit(
        record, {key: plain[key] for key in SECTIONS if key in plain}, sha256, path.read_bytes()
    )


def _complete_press(table: dict[str, Any], press: Press, path: Path) -> None:
    """Add to a kit's table the minutes that it omits, as unknown, if it names a film other than the
    paper's, whose values do not apply to it. Raises DesignError if the temperature or pressure for
    those minutes is missing.
    """
    films = [film for film in press.timed_films if film != (PAPER_PRODUCT, PAPER_THICKNESS)]
    for key in ("temperature_c", "pressure_kpa") if films else ():
        if key not in table:
            raise DesignError(
                f"{path}: press.minutes_for names {films[0][0]}, but press.{key} is missing; "
                "state the value for its minutes"
            )
    table.update({key: None for key in MINUTES if films and key not in table})


_shipped = cache(read_kit)


def load_kit(kit: object, folder: Path) -> Kit:
    path = kit_path(kit, folder)
    return _shipped(path) if kit in kit_names() else read_kit(path)


def _without_sources(table: Mapping[str, Any], prefix: str, path: Path) -> dict[str, Any]:
    """Return tables of plain values. Raises DesignError for a number or bond without a source."""
    plain: dict[str, Any] = {}
    for key, value in table.items():
        where = f"{prefix}{key}"
        if isinstance(value, dict) and (VALUE in value or SOURCE in value):
            source = value.get(SOURCE)
            if set(value) != {VALUE, SOURCE} or not isinstance(source, str) or not source.strip():
                raise DesignError(
                    f'{path}: {where} must be {{ value = ..., source = "where it is from" }} and '
                    "nothing else"
                )
            plain[key] = value[VALUE]
        elif isinstance(value, dict):
            plain[key] = _without_sources(value, f"{where}.", path)
        elif prefix and (key == BONDS or (key not in TEXTS and _is_number(value))):
            raise DesignError(
                f"{path}: {where} = {shown(value)} has no source; write {where} = {{ value = "
                f'{shown(value)}, source = "where it is from" }}'
            )
        else:
            plain[key] = value
    return plain


def _is_number(value: object) -> bool:
    """Return True if a value is a number, a number with a unit, or a list that contains one."""
    if isinstance(value, list):
        return any(map(_is_number, value))
    if isinstance(value, str):
        return is_measured(value)
    return isinstance(value, int | float) and not isinstance(value, bool)


def under_kit(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return a design's tables with the kit's values for every key that the design lacks.

    Raises DesignError if the kit is missing or faulty, or lacks the tube.
    """
    kit = load_kit(data.get("kit", DEFAULT), folder)
    filled = {**data}
    for section, kit_table in kit.tables.items():
        design_table = data.get(section, {})
        is_of_films = section == "films" and isinstance(design_table, dict)
        table = without_other_products(kit_table, design_table) if is_of_films else kit_table
        if section == "models":
            table = _from_folder(table, kit_path(data.get("kit", DEFAULT), folder).parent, folder)
        # A value that is not a table is refused later, with its own message.
        filled[section] = (
            _merged(table, design_table) if isinstance(design_table, dict) else design_table
        )
    inlet = data.get("inlet", {})
    if isinstance(inlet, dict):
        filled["inlet"] = {**inlet_of_kit(kit, inlet, "kit" in data), **inlet}
    return filled


def _from_folder(table: Mapping[str, Any], kit_folder: Path, folder: Path) -> Mapping[str, Any]:
    """Return the table, with the path of a calibration beside the kit relative to the design's."""
    name = table.get("calibration")
    if not isinstance(name, str) or not (kit_folder / name).is_file():
        return table
    return {**table, "calibration": os.path.relpath(kit_folder / name, folder or ".")}


def _merged(table: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table with all ``overrides`` applied, table by table."""
    merged = {**table, **overrides}
    for key, value in overrides.items():
        if isinstance(value, dict) and isinstance(table.get(key), dict):
            merged[key] = _merged(table[key], value)
    return merged


def inlet_of_kit(kit: Kit, inlet: Mapping[str, Any], is_named: bool) -> dict[str, Any]:
    """Return the kit's first adhesive, and its first tube or the one named by the inlet."""
    tubes, adhesives = kit.record.tubes, kit.record.adhesives
    values = {"adhesive": next(iter(adhesives))} if adhesives else {}
    if not tubes:
        return values
    name = inlet.get("tube", next(iter(tubes)))
    if isinstance(name, str) and name in tubes:
        return {**values, "tube": name, "tube_outer_diameter": tubes[name].outer_diameter}
    if is_named and "tube_outer_diameter" not in inlet:
        raise DesignError(
            f"inlet.tube = {shown(name)} is not in kit {kit.record.name} ({listed(tubes)}); use "
            "one of those, add it to the kit, or give inlet.tube_outer_diameter"
        )
    return values


def write_kit(file: Path) -> Path:
    """Copy the paper's kit, named after the new file. Raises DesignError if it exists."""
    return write_copy(templates_folder() / KITS / f"{DEFAULT}.toml", file)
