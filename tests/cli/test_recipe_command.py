"""``sbafab new testgrid`` and ``sbafab recipe``, from the empty grid to the power of a project."""

from __future__ import annotations

import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest

from sbafab.cli import main


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


@pytest.fixture
def table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Path:
    """A grid of the paper's film whose cell B2 cut through and A1 left a mark."""
    monkeypatch.chdir(tmp_path)
    asked = ["--machine", "K40", "--power", "10,30", "--speed", "20,80"]
    code, out, _ = run(["new", "testgrid", *asked], capsys)
    assert code == 0
    assert "4 squares" in out
    path = Path("testgrid/testgrid.csv")
    rows = [
        {"B2": f"{line[:-4]},yes,5,0.15,", "A1": f"{line[:-4]},no,,,"}.get(line[:2], line)
        for line in path.read_text().splitlines()
    ]
    path.write_text("\n".join(rows))
    return path


def test_a_recipe_of_the_kit_is_in_the_project_of_its_film(
    table: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["new", "kit", "lab.toml"], capsys)[0] == 0
    before = Path("lab.toml").read_text()
    code, out, _ = run(["recipe", str(table), "--kit", "lab.toml"], capsys)
    assert code == 0
    assert "Cell B2: 30 % at 20 mm/s, 1 pass" in out
    assert 'machine = "K40" under [laser]' in out
    kit = Path("lab.toml").read_text()
    assert kit.startswith(before.rstrip())
    [recipe] = tomllib.loads(kit)["laser"]["recipe"]
    assert (recipe["power_percent"], recipe["speed_mm_s"], recipe["kerf_mm"]) == (30, 20, 0.15)

    code, _, err = run(["recipe", str(table), "--kit", "lab.toml"], capsys)
    assert code == 2
    assert "lab.toml has a recipe to cut Stretchlon 200 of 0.038 mm on K40; remove it" in err
    assert Path("lab.toml").read_text() == kit

    few = ["1dof-5mm", "--set", "stack.balloons=2", "--set", "kit=lab.toml"]
    assert run(["cut", *few, "--set", "laser.machine=K40"], capsys)[0] == 0
    powers = {}
    for film in ("TPE", "PTFE"):
        root = ElementTree.parse(f"out/1dof-5mm/sheets/{film}_1.lbrn2").getroot()
        for item in root.iter("CutSetting"):
            values = {child.tag: child.get("Value") for child in item}
            layer = str(values["name"]).partition(":")[0]
            powers[film, layer] = values["maxPower"], values.get("speed")
        notes = root.find("Notes")
        assert notes is not None
        says = {
            "TPE": "To cut Stretchlon 200, 0.038 mm, on K40: 30 % at 20 mm/s, 1 pass, kerf 0.15",
            "PTFE": "no recipe to cut or engrave this film on K40: those powers are 0",
        }
        assert says[film] in notes.get("Notes", "")
    cut = {key for key, value in powers.items() if value == ("30", "20")}
    assert cut == {("TPE", "CUT_INNER"), ("TPE", "CUT_OUTER")}
    assert {value for key, value in powers.items() if key not in cut} == {("0", None)}
    assert run(["check", "out/1dof-5mm"], capsys)[0] == 0
    # Without the machine's name no recipe counts.
    assert run(["cut", *few], capsys)[0] == 0
    text = Path("out/1dof-5mm/sheets/TPE_1.lbrn2").read_text()
    assert 'maxPower Value="30"' not in text
    assert "Powers are 0" in text


def test_the_printed_recipe_can_be_pasted(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["recipe", str(table), "--operation", "engrave", "--cell", "A1"]
    code, out, _ = run([*arguments, "--date", "2026-05-12", "--source", "day one"], capsys)
    assert code == 0
    [recipe] = tomllib.loads(out[out.index("[[laser") :])["laser"]["recipe"]
    assert recipe == {
        "film": "Stretchlon 200",
        "thickness_mm": 0.038,
        "machine": "K40",
        "operation": "engrave",
        "power_percent": 10,
        "speed_mm_s": 80,
        "passes": 1,
        "source": "day one, cell A1",
        "date": "2026-05-12",
    }


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["new", "testgrid"], "testgrid needs --machine"),
        (["new", "kit", "--machine", "K40"], "--machine goes with testgrid only"),
        (["new", "testgrid", "--machine", "K", "--film", "TPU"], "--film needs --thickness"),
        (["new", "testgrid", "--machine", "K", "--power", "a"], "'a' must be numbers"),
        (["new", "testgrid", "--machine", "K", "--thickness", "2 m"], "must be at most 1 mm"),
        (["recipe", "none.csv"], "none.csv cannot be read"),
        (["recipe", "none.csv", "--date", "May"], "'May' is no date"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    arguments: list[str],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, err = run(arguments, capsys)
    assert code == 2
    assert says in err
    assert "Traceback" not in err
    assert not list(tmp_path.iterdir())


def test_a_faulty_recipe_of_a_kit_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "kit", "lab.toml"], capsys)[0] == 0
    whole = {
        "film": '"Stretchlon 200"',
        "thickness_mm": "0.038",
        "machine": '"K40"',
        "power_percent": "30",
        "speed_mm_s": "20",
        "source": '"grid"',
    }
    plain = Path("lab.toml").read_text()
    for key, value, says in (
        ("power_percent", "120", "power_percent"),
        ("speed_mm_s", "0", "speed_mm_s"),
        ("source", '" "', "has no source"),
        ("date", '"May"', "date"),
        ("kerf_mm", "3", "kerf_mm"),
        ("pasess", "2", "pasess"),
    ):
        table = "\n".join(f"{name} = {said}" for name, said in {**whole, key: value}.items())
        Path("lab.toml").write_text(f"{plain}\n[[laser.recipe]]\n{table}\n")
        code, _, err = run(["check", "1dof-5mm", "--set", "kit=lab.toml"], capsys)
        assert code == 2, err
        assert says in err
