"""Shapes drawn in Chromium with mouse and keys: what lands in the design file, and what rules find.

These start a server, its workers and a browser, and so run at length (``long``).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from sbafab import api
from tests.studio.browsing import BROWSED, Watched

pytestmark = BROWSED
DESIGN, FILE = api.template("pouch"), "pouch.toml"
VIEW = {"viewport": {"width": 1280, "height": 800}}


@pytest.fixture
def sketch(tab: Watched, link: str, folder: Path) -> Iterator[Sketch]:
    """The pouch in the view Draw, as its template has it."""
    (folder / FILE).write_text(DESIGN, encoding="utf-8")
    tab.load(link)
    tab.ready()
    tab.page.get_by_role("tab", name="Draw").click()
    yield Sketch(tab, folder / FILE)
    assert tab.complaints == []


class Sketch:
    """The view Draw, with places in mm."""

    def __init__(self, watched: Watched, file: Path) -> None:
        self.seen, self.page, self.file = watched, watched.page, file

    def pixel(self, x: float, y: float) -> tuple[float, float]:
        left, top = self.seen.page.evaluate(
            """([x, y]) => { const { surface, eye } = studio.drawing;
            const box = surface.getBoundingClientRect(), [px, py] = eye.px(x, y);
            return [box.left + px, box.top + py]; }""",
            [x, y],
        )
        return left, top

    def drag(self, start: tuple[float, float], end: tuple[float, float], key: str = "") -> None:
        """Drags what lies at one place to another one, with a key held down when it is taken."""
        self.page.mouse.move(*self.pixel(*start))
        if key:
            self.page.keyboard.down(key)
        self.page.mouse.down()
        if key:
            self.page.keyboard.up(key)
        self.page.mouse.move(*self.pixel(*end), steps=6)
        self.page.mouse.up()

    def shapes(self) -> Any:
        """The shapes of the text, once all is current."""
        self.seen.until("studio.pending.size === 0 && !studio.flight")
        return tomllib.loads(self.seen.say("studio.text"))["shapes"]

    def settled(self) -> Any:
        """Likewise, with the text a step of the history."""
        self.seen.until("studio.history[studio.place] === studio.text")
        return self.shapes()

    def table(self) -> Any:
        """All tables of the text, a step of the history."""
        self.settled()
        return tomllib.loads(self.seen.say("studio.text"))

    def type(self, label: str, value: str) -> None:
        field = self.page.get_by_label(label, exact=True)
        field.fill(value)
        field.press("Enter")


def test_a_dragged_point_snaps_to_the_grid_and_an_edge_becomes_an_arc(sketch: Sketch) -> None:
    sketch.drag((20, -15), (25.13, -17.41))
    assert sketch.settled()["pocket"] == {"polygon": [[-20, -15], [25, -17.5], [20, 15], [-20, 15]]}
    sketch.page.keyboard.press("Control+z")
    sketch.seen.until("studio.text.includes('[20, -15]')")
    sketch.seen.ready()
    # Half a circle is near where the edge is dragged to, and is what the edge becomes.
    sketch.drag((20, 0), (34.8, 0.1))
    path = [[-20, -15], [20, -15, 1], [20, 15], [-20, 15]]
    assert sketch.settled()["pocket"] == {"path": path}
    sketch.seen.ready()
    # 40 x 30 with half a disc of 15, and the strip beyond it.
    mask = sketch.seen.say("Object.values(studio.laminate.patterns).map(p => p.area)")
    assert min(mask) == pytest.approx(40 * 30 + math.pi * 15**2 / 2 + 2 * 9.5, abs=1e-3)
    # Comments and order stay.
    text = sketch.seen.say("studio.text")
    assert text.splitlines()[:15] == DESIGN.splitlines()[:15]
    assert "# Bonds of 1 mm beside pocket and strip" in text


def test_points_snap_to_points_edges_and_angles_of_what_stays(sketch: Sketch) -> None:
    page = sketch.page
    page.get_by_label("Shape", exact=True).select_option("strip")
    # The corner of the tab, which the strip does not move.
    sketch.drag((0, 24.5), (2.2, 23.9))
    assert sketch.settled()["strip"]["slot"] == [[0, 10], [2, 24]]
    page.get_by_label("Shape", exact=True).select_option("pocket")
    page.get_by_label("Points", exact=True).uncheck()
    page.get_by_label("Grid", exact=True).uncheck()
    # Straight above the point before, though the hand is not.
    sketch.drag((20, 15), (20.2, 12.34))
    x, y = sketch.settled()["pocket"]["polygon"][2]
    assert x == 20
    assert y == pytest.approx(12.34, abs=0.2)
    assert y != round(y, 1)


def test_points_are_typed_added_and_deleted_by_keys(sketch: Sketch) -> None:
    page = sketch.page
    sketch.type("Point 3, x, mm", "18.25")
    assert sketch.shapes()["pocket"]["polygon"][2] == [18.25, 15]
    sketch.type("Edge after point 3, arc in degrees, 0 for straight", "180")
    assert sketch.shapes()["pocket"]["path"][2] == [18.25, 15, pytest.approx(1)]
    surface = page.locator("#view-draw .surface")
    surface.focus()
    # The third point is chosen; one is added on its arc, which stays the same circle.
    surface.press("i")
    path = sketch.shapes()["pocket"]["path"]
    radius = (18.25 + 20) / 2
    assert path[2][2] == pytest.approx(math.tan(math.pi / 8))
    assert path[3] == pytest.approx([18.25 - radius, 15 + radius, math.tan(math.pi / 8)])
    surface.press("ArrowUp")
    surface.press("Shift+ArrowRight")
    assert sketch.shapes()["pocket"]["path"][3][:2] == pytest.approx([4.125, 34.625])
    surface.press("Delete")
    surface.press("a")
    sketch.shapes()
    surface.press("n")
    surface.press("Delete")
    assert len(sketch.shapes()["pocket"]["path"]) == 3
    surface.press("Delete")
    assert len(sketch.shapes()["pocket"]["path"]) in {2, 3}


def test_a_new_shape_is_clicked_saved_and_found_wanting(sketch: Sketch) -> None:
    page, seen = sketch.page, sketch.seen
    seen.ready()
    page.get_by_role("button", name="New shape").click()
    page.get_by_label("Name of the new shape").fill("cover")
    page.get_by_label("Layer that takes it").select_option("2")
    page.get_by_role("button", name="Add shape").click()
    # The cap ends 0.5 mm past the pocket at the right, where 0.75 mm of bond are asked for.
    corners = [(-21, -16), (20.5, -16), (20.5, 16), (2, 16), (2, 24), (-2, 24), (-2, 16), (-21, 16)]
    for corner in [*corners, corners[0]]:
        page.mouse.click(*sketch.pixel(*corner))
    assert sketch.shapes()["cover"] == {"polygon": [list(corner) for corner in corners]}
    seen.ready()
    finding = page.locator(".finding[data-rule=bond-width]")
    assert finding.get_attribute("data-verdict") == "fail"
    assert page.locator("#view-draw .finding-place[data-rule=bond-width]").count() == 1
    marked = seen.say("studio.findings.find(f => f.rule === 'bond-width')")
    assert marked["measured"] == pytest.approx(0.5)
    assert marked["where"]["x"] == pytest.approx(20.25, abs=0.26)
    page.keyboard.press("Control+s")
    seen.until("!studio.unsaved")
    saved = tomllib.loads(sketch.file.read_text(encoding="utf-8"))
    assert saved["layers"][2] == {"role": "cap", "shape": "cover"}
    assert api.build(api.load(sketch.file)).layers[2].profile.area == pytest.approx(
        41.5 * 32 + 4 * 8
    )
    # Dragged out to the bond that the rule wants, it passes; the other film's corner is near.
    page.get_by_label("Points", exact=True).uncheck()
    page.get_by_label("Edges", exact=True).uncheck()
    sketch.drag((20.5, -16), (21, -16))
    sketch.drag((20.5, 16), (21, 16))
    seen.until("studio.findings.find(f => f.rule === 'bond-width').verdict === 'pass'")
    seen.ready()
    assert page.locator("#view-draw .finding-place[data-rule=bond-width]").count() == 0


def test_a_crossing_is_shown_at_its_place_and_undone(sketch: Sketch) -> None:
    sketch.seen.ready()
    sketch.drag((20, 15), (-25, 5))
    alert = sketch.page.locator("#view-draw .draw-why")
    alert.wait_for()
    assert "shapes.pocket.polygon crosses or touches itself" in alert.inner_text()
    assert sketch.page.locator("#view-draw .error-place").count() == 1
    assert sketch.page.locator("#view-draw .stale-mark").inner_text() == "Last good design"
    sketch.page.keyboard.press("Control+z")
    sketch.seen.ready()
    assert not alert.is_visible()
    assert sketch.seen.say("studio.text") == DESIGN


def test_circles_have_a_diameter_and_any_outline_goes_on_as_points(sketch: Sketch) -> None:
    page = sketch.page
    page.get_by_role("button", name="New shape").click()
    page.get_by_label("Name of the new shape").fill("hole")
    page.get_by_label("Kind of the new shape").select_option("disc")
    page.get_by_role("button", name="Add shape").click()
    sketch.type("Diameter, mm", "3.2")
    sketch.type("Moved by x, mm", "4")
    sketch.type("Moved by y, mm", "-5")
    assert sketch.shapes()["hole"] == {"disc": 3.2, "at": [4, -5]}
    sketch.drag((5.6, -5), (6.52, -5))
    assert sketch.shapes()["hole"]["disc"] == pytest.approx(5)
    before = sketch.seen.say("studio.laminate.patterns[studio.layer(1).pattern].area")
    page.get_by_label("Shape", exact=True).select_option("film")
    page.get_by_role("button", name="Turn into points and arcs").click()
    film = sketch.shapes()["film"]
    assert set(film) == {"path"}
    assert {abs(row[2]) for row in film["path"] if len(row) > 2} == {0.414213562373}
    sketch.seen.ready()
    after = sketch.seen.say("studio.laminate.patterns[studio.layer(1).pattern].area")
    assert after == pytest.approx(before, abs=1e-4)


def test_a_selected_number_stays_selected_when_the_table_is_drawn_again(sketch: Sketch) -> None:
    field = sketch.page.get_by_label("Point 1, x, mm", exact=True)
    field.select_text()
    sketch.page.evaluate("studio.drawing.fill()")
    sketch.page.keyboard.type("-21")
    assert field.input_value() == "-21"


def test_edges_of_the_sketch_are_those_of_closed_formulas(sketch: Sketch) -> None:
    worst = sketch.page.evaluate(
        """async () => {
          const s = await import('/sketch.js');
          const off = [];
          const near = (a, b) => off.push(Math.abs(a - b));
          for (let k = 1; k < 60; k++) {
            const b = Math.tan((k - 30) / 25), edge = { x0: k, y0: 2, x1: -1, y1: k / 7, b };
            near(s.bulgeThrough(edge, s.apex(edge)), b);
            // Where an arc is parted, both parts are of its circle: lengths and chords add up.
            const shape = { path: [[k, 2, b], [-1, k / 7], [40, 40]], at: [3, 1], turned: 20 };
            const parted = s.inserted(shape, 0, 0.3).path;
            const angle = (c) => 4 * Math.atan(c ?? 0);
            near(angle(parted[0][2]) + angle(parted[1][2]), angle(b));
            if (b) near(angle(parted[0][2]), 0.3 * angle(b));
            const [u, v] = s.inward(shape, s.outward(shape, [k, -k]));
            near(u, k); near(v, -k);
          }
          return Math.max(...off);
        }"""
    )
    assert worst < 1e-6


def test_a_design_without_shapes_has_no_such_view(sketch: Sketch) -> None:
    sketch.page.evaluate("text => studio.open(text)", api.template("1dof-5mm"))
    sketch.seen.until("studio.laminate?.name === '1dof-5mm'")
    assert not sketch.page.get_by_role("tab", name="Draw").is_visible()
    assert sketch.page.locator("#tab-layers").get_attribute("aria-selected") == "true"


def test_a_shape_gets_another_name_everywhere(sketch: Sketch) -> None:
    sketch.page.get_by_label("Shape", exact=True).select_option("pocket")
    sketch.type("Name of the shape", "cavity")
    shapes = sketch.settled()
    assert "pocket" not in shapes
    assert shapes["mask"]["union"] == ["cavity", "strip"]
    assert shapes["ring"] == {"offset": "cavity", "by": 1}
    sketch.seen.until("studio.laminate && !studio.error")
    # A layer's shape too; a name that is taken is not.
    sketch.page.get_by_label("Shape", exact=True).select_option("film")
    sketch.type("Name of the shape", "sheet")
    text = tomllib.loads(sketch.seen.say("studio.text")) if sketch.settled() else {}
    assert [layer["shape"] for layer in text["layers"]] == ["sheet", "mask", "sheet"]
    sketch.type("Name of the shape", "mask")
    assert "sheet" in sketch.settled()


def test_seams_folds_and_ports_are_edited_in_forms(sketch: Sketch) -> None:
    page = sketch.page
    sketch.page.evaluate("text => studio.open(text)", api.template("folded"))
    sketch.seen.until("studio.laminate?.name === 'folded'")
    sketch.type("seam 1: Width, mm", "1.5")
    page.get_by_label("seam 2: Tool").select_option("laser")
    sketch.type("fold 1: Line: x y; x y, mm", "-20 -12; 20 -12.0")
    sketch.settled()
    text = tomllib.loads(sketch.seen.say("studio.text"))
    assert [seam["width"] for seam in text["seams"]] == [1.5, 2]
    assert text["seams"][1]["tool"] == "laser"
    page.locator("summary", has_text="Ports").click()
    page.get_by_role("button", name="Add port").click()
    sketch.settled()
    sketch.type("port 1: Place: x y, mm", "0 -1")
    sketch.settled()
    text = tomllib.loads(sketch.seen.say("studio.text"))
    assert text["ports"] == [{"name": "port", "layers": [1, 2], "at": [0, -1]}]
    page.get_by_role("button", name="Delete port").click()
    sketch.settled()
    assert "ports" not in tomllib.loads(sketch.seen.say("studio.text"))
    assert sketch.seen.say("studio.error") is None


def test_points_of_seams_and_folds_and_ports_are_dragged_and_undone(sketch: Sketch) -> None:
    text = api.template("folded") + '\n[[ports]]\nname = "middle"\nlayers = [1, 2]\nat = [0, 1]\n'
    sketch.page.evaluate("text => studio.open(text)", text)
    sketch.seen.until("studio.laminate?.name === 'folded'")
    before = sketch.table()
    (x, y), *rest = before["seams"][0]["path"]
    # Off the grid of 0.5 mm, on which the point lands; all else of the file stays.
    sketch.drag((x, y), (x + 0.6, y + 0.9))
    after = sketch.table()
    assert after["seams"][0]["path"] == [[x + 0.5, y + 1], *rest]
    assert {**after, "seams": before["seams"]} == before
    # Its other end stays as it is in the form, whose field has the new place.
    field = sketch.page.get_by_label("seam 1: Path: x y [bulge]; …, mm")
    assert field.input_value().startswith(f"{x + 0.5:g} {y + 1:g}; ")
    sketch.page.locator("#view-draw .surface").focus()
    sketch.page.keyboard.press("Control+z")
    sketch.seen.until(f"studio.values.seams[0].path[0][0] === {x}")
    assert sketch.table() == before
    # A port snaps to the end of a seam, though the hand is beside it.
    sketch.drag((0, 1), (x + 0.2, y - 0.1))
    assert sketch.table()["ports"][0]["at"] == [x, y]
    # A point of a fold lies straight from its other one: 0 degrees, not the grid.
    sketch.page.get_by_label("Grid", exact=True).uncheck()
    sketch.page.get_by_label("Points", exact=True).uncheck()
    sketch.page.get_by_label("Edges", exact=True).uncheck()
    (u, v), (_, w) = sketch.table()["folds"][0]["line"]
    assert v == w
    sketch.drag((u, v), (u - 3.37, v + 0.05))
    (moved, level), _ = sketch.table()["folds"][0]["line"]
    assert level == pytest.approx(v, abs=1e-6)
    assert moved == pytest.approx(u - 3.37, abs=0.2)


def test_shift_takes_a_seams_point_that_lies_on_a_shapes(sketch: Sketch) -> None:
    sketch.page.evaluate("text => studio.open(text)", api.template("folded"))
    sketch.seen.until("studio.laminate?.name === 'folded'")
    before = sketch.table()
    place = tuple(before["seams"][0]["path"][1])
    assert list(place) in before["shapes"]["middle"]["polygon"]
    sketch.drag(place, (-17, 10), "Shift")
    after = sketch.table()
    assert (after["seams"][0]["path"][1], after["shapes"]) == ([-17, 10], before["shapes"])
    sketch.drag(place, (-17.5, 11))
    assert [-17.5, 11] in sketch.table()["shapes"]["middle"]["polygon"]


def test_an_arc_of_a_seam_keeps_its_bulge_when_its_point_is_dragged(sketch: Sketch) -> None:
    text = api.template("folded")
    path = tomllib.loads(text)["seams"][0]["path"]
    bent = f"[[{path[0][0]}, {path[0][1]}, 0.25], [{path[1][0]}, {path[1][1]}]]"
    key = "seams.0.path"
    sketch.page.evaluate("text => studio.open(text)", text)
    sketch.seen.until("studio.laminate?.name === 'folded'")
    sketch.page.evaluate("([key, value]) => studio.edit([[key, value]])", [key, bent])
    sketch.seen.until("studio.values.seams[0].path[0][2] === 0.25")
    sketch.drag(tuple(path[0]), (path[0][0] + 1, path[0][1]))
    assert sketch.table()["seams"][0]["path"][0] == [path[0][0] + 1, path[0][1], 0.25]
