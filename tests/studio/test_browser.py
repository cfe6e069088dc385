"""The studio in Chromium, form and views: what a person sees; nothing complains, nobody is asked.

These start a server, its workers and a browser, and so run at length (``long``).
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from sbafab import api
from tests.studio.browsing import (
    BROWSED,
    DESIGN,
    FILE,
    PATIENCE,
    Watched,
    colours,
    picture,
    share_changed,
)

pytestmark = BROWSED


# 1. The form and the text.


def test_a_key_of_the_form_goes_into_the_text_with_its_comment(seen: Watched) -> None:
    field = seen.page.get_by_label("chamber.diameter, mm")
    assert field.input_value() == "5"
    field.fill("6.5")
    field.press("Enter")
    seen.until("studio.text.includes('diameter = 6.5')")
    assert seen.say("studio.text").splitlines() == [
        line.replace("diameter = 5  ", "diameter = 6.5").replace(
            "6.5            #", "6.5            #"
        )
        if line.startswith("diameter = 5 ")
        else line
        for line in DESIGN.splitlines()
    ]
    seen.ready()
    assert seen.say("studio.laminate.bounds[2]") == pytest.approx(
        api.build(api.loads(DESIGN.replace("diameter = 5 ", "diameter = 6.5 "))).bounds[2]
    )


def test_the_text_goes_into_the_form(seen: Watched) -> None:
    seen.page.get_by_role("tab", name="TOML").click()
    area = seen.page.get_by_role("textbox", name="Design file, TOML")
    area.fill(DESIGN.replace("balloons = 15", "balloons = 4"))
    seen.until("studio.laminate.balloons === 4")
    seen.page.get_by_role("tab", name="Form").click()
    assert seen.page.get_by_label("stack.balloons", exact=True).input_value() == "4"


def test_an_error_stands_at_its_field_in_the_command_line_s_words(
    seen: Watched, folder: Path
) -> None:
    field = seen.page.get_by_label("chamber.diameter, mm")
    field.fill("-5")
    field.press("Enter")
    alert = seen.page.locator(".row.bad .why")
    alert.wait_for()
    bad = folder / "bad.toml"
    bad.write_text(DESIGN.replace("diameter = 5 ", "diameter = -5 "), encoding="utf-8")
    command = [sys.executable, "-c", "from sbafab.entry import main; main()", "check", str(bad)]
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    bad.unlink()
    assert told.returncode == 2
    assert alert.inner_text() in " ".join(told.stderr.split())
    assert field.get_attribute("aria-invalid") == "true"
    # What is still shown is the last good design, and says so.
    assert seen.page.locator("#view-solid.stale.bad .stale-mark").inner_text() == "Last good design"
    seen.page.keyboard.press("Control+z")
    seen.ready()
    assert seen.page.locator(".row.bad").count() == 0


def test_every_key_has_a_field_with_its_meaning(seen: Watched) -> None:
    keys = {field["key"] for field in seen.say("studio.families.lobed")}
    named = set(seen.say("[...document.querySelectorAll('#form [name]')].map(e => e.name)"))
    assert keys - named == {"rules.waive"}  # a group of boxes
    assert seen.page.locator("[role=group][aria-label='rules.waive']").count() == 1
    seen.page.get_by_label("bond.width, mm").focus()
    help_text = seen.page.locator("#help").inner_text()
    assert "Width of every bonded ring" in help_text
    assert "Default 0.75" in help_text


def test_another_family_keeps_what_both_know(seen: Watched) -> None:
    seen.page.get_by_role("button", name="One stack").click()
    seen.until("studio.laminate.family === '1dof'")
    assert seen.say("studio.laminate.balloons") == 15


def test_a_file_changed_on_disk_is_loaded_and_saved_only_when_asked(
    seen: Watched, folder: Path
) -> None:
    (folder / FILE).write_text(DESIGN.replace("balloons = 15", "balloons = 3"), encoding="utf-8")
    seen.until("studio.laminate.balloons === 3")
    seen.page.get_by_label("stack.balloons", exact=True).fill("5")
    seen.page.keyboard.press("Enter")
    seen.until("studio.laminate.balloons === 5")
    assert "balloons = 3" in (folder / FILE).read_text(encoding="utf-8")
    # Changed here and there: the page asks.
    (folder / FILE).write_text(DESIGN.replace("balloons = 15", "balloons = 8"), encoding="utf-8")
    mine = seen.page.get_by_role("button", name="Keep mine")
    mine.wait_for(timeout=1000 * PATIENCE)
    # The question stays, though the rules of the last edit come in.
    seen.say("studio.emit('laminate'), studio.emit('checked')")
    mine.click()
    seen.page.keyboard.press("Control+s")
    seen.until("!studio.unsaved")
    assert "balloons = 5" in (folder / FILE).read_text(encoding="utf-8")


# 2. The views.


def test_layers_are_drawn_with_true_arcs_and_sizes(seen: Watched) -> None:
    seen.page.get_by_role("tab", name="Layers").click()
    shown = seen.page.locator("#shown-pattern")
    radii = {round(float(r), 4) for r in re.findall(r"A([\d.]+)", shown.get_attribute("d") or "")}
    assert radii == {1.0, 3.25}
    words = seen.page.locator("#view-layers svg text").all_text_contents()
    for size in ("20.24", "23.38", "3\u00d7 R3.25", "fits ⌀15.00", "lumen ⌀2.00"):
        assert size in words
    drawn = picture(seen, "#view-layers .surface")
    assert colours(drawn) > 6
    seen.page.get_by_role("button", name="P04 separator mask").click()
    assert share_changed(drawn, picture(seen, "#view-layers .surface")) > 0.05


def test_zoom_stays_when_the_design_changes(seen: Watched) -> None:
    seen.page.get_by_role("tab", name="Layers").click()
    stage = seen.page.locator("#view-layers .surface")
    stage.focus()
    for _ in range(4):
        seen.page.keyboard.press("+")
    before = stage.locator("g[transform]").get_attribute("transform")
    seen.say("studio.edit([['lumen.diameter', '2.4']])")
    seen.until("studio.laminate.lumen === 2.4")
    assert stage.locator("g[transform]").get_attribute("transform") == before


def test_hovering_names_layer_role_and_width(seen: Watched) -> None:
    box = seen.page.locator("#lower canvas").bounding_box()
    assert box is not None
    place = seen.page.evaluate(
        """() => { const canvas = document.querySelector('#lower canvas');
        const pen = canvas.getContext('2d');
        const k = canvas.width / canvas.clientWidth, row = Math.round(canvas.height / 2);
        for (let y = row; y < canvas.height; y++) {
          const data = pen.getImageData(0, y, canvas.width, 1).data;
          for (let x = 200; x < canvas.width; x++) {
            const red = data[4 * x] - 0xa9, blue = data[4 * x + 2] - 0xea;
            if (data[4 * x + 3] && Math.abs(red) < 3 && Math.abs(blue) < 3)
              return [x / k + 4, y / k]; } } }"""
    )
    seen.page.mouse.move(box["x"] + place[0], box["y"] + place[1])
    told = seen.page.locator("#hover").inner_text()
    assert "TPE" in told
    assert "balloon" in told
    assert "mm wide here" in told


def test_the_solid_comes_apart_is_cut_and_picked(seen: Watched) -> None:
    whole = picture(seen, "#view-solid .surface")
    assert colours(whole) > 6
    seen.page.locator("#view-solid").get_by_label("Explode").fill("90")
    apart = picture(seen, "#view-solid .surface")
    assert share_changed(whole, apart) > 0.05
    seen.page.get_by_role("button", name="Cut", exact=True).click()
    cut = picture(seen, "#view-solid .surface")
    assert share_changed(apart, cut) > 0.02
    seen.page.get_by_label("Layer", exact=True).fill("30")
    assert seen.say("studio.picked.index") == 30
    assert share_changed(cut, picture(seen, "#view-solid .surface")) > 0.001
    label = seen.page.locator("#view-solid canvas").get_attribute("aria-label")
    layer = api.build(api.loads(DESIGN)).layer(30)
    words = f"{layer.film.material} {layer.role.replace('-', ' ')}, balloon {layer.balloon}"
    assert label == f"Solid, Layer 30 {words}, {layer.pattern} picked"


def test_the_section_is_the_laminate_s(seen: Watched) -> None:
    """Spans that the page works out, against those of the exact geometry."""
    from sbafab.geometry.region import section

    laminate = api.build(api.loads(DESIGN))
    for origin, direction in (
        ((4.25, 0.0), (1.0, 0.0)),
        ((0.31, -1.1), (0.6, 0.8)),
        ((-5.0, 2.0), (0.0, 1.0)),
    ):
        found = seen.page.evaluate(
            """([x, y, u, v]) => import('/shapes.js').then(({spans}) => Object.fromEntries(
            Object.entries(studio.laminate.patterns).map(([name, p]) =>
              [name, spans(studio.shape(p.shape), x, y, u, v)])))""",
            [*origin, *direction],
        )
        for name, layers in laminate.patterns.items():
            exact = section(layers[0].profile, origin, direction)
            assert [end for span in found[name] for end in span] == pytest.approx(
                [end for span in exact for end in span], abs=2e-5
            )
        # What bonds the page finds along the plane from the layers.
        drawn = seen.page.evaluate(
            """([x, y, u, v]) => Promise.all([import('/section.js'), import('/shapes.js')]).then(
            ([{bonded}, {spans}]) => studio.laminate.bonds.map(({layers, z, gap}) => [z, gap,
              bonded(layers, i => spans(studio.shape(
                studio.laminate.patterns[studio.layer(i).pattern].shape), x, y, u, v))]))""",
            [*origin, *direction],
        )
        assert len(drawn) == len(laminate.interfaces)
        for (z, gap, ours), interface in zip(drawn, laminate.interfaces, strict=True):
            exact = section(interface.bond, origin, direction)
            assert (z, gap) == pytest.approx((interface.z, interface.gap), abs=1e-9)
            assert [end for span in ours for end in span] == pytest.approx(
                [end for span in exact for end in span], abs=2e-5
            )


def test_a_finding_leads_to_its_place_in_every_view(seen: Watched) -> None:
    solid = picture(seen, "#view-solid .surface")
    section = picture(seen, "#lower .surface")
    seen.page.locator(".finding[data-rule=bond-width]").click()
    assert share_changed(solid, picture(seen, "#view-solid .surface")) > 0.05
    assert share_changed(section, picture(seen, "#lower .surface")) > 0.05
    seen.page.get_by_role("tab", name="Layers").click()
    finding = next(f for f in api.check(api.loads(DESIGN)) if f.rule == "bond-width")
    cut = seen.say("studio.cut")
    assert (cut["x"], cut["y"]) == pytest.approx((finding.where.x, finding.where.y), abs=1e-3)
    assert seen.page.locator("#view-layers circle.place").count() == 1


def test_each_quantity_is_predicted_once_and_other_models_unfold(seen: Watched) -> None:
    seen.until("studio.prediction && !studio.prediction.quick")
    figures = api.predict(api.loads(DESIGN)).as_dict()["figures"]
    first = [figure["name"] for figure in figures if figure["design_with"]]
    others = [figure["name"] for figure in figures if not figure["design_with"]]
    panel = seen.page.locator(".section-block", has_text="Prediction")
    names = panel.locator("tr:visible td:first-child")

    def shown() -> list[str]:
        # What the paper measured stands below the name.
        return [text.partition("\n")[0] for text in names.all_inner_texts()]

    assert shown() == first
    panel.get_by_text(f"Other models of the same ({len(others)})").click()
    names.nth(len(first)).wait_for()
    assert shown() == first + others
    measured = [figure["measured"]["sentence"] for figure in figures if figure["measured"]]
    assert measured
    assert all(sentence in panel.inner_text() for sentence in measured)
    # It stays open when the figures change.
    seen.say("studio.edit([['bond.width', '0.8']])")
    seen.ready()
    assert panel.locator("details.more[open] tr:visible").count() > len(others) / 3
    row = panel.locator("tr", has_text=others[0]).last
    assert "Eqs." in (row.get_attribute("title") or "")


def test_two_designs_side_by_side(seen: Watched) -> None:
    seen.page.get_by_role("button", name="Compare").click()
    assert seen.page.locator("#view-compare .diffs").inner_text().startswith("No key differs")
    seen.say("studio.edit([['lumen.diameter', '3']])")
    seen.ready()
    told = seen.page.locator("#view-compare .diffs").inner_text()
    assert "lumen.diameter" in told
    # A rule that measures two things is listed for both where both differ.
    rules = [(f["rule"], f["measured"]) for f in seen.say("studio.findings")]
    was = [(f.rule, f.measured) for f in api.check(api.loads(DESIGN))]
    changed = [ours[0] for ours, theirs in zip(rules, was, strict=True) if ours != theirs]
    assert [line.split(",")[0] for line in told.split("\n") if ", limit" in line] == [
        rule for rule in changed if rule != "registration-yield"
    ]
    assert "Prediction" in told
    # What differs is painted in a colour that nothing else has.
    drawn = picture(seen, ".half >> nth=0")
    marked = sum(n for n, c in drawn.getcolors(1 << 20) or () if c[2] > c[0] > c[1] and c[2] > 220)
    assert marked > 200
