"""Designs out: resolved TOML, design hash, JSON schema."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from sbafab.design.films import UNCALIBRATED, LayerFilms
from sbafab.design.order import Order
from sbafab.design.records import Design, Inlet, Press, Registration

FITS = "fits"
LATER: Mapping[str, Sequence[str]] = {
    "order": ("success_rate", "certainty", "shift_hours"),
    "laser": ("hold_tpe", "hold_ptfe"),
    "panel": ("carrier_adhesive", "carrier_limit_c"),
}
"""Keys that came after the first hashes, which have none of them."""
FIRST_SPARES = 2
"""What ``order.spares`` was by default, of masks alone; today's default keeps its hash."""


def resolved(design: Design) -> dict[str, Any]:
    """The design with every default written out, as plain TOML values."""
    return _tables(design.completed())


def plain_tables(design: Design) -> dict[str, Any]:
    """The design as tables of a TOML file, defaults that depend on other values left open."""
    tables = _tables(design)
    if design.is_solved:
        del tables["chamber"]["diameter"]
    return tables


def _tables(design: Design) -> dict[str, Any]:
    tables = _without_none(design.model_dump(mode="json"))
    if not tables.get(FITS):
        # Nothing is asked for: an empty table would say nothing.
        tables.pop(FITS, None)
    return tables


def _without_none(table: dict[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, dict) else value
        for key, value in table.items()
        if value is not None
    }


def keys_of(design: Design) -> list[tuple[str, object, object]]:
    """Dotted key, value and default of every key, the default only where the value differs."""
    plain = type(design).model_validate({"name": design.name, "family": design.family})
    usual = dict(dotted(resolved(plain)))
    return [
        (key, value, usual.get(key) if usual.get(key) != value else None)
        for key, value in dotted(resolved(design))
    ]


def dotted(table: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Dotted key and value of every key of nested tables."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from dotted(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def design_toml(design: Design) -> str:
    """``design.toml`` of an output folder."""
    import tomli_w

    return tomli_w.dumps(resolved(design))


def _as_first_hashed(table: dict[str, Any], design: Design) -> dict[str, Any]:
    """The table with the kit's hash for its path, and without what came later and is not used.

    A design that says nothing of kit and layup keeps the hash that it had before there were any.
    """
    from sbafab.design.kits import DEFAULT, kit_of

    table["kit"] = kit_of(design).sha256 if design.kit != DEFAULT else None
    if design.layup == LayerFilms():
        table["layup"] = None
    if design.inlet.adhesive == Inlet().adhesive:
        table["inlet"]["adhesive"] = None
    _as_first_ordered(table, design)
    table["registration"]["pin_error"] = design.pin_error
    for name, key, usual in (
        ("registration", "plate_made_by", Registration().plate_made_by),
        ("press", "underlay_thickness", Press().underlay_thickness),
    ):
        if table[name][key] == usual:
            table[name][key] = None
    return _without_none(table)


def _as_first_ordered(table: dict[str, Any], design: Design) -> None:
    """Take out keys that came later and have their defaults, and what only allows a method."""
    table["registration"].pop("experimental")
    has_usual_spares = all(
        getattr(design.order, key) == getattr(Order(), key) for key in ("spares", "spare_share")
    )
    if has_usual_spares:
        table["order"] |= {"spares": FIRST_SPARES, "spare_share": None}
    for section, keys in LATER.items():
        asked = getattr(design, section)
        usual = type(asked)()
        for key in keys:
            if getattr(asked, key) == getattr(usual, key):
                table[section][key] = None


def design_sha256(design: Design) -> str:
    """Hash of all that decides the output; a drawn outline counts by its content, not its path."""
    return _sha256(_with_drawing(_as_first_hashed(resolved(design), design), design))


def actuator_sha256(design: Design) -> str:
    """Return the hash of what an actuator of the design is, however many are made, and on what.

    It counts shapes, the films' kind, product and thickness, tube and adhesive, how films are
    registered and bonded, and whether a kerf is compensated: uncompensated parts are narrower.
    Left out are name, kit, order, sheets, rules, tolerances, tools, and the kerf's width.
    """
    table = _with_drawing(resolved(design), design)
    for section in NO_ACTUATOR:
        table.pop(section, None)
    films = _films(design)
    table["layup"] = {role: films.get(name) for role, name in table["layup"].items()}
    table["bore"] = {"diameter": design.bore.diameter}
    method = design.registration.method
    table["registration"] = [
        method,
        *(getattr(design.registration, key) for key in PINNED if method != "channel-pin"),
    ]
    table["panel"] = [getattr(design.panel, key) for key in BRIDGED if method == "sheet"]
    table["press"] = [getattr(design.press, key) for key in BONDED]
    return _sha256(table)


NO_ACTUATOR = ("name", "kit", "films", "laser", "sheets", "order", "rules", FITS)
"""Sections that do not make another actuator; of films and laser the layup says what counts."""
PINNED = ("pin_diameter", "pin_clearance", "full_bond_pins")
BRIDGED = ("bridge_width", "stub", "tack_minutes")
BONDED = (
    *("temperature_c", "pressure_kpa", "platen_width", "platen_length", "flash_bottom_minutes"),
    *("bond_bottom_minutes", "flash_middle_minutes", "bond_all_minutes"),
)


def _films(design: Design) -> dict[str, list[object]]:
    """What a film is, by its table's name: kind, product, thickness, and if its kerf is known."""
    kerfs = {name: film.kerf for name, film in design.films.others.items()}
    kerfs |= {"tpe": design.laser.kerf_tpe, "ptfe": design.laser.kerf_ptfe}
    return {
        name: [film.kind, film.product, film.thickness, kerfs[name] != UNCALIBRATED]
        for name, film in design.films.stock.items()
    }


def _with_drawing(table: dict[str, Any], design: Design) -> dict[str, Any]:
    """The table with the drawn outline's content in place of its path."""
    if design.drawing is not None:
        table["chamber"]["outline"] = hashlib.sha256(design.drawing.read_bytes()).hexdigest()
    return table


def _sha256(table: dict[str, Any]) -> str:
    text = json.dumps(table, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()
