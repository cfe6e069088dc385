"""What a worker answers: the same words and numbers as the command line, nothing from elsewhere."""

from __future__ import annotations

import math
import re
import tomllib
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from sbafab import api
from sbafab.design.files import rule_names
from sbafab.errors import DesignError
from sbafab.models import balloon_map
from sbafab.studio import jobs
from sbafab.studio.app import design_in
from sbafab.studio.jobs import JOBS, SupersededError, edited, refusal
from tests.studio.asking import answers, job, packed

SMALL = api.template("1dof-5mm").replace("balloons = 6", "balloons = 2") + (
    "[rules]\nyield_builds = 100\n"
)


def test_the_answers_come_in_the_order_a_person_waits_for_them(tmp_path: Path) -> None:
    got = answers(job(tmp_path, SMALL))
    kinds = [answer["kind"] for answer in got]
    assert kinds[:4] == ["text", "design", "laminate", "prediction"]
    assert kinds[-2:] == ["nets", "checked"]
    assert got[-3]["rule"] == "registration-yield"
    found = [
        finding for answer in got if answer["kind"] == "rule" for finding in answer["findings"]
    ]
    theirs = api.check(api.loads(SMALL))
    assert [(f["rule"], f["measured"], f["message"]) for f in found] == [
        (f.rule, f.measured, f.message) for f in theirs
    ]


def test_a_shape_that_the_page_has_is_not_sent_again(tmp_path: Path) -> None:
    first = seen(job(tmp_path, SMALL))
    assert first["shapes"]
    again = seen({**job(tmp_path, SMALL), "has": list(first["shapes"])})
    assert again["shapes"] == {}
    assert again["patterns"] == first["patterns"]


def test_named_shapes_are_sent_with_their_arcs_even_where_one_fails(tmp_path: Path) -> None:
    pouch = api.template("pouch")
    told = {answer["kind"]: answer for answer in answers(job(tmp_path, pouch))}
    named, shapes = told["shapes"]["named"], told["shapes"]["shapes"]
    film = next(row for row in told["laminate"]["layers"] if row["role"] == "base")
    assert named["film"] == told["laminate"]["patterns"][film["pattern"]]["shape"]
    bulges = {round(abs(bulge), 9) for bulge in shapes[named["film"]][0][2::3]}
    assert bulges == {0.0, round(math.tan(math.pi / 8), 9)}

    crossed = "pocket = {path = [[0, 0], [9, 9], [9, 0], [0, 9]]}"
    text = re.sub("(?m)^pocket = .*", crossed, pouch)
    told = {answer["kind"]: answer for answer in jobs_answers(job(tmp_path, text))}
    assert told["shapes"]["named"]["pocket"] is None
    assert told["shapes"]["named"]["film"] is None
    assert told["shapes"]["named"]["tab"] == named["tab"]
    assert told["error"]["field"] == "shapes.pocket.path"
    assert "crosses or touches itself at x 4.5000, y 4.5000" in told["error"]["message"]


def jobs_answers(asked: dict[str, Any]) -> list[dict[str, Any]]:
    """Everything that the page hears, errors included."""
    return list(jobs.answers(asked, lambda: None))


def test_a_row_of_a_list_is_edited_in_place() -> None:
    pouch = api.template("pouch")
    edits = [("layers.2.shape", '"ring"'), ("layers.2.pieces", "2"), ("shapes.tab.at", "[1, 2]")]
    tab = "tab = {slot = [[0, 10], [0, 24]], width = 4"
    assert edited(pouch, edits) == pouch.replace(
        '{role = "cap", shape = "film"}', '{role = "cap", shape = "ring", pieces = 2}'
    ).replace(tab, f"{tab}, at = [1, 2]")
    shape = "[[layers]]\nshape = 'a'  # first\n[[layers]]\nshape = 'b'  # second\n"
    assert edited(shape, [("layers.1.shape", "'c'")]) == shape.replace("'b'", "'c'")
    for key in ("layers.3.shape", "layers.x.shape", "layers.1"):
        with pytest.raises(DesignError, match=f"{key}.*change it in the text"):
            edited(pouch, [(key, "1")])


def seen(asked: dict[str, Any]) -> dict[str, Any]:
    """The laminate that a job answers."""
    return next(a for a in JOBS["live"](asked, lambda: None) if a["kind"] == "laminate")


