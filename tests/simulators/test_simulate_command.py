"""What every simulator is asked for, and ``sbafab simulate`` and ``generate --decks``."""

from __future__ import annotations

import json
import re
import sys
from hashlib import sha256
from pathlib import Path

import pytest
from click.testing import CliRunner
from filelock import FileLock

import sbafab
from sbafab.cli import app
from sbafab.models.calibration import factors_of
from sbafab.simulators.simulator import NAMES, SimulationRequest, Stop, chamber_pressures
from tests.simulators.conftest import StandIn
from tests.simulators.test_recorded_runs import SOFA
from tests.site.formats import hold

CHAMBERS = ("chamber1", "chamber2")


@pytest.mark.parametrize(
    ("wish", "pressures"),
    [
        (SimulationRequest(), (6.0, 6.0)),
        (SimulationRequest(2.0), (2.0, 2.0)),
        (SimulationRequest(chambers={"chamber2": 3.0}), (0.0, 3.0)),
        (SimulationRequest(1.0, {"chamber2": 3.0}), (1.0, 3.0)),
    ],
)
def test_chamber_pressures(wish: SimulationRequest, pressures: tuple[float, float]) -> None:
    assert chamber_pressures(CHAMBERS, wish, 6.0) == dict(zip(CHAMBERS, pressures, strict=True))


