"""A family that an installed package adds in one file gets all that the families here have."""

from __future__ import annotations

import ast
import inspect
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

import sbafab
from sbafab.actuators import FAMILIES, one_dof
from sbafab.api.explained import design_keys
from sbafab.studio import forms

TWIN = (
    inspect.getsource(one_dof)
    .replace("OneDofDesign", "TwinDesign")
    .replace('Literal["1dof"]', 'Literal["twin"]')
    + "\n\nfrom sbafab.actuators import Family\n\nFAMILY = Family(TwinDesign, build)\n"
)
TWINS = ("1dof", "twin")
SMALL = "[stack]\nballoons = 2\n[rules]\nyield_builds = 100\n"
ASSEMBLY = """\
name = "standing"
family = "assembly"
[parts.base]
kind = "base"
width = 30
length = 30
thickness = 3
material = "acrylic"
[parts.arm]
kind = "sba"
design = "{design}"
on = "base"
at = "top"
"""


def installed(
    folder: Path,
    module: str = TWIN,
    groups: Mapping[str, Mapping[str, str]] | None = None,
    name: str = "twin",
) -> Path:
    """A folder on the path that holds a package as pip would lay it out: one module, with entry
    points by group.
    """
    (folder / f"{name}.py").write_text(module, encoding="utf-8")
    record = folder / f"{name}-1.0.dist-info"
    record.mkdir()
    (record / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = []
    for group, entries in (groups or {"sbafab.families": {"twin": "twin:FAMILY"}}).items():
        lines += [f"[{group}]", *(f"{entry} = {place}" for entry, place in entries.items())]
    (record / "entry_points.txt").write_text("\n".join(lines))
    return folder


# Runs several commands in one process, which imports the package once.
COMMANDS = """
import contextlib, io, json, sys
from sbafab.cli import main
ended = []
for arguments in json.loads(sys.argv[1]):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main(arguments)
        except SystemExit as ending:
            code = ending.code
    ended.append([code or 0, out.getvalue(), err.getvalue()])
print(json.dumps(ended))
"""


class Ended(NamedTuple):
    """How a command ended, and what it printed."""

    returncode: int
    stdout: str
    stderr: str


def sbafab_runs(site: Path, folder: Path, *commands: tuple[str, ...]) -> list[Ended]:
    root = Path(sbafab.__file__).parents[1]
    paths = [str(site), str(root), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    run = subprocess.run(
        [sys.executable, "-c", COMMANDS, json.dumps(commands)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        capture_output=True,
        text=True,
        check=True,
    )
    return [Ended(*ended) for ended in json.loads(run.stdout)]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return installed(tmp_path_factory.mktemp("site"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same design of both families, under one name."""
    folder = tmp_path_factory.mktemp("work")
    for family in TWINS:
        text = f'name = "small"\nfamily = "{family}"\n{SMALL}'
        (folder / f"{family}.toml").write_text(text)
        text = ASSEMBLY.format(design=f"./{family}.toml")
        (folder / f"{family}-standing.toml").write_text(text)
    return folder


def answers(site: Path, folder: Path, command: str, *options: str) -> list[str]:
    """What a command writes for the design of either family, its family's name aside."""
    commands = [(command, f"{family}.toml", *options) for family in TWINS]
    runs = sbafab_runs(site, folder, *commands)
    assert [run.returncode for run in runs] == [0, 0], [run.stderr for run in runs]
    return [run.stdout.replace('"twin"', '"1dof"') for run in runs]


def test_its_predictions_are_those_of_its_form(site: Path, folder: Path) -> None:
    plain, added = (
        json.loads(said)["figures"]
        for said in answers(site, folder, "predict", "--json", "--set", "models.calibration=none")
    )
    assert added == plain
    assert len(added) > 30


def test_it_gets_files_pages_and_decks_and_passes_as_built(site: Path, folder: Path) -> None:
    *runs, checked = sbafab_runs(
        site,
        folder,
        *(("generate", f"{family}.toml", "--decks", "-o", f"all-{family}") for family in TWINS),
        ("check", "all-twin/small"),
    )
    assert [run.returncode for run in runs] == [0, 0], [run.stderr for run in runs]
    plain, added = (
        {p.relative_to(top).as_posix() for p in top.rglob("*") if p.is_file()}
        for top in (folder / f"all-{family}" / "small" for family in TWINS)
    )
    assert added == plain
    assert added >= {"traveller.html", "press.json", "preview/stack.svg", "mesh/solid.stl"}
    assert checked.returncode == 0, checked.stdout


def test_assemblies_and_the_schema_know_it(site: Path, folder: Path) -> None:
    plain, added, schema = sbafab_runs(
        site,
        folder,
        *(("check", f"{family}-standing.toml", "--json") for family in TWINS),
        ("schema",),
    )
    assert plain.stdout == added.stdout != ""
    assert "TwinDesign" in schema.stdout
    # The studio's forms and what explain tells of keys follow from the schema.
    tables = json.loads(schema.stdout)
    assert forms.cards(tables)["twin"] == forms.cards(tables)["1dof"]
    assert forms.families(tables)["twin"] == forms.families(tables)["1dof"]
    assert all("twin" in row.families for row in design_keys(tables) if "1dof" in row.families)


def test_a_family_that_cannot_be_loaded_is_named(tmp_path: Path, folder: Path) -> None:
    broken = installed(tmp_path, "raise RuntimeError('no such film')\n")
    plain, run = sbafab_runs(broken, folder, ("check", "1dof.toml"), ("check", "twin.toml"))
    assert plain.returncode == 0
    assert run.returncode == 2
    assert "family twin of the installed package twin cannot be loaded (no such film)" in run.stderr
    assert "Traceback" not in run.stderr


TOP = Path(sbafab.__file__).parent


def modules_outside_the_families() -> list[Path]:
    package = [p for p in sorted(TOP.rglob("*.py")) if "actuators" not in p.relative_to(TOP).parts]
    beside = [TOP.parent / "docs", TOP.parent / "benchmarks"]
    return [*package, *(path for folder in beside for path in sorted(folder.rglob("*.py")))]


def test_no_page_of_the_studio_names_a_family() -> None:
    names = "|".join(map(re.escape, FAMILIES))
    # In quotes, as the key of an object, as an attribute, or as a design file would write it.
    named = re.compile(
        rf"""(["'`\\])({names})\1|[{{,]\s*({names})\s*:|(families|cards)\.({names})\b"""
        rf"""|family\W+({names})\b"""
    )
    static = TOP / "studio" / "static"
    pages = [p for p in static.rglob("*") if p.suffix in {".js", ".html", ".css"}]
    assert len(pages) > 30
    lines = [
        f"{path.name}:{number}: {line.strip()[:80]}"
        for path in pages
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if named.search(line)
    ]
    assert lines == []
    for line in ('family === "lobed"', "x = {radial: 1}", "families.drawn", 'family = \\"1dof\\"'):
        assert named.search(line), line


def test_no_room_but_actuators_asks_a_familys_name() -> None:
    own = {"one_dof", "lobed", "radial"}
    for path in modules_outside_the_families():
        text = path.read_text(encoding="utf-8")
        if not any(name in text for name in (*own, *FAMILIES)):
            continue
        # What a type checker alone reads decides nothing.
        tree = ast.parse(text)
        typed = [
            node
            for node in tree.body
            if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        ]
        for node in (node for top in tree.body if top not in typed for node in ast.walk(top)):
            said = node.value if isinstance(node, ast.Constant) else None
            assert said not in FAMILIES, f"{path.name}:{node.lineno} names the family {said}"
            if isinstance(node, ast.ImportFrom) and node.module:
                assert own.isdisjoint(node.module.split(".")), f"{path.name}:{node.lineno}"
                names = {alias.name for alias in node.names}
                assert node.module != "sbafab.actuators" or own.isdisjoint(names), path.name