def test_the_prediction_is_that_of_the_command(tmp_path: Path) -> None:
    told = {answer["kind"]: answer for answer in answers(job(tmp_path, SMALL))}
    theirs = api.predict(api.loads(SMALL), quick=True).as_dict()
    assert told["prediction"]["figures"] == theirs["figures"]
    # What an assembly does takes seconds; it is asked for when the hand rests.
    aperture = JOBS["live"](job(tmp_path, api.template("aperture")), lambda: None)
    told = {answer["kind"]: answer for answer in islice(aperture, 4)}
    assert told["prediction"]["quick"]
    assert told["prediction"]["figures"] == []


@pytest.mark.long
def test_what_to_design_with_stays_when_the_elastic_stack_s_figures_come(tmp_path: Path) -> None:
    text = edited(api.template("3dof-15mm"), [("stack.balloons", "2")])
    shown = JOBS["live"](job(tmp_path, text), lambda: None)
    quick = next(answer for answer in shown if answer["kind"] == "prediction")
    (full,) = answers({**job(tmp_path, text), "do": "elastic"})
    own = {key(figure): figure["design_with"] for figure in full["figures"]}
    assert {
        key(figure): figure["design_with"] for figure in quick["figures"]
    }.items() <= own.items()
    # The upper bound is hidden from the start.
    assert not own["bending", "maximum lateral tip displacement", "constant curvature"]


def key(figure: dict[str, Any]) -> tuple[str, str, str]:
    return figure["group"], figure["name"], figure["model"].partition(" (")[0]


@pytest.mark.parametrize(
    ("key", "value"),
    [("chamber.diameter", "-5"), ("stack.balloons", '"many"'), ("bond.width", '"5 ft"')],
)
def test_an_error_has_the_command_line_s_words_and_its_field(
    tmp_path: Path, key: str, value: str
) -> None:
    text = edited(SMALL, [(key, value)])
    with pytest.raises(DesignError) as ours:
        answers(job(tmp_path, text))
    with pytest.raises(DesignError) as theirs:
        api.loads(text)
    assert str(ours.value) == str(theirs.value)
    assert refusal(str(ours.value))["field"] == key


@pytest.mark.parametrize(
    "line",
    [
        '[chamber]\noutline = "../shape.dxf"',
        'kit = "/etc/passwd"',
        '[parts.a]\nkind = "sba"\ndesign = "../x.toml"',
        '[shapes]\npocket = {file = "../shape.dxf"}',
        '[models]\ncalibration = "/etc/passwd"',
        '[[layers]]\nfile = "../shape.dxf"',
    ],
)
def test_a_design_names_no_file_outside_the_folder(tmp_path: Path, line: str) -> None:
    with pytest.raises(DesignError, match="lies outside"):
        answers(job(tmp_path, f'name = "a"\nfamily = "1dof"\n{line}\n'))


@pytest.mark.parametrize(
    ("key", "named", "said"),
    [
        ("kit", "a" * 300, "neither a bundled kit"),
        ("kit", "a" * 300 + ".toml", "neither a bundled kit"),
        ("kit", "a/" * 400 + "b.toml", "neither a bundled kit"),
        ("chamber.outline", "a" * 300 + ".svg", "does not exist as a file"),
        ("kit", "latin.toml", "latin.toml is not a text file in UTF-8"),
    ],
)
def test_a_file_that_cannot_be_is_one_sentence(
    tmp_path: Path, key: str, named: str, said: str
) -> None:
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"\n')
    taken = edited(SMALL, [("chamber.diameter", None)]) if "outline" in key else SMALL
    with pytest.raises(DesignError, match=said):
        answers(job(tmp_path, edited(taken, [(key, f'"{named}"')])))


def test_a_file_of_the_folder_may_name_one_outside_no_more(tmp_path: Path) -> None:
    (tmp_path / "part.toml").write_text('kit = "/etc/passwd"', encoding="utf-8")
    text = 'family = "assembly"\n[parts.a]\nkind = "sba"\ndesign = "./part.toml"\n'
    with pytest.raises(DesignError, match="lies outside"):
        answers(job(tmp_path, text))


