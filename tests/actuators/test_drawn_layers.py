"""Drawn layers: the regions and findings of a family's own, and what is refused in a sentence."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from sbafab.actuators import FAMILIES, build, load_design
from sbafab.design.files import template_text
from sbafab.design.identity import design_sha256
from sbafab.design.records import validated
from sbafab.errors import DesignError
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.geometry.region import Region, disc
from sbafab.laminate.laminate import Laminate
from sbafab.models.figures import PredictionRequest
from sbafab.models.pouch import half_angle
from sbafab.models.prediction import predict
from sbafab.rules.deck import run_deck
from tests.designs import PAPER

FEW = PAPER.with_("rules.yield_builds=100")
POCKET, BOND, OVERHANG, BORE = 5.0, 0.75, 0.5, 1.04
END = POCKET / 2 + BOND + 5.0


def failing(laminate: Laminate) -> set[str]:
    return {finding.rule for finding in run_deck(laminate, FEW) if finding.verdict == "fail"}


def tables() -> dict[str, Any]:
    return tomllib.loads(template_text("pouch"))


def drawn(folder: Path, data: dict[str, Any]) -> Laminate:
    path = folder / "drawn.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    return build(load_design(path))


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
        data = tables()
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
        data = tables()
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


REFUSED: list[tuple[Sequence[str], object, str]] = [
    (("layers", "1", "role"), "cap", "layers has no gap with a chamber; lay a chamber-mask"),
    (("layers", "1", "shape"), "msk", "layer 2 names a shape 'msk' that is not there; did you"),
    (
        ("layers", "0", "flim"),
        "tpe",
        "layers.0.flim is not a key of a design file; did you mean layers.0.film?",
    ),
    (("shapes", "mask", "union"), ["mask"], "shapes.mask is made of itself, by way of mask"),
    (("shapes", "mask"), {"disc": 3, "ring": [3, 2]}, "has disc and ring; a shape is one of"),
    (("shapes", "mask"), {"slot": [[0, 0], [1, 0]]}, "is a slot without width; add it"),
    (("shapes", "mask"), {"disc": 3, "by": 1}, "is a disc, which has no by; remove it"),
    (("shapes", "mask"), {"pattern": "tab", "count": 2}, "has either round or step"),
    (("shapes", "mask"), {"offset": "pocket", "by": -20}, "shapes.mask encloses no area"),
    (("shapes", "mask"), {"file": "no.dxf"}, "no.dxf does not exist as a file; check its path"),
    (
        ("shapes", "mask"),
        {"polygon": [[0, 0], [5, 5], [5, 0], [0, 5]]},
        "shapes.mask.polygon crosses or touches itself at x 2.5000, y 2.5000",
    ),
    (("shapes", "mask"), {"polygon": [[0, 0], [0, 0], [5, 0]]}, "has one corner twice in a row"),
    (
        ("shapes", "mask"),
        {"path": [[0, 0], [5, 0], [5, 2, -1], [0, 2]]},
        "shapes.mask.path crosses or touches itself at x 1.0000, y 0.0000",
    ),
    (("shapes", "mask"), {"path": [[0, 0], [9, 0]]}, "shapes.mask.path encloses no area; move a"),
    (("shapes", "Mask"), {"disc": 3}, "has a shape named 'Mask'; a name is a small letter"),
    (("chambers",), [], "chambers is missing; add a list of"),
    (
        ("layers",),
        [{"role": "base", "shape": "film"}],
        "layers has 1 structural films; a laminate has",
    ),
    (("shapes", "mask"), {"pattern": "many", "count": 200, "step": [1, 0]}, "more than 5000 edges"),
    (("stack",), {"balloons": 2}, "stack.balloons = 2, and layers has 1 gaps with"),
    (("registration",), {"method": "ears"}, "'ears' adds parts to layers"),
    (("chamber",), {"outline": "a.dxf"}, "chamber.outline is a key that family drawn does not use"),
]


@pytest.mark.parametrize(("keys", "value", "sentence"), REFUSED)
def test_a_bad_key_is_refused_in_a_sentence(
    keys: Sequence[str], value: object, sentence: str, tmp_path: Path
) -> None:
    data: Any = tables()
    data["shapes"]["many"] = {"pattern": "tab", "count": 200, "step": [9, 0]}
    table = data
    for key in keys[:-1]:
        table = table[int(key) if key.isdigit() else key]
    table[keys[-1]] = value
    with pytest.raises(DesignError) as caught:
        drawn(tmp_path, data)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_drawing_and_a_film_of_its_own_go_into_the_folder_and_back(tmp_path: Path) -> None:
    import ezdxf

    def draw(radius: float) -> None:
        drawing = ezdxf.new(units=4)
        drawing.modelspace().add_circle((0, 0), radius)
        drawing.saveas(tmp_path / "round.dxf")

    data = tables()
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
    data = tables()
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
