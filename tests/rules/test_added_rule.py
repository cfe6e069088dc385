"""A rule that an installed package adds is a rule like ours; what docs/plugins.md shows works."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

from tests.actuators.test_added_family import installed, sbafab_runs

PAGE = Path(__file__).parents[2] / "docs" / "plugins.md"
SMALL = ("--set", "stack.balloons=2", "--set", "rules.yield_builds=100")
CHECK = ("check", "1dof-5mm", *SMALL)


def blocks() -> dict[str, str]:
    """Return the files of the page by their captions."""
    text = PAGE.read_text(encoding="utf-8")
    found = re.findall(r"^```\{code-block\} \w+\n:caption: (\S+)\n\n(.*?)^```$", text, re.M | re.S)
    return dict(found)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder on the path with the package of the page, as pip would lay it out."""
    files = blocks()
    groups = tomllib.loads(files["pyproject.toml"])["project"]["entry-points"]
    site = installed(tmp_path_factory.mktemp("site"), files["lab_sba.py"], groups, "lab_sba")
    (site / "lab_files.py").write_text(files["lab_files.py"])
    return site


def test_the_rule_of_the_page_is_one_of_the_deck(site: Path, tmp_path: Path) -> None:
    """A chamber of 5 mm makes a laminate of 12.5 mm with its tab, and one of 40 mm one of 47.5."""
    wide = (*SMALL, "--set", "chamber.diameter=40", "--set", "name=wide")
    runs = sbafab_runs(
        site,
        tmp_path,
        (*CHECK, "--json"),
        ("check", "1dof-5mm", *wide, "--json"),
        ("generate", "1dof-5mm", *wide, "--json"),
        ("check", "1dof-5mm", *wide, "--waive", "bed-size", "--json"),
        ("check", "1dof-5mm", *wide, "--set", 'rules.waive=["bed-size"]', "--json"),
        ("check", "1dof-5mm", *wide),
        ("explain", "bed-size"),
        ("schema",),
    )
    documents = [json.loads(run.stdout) for run in runs[:5]]
    found = [
        next(row for row in document["findings"] if row["rule"] == "bed-size")
        for document in documents
    ]
    assert [row["verdict"] for row in found] == ["pass", "fail", "fail", "waived", "waived"]
    assert (found[0]["measured"], found[0]["limit"], found[0]["unit"]) == (12.5, 30, "mm")
    assert documents[0]["findings"][-1]["rule"] == "bed-size", "last of the deck"
    assert not list(tmp_path.rglob("*.dxf"))
    assert re.search(r"^bed-size +fail +47\.500 mm +<= 30\.000 mm$", runs[5].stdout, re.M)
    assert runs[6].returncode == 0
    assert '"bed-size"' in runs[7].stdout


@pytest.mark.long
def test_rows_of_a_sweep_know_which_packages_measured_them(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One more rule, or another version of it, and the design is measured again."""
    sweep = ("sweep", "1dof-5mm", *SMALL, "--vary", "stack.balloons=2", "--workers", "1", "--json")
    record = site / "lab_sba-1.0.dist-info" / "METADATA"
    monkeypatch.setenv("PYTHONPATH", str(site))
    (first,) = sbafab_runs(site, tmp_path, sweep)
    (again,) = sbafab_runs(site, tmp_path, sweep)
    text = record.read_text()
    record.write_text(text.replace("Version: 1.0", "Version: 1.1"))
    (other,) = sbafab_runs(site, tmp_path, sweep)
    record.write_text(text)
    assert [json.loads(run.stdout)["measured_now"] for run in (first, again, other)] == [1, 0, 1]


def test_the_family_of_the_page_makes_an_actuator(site: Path, tmp_path: Path) -> None:
    (tmp_path / "soft.toml").write_text(
        'name = "soft"\nfamily = "lab-1dof"\n[stack]\nballoons = 2\n'
    )
    (run,) = sbafab_runs(site, tmp_path, ("check", "soft.toml", *SMALL, "--json"))
    assert json.loads(run.stdout)["summary"]["holds"]


def test_formats_files_and_simulators_of_the_page_work(site: Path, tmp_path: Path) -> None:
    generate = ("generate", "1dof-5mm", *SMALL, "--set", "bore.diameter=1")
    drawings = tmp_path / "lab-1"
    drawings.mkdir()
    runs = sbafab_runs(
        site,
        tmp_path,
        generate,
        ("check", "out/1dof-5mm"),
        ("simulate", "1dof-5mm", "--with", "lab-solver", "--export", *generate[2:]),
        ("mesh", "--help"),
        ("import", "lab-1"),
        ("simulate", "1dof-5mm", "--with", "lab-solved"),
    )
    assert [run.returncode for run in runs] == [0, 0, 0, 0, 2, 2], runs
    folder = tmp_path / "out" / "1dof-5mm"
    assert (folder / "label.txt").read_text() == "1dof-5mm\n"
    assert "label.txt" in json.loads((folder / "manifest.json").read_text())["files"]
    assert (folder / "lab-solver" / "model.txt").read_text() == "7 layers\n"
    assert "xyz" in runs[3].stdout
    # Ours reads such a folder; it is empty.
    assert "layers.csv" in runs[4].stderr
    assert "lab-solver" in runs[5].stderr


RULE = """
from sbafab.rules.finding import Finding, Place
from sbafab.rules.rule import Explanation, Rule

def check(measures):
    return [Finding("mine", "pass", None, None, "", Place(), "")]

RULE = Rule({name!r}, check, Explanation("", "", ""))
"""


@pytest.mark.parametrize(
    ("module", "names", "reason"),
    [
        (
            "1 / 0",
            ("mine",),
            "rule mine of the installed package broken cannot be loaded (division",
        ),
        ("RULE = 3", ("mine",), "(broken:RULE is not a Rule); repair or uninstall that package"),
        ("x = 3", ("mine",), "has no attribute 'RULE'"),
        (RULE.format(name="other"), ("mine",), "names itself other"),
        (RULE.format(name="sealing"), ("sealing",), "rule sealing already exists; uninstall"),
    ],
)
def test_a_rule_that_cannot_be_loaded_passes_no_design(
    module: str, names: tuple[str, ...], reason: str, tmp_path: Path
) -> None:
    groups = {"sbafab.rules": dict.fromkeys(names, "broken:RULE")}
    site = installed(tmp_path, module, groups, "broken")
    for run in sbafab_runs(site, tmp_path, CHECK, ("generate", "1dof-5mm", *SMALL)):
        assert (run.returncode, run.stdout) == (2, "")
        assert reason in run.stderr
        assert run.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_waived_rule_of_a_package_that_is_not_installed_is_named(tmp_path: Path) -> None:
    waive = ("--set", 'rules.waive=["bed-size"]')
    (run,) = sbafab_runs(tmp_path, tmp_path, (*CHECK, *waive))
    assert run.returncode == 2
    assert "rules.waive.0 = 'bed-size' must be the name of a rule" in run.stderr
