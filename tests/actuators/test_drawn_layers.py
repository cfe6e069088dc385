"""Drawn layers: the regions and findings of a family's own, and what is refused in a sentence."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sbafab.actuators import FAMILIES, build, load_design
from sbafab.design.files import read_toml, template_names, template_text, templates_folder
from sbafab.design.identity import design_sha256
from sbafab.design.records import validated
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, disc
from sbafab.laminate.joints import Net, Port
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.lay_up import press_steps
from sbafab.meshing.conforming.layup import MeshSettings
from sbafab.meshing.conforming.meshes import conforming_meshes
from sbafab.meshing.solid import MASKLESS_GAP, cavity, solid
from sbafab.models.figures import PredictionRequest
from sbafab.models.pouch import half_angle
from sbafab.models.prediction import predict
from sbafab.rules.deck import run_deck, run_rule
from sbafab.rules.finding import Finding
from sbafab.rules.measures import Measures
from sbafab.rules.tube_fit import RULE as TUBE_FIT
from tests.designs import FEW, drawn, failing, tables
from tests.quick import few

POCKET, BOND, OVERHANG, BORE = 5.0, 0.75, 0.5, 1.04
END = POCKET / 2 + BOND + 5.0


def as_1dof(balloons: int, width: float) -> dict[str, Any]:
    """The layers of 1dof-5mm as its geometry states them, drawn by shapes."""
    beyond = END + OVERHANG
    shapes = {
        "pocket": {"disc": POCKET},
        "bore": {"disc": BORE},
        "plate": {"offset": "pocket", "by": BOND},
        "tab": {"slot": [[0, 0], [END, 0]], "width": width + 2 * BOND},
        "strip": {"slot": [[0, 0], [beyond, 0]], "width": width},
        "sharp": {"union": ["plate", "tab"]},
        "bottom": {"fillet": "sharp", "radius": 1},
        "bottom-wall": {"difference": ["bottom", "bore"]},
        "fed": {"union": ["pocket", "strip"]},
        "fed-mask": {"difference": ["fed", "bore"]},
        "wall": {"ring": [POCKET + 2 * BOND, BORE]},
        "mask": {"difference": ["pocket", "bore"]},
        "reach": {"offset": "plate", "by": OVERHANG},
        "neck": {"offset": "bore", "by": BOND},
        "separator": {"difference": ["reach", "neck"]},
    }
    rows = [("base", "bottom"), ("chamber-mask", "fed-mask"), ("wall", "bottom-wall")]
    for _ in range(balloons - 1):
        rows += [("separator-mask", "separator"), ("wall", "wall")]
        rows += [("chamber-mask", "mask"), ("wall", "wall")]
    rows[-1] = ("cap", "plate")
    chamber = {"name": "chamber1", "centres": [[0, 0]], "mouth": [END, 0], "angle": 0}
    return {
        "name": "1dof-5mm",
        "family": "drawn",
        "layers": [{"role": role, "shape": shape} for role, shape in rows],
        "chambers": [chamber],
        "shapes": shapes,
        "body": "plate",
    }


def test_1dof_5mm_drawn_is_the_familys_own_laminate(tmp_path: Path) -> None:
    ours = build(load_design("1dof-5mm"))
    theirs = drawn(tmp_path, as_1dof(ours.balloons, ours.inlets[0].width))
    assert replace(theirs, family="1dof") == ours
    assert run_deck(theirs, FEW) == run_deck(ours, FEW)
    assert failing(ours) == set()


def test_shapes_have_the_areas_of_closed_formulas(tmp_path: Path) -> None:
    def area(shape: dict[str, Any], **others: dict[str, Any]) -> float:
        data = tables("pouch")
        data["shapes"] |= {**others, "body": shape}
        return drawn(tmp_path, {**data, "body": "body"}).outline.area

    hole = {"disc": 2, "at": [5, 0]}
    assert area({"disc": 4}) == pytest.approx(4 * math.pi)
    assert area({"ring": [4, 2]}) == pytest.approx(3 * math.pi)
    assert area({"slot": [[0, 0], [3, 4]], "width": 2}) == pytest.approx(10)
    assert area({"stadium": [2, 5], "turned": 30}) == pytest.approx(6 + math.pi)
    assert area({"polygon": [[0, 0], [0, 3], [4, 0]]}) == pytest.approx(6)
    assert area({"path": [[0, 0], [0, 3], [4, 0]]}) == pytest.approx(6)
    # Half a disc below a square; a segment of 270 degrees taken out of the side of a rectangle.
    assert area({"path": [[0, 0, 1], [2, 0], [2, 2], [0, 2]]}) == pytest.approx(4 + math.pi / 2)
    turn = math.radians(270)
    dented = [[0, 0, -math.tan(turn / 4)], [0, 2**0.5], [0, 5], [-9, 5], [-9, -9], [0, -9]]
    assert area({"path": dented}) == pytest.approx(9 * 14 - (turn - math.sin(turn)) / 2)
    assert area({"offset": "hole", "by": 1}, hole=hole) == pytest.approx(4 * math.pi)
    around = {"pattern": "hole", "count": 6, "round": [0, 0]}
    assert area(around, hole=hole) == pytest.approx(6 * math.pi)
    line = {"pattern": "hole", "count": 3, "step": [0, 3]}
    assert area(line, hole=hole) == pytest.approx(3 * math.pi)


def test_a_path_has_exact_arcs(tmp_path: Path) -> None:
    def shape(**keys: object) -> Region:
        data = tables("pouch")
        data["shapes"]["body"] = keys
        return drawn(tmp_path, {**data, "body": "body"}).outline

    assert shape(path=[[-2, 0, 1], [2, 0, 1]]) == shape(disc=4)
    sides = [[1, -2], [1, 2, 1], [-1, 2], [-1, -2, 1]]
    assert shape(path=sides) == shape(stadium=[2, 6])
    back = [[-1, -2], [-1, 2, -1], [1, 2], [1, -2, -1]]
    assert shape(path=back, turned=90) == shape(stadium=[2, 6], turned=90)
    # More than half a turn, and a bulge that bends nothing.
    arcs = [edge for edge in shape(path=[[0, 0, 2], [3, 0, 1e-300]]).edges if edge.bulge]
    radius = 3 * (2**2 + 1) / (4 * 2)
    assert sum(edge.length for edge in arcs) == pytest.approx(radius * 4 * math.atan(2))


def test_a_drawing_and_a_film_of_its_own_go_into_the_folder_and_back(tmp_path: Path) -> None:
    import ezdxf

    def draw(radius: float) -> None:
        drawing = ezdxf.new(units=4)
        drawing.modelspace().add_circle((0, 0), radius)
        drawing.saveas(tmp_path / "round.dxf")

    data = tables("pouch")
    data["shapes"]["pocket"] = {"file": "round.dxf"}
    data["films"] = {"pet": {"kind": "structural", "product": "PET", "thickness": 0.1}}
    data["layers"][2]["film"] = "pet"
    draw(12)
    laminate = drawn(tmp_path, data)
    # The strip leaves the pocket within the disc, and reaches far beyond it.
    mask = laminate.layers[1].profile
    assert (mask & disc((0, 0), 12)).area == pytest.approx(144 * math.pi)
    assert [layer.film.material for layer in laminate.layers] == ["TPE", "PTFE", "PET"]

    folders = []
    for out in ("once", "again"):
        design = load_design(tmp_path / "drawn.toml", ["rules.yield_builds=100"])
        folders.append(generate(RunRequest(design, tmp_path / out, ("cut",))).folder)
    once, again = (
        {path.relative_to(top): path.read_bytes() for path in top.rglob("*") if path.is_file()}
        for top in folders
    )
    assert once == again
    assert {finding.verdict for finding in check_folder(folders[0])} <= {"pass", "warn"}
    assert (folders[0] / "pocket-file.dxf").read_bytes() == (tmp_path / "round.dxf").read_bytes()

    before = design_sha256(load_design(tmp_path / "drawn.toml"))
    draw(11)
    assert design_sha256(load_design(tmp_path / "drawn.toml")) != before


def test_predictions_leave_out_in_a_sentence_what_has_no_model() -> None:
    data = tables("pouch")
    del data["mechanism"]
    design = validated(data, {"drawn": FAMILIES["drawn"].record}, Path())
    prediction = predict(design, PredictionRequest((10.0,)))
    reasons = {item.reason for item in prediction.left_out}
    assert {figure.group for figure in prediction.figures} <= {"size", "inlet", "strength"}
    assert len(reasons) == 1
    assert "no model knows the form of layers drawn one by one" in reasons.pop()


def test_a_pouch_motor_pulls_by_the_closed_form_of_its_pocket_as_drawn() -> None:
    """40 x 30 mm along x: at t = 1.0 rad, 15.853 % shorter, p D L cos t / t."""
    prediction = predict(load_design("pouch"), PredictionRequest((0.5,)))
    assert prediction.value("contraction") == pytest.approx(40 * (1 - 2 / math.pi))
    angle = float(half_angle(0.1))
    by_hand = 0.5e-3 * 30 * 40 * math.cos(angle) / angle
    assert prediction.value("pull", kpa=0.5, share=0.1) == pytest.approx(by_hand, rel=1e-6)
    assert all("not calibrated" in f.model.trust for f in prediction.figures if f.group == "force")
    quantities = [line.quantity for line in prediction.verdict]
    assert {"stroke", "force"} <= set(quantities)


def test_a_film_that_would_stretch_leaves_the_pull_out_and_says_how_far_it_holds() -> None:
    """T = p L / 2 t, stretched by 5 % at E h / 20 = 0.019 N/mm."""
    prediction = predict(load_design("pouch"), PredictionRequest((10.0,)))
    angle = float(half_angle(0.1))
    most = 1000 * 0.05 * 10 * 0.038 * 2 * angle / 40
    (reason,) = {o.reason for o in prediction.left_out if "10 kPa, 10 % shorter" in o.name}
    assert f"holds to {most:.3g} kPa" in reason
    assert any(f.name.startswith("pull at 0.7") for f in prediction.figures)


def test_a_width_unlike_the_drawn_strip_is_named() -> None:
    [chamber] = load_design("pouch").model_dump()["chambers"]
    findings = {}
    for width in (2.0, 3.0):
        design = load_design("pouch").with_({"chambers": [{**chamber, "width": width}]})
        findings[width] = run_rule(TUBE_FIT, Measures(build(design), design))
    assert [finding.verdict for finding in findings[2.0]] == ["pass"]
    *_, unlike = findings[3.0]
    assert unlike.verdict == "warn"
    assert (
        "stated width of 3.000 mm but is drawn 2.000 mm wide, x 0.000, y 24.000" in unlike.message
    )


# Layers in any order, and films bonded by seams.

SIDE, WIDTH, TAB = 40.0, 1.0, 4.0


def test_a_seam_bonds_half_its_width_on_both_sides_of_its_path(tmp_path: Path) -> None:
    (gap,) = drawn(tmp_path, tables("welded")).interfaces
    length = 4 * SIDE - TAB + 2 * 10
    # Four corners outside the square bend one way, two at the tab the other; ends stand in the air.
    corner = WIDTH**2 / 4 * (1 - math.pi / 4)
    assert gap.bond.area == pytest.approx(length * WIDTH - 6 * corner)
    assert gap.kind == "chamber"
    assert not gap.pressed
    assert gap.unbonded.area == pytest.approx(gap.contact.area - gap.bond.area)


def test_a_welded_pouch_passes_and_a_gap_in_its_seam_leaks(tmp_path: Path) -> None:
    assert failing(drawn(tmp_path, tables("welded"))) == set()
    data = tables("welded")
    data["seams"][0]["path"] = data["seams"][0]["path"][:-2]
    findings = {finding.rule: finding for finding in run_deck(drawn(tmp_path, data), FEW)}
    assert findings["sealing"].verdict == "fail"
    assert "close the path of the seam there, make it wider" in findings["sealing"].message
    assert "mask" not in findings["sealing"].message + findings["tube-fit"].message


def test_a_roller_ends_square_and_a_hot_tip_round(tmp_path: Path) -> None:
    data = tables("welded")
    line = {"name": "line", "layers": [1, 2], "path": [[-5, 0], [5, 0]], "width": 2}
    for tool, area in (("roller", 20.0), ("hot-tip", 20.0 + math.pi)):
        data["seams"] = [{**line, "tool": tool}]
        (gap,) = drawn(tmp_path, data).interfaces
        assert gap.bond.area == pytest.approx(area)


def test_sheets_masks_and_films_stack_in_any_order(tmp_path: Path) -> None:
    data = tables("pouch")
    film, mask = {"shape": "film"}, {"role": "chamber-mask", "shape": "mask"}
    data["layers"] = [
        {"role": "sheet", **film},
        {"role": "base", **film},
        mask,
        mask,
        {"role": "wall", **film},
        {"role": "cap", **film},
    ]
    laminate = drawn(tmp_path, data)
    assert [gap.kind for gap in laminate.interfaces] == ["bond", "chamber", "bond"]
    assert [layer.balloon for layer in laminate.layers] == [None, 1, 1, 1, 1, 1]
    assert failing(laminate) == set()
    assert laminate.interfaces[1].gap == pytest.approx(2 * laminate.layers[2].film.thickness)
    steps = press_steps(laminate)
    added = sorted(index for step in steps for index in step.adds)
    assert added == [layer.index for layer in laminate.layers]


# Ports and nets of drawn layers: keys, what is refused, and faults that nets alone catches.


def failures(laminate: Laminate) -> list[Finding]:
    return [finding for finding in run_deck(laminate, FEW) if finding.verdict == "fail"]


def test_a_routed_design_passes_the_deck(tmp_path: Path) -> None:
    laminate = drawn(tmp_path, tables("routed"))
    assert laminate.ports[2] == Port("tube", 3, 5, (0.0, 9.0), "hole", 1.016)
    assert laminate.nets == (Net("a", ("supply", "left")), Net("b", ("tube", "right")))
    assert laminate.bores == ()
    assert failures(laminate) == []


def without_hole(data: dict[str, Any]) -> None:
    data["shapes"]["middle"]["difference"].remove("hole-a")


def with_bridge(data: dict[str, Any]) -> None:
    data["shapes"]["bridge"] = {"slot": [[-8, 0], [8, 0]], "width": 2}
    data["shapes"]["pockets"]["union"].append("bridge")
    data["layers"][3]["pieces"] = 2


def with_stub(data: dict[str, Any]) -> None:
    data["shapes"]["stub"] = {"slot": [[-12, -9], [-12, -1]], "width": 2}
    data["shapes"]["routes"]["union"].append("stub")


def with_second_hole(data: dict[str, Any]) -> None:
    data["shapes"]["leak"] = {"disc": 1, "at": [8, -3]}
    data["shapes"]["top"]["difference"].append("leak")


def without_route(data: dict[str, Any]) -> None:
    data["shapes"]["routes"]["union"].remove("up-a")
    data["layers"][1]["pieces"] = 3


def too_narrow(data: dict[str, Any]) -> None:
    data["shapes"]["up-a"]["width"] = 0.25


FAULTS: list[tuple[Callable[[dict[str, Any]], None], str, Point]] = [
    (without_hole, "net a is open: left is not joined to supply; they are nearest at", (-8, -5.5)),
    (with_bridge, "nets a and b are joined at interface 2", (0, 0)),
    (with_stub, "net a has a dead end at interface 1", (-12, -2)),
    (with_second_hole, "net b reaches the outside at layer 5", (8, -3)),
    (without_route, "net a is open: left is not joined to supply; they are nearest", (-8, -7.1)),
    (
        too_narrow,
        "of net a that is hardest to open is 0.250 mm wide as drawn, at interface 1",
        (-8, -7.5),
    ),
]


@pytest.mark.parametrize(("spoil", "words", "place"), FAULTS)
def test_nets_alone_catches_it(
    tmp_path: Path, spoil: Callable[[dict[str, Any]], None], words: str, place: Point
) -> None:
    data = tables("routed")
    spoil(data)
    failed = failures(drawn(tmp_path, data))
    assert {finding.rule for finding in failed} == {"nets"}
    assert words in failed[0].message
    x, y = failed[0].where.x, failed[0].where.y
    assert x is not None
    assert y is not None
    assert math.dist((x, y), place) <= 1


def test_a_chamber_lies_in_its_net_in_each_of_its_balloons(tmp_path: Path) -> None:
    data = tables("two")
    data["layers"][3] = {"role": "chamber-mask", "shape": "foreign"}
    data["layers"][2]["shape"] = "film"
    failed = failures(drawn(tmp_path, data))
    opened, shorted = (finding for finding in failed if finding.rule == "nets")
    assert opened.message.startswith("net a is open: the pocket of a in balloon 2 is not joined to")
    assert shorted.message.startswith("nets a and b are joined at interface 2")
    # With no pocket at all there it is an open alone.
    data["layers"][3]["shape"] = "to-right"
    messages = [f.message for f in failures(drawn(tmp_path, data)) if f.rule == "nets"]
    assert [message.split(" (")[0] for message in messages] == [
        "net a is open: the pocket of a in balloon 2 lies outside all voids"
    ]


def test_a_bore_counts_with_nets_too(tmp_path: Path) -> None:
    """Its hole is 0.3 of what the bore asks for; nets alone would pass it."""
    data = tables("two")
    data["shapes"]["bore"] = {"disc": 0.6, "at": [0, 0]}
    (clear,) = failures(drawn(tmp_path, data))
    assert clear.rule == "channel-clear"
    assert clear.measured == pytest.approx(0.6)
    # Off the chamber's place it is a hole like others.
    data["shapes"]["bore"]["at"][1] += 2
    assert failures(drawn(tmp_path, data)) == []


# The templates of drawn layers: rules, sources, predictions and meshes of each.


DRAWN = [
    name
    for name in template_names()
    if read_toml(templates_folder() / f"{name}.toml")["family"] == "drawn"
]
SOURCE = re.compile(r"arXiv \d{4}\.\d{4,5}|\(\d{4}\) \d+|US \d{4}/\d{7}|doi 10\.")


@pytest.mark.parametrize("name", DRAWN)
def test_each_names_its_source_and_that_nobody_built_it(name: str) -> None:
    comment = template_text(name).partition("\nname")[0]
    assert "ever built" in comment.partition("\n")[0] + comment
    assert SOURCE.search(comment.replace("\n# ", " "))


@pytest.mark.parametrize("name", DRAWN)
def test_each_passes_its_rules(name: str) -> None:
    design = load_design(name)
    assert design.rules.waive == ()
    findings = run_deck(build(design), FEW)
    assert "fail" not in {finding.verdict for finding in findings}


@pytest.mark.parametrize("name", few(DRAWN, 3))
def test_each_has_a_volume_mesh_with_open_chambers(name: str) -> None:
    laminate = build(load_design(name))
    meshes = conforming_meshes(laminate, MeshSettings(h=1.0))
    films = sum(layer.profile.area * layer.film.thickness for layer in laminate.tpe_layers)
    assert meshes.statistics["volume"]["volume_mm3"] == pytest.approx(films, rel=1e-3)
    faces = meshes.volume.face_sets
    assert all(len(faces[f"cavity_{chamber.name}"]) for chamber in laminate.chambers)


def test_a_chamber_ends_where_a_hole_leads_to_the_next_one_of_its_net() -> None:
    """The mask's area times its thickness; the via's own air, 0.06 mm3, is in neither."""
    laminate = build(load_design("diode"))
    volume = conforming_meshes(laminate, MeshSettings(h=1.0, gaps=True)).volume
    base = laminate.layers[0].profile
    masks = [layer for layer in laminate.layers if layer.is_mask]
    for name, mask in zip(("in", "out"), masks, strict=True):
        expected = (mask.profile & base).area * mask.film.thickness
        assert volume.cavity(name)[0].volume == pytest.approx(expected, rel=2e-3)


def test_a_pouch_without_a_mask_has_a_cavity_that_its_fold_closes() -> None:
    """36 mm between seams x 22.5 mm to half a millimetre from the fold, and the inlet: 2 x 13."""
    laminate = build(load_design("folded"))
    (chamber,) = laminate.chambers
    held = cavity(laminate, chamber).volume
    assert held == pytest.approx(MASKLESS_GAP * (36 * 22.5 + 2 * 13), rel=0.01)
    whole = solid(laminate).volume
    films = 2 * laminate.layers[0].profile.area * 0.1
    void = MASKLESS_GAP * laminate.layers[0].profile.area
    assert whole == pytest.approx(films + void - held, rel=1e-3)


def test_the_finger_bends_by_the_moment_of_its_pouch() -> None:
    """By hand p D L^2 (1/2 + 1 / sqrt 3) / 4, D = 14 and L = 16 mm; 3 hinges of 95.3 deg."""
    prediction = predict(load_design("finger"), PredictionRequest((10.0,)))
    by_hand = 0.01 * 14 * 16**2 * (0.5 + 1 / math.sqrt(3)) / 4
    assert prediction.value("moment", kpa=10, share=0) == pytest.approx(by_hand, rel=1e-4)
    assert prediction.value("free_bend") == pytest.approx(3 * 95.3, abs=0.2)


def test_the_array_is_bounded_by_pressure_times_pocket_and_says_what_was_measured() -> None:
    prediction = predict(load_design("array"), PredictionRequest((230.0,)))
    by_hand = 0.230 * math.pi * 4**2
    assert prediction.value("force_bound", of="row2") == pytest.approx(by_hand, rel=0.05)
    (model,) = {f.model for f in prediction.figures if f.group == "force"}
    assert "2.1 N at 230 kPa" in model.trust


def test_the_vacuum_stack_slips_by_its_friction_and_jams_n_squared_times_as_stiff() -> None:
    """2 mu P b n h / 3 with mu = 0.3, b = 20, n h = 0.4: by hand 0.128 N at -80 kPa."""
    prediction = predict(load_design("vacuum"), PredictionRequest((-80.0,)))
    assert prediction.value("slip_load", kpa=-80) == pytest.approx(0.128)
    assert prediction.value("jamming_ratio") == 64


def test_the_grippers_right_cavity_goes_through_its_via() -> None:
    laminate = build(load_design("gripper"))
    (right,) = [chamber for chamber in laminate.chambers if chamber.name == "right"]
    # Pouch; channel down to its corner, along and at its end; the via through a film of 0.1 mm.
    lower, upper = 16 * 14, 3.4 * (24 - 2.3) + 3.4 * 25 + 3.4 * 3.8
    expected = 0.025 * (lower + upper) + 0.1 * math.pi * 0.52**2
    assert cavity(laminate, right).volume == pytest.approx(expected, rel=1e-4)