def test_a_change_that_comes_during_the_yield_ends_it(tmp_path: Path) -> None:
    text = edited(SMALL, [("rules.yield_builds", "100000")])
    names = rule_names()
    before = names[names.index("registration-yield") - 1]
    seen: list[str] = []
    beats = 0

    def beat() -> None:
        # Two come between the last rule and the yield, the others within it.
        nonlocal beats
        beats += bool(seen) and seen[-1] == before
        if beats > 4:
            raise SupersededError

    for answer in jobs.answers(job(tmp_path, text), beat):
        seen.append(answer.get("rule", answer["kind"]))
    assert seen[-2:] == [before, "superseded"]


def test_edits_keep_comments_and_order() -> None:
    text = api.template("3dof-15mm")
    new = edited(
        text, [("chamber.diameter", "6.2"), ("rules.bond_width", "0.7"), ("lumen.diameter", None)]
    )
    assert tomllib.loads(new)["chamber"]["diameter"] == 6.2
    assert tomllib.loads(new)["rules"] == {"bond_width": 0.7}
    assert "diameter" not in tomllib.loads(new)["lumen"]
    old_lines, new_lines = text.splitlines(), new.splitlines()
    changed = [line for line in old_lines if line not in new_lines]
    assert [line.split("=")[0].strip() for line in changed] == ["diameter", "diameter"]
    assert "# of the pocket; a list gives one a balloon (a tapered stack)" in new
    # The comment keeps its column.
    column = next(line.index("#") for line in old_lines if "of the pocket" in line)
    assert next(line.index("#") for line in new_lines if "of the pocket" in line) == column


@pytest.mark.parametrize(
    ("text", "value"), [("a = [", "1"), ("a = 1", "= ="), ("a = 1", "1\nb = 2"), ("a = 1", "")]
)
def test_an_edit_that_is_no_toml_gets_one_sentence(text: str, value: str) -> None:
    with pytest.raises(DesignError):
        edited(text, [("a", value)])


def test_a_table_is_not_written_into_a_value() -> None:
    with pytest.raises(DesignError, match="a value, not a table"):
        edited("bond = 3", [("bond.width", "1")])


def test_a_link_holds_a_design() -> None:
    text = api.template("3dof-15mm")
    link = f"http://127.0.0.1:8417/#design={packed(text)}"
    assert design_in(link) == text
    assert len(link) < 1600
    for broken in (
        link[:-9],
        "http://127.0.0.1/",
        "http://[",
        link + "x!",
        "http://a/#design=" + packed("a" * 2_000_000),
    ):
        with pytest.raises(DesignError, match="holds no design"):
            design_in(broken)


@pytest.mark.long
def test_poses_are_the_stack_s(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = api.template("1dof-5mm")
    asked: dict[str, Any] = {"do": "motion", "pose": {"pressures": [20.0], "plate": 3.0}}
    (pose,) = answers({**job(tmp_path, text), **asked})
    theirs = api.stack(api.loads(text)).pose((20.0,), plate=3.0)
    assert pose["force"] == pytest.approx(theirs.force, rel=1e-4)
    assert pose["height"] == pytest.approx(theirs.height, abs=1e-3)
    asked["pose"]["curves"] = True
    pose, curves = answers({**job(tmp_path, text), **asked})
    assert curves["holds"]
    monkeypatch.setattr(balloon_map, "MOST_ERROR", 1e-9)
    pose, curves = answers({**job(tmp_path, text), **asked})
    assert not curves["holds"]
    with pytest.raises(DesignError, match="pressures must be 1 finite"):
        answers({**job(tmp_path, text), "do": "motion", "pose": {"pressures": [1, 2]}})


@pytest.mark.long
def test_air_through_a_tube_takes_its_time(tmp_path: Path) -> None:
    """A longer tube fills later, both end at the valve's pressure, each tab has its own."""
    text = api.template("1dof-5mm")

    def filled(tab: str, length: float) -> list[float]:
        tube = {"length": length, "diameter": 0.3, "dt": 0.005}
        asked = {"do": "motion", "tab": tab, "pose": {"pressures": [20.0], "tube": tube}}
        steps = [answers({**job(tmp_path, text), **asked})[0] for _ in range(120)]
        assert steps[-1]["time"] == pytest.approx(0.6)
        return [step["pressures"][0] for step in steps]

    short, long = filled("a", 100.0), filled("b", 1000.0)
    assert short[0] < 20
    assert all(one >= other - 1e-6 for one, other in zip(short, long, strict=True))
    assert short[5] > long[5]
    assert short[-1] == pytest.approx(20.0, rel=0.01)