@pytest.fixture
def no_programs(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without any simulator."""
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(sys.modules, "mujoco", None)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("no_programs")
def test_a_simulator_that_is_missing(tmp_path: Path, name: str) -> None:
    given = ["simulate", "1dof-5mm", "--set", "stack.balloons=1", "--with", name]
    result = CliRunner().invoke(app, [*given, "-o", str(tmp_path)])
    assert result.exit_code == 2
    assert "install" in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--with", "calculix", "--pressure", "6 inches"], "must be a pressure"),
        (["--with", "calculix", "--chamber", "chamber1"], "must be NAME=PRESSURE"),
        (["--with", "calculix", "--chamber", "left=3"], "names chamber left, which does not exist"),
        (["--with", "calculix", "--scene", "volume"], "scene is for sofa"),
        (["--with", "calculix", "--h", "3"], "h = 3"),
        (["--with", "sofa", "--h", "0.3"], "h is for calculix"),
        (["--with", "sofa", "--volume", "chamber1=8"], "--volume is for --scene volume"),
        (["--with", "sofa", "--export", "--seconds", "nan"], "simulated time = nan s"),
        (["--with", "calculix", "--minutes", "nan"], "must be a finite number"),
        (["--with", "ansys"], "calculix"),
        (["--with", "calculix", "--pressure", "2000"], "pressure of chamber1 = 2000 kPa"),
        (["--with", "calculix", "--symmetry", "sector"], "lacks the mesh symmetry sector"),
        (["--with", "sofa", "--pressure", "0"], "0 kPa in every chamber"),
        (["--with", "mujoco", "--pressure", "-5"], "to 1000 kPa; a vacuum is for calculix"),
        (["--with", "sofa", "--scene", "volume", "--volume", "left=3"], "left"),
        (["--with", "mujoco", "--seconds", "1"], "simulated time = 1 s"),
        (["--with", "mujoco", "--h", "3"], "h is for calculix"),
    ],
)
@pytest.mark.usefixtures("no_programs")
def test_bad_arguments(tmp_path: Path, options: list[str], words: str) -> None:
    """Arguments are judged before programs are looked for: the one at fault is named anywhere."""
    result = CliRunner().invoke(app, ["simulate", "1dof-5mm", "-o", str(tmp_path), *options])
    assert result.exit_code == 2, result.output
    assert words in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--with", "calculix", "--pressure", "20"], "a vacuum is negative: write -20"),
        (["--with", "calculix", "--chamber", "stack=20"], "stack = 20 kPa is out of range"),
        (["--with", "calculix", "--pressure", "-102"], "must be from -101.325 to"),
        (["--with", "sofa"], "works under vacuum, which sofa does not support; use calculix"),
    ],
)
@pytest.mark.usefixtures("no_programs")
def test_a_vacuum_has_one_sign(tmp_path: Path, options: list[str], words: str) -> None:
    result = CliRunner().invoke(app, ["simulate", "vacuum", "-o", str(tmp_path), *options])
    assert result.exit_code == 2, result.output
    assert words in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_parts_that_are_images_take_one_pressure(tmp_path: Path) -> None:
    arguments = ["simulate", "3dof-15mm", "--with", "calculix", "-o", str(tmp_path)]
    arguments += ["--symmetry", "half", "--export"]
    result = CliRunner().invoke(app, [*arguments, "--chamber", "chamber2=1"])
    assert result.exit_code == 2
    assert "symmetry half computes" in result.stderr
    assert "use equal pressures for both" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_export_keeps_what_is_there(tmp_path: Path) -> None:
    folder = tmp_path / "1dof-5mm"
    for command in (["press"], ["simulate", "--with", "sofa", "--export", "--pressure", "3"]):
        result = CliRunner().invoke(app, [*command, "1dof-5mm", "-o", str(tmp_path)])
        assert result.exit_code == 0, result.output
    listed = json.loads((folder / "manifest.json").read_text())["files"]
    assert {"press.json", "sofa/actuator.scn", "sofa/scene.py"} <= set(listed)
    assert 'pressure="3"' in (folder / "sofa" / "actuator.scn").read_text()
    assert (folder / "sofa").stat().st_mode == folder.stat().st_mode


def test_decks_of_a_whole_run(tmp_path: Path) -> None:
    pytest.importorskip("netgen")
    arguments = ["--set", "stack.balloons=1", "-o", str(tmp_path), "--json"]
    result = CliRunner().invoke(app, ["generate", "1dof-5mm", "--decks", *arguments])
    assert result.exit_code == 0, result.output
    folder = tmp_path / "1dof-5mm"
    assert "6 kPa" in (folder / "calculix" / "actuator.inp").read_text()
    assert (folder / "sofa" / "actuator.scn").is_file()


def test_a_design_under_a_vacuum_is_drawn_in_by_default(tmp_path: Path) -> None:
    pytest.importorskip("netgen")
    given = ["simulate", "vacuum", "--with", "calculix", "--export", "--symmetry", "half"]
    result = CliRunner().invoke(app, [*given, "--h", "4", "-o", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert "stack -6 kPa" in (tmp_path / "vacuum" / "calculix" / "actuator.inp").read_text()


def test_a_run_leaves_what_it_found(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    arguments = ["simulate", "1dof-5mm", "--with", "mujoco", "--seconds", "2", "-o", str(tmp_path)]
    result = CliRunner().invoke(app, [*arguments, "--set", "stack.balloons=1", "--json"])
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    found = json.loads((tmp_path / "1dof-5mm" / "mujoco" / "result.json").read_text())
    assert found["tip"] == told["tip"]
    assert found["tip"][2] > 0.5
    # Two films of 0.038 mm.
    assert found["height"] == pytest.approx(found["tip"][2] + 0.076)
    hold("simulate", found)
    assert told == {**found, "folder": str(tmp_path / "1dof-5mm" / "mujoco")}
    assert found["stopped"] is None


def test_the_log_of_a_void_run_is_where_the_message_says(tmp_path: Path, stand_in: StandIn) -> None:
    """A program in runSofa's place that writes no place of a node."""
    stand_in("runSofa", "print('[ERROR] what went wrong')")
    out = tmp_path / "out"
    given = ["simulate", "1dof-5mm", "--set", "stack.balloons=1", "--with", "sofa", "-o", str(out)]
    found = CliRunner().invoke(app, given)
    named = re.search(r"\(see (.*\.log)\)", found.output.replace("\n", " "))
    assert found.exit_code == 1
    assert not (out / "1dof-5mm").exists()
    assert named is not None, found.output
    assert "[ERROR] what went wrong" in Path(named[1]).read_text(encoding="utf-8")


def test_an_interrupted_run_without_results_leaves_nothing(
    tmp_path: Path, stand_in: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(command: object, log: Path, *_: object) -> tuple[int, Stop]:
        log.write_text("")
        return -2, Stop("interrupt", "it was interrupted")

    stand_in("runSofa", "")
    monkeypatch.setattr("sbafab.simulators.simulator.run_program", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sbafab.simulate("1dof-5mm", "stack.balloons=1", simulator="sofa", out=tmp_path / "out")
    assert not list((tmp_path / "out").iterdir())


@pytest.fixture
def risen(tmp_path: Path, stand_in: StandIn) -> list[str]:
    """A command that runs a program in runSofa's place, whose tip rises by 1 mm."""
    stand_in("runSofa", f"{SOFA}\nfor t in (0, 0.1): write(t, 1)\n")
    given = ["simulate", "1dof-5mm", "--set", "stack.balloons=1", "--with", "sofa"]
    return [*given, "--seconds", "0.1", "-o", str(tmp_path / "out")]


def test_a_result_says_which_films_and_pockets_it_is_of(risen: list[str]) -> None:
    """Simulators take neither the pressed film's modulus nor the pockets' loss of ``predict``."""
    factors = factors_of(sbafab.load("1dof-5mm"))
    words = " ".join(CliRunner().invoke(app, risen).stdout.split())
    assert "(film as bought, pockets as drawn; predict uses the calibration paper:" in words
    assert f"{factors.modulus_ratio:.3g} times the modulus, pocket radii" in words
    own = " ".join(
        CliRunner().invoke(app, [*risen, "--set", "models.calibration=none"]).stdout.split()
    )
    assert "simulated." in own
    assert "as bought" not in own


def test_a_folder_that_another_run_holds_is_asked_for_before_the_run(
    tmp_path: Path, risen: list[str], stand_in: StandIn
) -> None:
    (tmp_path / "out").mkdir()
    stand_in("runSofa", "open('ran', 'w')")
    with FileLock(tmp_path / "out" / ".1dof-5mm.lock"):
        found = CliRunner().invoke(app, risen)
    assert found.exit_code == 2
    assert "another run is writing" in found.stderr
    assert not list(tmp_path.rglob("ran"))


def test_a_result_is_kept_where_its_folder_is_taken_meanwhile(
    tmp_path: Path, risen: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another run has begun while the simulator ran: what was asked before is no longer so."""
    monkeypatch.setattr("sbafab.folders.run.refuse_busy", lambda target: None)
    out = tmp_path / "out"
    out.mkdir()
    with FileLock(out / ".1dof-5mm.lock"):
        for number in (1, 2):
            found = CliRunner().invoke(app, [*risen, "--json"])
            assert found.exit_code == 0, found.output
            assert "another run is writing" in found.stderr
            folder = Path(json.loads(found.stdout)["folder"])
            assert folder.name.startswith("1dof-5mm-sofa-")
            assert len([*out.glob("1dof-5mm-sofa-*")]) == number
            kept = json.loads((folder / "result.json").read_text())
            assert kept["tip"] == pytest.approx([0, 0, 1])
            assert (folder / "actuator.scn").is_file()


def test_a_design_that_breaks_a_rule_is_not_simulated(tmp_path: Path) -> None:
    arguments = ["simulate", "1dof-5mm", "--with", "sofa", "--export", "-o", str(tmp_path)]
    result = CliRunner().invoke(app, [*arguments, "--set", "bond.width=0.5"])
    assert result.exit_code == 1
    assert "bond-width" in result.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("kpa", "warned"), [("183", False), ("184", True)])
def test_past_this_designs_burst_is_warned_of(kpa: str, warned: bool, tmp_path: Path) -> None:
    """Pockets twice as wide as the paper's, which burst at 367 kPa: half of that by film stress."""
    arguments = ["1dof-10mm", "--with", "sofa", "--export", "--pressure", kpa, "-o", str(tmp_path)]
    result = CliRunner().invoke(app, ["simulate", *arguments])
    assert result.exit_code == 0
    assert ("past the estimated burst pressure" in result.stderr) == warned


def test_a_simulator_that_cannot_take_a_design(tmp_path: Path) -> None:
    result = CliRunner().invoke(
        app, ["simulate", "radial-15mm", "--with", "mujoco", "--export", "-o", str(tmp_path)]
    )
    assert result.exit_code == 2
    assert "lie on a sheet" in result.stderr


def test_results_of_another_input_are_not_kept(tmp_path: Path) -> None:
    common = ["1dof-5mm", "--with", "sofa", "--export", "-o", str(tmp_path)]
    assert CliRunner().invoke(app, ["simulate", *common]).exit_code == 0
    folder = tmp_path / "1dof-5mm"
    (folder / "sofa" / "tip.state").write_text("of a run")
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["files"]["sofa/tip.state"] = sha256(b"of a run").hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest))
    assert CliRunner().invoke(app, ["press", "1dof-5mm", "-o", str(tmp_path)]).exit_code == 0
    assert (folder / "sofa" / "tip.state").exists()
    assert CliRunner().invoke(app, ["simulate", *common, "--pressure", "2"]).exit_code == 0
    assert not (folder / "sofa" / "tip.state").exists()
