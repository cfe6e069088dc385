"""Scripts of users: mypy reads the types here (``files`` in pyproject.toml), pytest the values."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, assert_type, cast, get_args, get_overloads, get_type_hints

import pytest

import sbafab
from sbafab.actuators.drawn import DrawnDesign
from sbafab.actuators.lobed import LobedDesign
from sbafab.actuators.one_dof import OneDofDesign
from sbafab.actuators.radial import RadialDesign
from sbafab.api.designs import load
from sbafab.design.files import ASSEMBLY, read_toml, templates_folder


def test_a_template_has_the_keys_of_its_family() -> None:
    assert assert_type(sbafab.load("1dof-5mm"), OneDofDesign).chamber.diameter == 5
    assert assert_type(sbafab.load("3dof-15mm"), LobedDesign).chamber.count == 3
    assert assert_type(sbafab.load("radial-15mm"), RadialDesign).tube.outer_diameter == 15
    assert assert_type(sbafab.load("pouch"), DrawnDesign).layers
    lobed = sbafab.load("3dof-15mm", "stack.balloons=6")
    assert assert_type(sbafab.load(lobed, stack={"balloons": 5}), LobedDesign).stack.balloons == 5


def test_a_file_has_them_by_a_cast(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    path.write_text(sbafab.template("3dof-15mm"), encoding="utf-8")
    design = assert_type(sbafab.load(path), sbafab.Design)
    assert cast(LobedDesign, design).chamber.count == 3


def test_every_template_of_a_family_is_named() -> None:
    """The names that ``load`` knows, with the record that it says they have."""
    named: dict[str, type] = {}
    for signature in get_overloads(load):
        hints = get_type_hints(signature, localns=globals())
        if getattr(hints["source"], "__origin__", None) is Literal:
            named |= dict.fromkeys(get_args(hints["source"]), hints["return"])
    shipped = [
        name
        for name in sbafab.templates()
        if read_toml(templates_folder() / f"{name}.toml")["family"] != ASSEMBLY
    ]
    assert named == {name: type(sbafab.load(name)) for name in shipped}


def test_records_at_the_top_are_those_that_functions_take_and_return() -> None:
    stack = sbafab.stack("1dof-5mm", most_pressure=20)
    assert isinstance(sbafab.build("1dof-5mm"), sbafab.Laminate)
    assert isinstance(sbafab.check("1dof-5mm"), sbafab.Findings)
    assert sbafab.StackBatch(stack).poses([(5,), (10,)]).tips.shape == (2, 3)
    with pytest.raises(sbafab.DesignError, match=r"stack\.balloons = 0"):
        sbafab.load("1dof-5mm", "stack.balloons=0")
