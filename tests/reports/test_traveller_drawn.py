"""traveller.html of drawn designs: faces, notes, folds and seams as the bench needs them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from sbafab.pressing.schedule import schedule
from sbafab.reports.traveller.bench import before_cutting
from sbafab.reports.traveller.job import Job, Work
from sbafab.reports.underlay import seams_pdf
from tests.reports.bench_pages import SHA, built, page, words_of


def test_a_coated_film_is_laid_by_its_face(sheet_files: Any) -> None:
    words = words_of(page(sheet_files, "array"))
    # The coating is on the upper face; the cap is laid turned, so that both coatings meet.
    assert "Lay layer 1: TPUNYLON base P01, nylon face down." in words
    assert "Lay layer 3: TPUNYLON cap P03, tpu face down." in words
    assert "face down" not in words_of(page(sheet_files, "1dof-5mm"))


def test_notes_of_a_drawn_design_head_its_lay_up(sheet_files: Any) -> None:
    tree = page(sheet_files, "array")
    lay_up = words_of(tree.get_element_by_id("lay-up").getparent())
    assert "Note: Coated sides face each other: the base's up, the cap's down. Repeat" in lay_up
    assert tree.xpath("//*[@id='trim']") == []


def test_a_fold_is_placed_on_the_loose_part(sheet_files: Any) -> None:
    tree = page(sheet_files, "folded")
    (fold,) = [step for step in tree.findall(".//article") if "Fold of layers" in words_of(step)]
    words = words_of(fold)
    # The line is at y = -12 and the mouth at y = 24 of the design, which is not on the page.
    assert "fold 36.0 mm from the tab's end of half 1." in words
    assert "Fold half 2 up along the line and over onto half 1" in words
    assert "-12" not in words
    (picture,) = fold.xpath(".//*[local-name()='svg']")
    assert [text for text in ("half 1", "half 2", "36.0") if text not in words_of(picture)] == []
    assert picture.xpath(".//*[@stroke-dasharray]")
    assert "Never turn a part over but for folds" in words_of(tree)


def test_a_seam_names_its_file_and_its_beginning(sheet_files: Any) -> None:
    tree = page(sheet_files, "folded")
    left, right = [words_of(s) for s in tree.findall(".//article") if ": Seam " in words_of(s)]
    assert "Follow the path (layers/seam_001_left.dxf)" in left
    assert "Follow the path (layers/seam_002_right.dxf)" in right
    # From (-19, -13) on films with their lower left corner at (-20, -12).
    start = "1.0 mm right of the films' left edge and 1.0 mm below their lower edge"
    assert start in left
    assert "heat-proof mat" in left


DOUBLE = """
name = "double"
family = "drawn"
layers = [
  {role = "base", shape = "film", film = "pe"},
  {role = "wall", shape = "film", film = "pe"},
  {role = "cap", shape = "film", film = "CAP"},
]
seams = [
  {name = "upper", layers = [2, 3], path = RIM, width = 2, tool = "hot-tip"},
  {name = "lower", layers = [1, 2], path = RIM, width = 2, tool = "hot-tip"},
]
chambers = [
  {name = "low", centres = [[0, 0]], mouth = [0, 24], angle = 90, width = 2, balloons = [1]},
  {name = "high", centres = [[0, 0]], mouth = [0, 24], angle = 90, width = 2, balloons = [2]},
]
[shapes]
body = {polygon = [[-20, -14], [22, -14], [22, 13], [-20, 13]]}
tab = {polygon = [[-3, 0], [3, 0], [3, 24], [-3, 24]]}
film = {union = ["body", "tab"]}
[films.pe]
kind = "structural"
product = "LDPE"
thickness = 0.1
melting_point = 110
[films.pet]
kind = "structural"
product = "PET"
thickness = 0.05
"""
"""Two pouches on each other, whose rims are welded one over the other."""
RIM = "[[-2, 25], [-2, 12], [-19, 12], [-19, -13], [19, -13], [19, 12], [2, 12], [2, 25]]"


def seam_pages(cap: str, tmp_path: Path) -> list[Any]:
    file = tmp_path / "double.toml"
    file.write_text(DOUBLE.replace("CAP", cap).replace("RIM", RIM))
    return page(lambda _: [], str(file)).findall(".//article")


def test_a_film_under_a_joined_stack_is_laid_on_the_work_turned_over(tmp_path: Path) -> None:
    """From above the tool would melt the cap, which lies over the seam of the other two films."""
    upper, lower = seam_pages("pe", tmp_path)
    assert "Turn the work over" not in words_of(upper)
    assert "mirrored" not in words_of(upper)
    words = words_of(lower)
    assert "Turn the work over, left to right, layer 3 down" in words
    assert words.index("Turn the work over") < words.index("Lay layer 1: PE base P01, upper face")
    assert "the path is mirrored left to right" in words
    assert "Print seams.pdf at 100 %, mirrored left to right" in words
    assert "A machine takes the file below, mirrored left to right." in words
    # It begins at x = -2, 18 mm from the left edge at -20 and 24 mm from the right one at 22.
    assert "18.0 mm right of the films' left edge" in words_of(upper)
    assert "24.0 mm right of the films' left edge" in words
    drawn = [article.find(".//svg/g").get("transform") for article in (upper, lower)]
    assert drawn == ["scale(1 -1)", "scale(-1 -1)"]


def test_under_a_film_that_stays_solid_a_film_is_laid_as_it_lies(tmp_path: Path) -> None:
    words = words_of(seam_pages("pet", tmp_path)[1])
    assert "Turn the work over" not in words
    assert "Lay layer 1: PE base P01, by eye; then what is joined on it, as it was." in words
    assert "mirrored" not in words


def test_the_papers_actuator_is_not_on_other_pages(sheet_files: Any) -> None:
    folded = words_of(page(sheet_files, "folded"))
    assert "faced up in the press" not in folded
    assert "balloons of 5 mm" not in folded
    assert "Handling________ min" in folded
    assert "Total, one actuator________ h" in folded
    # From the mouth at 24 to 12, where the seams' corners begin to be round.
    assert "Push the tube in between them, up to 5 mm deep, the inlet's length in" in folded
    assert "the channel runs straight for 12 mm" in folded
    paper = words_of(page(sheet_files, "1dof-5mm"))
    assert "balloons of 5 mm" in paper
    assert "Handling60 min" in paper
    # Strips of the array's rows: from the pouch's rim at 9 + 4 mm to the mouth at 22 mm.
    assert "the channel runs straight for 9 mm" in words_of(page(sheet_files, "array"))


def test_tubes_are_glued_with_what_bonds_their_film(sheet_files: Any) -> None:
    """The paper sealed Stretchlon 200; nobody stated that its vinyl adhesive bonds polyethylene."""
    vinyl, blank = "Loctite Vinyl", "________ (nobody stated an adhesive for"
    assert vinyl in words_of(page(sheet_files, "1dof-5mm"))
    assert blank not in words_of(page(sheet_files, "1dof-5mm"))
    tpu = page(sheet_files, "1dof-5mm", "films.tpe.product=TPU", "films.tpe.thickness=0.05")
    # The finger's mouth is between two films of polyethylene; its slotted sheet has no tab.
    for name in ("folded", "gripper", "finger"):
        words = words_of(page(sheet_files, name))
        assert vinyl not in words
        assert f"small drop of {blank} LDPE film, 100 um:" in words
        assert f"Adhesive{blank} LDPE film, 100 um:" in words
    assert f"small drop of {blank} TPU" in words_of(tpu)
    # What a designer names that the kit lacks is the designer's to know.
    named = words_of(page(sheet_files, "folded", "inlet.adhesive=Hot melt of EVA"))
    assert "small drop of Hot melt of EVA; keep it out" in named


def test_a_flash_bond_that_bonds_nothing_is_said_to_be_needless(sheet_files: Any) -> None:
    first, second = [words_of(step) for step in page(sheet_files, "array").findall(".//article")]
    assert "No bond: one film and masks" in first
    assert "Leave this step out: nothing bonds in it" in first
    assert "Flash bond" not in first
    assert "After the flash bond it cannot be moved" not in first
    laid = "lay layers 2 and 3 one by one in place of its stack, as step 1 says"
    assert f"Where step 1 was left out, {laid}; the print shows their edges too." in second
    assert "leave it out: nothing bonds in it" in words_of(page(sheet_files, "array"))
    assert "leave it out" not in words_of(page(sheet_files, "1dof-5mm"))
    # Textile coated with TPU: there is no TPE film in it.
    assert "Full bond: films that face each other melt into one" in second
    assert "nothing bonds" not in words_of(page(sheet_files, "1dof-5mm"))


def test_a_tube_goes_between_the_films_of_its_own_chamber(sheet_files: Any) -> None:
    words = words_of(page(sheet_files, "diode"))
    # The channel lies between base and wall, the pocket between wall and cap.
    assert "the tab's end, layers 1 and 3 for in and layers 3 and 5 for out; the PTFE" in words


def test_chambers_of_one_net_are_filled_by_its_first_tube(sheet_files: Any) -> None:
    """What comes out of the other is no leak between chambers."""
    diode, gripper = words_of(page(sheet_files, "diode")), words_of(page(sheet_files, "gripper"))
    closed = "(net through): fill by in, and keep out closed in every test below."
    open_tubes = "While one chamber is full, watch the open tubes of the others"
    assert closed in diode
    assert open_tubes not in diode
    assert "raise the chamber slowly to 5 kPa and hold for 60 s. All" in diode
    assert "the other chambers open" not in diode
    assert "lead into the same channels" not in gripper
    assert open_tubes in gripper
    assert "raise each chamber slowly to 5 kPa" in gripper


def test_a_folded_part_comes_off_the_sheet_as_one() -> None:
    design, laminate = built("folded")
    plan = schedule(laminate, design)
    _, held, _ = before_cutting([Work(design, laminate, plan, (), Job(SHA, "sbafab 1.0.0"))])
    # One part and one spare, of 21.3 cm2 of LDPE, 0.1 mm thick, 0.92 mg/mm3; each half weighs 98.
    assert "2 come free, the lightest of 197 mg" in held.text


def test_a_stack_for_vacuum_is_tested_under_vacuum(sheet_files: Any) -> None:
    words = words_of(page(sheet_files, "vacuum"))
    assert "Bottom balloon, layers 2 to 10" in words
    assert "draw the chamber to the vacuum of use" in words
    assert "vacuum of use" not in words_of(page(sheet_files, "pouch"))


def test_paths_of_seams_are_printed_on_the_films_at_one_to_one(sheet_files: Any) -> None:
    _, laminate = built("folded")
    data = seams_pdf(laminate, SHA)
    assert data is not None
    words = data.decode("latin-1")
    assert words.count("/Type /Page ") == 1
    # Millimetres, 72 / 25.4 points each, and the path as in the design, from its first corner.
    assert "2.8346456693 0 0 2.8346456693 0 0 cm" in words
    left = r"q 1 0 0 1 (\S+) (\S+) cm -19 -13 m -19 12 l -2\.2 12 l -2\.2 25 l S Q"
    (x, y) = re.findall(left, words)[0]
    # The fold is at y = -12: an edge of the film runs there, as far off as the path.
    assert re.search(rf"\S+ {float(y) - 12:g} [ml]", words)
    assert "step 3: seam right, hot-tip, 2 mm wide" in words
    assert seams_pdf(built("pouch")[1], SHA) is None
    assert "Print seams.pdf at 100 %" in words_of(page(sheet_files, "folded"))
    assert float(x) > 0


def test_films_are_named_and_held_as_what_they_are(sheet_files: Any) -> None:
    vacuum = words_of(page(sheet_files, "vacuum"))
    # Its masks are PET, which adhesives hold; seven of them are alike.
    assert "PET50, 0.05 mm thick: stick it" in vacuum
    assert "PTFE hardly sticks" not in vacuum
    assert "Lay layers 3 to 9, all alike: PET50 chamber mask P03." in vacuum
    assert "PTFE hardly sticks" in words_of(page(sheet_files, "3dof-15mm"))
    finger = words_of(page(sheet_files, "finger"))
    # The cells of a row follow each other without a space.
    assert "parts in 1 layersee the cut files" in finger
    assert "PETPE, PE and PTFE kerf uncalibrated" in finger
