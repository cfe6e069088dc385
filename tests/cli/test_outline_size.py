"""The size that was understood of a drawn outline is printed, and kept with what is written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sbafab.cli import main

SAID = "drawn outline: 8.000 x 8.000 mm, read at 1 mm a unit"
PAGE = 'xmlns="http://www.w3.org/2000/svg" width="40mm" height="40mm" viewBox="-20 -20 40 40"'


@pytest.fixture
def design(tmp_path: Path) -> list[str]:
    """Arguments that give a small design a drawn outline."""
    path = tmp_path / "pocket.svg"
    path.write_text(f'<svg {PAGE}><circle r="4"/></svg>')
    return ["1dof-5mm", "--set", "stack.balloons=1", "--set", f"chamber.outline={path}"]


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    out, err = capsys.readouterr()
    assert not ended.value.code, err
    return " ".join(out.split())


def test_generate_says_the_size(
    design: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert f"note {SAID}" in run(["generate", *design, "-o", str(out)], capsys)
    folder = out / "1dof-5mm"
    before = (folder / "manifest.json").read_text()
    assert json.loads(before)["notes"] == [SAID]
    assert SAID in (folder / "preview" / "layers.svg").read_text()
    # The folder's own design gives the same bytes, though its drawing has another name there.
    again = ["generate", str(folder / "design.toml"), "-o", str(tmp_path / "again"), "--json"]
    assert json.loads(run(again, capsys))["notes"] == [SAID]
    assert (tmp_path / "again" / "1dof-5mm" / "manifest.json").read_text() == before


def test_check_says_the_size(design: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert f"note: {SAID}" in run(["check", *design], capsys)
    assert json.loads(run(["check", *design, "--json"], capsys))["notes"] == [SAID]
