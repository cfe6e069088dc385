"""Assembly files: what is refused is refused in one sentence that names the field."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sbafab.actuators import load_design
from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.files import load, load_assembly
from sbafab.design.records import Design
from sbafab.errors import DesignError

Together = Callable[[dict[str, Any]], Assembled]
Tables = Callable[[str], dict[str, Any]]


def put(data: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    *tables, key = path.split(".")
    table = data
    for name in tables:
        table = table.setdefault(name, {})
    if value is None:
        del table[key]
    else:
        table[key] = value
    return data


FAULTS: list[tuple[dict[str, Any], str]] = [
    ({"parts": {}}, "add [parts.NAME]"),
    ({"parts.arm": 3}, "parts.arm = 3 must be a table"),
    ({"parts.arm.kind": None}, "parts.arm.kind is missing"),
    ({"parts.arm.kind": "sbaa"}, "did you mean sba?"),
    ({"parts.arm.desgin": "x"}, "parts.arm.desgin is not a key"),
    ({"parts.arm.design": "3dof-15"}, "parts.arm: .*did you mean 3dof-15mm?"),
    ({"parts.arm.design": "own.toml"}, "own.toml' is neither a template"),
    ({"parts.arm.design": "standing"}, "parts.arm: design = 'standing' is an assembly; use"),
    ({"parts.arm.set": {"bond": {"widht": 1}}}, "parts.arm: .*did you mean bond.width"),
    ({"parts.arm.set": {"bore": {"diameter": 9}}}, "parts.arm: bore.diameter"),
    ({"parts.arm.on": "tubs"}, "parts.arm.on = 'tubs' .*did you mean tube?"),
    ({"parts.arm.at": None}, "parts.arm.at is missing; .*start"),
    ({"parts.arm.at": "top"}, 'parts.arm.at = "top"; .*"start", "end", "outside"'),
    ({"parts.arm.at": "botom"}, "parts.arm.at = 'botom' must be"),
    ({"parts.arm.at": "lumen"}, "is fixed on a tube at one of"),
    ({"parts.cup.on": "vacuum"}, "no cup can be fixed on a line"),
    ({"parts.tube.at": "end"}, "needs parts.tube.on"),
    ({"parts.arm.on": None, "parts.arm.at": None}, '"tube", "arm" have no key on'),
    ({"parts.tube.on": "arm", "parts.tube.at": "top"}, '"tube", "arm" are fixed on each other'),
    ({"parts.arm.on": "arm", "parts.arm.at": "top"}, '"arm" hangs on itself'),
    ({"rules": {"waive": ["bond"]}}, "there are tube-match, .*bond-width"),
    ({"parts.tube.inner_diameter": 15}, "parts.tube must have an inner_diameter smaller"),
    ({"parts.tube.length": "long"}, "parts.tube.length = 'long' must be a length"),
    ({"parts.tube.length": -4}, "parts.tube.length = -4 must be"),
    ({"parts.grip.turn": 90}, "parts.grip.turn = 90 .*must be 0 or 180"),
    ({"parts.grip.at": "end"}, "parts.grip is a radial design; wrap it around a tube"),
    ({"parts.cup.on": "grip"}, "which is bent around a tube and has no flat face"),
    ({"parts.cup.bore": 4.5}, "parts.cup must have a neck at least as wide as"),
    ({"parts.arm.design": "1dof-5mm"}, "which has no lumen"),
    ({"parts.vacuum.at": "inlet", "parts.vacuum.chamber": "x"}, "has no inlet in arm"),
    ({"deploy.lumen": 3}, "deploy.lumen is not a key"),
    ({"rules.waive": ["seats"]}, "rules.waive"),
    ({"name": "../x"}, "name = '../x' must be"),
    ({"sheets": {"tpe": {"width": -1}}}, "sheets.tpe.width = -1"),
    ({"parts.1x": {"kind": "tube"}}, "parts.1x = '1x' must be 1 to 32 letters"),
    ({f"parts.{'a' * 33}": {"kind": "tube"}}, "must be 1 to 32 letters"),
]


@pytest.mark.parametrize(("changes", "message"), FAULTS, ids=lambda value: str(value)[:50])
def test_what_is_wrong_is_said_in_one_sentence(
    changes: dict[str, Any], message: str, tables: Tables, put_together: Together
) -> None:
    data = tables("brace")
    for path, value in changes.items():
        put(data, path, value)
    pattern = message.replace("[", r"\[").replace("?", r"\?")
    with pytest.raises(DesignError, match=pattern) as caught:
        put_together(data)
    assert "\n" not in str(caught.value)


def test_an_assembly_without_an_actuator_is_refused(put_together: Together) -> None:
    data = {"name": "x", "family": "assembly", "parts": {"tube": {"kind": "tube"}}}
    with pytest.raises(DesignError, match='add a part of kind = "sba"'):
        put_together(data)


def test_a_design_is_no_assembly_and_the_other_way_round() -> None:
    with pytest.raises(DesignError, match="is not an assembly"):
        load_assembly("3dof-15mm")
    with pytest.raises(DesignError, match="'brace' is an assembly of several designs"):
        load_design("brace")
    assert isinstance(load("3dof-15mm"), Design)


def test_keys_are_set_by_assignment_and_in_tables() -> None:
    whole = load_assembly("brace", ["parts.arm.set.stack.balloons=4", "parts.tube.length=5 cm"])
    assembled = assemble(whole)
    arm = assembled["arm"].made
    assert arm is not None
    assert arm.laminate.balloons == 4
    assert assembled["tube"].height == 50


def test_a_part_may_be_a_design_file_beside_the_assembly(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('family = "1dof"\nstack.balloons = 2\n', encoding="utf-8")
    whole = tmp_path / "mine.toml"
    whole.write_text(
        'family = "assembly"\n[parts.a]\nkind = "sba"\ndesign = "own.toml"\n', encoding="utf-8"
    )
    assembled = assemble(load_assembly(whole))
    assert assembled.assembly.name == "mine"
    assert [design.design.name for design in assembled.designs] == ["own"]


def test_a_typed_path_starts_where_the_user_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own.toml").write_text('family = "1dof"\nstack.balloons = 2\n', encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assembled = assemble(load_assembly("aperture", ["parts.arm.design=own.toml"]))
    assert [design.design.name for design in assembled.designs] == ["own"]


def test_equal_parts_share_a_design_and_others_get_names_of_their_own() -> None:
    standing = assemble(load_assembly("standing", ["order.copies=2"]))
    assert [(d.design.name, d.design.order.copies) for d in standing.designs] == [("3dof-15mm", 6)]
    mixed = assemble(load_assembly("standing", ["parts.head.set.stack.balloons=5"]))
    names = {d.design.name: (d.parts, d.design.order.copies) for d in mixed.designs}
    assert names == {"3dof-15mm-left": (("left", "right"), 2), "3dof-15mm-head": (("head",), 1)}


def test_machine_and_films_of_the_assembly_count_for_every_part() -> None:
    assembled = assemble(load_assembly("brace", ["sheets.tpe.width=300", "laser.kerf_tpe=0.1"]))
    assert [design.design.sheets.tpe.width for design in assembled.designs] == [300, 300]
    assert [design.design.laser.kerf_tpe for design in assembled.designs] == [0.1, 0.1]
    assert {design.design.sheets.tpe.length for design in assembled.designs} == {152.4}


def test_a_waived_rule_of_the_deck_reaches_the_designs() -> None:
    assembled = assemble(load_assembly("brace", (), ["tube-fit", "seat"]))
    assert [design.design.rules.waive for design in assembled.designs] == [
        ("tube-fit",),
        ("tube-fit",),
    ]
