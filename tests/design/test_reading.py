"""Design files in: every kind of bad input is one sentence that names field and remedy."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sbafab.actuators import build, load_design
from sbafab.design.files import (
    ASSEMBLY,
    read_toml,
    template_names,
    template_summaries,
    templates_folder,
    write_new,
)
from sbafab.design.identity import design_sha256
from sbafab.design.records import design_toml, resolved
from sbafab.design.units import millimetres
from sbafab.errors import DesignError

DESIGNS = [
    name
    for name in template_names()
    if read_toml(templates_folder() / f"{name}.toml")["family"] != ASSEMBLY
]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (0.75, 0.75),
        (3, 3.0),
        ("0.75 mm", 0.75),
        ("38um", 0.038),
        ("6 in", 152.4),
        ('6"', 152.4),
        ("1 mil", 0.0254),
    ],
)
def test_lengths(text: object, expected: float) -> None:
    assert millimetres(text) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("text", ["", "five", "5 furlong", "1,5", "nan", True, None, [5]])
def test_not_a_length(text: object) -> None:
    with pytest.raises(ValueError, match="must be a length such as"):
        millimetres(text)


@pytest.mark.parametrize(
    ("assignment", "says"),
    [("chamber.diameter.x=5", "is a value, not a table"), ("chamber", "is not KEY=VALUE")],
)
def test_what_sets_no_key_is_refused(assignment: str, says: str) -> None:
    with pytest.raises(DesignError, match=says):
        load_design("3dof-15mm", [assignment])


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"a = [", "is not valid TOML"),
        (b"[tab]\nlength = 5\nlength = 6", "(at end of document), 'length = 6'"),
        (b"length = 5\nlength = 6\n\n", "(at line 2, column 11), 'length = 6'"),
        (b"[lumen]\ndiameter = 3 mm", 'a value with a unit stands in quotes: "3 mm"'),
        (b"\xff\xfe", "UTF-8"),
        (b"", "family is missing"),
        (b"a = " + b"[" * 5000, "is not valid TOML"),
        (b"#" * 1_100_000, "at most 1,000,000"),
        (b'family = "lobed"\nname = ""', "name = ''"),
    ],
)
def test_bad_files_are_one_sentence(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "design.toml"
    path.write_bytes(content)
    with pytest.raises(DesignError, match=re.escape(says)):
        load_design(path)


def test_unknown_sources(tmp_path: Path) -> None:
    with pytest.raises(DesignError, match="did you mean 3dof-15mm"):
        load_design("3dof-15")
    with pytest.raises(DesignError, match="is a folder"):
        load_design(tmp_path)
    with pytest.raises(DesignError, match="neither a template nor a design file"):
        load_design("a\0b")


@pytest.mark.parametrize("name", DESIGNS)
def test_resolved_design_reads_back_as_the_same(name: str, tmp_path: Path) -> None:
    design = load_design(name)
    path = tmp_path / "design.toml"
    path.write_text(design_toml(design), encoding="utf-8")
    again = load_design(path)
    assert resolved(again) == resolved(design)
    assert design_sha256(again) == design_sha256(design)


def test_every_template_builds_and_says_what_it_is() -> None:
    assert {"1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm"} <= set(template_summaries())
    assert all(len(summary) > 20 for summary in template_summaries().values())
    for name in DESIGNS:
        assert build(load_design(name)).name == name


def test_new_writes_a_design_that_builds_and_never_overwrites(tmp_path: Path) -> None:
    path = tmp_path / "my gripper.toml"
    write_new("3dof-15mm", path)
    assert load_design(path).name == "my-gripper"
    with pytest.raises(DesignError, match="exists"):
        write_new("3dof-15mm", path)
    with pytest.raises(DesignError, match="did you mean 1dof-5mm"):
        write_new("1dof-5", tmp_path / "x.toml")
    with pytest.raises(DesignError, match="cannot be written"):
        write_new("1dof-5mm", tmp_path / "nowhere" / "x.toml")
