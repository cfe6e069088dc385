"""What a newcomer meets: a screenful, errors for programs, hints, completion, watching."""

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
from sbafab.assemblies.checks import CHECKS
from sbafab.cli import COMMANDS, app, main
from sbafab.cli.check import file_states, watch_source
from sbafab.cli.explain import design_keys
from sbafab.cli.printing import limit_text
from sbafab.design.files import key_paths
from sbafab.models.figures import FLAGS
from sbafab.rules.deck import EXPLAINED, rule_names
from sbafab.rules.finding import Finding, Place


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


SILENT = {"nets"}
"""Rules that say nothing of a design without the keys that they read."""


def test_check_fits_a_screen_and_sums_up_last(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = run(["check", "3dof-15mm"], capsys)
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
    _, out, _ = run(["check", "3dof-15mm", "--set", "mask.overhang=0.3"], capsys)
    assert max(map(len, out.splitlines())) <= 80
    _, said, _ = run(["check", "3dof-15mm", "-v"], capsys)
    assert "largest contribution" in " ".join(said.split())
    assert max(map(len, said.splitlines())) <= 80


def test_limits_say_whether_they_are_the_least_or_the_most(
    capsys: pytest.CaptureFixture[str],
) -> None:
    faulty = ["--set", "mask.overhang=0.3", "--set", "press.platen_width=19"]
    senses: dict[tuple[str, str], bool] = {}
    for source, *more in (("3dof-15mm",), ("3dof-15mm", *faulty), ("brace",)):
        _, out, _ = run(["check", source, *more, "--json"], capsys)
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


def test_help_says_what_every_command_does_in_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(["--help"], capsys)
    assert "..." not in out.partition("Commands:")[2]


def test_shares_say_what_they_are_of(capsys: pytest.CaptureFixture[str]) -> None:
    few = ["1dof-5mm", "--set", "stack.balloons=1", "--set", "rules.yield_builds=100"]
    few += ["--set", "registration.method=ears"]
    _, out, _ = run(["check", *few], capsys)
    assert re.search(r"^pin-fit +pass +[\d.]+% stretch  <= 30% stretch$", out, re.MULTILINE)
    assert re.search(r"^registration-yield +pass +[\d.]+% hold +no target$", out, re.MULTILINE)
    _, out, _ = run(["check", *few, "--set", "rules.target_yield=0.5"], capsys)
    assert re.search(r"^registration-yield +pass +[\d.]+% hold +>= 50% hold$", out, re.MULTILINE)


def test_check_json_names_schema_design_and_summary(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["check", "1dof-5mm", "--set", "stack.balloons=1", "--json"]
    code, out, _ = run([*arguments, "--set", "mask.overhang=0.47"], capsys)
    found = json.loads(out)
    assert code == 1
    assert (found["schema"], found["design"]) == ("sbafab/checks@1", "1dof-5mm")
    failed = {f["rule"] for f in found["findings"] if f["verdict"] == "fail"}
    assert (found["summary"]["holds"], found["summary"]["fail"]) == (False, len(failed))


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


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("registration", "did you mean registration-yield or registration-nominal"),
        ("bond", "did you mean bond-width\n"),
        ("zzz", "it may be bond-width, mask-overhang"),
    ],
)
def test_an_unknown_waiver_is_told_in_the_words_it_was_given(
    name: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = run(["check", "1dof-5mm", "--waive", name], capsys)
    assert code == 2
    assert err.startswith(f"sbafab: --waive '{name}': no rule has that name; ")
    assert said in err


@pytest.mark.parametrize(
    ("arguments", "kind", "exit_code"),
    [
        (["check", "nosuch", "--json"], "input", 2),
        (["check", "--json"], "usage", 2),
        (["generate", "1dof-5mm", "--json", "--bogus"], "usage", 2),
        (["cut", "radial-15mm", "--json", "--set", "sheets.tpe.width=40"], "too-large", 1),
    ],
)
def test_errors_are_told_to_programs_too(
    arguments: list[str],
    kind: str,
    exit_code: int,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run(arguments, capsys)
    told = json.loads(out)
    assert code == told["error"]["exit_code"] == exit_code
    assert (told["schema"], told["error"]["kind"]) == ("sbafab/error@1", kind)
    assert err == f"sbafab: {told['error']['message']}\n"
    assert list(tmp_path.iterdir()) == []


def test_a_file_without_its_ending_is_guessed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "colon.toml").write_text('family = "1dof"\n')
    code, _, err = run(["generate", "colon"], capsys)
    assert code == 2
    assert err.endswith("did you mean colon.toml?\n")


def test_every_rule_and_check_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    assert set(EXPLAINED) > {*CHECKS, "file-integrity", "manifest-claims", "as-designed"}
    code, out, _ = run(["explain", "mask-overhang"], capsys)
    assert code == 0
    assert "rules.mask_overhang" in out
    code, out, _ = run(["explain"], capsys)
    assert [line.split()[0] for line in out.splitlines()] == list(EXPLAINED)
    code, _, err = run(["explain", "mask-overhag"], capsys)
    assert code == 2
    assert "did you mean mask-overhang?" in err


def test_flags_and_factors_are_explained_in_two_sentences(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for term in (*FLAGS, "calibration", "press-factor", "press_factor"):
        code, out, _ = run(["explain", term, "--json"], capsys)
        assert code == 0
        assert len(re.findall(r"\.(?: |$)", json.loads(out)["meaning"])) == 2, term
    _, out, _ = run(["explain", "calibration"], capsys)
    assert "models.calibration" in out


def test_every_key_and_quantity_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(["explain", "chamber.diameter"], capsys)
    assert "mm from 0.001 to 1000" in out
    assert "1dof, lobed" in out
    _, out, _ = run(["explain", "chamber", "--json"], capsys)
    listed = {row["key"]: row for row in json.loads(out)["keys"]}
    assert listed["chamber.diameter"]["default"] == "5.0"
    _, out, _ = run(["explain", "force"], capsys)
    assert "blocked" in out
    told = [(family, row.key) for row in design_keys() for family in row.families]
    for family, record in records().items():
        keys = {key for of, key in told if of == family}
        for path in filter(record.uses, key_paths(record)):
            assert path in keys or any(key.startswith(f"{path}.") for key in keys), path
    assert [row.key for row in design_keys() if not row.meaning] == []


def test_the_keys_that_are_named_are_keys(capsys: pytest.CaptureFixture[str]) -> None:
    from sbafab.actuators import records
    from sbafab.assemblies.records import Assembly
    from sbafab.design.files import key_paths

    known = set(key_paths(Assembly))
    for record in records().values():
        known |= set(key_paths(record))
    assert {key for one in EXPLAINED.values() for key in one.keys} - known == set()


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


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("check", "cut files would state it"),
        ("cut", "Write the cut files"),
        ("press", "Write the schedule"),
        ("predict", "Write the prediction"),
    ],
)
def test_waive_speaks_of_its_command(
    command: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    _, out, _ = run([command, "--help"], capsys)
    assert words in " ".join(out.split())


def test_watching_looks_again_at_what_changed_only(tmp_path: Path) -> None:
    design = tmp_path / "mine.toml"
    design.write_text("a = 1\n")
    assert list(file_states(design)) == [design]
    seen: list[str] = []

    def once() -> None:
        seen.append(design.read_text())
        if len(seen) == 1:
            design.write_text("a = 22\n")

    watch_source(once, design, polls=3)
    assert seen == ["a = 1\n", "a = 22\n"]


def test_watch_is_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(["check", "1dof-5mm", "--watch", "--json"], capsys)
    assert code == 2
    assert "--watch and --json exclude each other" in err


def test_help_cuts_no_command_short(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    _, out, _ = run(["--help"], capsys)
    ours = ("new", "generate", "check", "explain", "cut", "mesh", "kerf", "predict", "schema")
    lines = [line for line in out.splitlines() if line.split()[:1] and line.split()[0] in ours]
    assert len(lines) >= len(ours)
    assert [line for line in lines if line.endswith("...")] == []


def test_python_counts_rules_as_the_command_does(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(["check", "1dof-5mm"], capsys)
    said = out.splitlines()[-1].partition("passed: ")[2].partition(".")[0]
    assert repr(sbafab.check("1dof-5mm")) == f"Findings({said})"


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("record", "Result of the leak test."),
        ("sweep", "Accept the failure of this rule in every design"),
        ("find", "Folder in which found.toml is written"),
        ("picture", "NAME-flat.png"),
    ],
)
def test_help_says_what_the_command_does(
    command: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    _, out, _ = run([command, "--help"], capsys)
    said = " ".join(out.split())
    assert words in said
    assert "LabResult" not in said
    if command == "sweep":
        # It writes none.
        assert "cut files" not in said


def test_known_keys_are_those_that_a_file_may_hold(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kit = tmp_path / "mine.toml"
    kit.write_text('schema = "sbafab/kit@1"\nname = "mine"\nversion = "1"\nfoo = "bar"\n')
    code, _, err = run(["check", "1dof-5mm", "--set", f"kit={kit}"], capsys)
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


@pytest.mark.parametrize(
    ("typed", "hint"),
    [
        ("gen", "did you mean generate?"),
        ("chekc", "did you mean check?"),
        ("pre", "did you mean press or predict?"),
        ("xyzzy", "'xyzzy' is not a command; see sbafab --help"),
    ],
)
def test_an_unknown_command_is_answered_with_the_nearest(
    typed: str, hint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = run([typed, "3dof-15mm"], capsys)
    assert (code, out) == (2, "")
    assert hint in err


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--to", "tip.txt"], "tip.txt must end in .toml"),
        (["--to", "tip.toml", "-o", "out"], "--out names a folder and --to a file"),
    ],
)
def test_a_found_design_goes_to_a_folder_or_a_toml_file(
    arguments: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = run(["find", "1dof-5mm", "--max", "mass=1", *arguments], capsys)
    assert (code, out) == (2, "")
    assert reason in err


QUICK = ["--set", "stack.balloons=2", "--set", "rules.yield_builds=100"]


@pytest.mark.parametrize(
    ("arguments", "written"),
    [
        (["generate", "1dof-5mm", *QUICK], "out/1dof-5mm"),
        (["cut", "1dof-5mm", *QUICK], "out/1dof-5mm"),
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
def test_quiet_prints_the_folder_alone(
    arguments: list[str],
    written: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    if arguments[0] == "import":
        sbafab.generate("1dof-5mm", *QUICK[1::2])
    code, out, err = run([*arguments, "-q"], capsys)
    assert (code, out, err) == (0, f"{written}\n" if written else "", "")
    assert Path(written).exists()


def test_quiet_prints_errors_and_results_for_programs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    narrow = [*QUICK, "--set", "bond.width=0.7"]
    code, out, err = run(["check", "1dof-5mm", *narrow, "-q"], capsys)
    assert (code, out) == (1, "")
    assert err.startswith("sbafab: 1dof-5mm failed: bond-width")
    assert err.count("\n") == 1
    code, out, err = run(["generate", "1dof-5mm", *narrow, "-q", "-o", str(tmp_path)], capsys)
    assert (code, out) == (1, f"{tmp_path / '1dof-5mm'}\n")
    assert err.startswith("sbafab: 1dof-5mm failed: bond-width")
    code, out, err = run(["check", "1dof-5mm", *narrow, "-q", "--json"], capsys)
    assert (code, err) == (1, "")
    assert not json.loads(out)["summary"]["holds"]
    code, out, err = run(["map", "1dof-5mm", "--points", "2", "-q"], capsys)
    assert (code, err) == (0, "")
    assert out.startswith("balloon,pressure_kpa")
    assert run(["check", "nosuch", "-q"], capsys)[0] == 2


WRITING = [
    name for name, command in COMMANDS.items() if any("-o" in p.opts for p in command.params)
]


@pytest.mark.parametrize("name", WRITING)
def test_an_output_is_a_folder_everywhere(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("mine")
    places = {tmp_path / "tip.toml": "is a file's name, and -o takes a folder"}
    places[tmp_path / "file"] = "is a file, not a folder; choose a folder with -o"
    for place, reason in places.items():
        code, out, err = run([name, "1dof-5mm", "1dof-10mm", "-o", str(place)], capsys)
        assert (code, out) == (2, "")
        assert reason in err
    has_file = any("--to" in param.opts for param in COMMANDS[name].params)
    code, _, err = run([name, "1dof-5mm", "-o", "tip.toml"], capsys)
    assert ("--to tip.toml" in err) == has_file
