"""The press steps and the plate, by the figures that their pages show."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import shapely

from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.files import assembly_of
from sbafab.design.files import read_toml, templates_folder
from sbafab.design.sections import Acceptance
from sbafab.laminate.burst import burst
from sbafab.laminate.lay_up import press_steps
from sbafab.reports.drawing import text_width
from sbafab.reports.prints import seams_pdf
from sbafab.reports.traveller.assembly_page import PartJoint, joints
from sbafab.reports.traveller.lay_up import beds
from sbafab.reports.traveller.lay_up import pitch as pitch_of
from sbafab.reports.traveller.page import (
    PressPage,
    acceptance,
    joint_pages,
    proof,
    step_pages,
    straight_run,
)
from sbafab.reports.traveller.pictures import plan
from tests.reports.pages import DOUBLE, EARS, TPU, bench, built, page, words_of, work_of

TPE, PTFE, BOND, OVERHANG = 0.038, 0.025, 0.75, 0.5


def hole_rows(tree: Any) -> list[list[str]]:
    [table] = [t for t in tree.iter("table") if t.get("class") == "holes"]
    return [[words_of(cell) for cell in row] for row in table.findall(".//tbody/tr")]


def test_pins_stand_over_the_stack_by_their_chamfer_at_least() -> None:
    work = work_of("3dof-15mm")
    depths = {row[1]: row[2] for row in hole_rows(bench(work))}
    first, second, third, fourth = step_pages(work)
    assert second.pins == fourth.pins == []
    for step, stack in ((first, TPE + PTFE), (third, 27 * TPE + 28 * PTFE)):
        pins = [pin for _, pin in step.pins]
        # Chamfers of ISO 8734: 0.2 at a diameter of 1, 0.35 at 2.
        assert [pin.diameter_mm for pin in pins] == [1, 2]
        for pin, chamfer in zip(pins, (0.2, 0.35), strict=True):
            assert depths[f"{pin.diameter_mm:g}"] == f"{pin.seat_mm:g} ± 0.05"
            # A pin's length is good to 0.25, its hole's depth to 0.05.
            assert pin.stands_mm == pytest.approx(pin.length_mm - pin.seat_mm)
            assert pin.tolerance_mm == pytest.approx(0.3)
            # The stack lies on a release film of 0.05 mm, which the pins are pricked through.
            assert step.step.top_mm == pytest.approx(0.05 + stack)
            assert pin.stands_mm - pin.tolerance_mm - step.step.top_mm >= chamfer


def test_the_hole_table_has_every_pin_from_the_plates_corner() -> None:
    work = work_of("3dof-15mm")
    rows = hole_rows(bench(work))
    assert [row[0] for row in rows] == [pin.name for pin in work.laminate.pins]
    for row, pin in zip(rows, work.laminate.pins, strict=True):
        assert (float(row[6]), float(row[7])) == pytest.approx(pin.centre, abs=6e-4)
    # Both frames differ by one shift, and the plate's own lies in its front left corner.
    shifts = {tuple(round(float(r[4 + i]) - float(r[6 + i]), 2) for i in (0, 1)) for r in rows}
    assert len(shifts) == 1
    assert all(60 < value < 95 for value in shifts.pop())


def edges_by_eye(step: PressPage) -> dict[str, set[tuple[str, float | None, str, bool]]]:
    """What the hand decides by pattern, and the edge along which."""
    found: dict[str, set[tuple[str, float | None, str, bool]]] = {}
    for bed in (one for one in step.beds if one.made_in is None):
        for by_eye in (one for lay in step.lays(bed) for one in lay.by_eye):
            edge = by_eye.edge
            assert edge is not None
            said = by_eye.hand, edge.outside, edge.neighbour, edge.all_round
            found.setdefault(by_eye.pattern, set()).add(said)
    return found


def test_a_hand_lays_what_no_pin_holds_and_turns_what_one_holds() -> None:
    """Separators turn about the lumen alone; walls have four pins, masks of pockets are discs."""
    first, _, third, _ = step_pages(work_of("3dof-15mm"))
    assert edges_by_eye(third) == {"P04": {("turn", OVERHANG, "TPE wall", True)}}
    # Each strip of the mask in pieces turns about the pin of its own chamber.
    assert edges_by_eye(first) == {"P02": {("turn", -BOND, "TPE wall", False)}}
    # With ears all have two pins at least.
    for step in step_pages(work_of("3dof-15mm", EARS)):
        assert edges_by_eye(step) == {}
    # One chamber has no lumen: its separators open wider than the only pin, whose lowest layer
    # gives the angle that the wall is turned to.
    first, _, third, _ = step_pages(work_of("1dof-5mm"))
    assert set(edges_by_eye(first)) == {"P03"}
    assert {edge[1:3] for edge in edges_by_eye(first)["P03"]} == {(BOND, "PTFE chamber mask")}
    assert edges_by_eye(third)["P04"] == {("lay", OVERHANG, "TPE wall", True)}
    # A separator reaches 0.5 mm out of the smaller wall, and so 0.3 out of one 0.4 wider.
    sizes = ("chamber.diameter=[5.4, 3, 5.4, 5, 5]", "stack.balloons=5")
    _, _, third, *_ = step_pages(work_of("1dof-5mm", *sizes))
    assert {edge[1] for edge in edges_by_eye(third)["P10"]} == {0.3, 0.5}


def test_without_pins_each_edge_is_laid_along_another() -> None:
    _, second, _, fourth = step_pages(work_of("3dof-15mm"))
    edge = second.edge(2)
    assert edge is not None
    assert (edge.layer, edge.outside, edge.neighbour, edge.numbers[0]) == (3, 0, "TPE base", 1)
    stack, cap = fourth.edge(4), fourth.edge(59)
    assert stack is not None
    assert cap is not None
    assert (stack.layer, stack.outside, stack.numbers[0]) == (4, OVERHANG, 3)
    assert (cap.outside, cap.neighbour, cap.numbers) == (-OVERHANG, "PTFE separator mask", (56, 57))
    assert cap.on == "TPE wall"
    first, *_ = step_pages(work_of("radial-15mm"))
    edge = first.edge(5)
    assert edge is not None
    assert (edge.is_several, edge.outside, edge.neighbour) == (True, BOND, "PTFE chamber mask")


def test_every_piece_on_a_sheet_has_its_place() -> None:
    *_, last = step_pages(work_of("radial-15mm"))
    pitch = 15 * math.pi / 3
    assert pitch_of(last.places) == pytest.approx(pitch)
    # 1 mm of sheet past the SBAs, which are 11.5 wide and 20 long.
    for (out, piece), place in zip(
        itertools.product((OVERHANG, 0.0), (1, 2, 3)), last.places, strict=True
    ):
        x = (piece - 0.5) * pitch
        wanted = piece, x, 11.0, x - 5.75 - out, 1.0 - out
        told = place.piece, place.x, place.y, place.left, place.low
        assert told == pytest.approx(wanted, abs=1e-6)
    for other in (("3dof-15mm",), ("radial-15mm", EARS)):
        assert not any(step.places for step in step_pages(work_of(*other)))


@pytest.mark.parametrize(
    "design",
    [
        ("radial-15mm", EARS),
        ("3dof-15mm", EARS, "chamber.count=4", "chamber.diameter=6.5", "lumen.diameter=3"),
        ("3dof-15mm",),
    ],
)
def test_names_in_the_top_view_are_apart(design: tuple[str, ...]) -> None:
    _, laminate = built(*design)
    parts = press_steps(laminate)
    known = {thing.name for thing in (*laminate.pins, *laminate.chambers)}
    for part in parts:
        drawn = plan(laminate, part, beds(parts, part), "plan")
        boxes = {}
        for x, y, size, words in re.findall(
            r'<text x="([-\d.]+)" y="([-\d.]+)" font-size="([\d.]+)"[^>]*>(.*?)<', drawn
        ):
            half, high, foot = text_width(words, float(size)) / 2, float(size), float(y)
            left, low = float(x) - half, foot - 0.85 * high
            boxes[words] = shapely.box(left, low, left + 2 * half, low + high)
        names = boxes.keys() & known
        assert {pin.name for pin in part.pins} <= names
        for one, other in itertools.combinations([boxes[name] for name in names], 2):
            assert one.intersection(other).area <= 0.1 * min(one.area, other.area)


# Seams and folds of drawn layers.


def test_a_fold_is_placed_on_the_loose_part() -> None:
    """The line is at y = -12 and the mouth at y = 24 of the design."""
    fold, *seams = joint_pages(work_of("folded"))
    assert fold["lengths"][0] == pytest.approx(36.0)
    for number, (seam, name) in enumerate(zip(seams, ("left", "right"), strict=True), 1):
        assert seam["path"] == f"layers/seam_{number:03d}_{name}.dxf"
    # From (-19, -13) on films with their lower left corner at (-20, -12).
    assert seams[0]["start"] == pytest.approx((1.0, -1.0))


def seam_pages(cap: str, tmp_path: Path) -> list[Any]:
    file = tmp_path / f"double_{cap}.toml"
    cap_of = 'role = "cap", shape = "film", film = '
    file.write_text(DOUBLE.read_text().replace(f'{cap_of}"pe"', f'{cap_of}"{cap}"'))
    return joint_pages(work_of(str(file)))


def test_a_film_under_a_joined_stack_is_laid_on_the_work_turned_over(tmp_path: Path) -> None:
    """From above the tool would melt the cap, which lies over the seam of the other two films."""
    upper, lower = seam_pages("pe", tmp_path)
    assert (upper["step"].from_below, lower["step"].from_below) == (False, True)
    assert lower["held"] == 3
    assert [(layer.index, is_under) for layer, is_under in lower["lays"]] == [(1, False)]
    # It begins at x = -2, 18 mm from the left edge at -20 and 24 mm from the right one at 22.
    assert (upper["start"][0], lower["start"][0]) == pytest.approx((18.0, 24.0))
    assert '<g transform="matrix(-' in lower["picture"]
    assert '<g transform="matrix(-' not in upper["picture"]
    # Under a film that stays solid it is laid as it lies.
    _, solid = seam_pages("pet", tmp_path)
    assert not solid["step"].from_below
    assert [(layer.index, is_under) for layer, is_under in solid["lays"]] == [(1, True)]


def test_the_channel_of_a_drawn_tab_runs_straight_up_to_its_first_corner() -> None:
    """Folded: from the mouth at 24 to 12, where the seams' corners begin to be round. Array: strips
    from the pouch's rim at 9 + 4 mm to the mouth at 22 mm.
    """
    for template, run in (("folded", 12), ("array", 9)):
        laminate = built(template)[1]
        shortest = min(straight_run(laminate, inlet) for inlet in laminate.inlets)
        assert math.floor(shortest) == run


def test_paths_of_seams_are_printed_on_the_films_at_one_to_one() -> None:
    work = work_of("folded")
    data = seams_pdf(work.laminate, work.sha256)
    assert data is not None
    words = data.decode("latin-1")
    assert words.count("/Type /Page ") == 1
    # Millimetres, 72 / 25.4 points each, and the path as in the design, from its first corner.
    assert "2.8346456693 0 0 2.8346456693 0 0 cm" in words
    left = r"q 1 0 0 1 (\S+) (\S+) cm -19 -13 m -19 12 l -2\.2 12 l -2\.2 25 l S Q"
    (x, y) = re.findall(left, words)[0]
    # The fold is at y = -12: an edge of the film runs there, shifted as far as the path.
    assert re.search(rf"q 1 0 0 1 {x} {y} cm [^Q]*\S+ -12 [ml]", words)
    assert float(x) > 0
    assert seams_pdf(built("pouch")[1], work.sha256) is None


def test_pins_are_drawn_filled_where_they_are_in() -> None:
    work = work_of("3dof-15mm")
    for step, article in zip(work.schedule.steps, page(work).findall(".//article"), strict=True):
        drawn = article.findall(".//svg")[0]
        fills = Counter(circle.get("fill") for circle in drawn.iter("circle"))
        # One circle of each kind belongs to the key.
        assert fills["#1a1a1a"] == len(step.pins) + 1
        assert fills["#ffffff"] == len(work.laminate.pins) - len(step.pins) + 1


def test_the_places_of_a_full_plate_are_said_as_a_grid() -> None:
    work = work_of("1dof-5mm", "stack.balloons=2", "order.copies=60", "order.at_once=60")
    words = words_of(bench(work))
    found = re.search(
        r"rows of (\d+): .* next ([\d.]+) mm to the right, .* next ([\d.]+) mm", words
    )
    assert found is not None
    columns, right, back = int(found[1]), float(found[2]), float(found[3])
    for n, place in enumerate(work.cycles.places):
        assert place == pytest.approx(((n % columns) * right, (n // columns) * back), abs=2e-2)
    assert "place 2 by" not in words


# The traveller's steps of joining: an order that can be done, parts placed as they are drawn.


def together(template: str, **parts: dict[str, Any]) -> Assembled:
    data = read_toml(templates_folder() / f"{template}.toml")
    for name, keys in parts.items():
        data["parts"].setdefault(name, {}).update(keys)
    return assemble(assembly_of(data, templates_folder() / "some.toml"))


def joint(assembled: Assembled, name: str) -> PartJoint:
    [found] = [one for one in joints(assembled) if one.placed.name == name]
    return found


def test_a_line_is_threaded_while_both_ends_can_be_reached() -> None:
    brace = together("brace")
    names = [one.placed.name for one in joints(brace)]
    assert names == ["tube", "grip", "vacuum", "arm", "cup"]
    assert joint(brace, "arm").lines == ["vacuum"]
    # The root is there before what it carries.
    line = {"kind": "line", "on": "arm", "at": "lumen", "length": 30, "along": -5}
    names = [one.placed.name for one in joints(together("aperture", feed=line))]
    assert names.index("arm") == 0 < names.index("feed")


@pytest.mark.parametrize("end", ["end", "start"])
@pytest.mark.parametrize("turn", [0, 60, 180, 250])
def test_the_tab_points_where_it_is_said_to(end: str, turn: float) -> None:
    assembled = together("standing", head={"at": end, "turn": turn})
    head = assembled["head"]
    assert head.made is not None
    (mouth_x, mouth_y) = head.made.laminate.inlets[0].mouth
    # The tube lies; in its own frame the marked line is at x, and its end is looked at from above.
    tube = assembled["tube"]
    at = head.at((mouth_x, mouth_y, 0.0))
    x_axis, y_axis = (
        [b - a for a, b in zip(tube.at((0, 0, 0)), tube.at(unit), strict=True)]
        for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    )
    x, y = (sum(a * b for a, b in zip(at, axis, strict=True)) for axis in (x_axis, y_axis))
    drawn = math.degrees(math.atan2(y, x)) * (1 if end == "end" else -1) % 360
    told = joint(assembled, "head").heading
    assert math.cos(math.radians(told - drawn)) == pytest.approx(1)


@pytest.mark.parametrize(("at", "up"), [("top", 5), ("bottom", -5)])
def test_a_place_on_a_plate_is_said_as_it_is_seen(at: str, up: float) -> None:
    plate = {"kind": "base", "width": 60, "length": 30, "thickness": 2, "material": "acrylic"}
    two = {"kind": "sba", "design": "1dof-5mm", "on": "plate", "at": at, "offset": [-15, 5]}
    tables = {"name": "own", "family": "assembly", "parts": {"plate": plate, "two": two}}
    own = assemble(assembly_of(tables, templates_folder() / "some.toml"))
    assert joint(own, "two").aside == (-15, up)


def test_supply_tubes_run_where_no_balloon_opens() -> None:
    """Three SBAs at 0, 120 and 240 degrees round the tube; the gaps are half way between."""
    runs = joint(together("brace"), "arm").supply
    assert [run.angle % 360 for run in runs] == pytest.approx([60, 180, 300])
    assert [run.over for run in runs] == [()] * 3
    crossing = joint(together("brace", arm={"turn": 0}), "arm").supply
    assert {name for run in crossing for name in run.over} == {"grip"}
    assert joint(together("aperture"), "arm").supply == ()


def test_stacked_actuators_go_by_each_others_tabs() -> None:
    second = {"kind": "sba", "design": "1dof-5mm", "on": "arm", "at": "top", "turn": 90}
    assert joint(together("aperture", second=second), "second").heading == 90
    tube = {"kind": "tube", "on": "arm", "at": "top", "turn": 30}
    assert joint(together("aperture", tube=tube), "tube").heading == 30


def test_a_wrap_is_glued_with_what_its_design_names() -> None:
    bare = together("brace")
    part = bare["grip"].part.model_copy(update={"glue": None})
    parts = tuple(replace(p, part=part) if p.name == "grip" else p for p in bare.parts)
    assert joint(replace(bare, parts=parts), "grip").glue == "3M 1587"


# What an actuator must stand: the proof pressure, and the fitting that it is tested with.


@pytest.mark.parametrize(
    ("template", "changes", "proved"),
    [
        ("1dof-5mm", (), 150.0),
        ("3dof-15mm", (), 150.0),
        ("1dof-10mm", (), 110.0),
        ("1dof-10mm", ("films.tpe.thickness=0.057",), 150.0),
        ("radial-15mm", (), 85.0),
        ("1dof-5mm", ("acceptance.proof_pressure_kpa=120",), 120.0),
        ("1dof-5mm", ("films.tpe.product=TPU", "films.tpe.thickness=0.038"), None),
        ("1dof-5mm", (*TPU, "acceptance.proof_pressure_kpa=60"), 60.0),
    ],
)
def test_proof_pressure_stays_well_below_the_burst(
    template: str, changes: tuple[str, ...], proved: float | None
) -> None:
    """What pockets burst at by the paper's, tests/rules/test_pressure_rating.py has."""
    work = work_of(template, *changes)
    estimate, found = burst(work.laminate), proof(work)
    assert (estimate is None) == any("films.tpe.product" in change for change in changes)
    assert found.kilopascals == proved
    if estimate is not None and proved is not None:
        assert proved <= 0.6 * estimate.kpa
    assert (found.paper_kpa, found.paper_error) == (367, 18)


def test_the_needle_holds_in_the_tubes_bore() -> None:
    """0.02825 in of 22 gauge over the tube's 0.025 in: 13 % wider."""
    assert "22 G (outer diameter 0.718 mm)" in Acceptance().fitting
    assert (
        acceptance(work_of("3dof-15mm"))["bore"] == 0.635 == pytest.approx(0.718 / 1.13, abs=1e-3)
    )


def test_chambers_of_one_net_are_filled_by_its_first_tube() -> None:
    """What comes out of the other is no leak between chambers."""
    diode, gripper = (acceptance(work_of(name)) for name in ("diode", "gripper"))
    assert diode["shared"] == {"through": ["in", "out"]}
    assert diode["filled"] == []
    # The channel lies between base and wall, the pocket between wall and cap.
    assert diode["tab_films"] == {(1, 3): ["in"], (3, 5): ["out"]}
    assert gripper["shared"] == {}
    assert len(gripper["filled"]) > 1
