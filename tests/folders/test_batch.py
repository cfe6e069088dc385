"""Several copies pressed at once: the plate, the records and the page, written and checked."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from lxml import html as lxml_html

from sbafab.actuators import load_design
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.folders.check import check_folder
from sbafab.folders.run import Run, RunRequest, generate
from sbafab.geometry.region import Region
from sbafab.rules.deck import has_failed
from tests.folders.doctoring import Doctor

COPIES = 5


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    # The platen takes a block of two by two of 12.5 x 7.5 with 5 between and 6 round: 42 x 32.
    small = ("press.platen_width=42", "press.platen_length=32")
    few = ("stack.balloons=2", f"order.copies={COPIES}", "rules.yield_builds=100")
    design = load_design("1dof-5mm", [*small, *few])
    return generate(
        RunRequest(design, tmp_path_factory.mktemp("batch"), ("cut", "press", "preview"))
    )


def test_two_cycles_make_five_copies_on_one_plate(run: Run) -> None:
    batch = run.manifest["batch"]
    assert (batch["at_once"], batch["cycles"]) == (3, [3, 2])
    press = json.loads((run.folder / "press.json").read_text())
    said = press["batch"]
    assert (said["press_minutes"], said["hands_minutes"]) == (90, 300)
    assert said["total_minutes"] == 390
    assert press["total_press_minutes"] == 45
    assert not has_failed(check_folder(run.folder))


SERIALS = ["A-01", "A-02", "A-03", "B-01", "B-02"]


def test_a_laminate_has_one_serial_on_the_page_and_for_programs(run: Run) -> None:
    page = lxml_html.fromstring((run.folder / "traveller.html").read_text())
    rows = page.xpath("//table[@class='serials']/tbody/tr")
    assert [[cell.text_content() for cell in row[:4]] for row in rows] == [
        [serial, str(copy), serial[0], str(int(serial[2:]))]
        for copy, serial in enumerate(SERIALS, 1)
    ]
    assert json.loads((run.folder / "press.json").read_text())["batch"]["serials"] == SERIALS
    tubed = page.xpath("//label[span[starts-with(., 'A-') or starts-with(., 'B-')]]")
    assert {label.text_content().strip() for label in tubed} == set(SERIALS)
    words = " ".join(page.text_content().split())
    assert "5 copies in 2 press cycles of 3, 2 at once: 90 min in the press instead of 225" in words
    assert "390 min" in words
    assert "Do not pause from the first layer of a step until the press is opened" in words
    assert "each straight to its number in the tray" in words
    closings = page.xpath("//label[contains(., 'cycle B')]")
    assert len(closings) == 4


def test_the_bill_counts_what_the_batch_takes(run: Run) -> None:
    with (run.folder / "bill.csv").open(newline="") as file:
        bill = {row["item"]: row for row in csv.DictReader(file)}
    needed = {name: int(row["needed"] or 0) for name, row in bill.items()}
    # A tube and a drop a copy, and a spare tube; two release films each time that a cycle is
    # pressed in a step, and one below films that are turned over.
    assert (needed["Tube"], needed["Adhesive"]) == (COPIES + 1, COPIES)
    assert (needed["Release film"], needed["Tray"], needed["Base plate"]) == (17, 2, 1)
    # 42 x 32 mm each.
    assert float(bill["Release film"]["area_m2"]) == pytest.approx(17 * 42 * 32 / 1e6, abs=5e-5)
    for material in ("TPE", "PTFE"):
        files = [*(run.folder / "sheets").glob(f"{material}_*.dxf")]
        assert needed[f"{material} film"] == len(files)
        # 6 x 6 in.
        area = len(files) * 0.1524**2
        assert float(bill[f"{material} film"]["area_m2"]) == pytest.approx(area, abs=5e-5)


Change = Callable[[Doctor], object]


def redrawn_plate(holes_left_out: int = 0, notes_left_out: int = 0, depth: str = "2.") -> Change:
    """The plate without its last holes or notes, or with another depth in its properties."""

    def change(doctor: Doctor) -> None:
        path = doctor.folder / doctor.manifest["fixture"]
        found = read_profile(path)
        lost = found.region.holes[len(found.region.holes) - holes_left_out :]
        region = Region(tuple(c for c in found.region.contours if c not in lost))
        # After the datum cross come the letters that tell the shop of its holes.
        notes = [[edges[0].start, *(e.end for e in edges)] for _, edges in found.strokes[2:]]
        holes = found.properties["HOLES"].replace("2.", depth)
        text = dxf_text(
            cutting_sequence(region),
            {**found.properties, "HOLES": holes},
            notes=notes[: len(notes) - notes_left_out],
        )
        path.write_text(text, newline="\n")

    return change


def claimed(**batch: object) -> Change:
    return lambda doctor: doctor.set_manifest(lambda m: m["batch"].update(batch))


@pytest.mark.parametrize(
    ("change", "rules"),
    [
        (redrawn_plate(), set()),
        (redrawn_plate(holes_left_out=1), {"as-designed"}),
        (redrawn_plate(notes_left_out=1), {"as-designed"}),
        (redrawn_plate(depth="4."), {"as-designed"}),
        (claimed(cycles=[4]), {"manifest-claims"}),
        (claimed(places=[{"x": x, "y": 0} for x in (0, 17, 34)]), {"manifest-claims"}),
    ],
)
def test_a_plate_or_cycles_that_leave_something_out_fail(
    change: Change, rules: set[str], run: Run, tmp_path: Path
) -> None:
    doctor = Doctor(Path(shutil.copytree(run.folder, tmp_path / "run")))
    change(doctor)
    doctor.rehash()
    assert {f.rule for f in check_folder(doctor.folder) if f.verdict == "fail"} == rules
