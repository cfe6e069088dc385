"""Bad input to every command: one sentence, exit code 2, and nothing on disk."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

from sbafab.cli import COMMANDS
from tests.cli.conftest import Run
from tests.site.formats import hold

OVAL = Path(__file__).parents[2] / "docs" / "gallery" / "oval.toml"
CASES = f"""
check nosuch | is neither a template nor a design file
check 3dof-15mm --set bond.widht=1 | did you mean bond.width
check 3dof-15mm --set bond.width=-1 | bond.width = -1
check 1dof-5mm --waive registration | did you mean registration-yield or registration-nominal
check 1dof-5mm --waive bond | --waive 'bond': no rule has that name; did you mean bond-width
check 1dof-5mm --waive zzz | it may be bond-width, mask-overhang
check 1dof-5mm --target-yield 1 | must be a share above 0 and below 1
check 1dof-5mm --target-yield 120% | must be a share above 0 and below 1
check 1dof-5mm --target-yield "0.9 mm" | must be a share above 0 and below 1
check brace --target-yield 0.9 | check its parts' designs one by one
check brace --set parts.arm.on=tubs | did you mean tube?
check brace --set parts.arm.at=top | "start", "end", "outside"
check brace --set parts.arm.design=nosuch | parts.arm: 'nosuch' is neither
check 1dof-5mm --set order.copies=900 | sheets.tpe.most allows 20
generate brace --set parts.tube.kind=pipe | parts.tube.kind = 'pipe'
generate brace --set parts.tube.on=cup | no tube can be fixed on a cup
generate brace --waive seats | --waive 'seats': no rule has that name; did you mean seat
generate brace --set parts=1 | add [parts.NAME]
generate brace --set parts.arm.set.laser.kerf_tpe=0.1 | laser differs
generate brace --decks | decks need a single design, but brace is an assembly
generate brace --target-yield 0.9 | generate its parts' designs one by one
generate standing --copies 0 | order.copies = 0
generate 3dof-15mm --set name=../x | name = '../x'
generate 1dof-5mm --copies 1e3 | '1e3' is not a valid integer; see sbafab generate --help
generate 1dof-5mm --chord-error 0.01 | needs --dxf-profile chords
predict 1dof-5mm --set models.calibration=lab.toml | sbafab calibrate writes one
press brace | is an assembly of several designs
mesh brace | is an assembly of several designs
cut brace | is an assembly of several designs
picture brace | is an assembly of several designs
simulate brace --with sofa | is an assembly of several designs
nest brace 1dof-5mm | is an assembly of several designs
compare brace 1dof-5mm | is an assembly
cut 1dof-5mm --set bore.diameter=9 | bore
cut 1dof-5mm --copies 900 --set sheets.tpe.most=1 | sheets.tpe.most
cut 1dof-5mm --set sheets.ptfe.border=80 | border
cut 1dof-5mm --set sheets.tpe.spacing=0 | sheets.tpe.spacing = 0
cut 1dof-5mm --set sheets.tpe.spacing=90 --set sheets.tpe.most=3 | sheets.tpe
cut 1dof-5mm --set sheets.tpe.pins=[[1,2]] | sheets.tpe.pins
cut 1dof-5mm --set laser.kerf_tpe=2 | laser.kerf_tpe = 2
cut 1dof-5mm --set laser.kerf_tpe=[0.1,0.08] --dxf-profile chords | write bulges or arcs
cut 1dof-5mm --set bore.diameter=1 --waive film-limits --set laser.kerf_tpe=1 | kerf
press 1dof-5mm --set press.temperature_c=110 | temperature
mesh 1dof-5mm --h 5 | h
mesh 1dof-5mm --h 0 | must be a length above 0 mm
mesh 1dof-5mm --fill 30 | ul
mesh 1dof-5mm --fill chamber1=3 | chamber1
mesh 3dof-15mm --symmetry quarter | quarter
nest 1dof-5mm 1dof-5mm | 1dof-5mm
nest 1dof-5mm --name a/b | a/b
new nosuch | nosuch
frobnicate | 'frobnicate' is not a command; see sbafab --help
gen 3dof-15mm | did you mean generate? See sbafab --help
chekc 3dof-15mm | did you mean check?
pre 3dof-15mm | did you mean press or predict?
check | Missing argument 'DESIGN|FOLDER'; see sbafab check --help
check x --bogus | No such option
kerf x.csv --resolution nan | must be a finite number
kerf nosuch.csv | nosuch.csv
explain mask-overhag | did you mean mask-overhang?
predict 1dof-5mm --volume 17 | give 0 to 16.94 ul a balloon
predict 1dof-5mm --volume nan | the units are ul, ml, mm3
predict 1dof-5mm --volume "0.02 ml" | give 0 to 16.94 ul a balloon
predict 1dof-5mm --pressure "11 bar" | give more than 0, at most 1000 kPa
predict 1dof-5mm --pressure 0 | pressure = 0 kPa is out of range; give more than 0
sweep 1dof-5mm --vary stack.balloons=2,3 --pressure 0 | pressure = 0 kPa is out of range
find 1dof-5mm --min stroke@0kPa=5 | pressure = 0 kPa is out of range
predict 1dof-5mm --pressure "4 atm" | '4 atm' must be a pressure such as
predict 1dof-5mm --pressure -20 | a vacuum does nothing
predict 1dof-5mm --flow 0 | must be from 1e-06 to 1e+06 ml/min
predict 1dof-5mm --flow inf | must be a flow such as
predict 1dof-5mm --flow 1e999 | must be a finite flow
predict 1dof-5mm --load 5 | --load is for an assembly, and 1dof-5mm is one actuator
predict brace --flow 30 | --flow is for one actuator, and brace is an assembly
predict brace --tip-load 3 | --tip-load is for one actuator
predict radial-15mm --tip-load 3 | --tip-load is for elastic balloons, round pockets
predict brace --volume 5 | --volume is for one actuator
predict brace --waive seat | --waive is for written files
predict brace -o x | --out is for written files
predict brace --pressure 5 --pressure 6 | an assembly needs a single pressure
predict {OVAL} --volume 5 | --volume is for pockets that are round or oblong
map 1dof-5mm --to a.csv --pressures 5 | is for a MuJoCo model
map 1dof-5mm --to a.xml --pressures 5,5 | has 2 of 1 pressures
map 1dof-5mm --to a.xml --pressures x | must be a pressure such as
map 1dof-5mm --to a.xml --pressures 200 | give 0 to 110 kPa
map radial-15mm | no round pockets
map 1dof-5mm --to map.txt | must end with .csv or .xml
map 1dof-5mm --pressure 400 | 400 kPa exceeds the estimated burst pressure of 367 kPa
map 1dof-5mm --pressure 0 | it must be above 0 kPa
calibrate nosuch | neither bundled evidence
calibrate --name paper | which is reserved
calibrate --name none | which is reserved
calibrate --name "my lab" | use letters, digits
find 1dof-5mm --max mass=1 --to tip.txt | tip.txt must end in .toml
find 1dof-5mm --max mass=1 --to tip.toml -o out | --out names a folder and --to a file
find 1dof-5mm --min strok=5 | did you mean stroke?
find 1dof-5mm --min stroke=5 --max stroke=4 | contradict each other
find 1dof-5mm --min inflated_diameter=5 --max inflated_diameter=4 | contradict each other
find 1dof-5mm --max mass=nan | must be a number
find 1dof-5mm --min bend=90 | 1dof-5mm does not bend
find 1dof-5mm --max time=1 --flow "35 l" | must be a flow
find 1dof-5mm --sure 0.4 | must be above 0.5 and below 1
find 1dof-5mm --sure 90 | must be a share above 0 and below 1
find 1dof-5mm --min reference_stroke=5 --sure 0.9 | ask for stroke@10kPa
find 1dof-5mm --set models.calibration=none --sure 0.9 | needs a calibration
find 1dof-5mm --max mass=-1 | must be at least 0
find 1dof-5mm --min yield=95 | a fraction from 0 to 1
find 1dof-5mm --min stroke@50=5 | '50' has no unit; write 50kPa
find 1dof-5mm --min force@1mm@5kPa@6kPa=1 | names two pressures
find 1dof-5mm --min chamber.diamter=5 | did you mean chamber.diameter?
find 1dof-5mm --min lumen=3 | 1dof-5mm has no lumen
find 1dof-5mm --min inlet.tab_length=6 | --free inlet.tab_length=LOW:HIGH:STEP
find 1dof-5mm --max deflated_diameter=3 | only radial designs
find 1dof-5mm --free chamber.diameter=6:3:1 | --free 'chamber.diameter=6:3:1' ends below
find 1dof-5mm --free registration.method=ears,glue | 'glue' must be 'channel-pin' or 'ears'
find 1dof-5mm --min registration.method=3 | is a word, 'channel-pin', and cannot have a limit
record | give the DESIGN that was built, --find or --report
record 1dof-5mm | a result needs its serial
record 1dof-5mm --serial A1 | A1 has no result; give leak
record 1dof-5mm --report | DESIGN cannot be combined with --report
record --chart a.svg --serial A1 | --serial cannot be combined with --chart
record --report --leak pass | --leak cannot be combined with --report
record 1dof-5mm --serial A1 --withdraw | --withdraw cannot be combined with DESIGN
record 1dof-5mm --table x.csv --leak pass | --leak cannot be combined with --table
record 1dof-5mm --table x.csv | x.csv cannot be read
record --correct 1 | give the correct result
record --correct 1 --again | --again cannot be combined with --correct
record --correct x1 --leak pass | neither a record, such as 3, nor an entry, such as e3
record --correct e1 | give an --entry
record --correct e1 --entry note=x --leak pass | give an --entry
record --correct 1 --leak pass --entry note=x | give the correct result
record --chart a.svg | lab.sqlite is not a file of records
record 1dof-5mm --serial A1 --entry step | must be fields such as step=1
record 1dof-5mm --serial A1 --entry "note='x" | an unmatched quotation mark
record 1dof-5mm --entry note=x | an entry needs its serial
record 1dof-5mm --history x.doc | must end in .csv, .toml, .json
record 1dof-5mm --serial A1 --leak pass --again | there is no earlier attempt
record --correct 1 --leak fail | lab.sqlite does not exist
record nosuch --serial A1 --leak pass | nosuch
record 1dof-5mm --serial A1 --burst "3 N" | must be a pressure
record 1dof-5mm --serial A1 --force nan | force_n = nan must be a finite
record 1dof-5mm --serial A1 --leak pass --lab no/lab.db | cannot be opened
"""
ROWS = [line.partition(" | ")[::2] for line in CASES.strip().splitlines()]


@pytest.mark.parametrize(("line", "said"), ROWS)
def test_bad_input_is_one_sentence(line: str, said: str, tmp_path: Path, run: Run) -> None:
    code, out, err = run("", *shlex.split(line))
    assert (code, out) == (2, "")
    assert err.startswith("sbafab: ")
    assert err.count("\n") == 1
    assert said in err
    assert list(tmp_path.iterdir()) == []


FIXED = " ".join(
    f"--set {key}"
    for key in (
        *("stack.balloons=2", "rules.yield_builds=100", "registration.method=channel-pin"),
        *("bond.width=0.75", "mask.overhang=0.5", "registration.hand_placement=0.2"),
    )
)
"""Keys that a yield may not change, of builds that a hand places roughly."""


def test_no_command_shows_the_help(run: Run) -> None:
    code, out, err = run("")
    assert code == 2
    assert "Usage: sbafab" in out + err


@pytest.mark.parametrize(
    ("line", "kind", "exit_code"),
    [
        ("check nosuch --json", "input", 2),
        ("check --json", "usage", 2),
        ("new 1dof-5mm --json", "usage", 2),
        ("generate 1dof-5mm --json --bogus", "usage", 2),
        ("cut radial-15mm --json --set sheets.tpe.width=40", "too-large", 1),
        (f"generate 1dof-5mm --json --target-yield 0.99 {FIXED}", "yield", 1),
    ],
)
def test_errors_are_told_to_programs_too(
    line: str, kind: str, exit_code: int, tmp_path: Path, run: Run
) -> None:
    code, out, err = run(line)
    told = json.loads(out)
    hold("error", told)
    assert code == told["error"]["exit_code"] == exit_code
    assert (told["schema"], told["error"]["kind"]) == ("sbafab/error@1", kind)
    assert err == f"sbafab: {told['error']['message']}\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("1dof-5mm --set sheets.tpe.width=25", "does not fit the usable 5.0 x 132.4 mm"),
        ("brace --set sheets.tpe.width=30", "does not fit the usable 10.0 x 132.4 mm"),
    ],
)
def test_a_part_that_no_sheet_takes_is_refused_by_check_and_generate(
    source: str, said: str, run: Run
) -> None:
    """It ends as one that the press does not take."""
    for command in ("check", "generate"):
        code, out, err = run(f"{command} {source}")
        assert (code, out) == (1, "")
        # A slow machine may say how far it was before.
        assert said in err.splitlines()[-1]


WRITING = [
    name for name, command in COMMANDS.items() if any("-o" in p.opts for p in command.params)
]


@pytest.mark.parametrize("name", WRITING)
def test_an_output_is_a_folder_everywhere(name: str, tmp_path: Path, run: Run) -> None:
    (tmp_path / "file").write_text("mine")
    designs = f"{name} 1dof-5mm 1dof-10mm"
    assert "is a file, not a folder; choose a folder with -o" in run(f"{designs} -o file")[2]
    code, out, err = run(f"{designs} -o tip.toml")
    assert (code, out) == (2, "")
    assert "is the name of a file, but -o needs a folder" in err
    has_file = any("--to" in param.opts for param in COMMANDS[name].params)
    assert ("--to tip.toml" in err) == has_file
