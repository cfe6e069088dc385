"""Keys that a family does not use: refused by name at every door, and written in no file."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

import sbafab
from sbafab.actuators import FAMILIES, load_design, schema
from sbafab.design.files import templates_folder
from sbafab.design.records import Design, Free, design_toml, dotted, plain_tables
from sbafab.errors import DesignError
from tests.designs import drawn, tables

TEMPLATES = {"1dof": "1dof-5mm", "lobed": "3dof-15mm", "radial": "radial-15mm", "drawn": "pouch"}
EVERY = {
    key: value
    for key, value in dotted(load_design("1dof-5mm").model_dump(mode="json"))
    if key.partition(".")[0] in Design.model_fields and "." in key
}
"""The keys of the sections that all families share."""
UNUSED = [
    (family, key) for family in TEMPLATES for key in EVERY if not FAMILIES[family].record.uses(key)
]


@pytest.mark.parametrize(("family", "key"), UNUSED)
def test_each_is_refused_by_name(family: str, key: str, tmp_path: Path) -> None:
    """Whatever it says, its default too."""
    value = EVERY[key]
    section, name = key.split(".")
    words = rf"^{key} is a key that family {family} does not use; remove it"
    design = load_design(TEMPLATES[family])
    with pytest.raises(DesignError, match=words):
        design.with_({section: {name: value}})
    with pytest.raises(DesignError, match=words):
        load_design(TEMPLATES[family], [f"{key}={value if isinstance(value, float) else 'x'}"])
    with pytest.raises(DesignError, match=words):
        drawn(tmp_path, {**tables(TEMPLATES[family]), section: {name: 1}})


def test_sweeps_and_searches_refuse_them(tmp_path: Path) -> None:
    words = r"bond\.width is a key that family drawn does not use"
    with pytest.raises(DesignError, match=words):
        sbafab.sweep("pouch", vary=["bond.width=0.8,0.9"], out=tmp_path)
    with pytest.raises(DesignError, match=words):
        sbafab.find("pouch", least={"mass": 0}, free=[Free("bond.width", 0.7, 0.9, 0.1)])


@pytest.mark.parametrize("family", TEMPLATES)
def test_what_is_written_has_none_and_loads(family: str, tmp_path: Path) -> None:
    design = load_design(TEMPLATES[family]).placed(templates_folder())
    written: dict[str, Any] = tomllib.loads(design_toml(design))
    record = FAMILIES[family].record
    assert all(record.uses(key) for key, _ in dotted(written))
    assert all(record.uses(key) for key, _ in dotted(plain_tables(design)))
    file = tmp_path / "design.toml"
    file.write_text(design_toml(design), encoding="utf-8")
    assert plain_tables(load_design(file)).keys() == plain_tables(design).keys()
    sections = schema()["$defs"][record.__name__]["properties"]
    assert all(record.uses(key) for key in sections)
