"""What a newcomer meets: a screenful, errors for programs, hints, completion, quiet."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete

import sbafab
from sbafab.actuators import records
from sbafab.api.explained import design_keys
from sbafab.assemblies.checks import CHECKS
from sbafab.assemblies.records import Assembly
from sbafab.cli import app
from sbafab.cli.show import limit_text
from sbafab.design.files import key_paths, rule_names
from sbafab.models.figures import FLAGS
from sbafab.rules.deck import EXPLAINED
from sbafab.rules.finding import Finding, Place
from tests.cli.conftest import Run

SILENT = {"nets"}
"""Rules that say nothing of a design without the keys that they read."""


def test_check_fits_a_screen_and_sums_up_last(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = run("check", "3dof-15mm")
    assert code == 0
    lines = out.splitlines()
    assert len(lines) <= len(rule_names()) + 8
    assert max(map(len, lines)) <= 80
    rules = [rule for rule in rule_names() if rule not in SILENT]
    for rule in rules:
        assert sum(line.startswith(f"{rule} ") for line in lines) == 1, rule
    assert "registration-worst-case: align layers 2 to 3 in step 2 with care" in out
    count = len(rules)
    assert lines[-1] == f"3dof-15mm passed: {count} rules, 1 warning. Details: -v"
    _, out, _ = run("check", "3dof-15mm", "--set", "mask.overhang=0.3")
    assert max(map(len, out.splitlines())) <= 80
    _, said, _ = run("check", "3dof-15mm", "-v")
    assert "largest contribution" in " ".join(said.split())
    assert max(map(len, said.splitlines())) <= 80


def test_limits_say_whether_they_are_the_least_or_the_most(
    run: Run,
) -> None:
    faulty = ["--set", "mask.overhang=0.3", "--set", "press.platen_width=19"]
    senses: dict[tuple[str, str], bool] = {}
    for source, *more in (("3dof-15mm",), ("3dof-15mm", *faulty), ("brace",)):
        _, out, _ = run("check", source, *more, "--json")
        for one in json.loads(out)["findings"]:
            if one["verdict"] not in ("pass", "fail") or None in (one["limit"], one["measured"]):
                continue
            assert one["rule"] in {*rule_names(), *CHECKS}
            finding = Finding(one["rule"], "pass", one["limit"], None, "", Place(), "")
            is_most = limit_text(finding).startswith("<= ")
            good = one["verdict"] == "pass"
            off = one["measured"] - one["limit"]
            assert abs(off) <= 1e-3 or (off < 0) == (good == is_most), one
            senses[one["rule"], one["verdict"]] = is_most
    # Both senses, held and broken.
    assert senses["mask-overhang", "fail"] is False
    assert senses["press-fit", "fail"] is True
    assert {sense for (_, verdict), sense in senses.items() if verdict == "pass"} == {False, True}


def test_shares_say_what_they_are_of(run: Run) -> None:
    few = ["1dof-5mm", "--set", "stack.balloons=1", "--set", "rules.yield_builds=100"]
    few += ["--set", "registration.method=ears"]
    _, out, _ = run("check", *few)
    assert re.search(r"^pin-fit +pass +[\d.]+% stretch  <= 30% stretch$", out, re.MULTILINE)
    assert re.search(r"^registration-yield +pass +[\d.]+% hold +no target$", out, re.MULTILINE)
    _, out, _ = run("check", *few, "--set", "rules.target_yield=0.5")
    assert re.search(r"^registration-yield +pass +[\d.]+% hold +>= 50% hold$", out, re.MULTILINE)


def test_the_module_is_the_command() -> None:
    """Where pip's folder of scripts is not on the path, as on many a Windows machine."""
    ended = subprocess.run(
        [sys.executable, "-m", "sbafab", "check", "1dof-6mm"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 2
    assert ended.stderr.startswith("sbafab: '1dof-6mm' is neither a template nor a design file")


def test_a_file_without_its_ending_is_guessed(run: Run, tmp_path: Path) -> None:
    (tmp_path / "colon.toml").write_text('family = "1dof"\n')
    code, _, err = run("generate", "colon")
    assert code == 2
    assert err.endswith("did you mean colon.toml?\n")


def test_every_rule_and_check_is_explained(run: Run) -> None:
    assert set(EXPLAINED) > {*CHECKS, "file-integrity", "manifest-claims", "as-designed"}
    code, out, _ = run("explain", "mask-overhang")
    assert code == 0
    assert "rules.mask_overhang" in out
    code, out, _ = run("explain")
    assert [line.split()[0] for line in out.splitlines()] == list(EXPLAINED)
    known = {key for record in (*records().values(), Assembly) for key in key_paths(record)}
    assert {key for one in EXPLAINED.values() for key in one.keys} - known == set()


def test_flags_and_factors_are_explained_in_two_sentences(
    run: Run,
) -> None:
    for term in (*FLAGS, "calibration", "press-factor", "press_factor"):
        code, out, _ = run("explain", term, "--json")
        assert code == 0
        assert len(re.findall(r"\.(?: |$)", json.loads(out)["meaning"])) == 2, term
    _, out, _ = run("explain", "calibration")
    assert "models.calibration" in out


def test_every_key_and_quantity_is_explained(run: Run) -> None:
    _, out, _ = run("explain", "chamber.diameter")
    assert "mm from 0.001 to 1000" in out
    assert "1dof, lobed" in out
    _, out, _ = run("explain", "chamber", "--json")
    listed = {row["key"]: row for row in json.loads(out)["keys"]}
    assert listed["chamber.diameter"]["default"] == "5.0"
    _, out, _ = run("explain", "force")
    assert "blocked" in out
    told = [(family, row.key) for row in design_keys() for family in row.families]
    for family, record in records().items():
        keys = {key for of, key in told if of == family}
        for path in filter(record.uses, key_paths(record)):
            assert path in keys or any(key.startswith(f"{path}.") for key in keys), path
    assert [row.key for row in design_keys() if not row.meaning] == []


def completed(arguments: list[str], typed: str) -> list[str]:
    shell = ShellComplete(app, {}, "sbafab", "_SBAFAB_COMPLETE")
    return [str(item.value) for item in shell.get_completions(arguments, typed)]


def test_shells_complete_templates_keys_and_rules() -> None:
    assert completed([], "sim") == ["simulate"]
    assert set(completed(["check"], "3d")) >= {"3dof-15mm"}
    assert set(completed(["new"], "")) >= {"kit", "coupon", "brace"}
    assert completed(["explain"], "seal") == ["sealing"]
    assert completed(["generate", "1dof-5mm", "--waive"], "bond") == ["bond-width"]
    assert "chamber.diameter=" in completed(["check", "1dof-5mm", "--set"], "chamber.")
    methods = completed(["check", "1dof-5mm", "--set"], "registration.method=")
    assert methods == [f"registration.method={name}" for name in ("channel-pin", "ears")]


def test_a_shell_gets_its_script() -> None:
    script = subprocess.run(
        [sys.executable, "-c", "from sbafab.entry import main; main()"],
        env={"_SBAFAB_COMPLETE": "zsh_source", "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    assert "compdef" in script.stdout


def test_known_keys_are_those_that_a_file_may_hold(tmp_path: Path, run: Run) -> None:
    kit = tmp_path / "mine.toml"
    kit.write_text('schema = "sbafab/kit@1"\nname = "mine"\nversion = "1"\nfoo = "bar"\n')
    code, _, err = run("check", "1dof-5mm", "--set", f"kit={kit}")
    assert code == 2
    known = err.partition("known here: ")[2].strip().split(", ")
    assert "schema" in known
    assert "schema_name" not in known


def test_mesh_formats_are_called_as_they_are_written() -> None:
    """The version of Gmsh's format, wherever it is named, is the one in the files' first lines."""
    root = Path(__file__).parents[2]
    writer = (root / "sbafab/meshing/formats.py").read_text(encoding="utf-8")
    version = re.findall(r"MeshFormat.n(\d\.\d)", writer)[0]
    places = [*root.glob("docs/*.md"), *root.glob("docs/scripts/*.py"), root / "README.md"]
    named = [
        found
        for place in places
        for found in re.findall(r"(?:MSH|Gmsh) (\d\.\d)", place.read_text(encoding="utf-8"))
    ]
    assert named
    assert set(named) == {version}


QUICK = ["--set", "stack.balloons=2", "--set", "rules.yield_builds=100"]


@pytest.mark.parametrize(
    ("arguments", "written"),
    [
        (["generate", "1dof-5mm", *QUICK], "out/1dof-5mm"),
        (["nest", "1dof-5mm", "1dof-10mm", *QUICK], "out/job"),
        (["predict", "pouch"], "out/pouch"),
        (["simulate", "1dof-5mm", "--with", "sofa", "--export", *QUICK], "out/1dof-5mm/sofa"),
        (["find", "1dof-5mm", "--max", "mass=1", "--tries", "4"], "found.toml"),
        (["import", "out/1dof-5mm/laminate.json", "--to", "again.toml"], "again.toml"),
        (["compare", "pouch", "pouch", "-o", "cmp"], "cmp/compare"),
        (["picture", "pouch"], "pouch-flat.png"),
        (["check", "1dof-5mm", *QUICK], ""),
    ],
)
def test_quiet_prints_the_folder_alone(arguments: list[str], written: str, run: Run) -> None:
    if arguments[0] == "import":
        sbafab.generate("1dof-5mm", *QUICK[1::2])
    code, out, err = run(*arguments, "-q")
    assert (code, out, err) == (0, f"{written}\n" if written else "", "")
    assert Path(written).exists()


def test_quiet_prints_errors_and_results_for_programs(tmp_path: Path, run: Run) -> None:
    narrow = [*QUICK, "--set", "bond.width=0.7"]
    code, out, err = run("check", "1dof-5mm", *narrow, "-q")
    assert (code, out) == (1, "")
    assert err.startswith("sbafab: 1dof-5mm failed: bond-width")
    assert err.count("\n") == 1
    code, out, err = run("generate", "1dof-5mm", *narrow, "-q", "-o", str(tmp_path))
    assert (code, out) == (1, f"{tmp_path / '1dof-5mm'}\n")
    assert err.startswith("sbafab: 1dof-5mm failed: bond-width")
    code, out, err = run("check", "1dof-5mm", *narrow, "-q", "--json")
    assert (code, err) == (1, "")
    assert not json.loads(out)["summary"]["holds"]
    code, out, err = run("map", "1dof-5mm", "--points", "2", "-q")
    assert (code, err) == (0, "")
    assert out.startswith("balloon,pressure_kpa")
    assert run("check", "nosuch", "-q")[0] == 2
