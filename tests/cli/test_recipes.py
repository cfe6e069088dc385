"""Recipes of a kit: power and speed in LightBurn's project, and faulty ones by name."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from tests.cli.conftest import Run

RECIPE = """
[[laser.recipe]]
film = "Stretchlon 200"
thickness_mm = 0.038
machine = "K40"
power_percent = 30
speed_mm_s = 20
kerf_mm = 0.15
source = "material test of day one"
"""


def test_a_recipe_of_the_kit_is_in_the_project_of_its_film(run: Run) -> None:
    assert run("new", "kit", "lab.toml")[0] == 0
    kit = Path("lab.toml")
    kit.write_text(kit.read_text() + RECIPE)

    few = ["1dof-5mm", "--set", "stack.balloons=2", "--set", "kit=lab.toml"]
    assert run("cut", *few, "--set", "laser.machine=K40")[0] == 0
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
    assert run("check", "out/1dof-5mm")[0] == 0
    # Without the machine's name no recipe counts.
    assert run("cut", *few)[0] == 0
    text = Path("out/1dof-5mm/sheets/TPE_1.lbrn2").read_text()
    assert 'maxPower Value="30"' not in text
    assert "Powers are 0" in text

    kit.write_text(kit.read_text() + RECIPE)
    code, _, err = run("check", *few)
    assert code == 2
    assert "two recipes to cut Stretchlon 200 of 0.038 mm on K40; keep one" in err


def test_a_faulty_recipe_of_a_kit_is_named(run: Run) -> None:
    assert run("new", "kit", "lab.toml")[0] == 0
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
        code, _, err = run("check", "1dof-5mm", "--set", "kit=lab.toml")
        assert code == 2, err
        assert says in err
