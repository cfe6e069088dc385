"""The studio in Chromium: motion, rules, files, links, and how it bears what goes wrong."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from sbafab import api
from tests.studio.asking import packed
from tests.studio.browsing import (
    BROWSED,
    DESIGN,
    FILE,
    PATIENCE,
    Watched,
    colours,
    picture,
    served,
    share_changed,
)

pytestmark = BROWSED

CONE = api.template("1dof-5mm").replace('name = "1dof-5mm"', 'name = "cone"')


# 3. The actuator moves.


def test_pressure_bends_the_actuator_as_the_stack_says(seen: Watched) -> None:
    seen.page.get_by_role("tab", name="Motion").click()
    seen.until("Boolean(studio.motion.pose)")
    first = picture(seen, "#view-motion .surface")
    seen.page.get_by_label("chamber1, kPa").fill("30")
    seen.page.get_by_label("chamber2, kPa").fill("10")
    seen.until("studio.motion.pose.pressures.join() === '30,10,0' && Boolean(studio.motion.way)")
    stack = api.stack(api.loads(DESIGN))
    pose = stack.pose((30, 10, 0))
    assert seen.say("studio.motion.pose.bend") == pytest.approx(pose.bend, abs=0.05)
    seen.until(f"document.querySelector('.reading').innerText.includes('{pose.height:.2f} mm')")
    assert share_changed(first, picture(seen, "#view-motion .surface")) > 0.02
    seen.until("document.querySelectorAll('#view-motion svg.plot').length === 3")
    seen.say("studio.motion.set(() => 20)")
    seen.page.get_by_label("Plate", exact=True).check()
    seen.until("studio.motion.pose.force > 0 && !studio.motion.asking && !studio.motion.frame")
    held = seen.say("[studio.motion.pose.force, Number(studio.motion.plateHeight.value)]")
    assert held[0] == pytest.approx(stack.pose((20, 20, 20), plate=held[1]).force, rel=1e-3)


def test_the_tip_is_pulled_by_hand(seen: Watched) -> None:
    seen.page.get_by_role("tab", name="Motion").click()
    seen.until("Boolean(studio.motion.pose)")
    seen.say("studio.motion.set(() => 20)")
    seen.until("studio.motion.pose.pressures[2] === 20")
    box = seen.page.locator("#view-motion canvas").bounding_box()
    assert box is not None
    at = seen.page.evaluate(
        """() => { const m = studio.motion, [x, y] = m.stage.camera.seen(m.pose.origins.at(-1));
        return [(x + 1) / 2, (1 - y) / 2]; }"""
    )
    x, y = box["x"] + at[0] * box["width"], box["y"] + at[1] * box["height"]
    seen.page.mouse.move(x, y)
    seen.page.mouse.down()
    seen.page.mouse.move(x + 40, y, steps=4)
    seen.until("studio.motion.pose.bend > 2")
    seen.until("document.querySelector('.reading').innerText.includes('Pull')")
    seen.page.mouse.up()
    seen.until("studio.motion.pose.bend < 0.1")


def test_what_the_paper_measured_stands_beside_a_pose(seen: Watched) -> None:
    seen.page.get_by_role("tab", name="Motion").click()
    text = DESIGN + '\n[models]\ncalibration = "none"\n'
    seen.page.evaluate("text => studio.open(text)", text)
    seen.until("document.querySelector('#view-motion').innerText.includes('17.5 mm')")


def test_a_design_out_of_the_model_s_range_says_so_on_the_spot(seen: Watched) -> None:
    seen.page.get_by_role("tab", name="Motion").click()
    # A pose of the design before that comes late is not drawn.
    seen.say("studio.motion.stack = null, studio.motion.arrived({}), 0")
    seen.page.evaluate("text => studio.open(text)", api.template("radial-15mm"))
    seen.until("document.querySelector('#view-motion .trust.beyond')?.textContent.length > 20")


# 4. Rules live.


def test_what_is_not_current_is_marked_until_it_is(seen: Watched) -> None:
    seen.page.evaluate(
        """() => { window.marks = []; const view = document.querySelector('#view-solid');
        studio.on('stale', () => marks.push(view.classList.contains('stale')));
        studio.edit([['chamber.diameter', '5.5']]); }"""
    )
    assert seen.page.locator("#view-solid").get_attribute("class") in {"view stale", "view"}
    seen.ready()
    marks = seen.say("window.marks")
    assert marks[0] is True
    assert marks[-1] is False
    theirs = api.check(api.loads(DESIGN.replace("diameter = 5 ", "diameter = 5.5 ")))
    ours = seen.say("studio.findings.map(f => [f.rule, f.verdict, f.measured])")
    assert ours == [[f.rule, f.verdict, f.measured] for f in theirs]


def test_a_drag_shows_states_on_its_way_and_ends_with_the_last(seen: Watched) -> None:
    shown = seen.page.evaluate(
        """async () => { const seen = new Set();
        studio.on('laminate', () => seen.add(studio.laminate.bounds[2]));
        for (let i = 0; i < 30; i++) {
          studio.edit([['chamber.diameter', String(5 + i / 10)]]);
          await new Promise(r => setTimeout(r, 60)); }
        return seen.size; }"""
    )
    assert shown >= 1
    seen.ready()
    assert seen.say("studio.values.chamber.diameter") == 7.9


def test_a_rule_that_fails_stands_first(seen: Watched) -> None:
    seen.say("studio.edit([['bond.width', '0.5']])")
    seen.ready()
    first = seen.page.locator(".finding").first
    assert first.get_attribute("data-verdict") == "fail"
    assert "bond-width: fail" in (first.get_attribute("aria-label") or "")


# 5. Make it.


def test_the_zip_holds_the_bytes_of_the_command_line(seen: Watched, tmp_path: Path) -> None:
    seen.page.get_by_role("button", name="Make", exact=True).click()
    seen.page.get_by_role("button", name="Generate", exact=True).click()
    seen.page.locator("button[data-file='traveller.html']").wait_for(timeout=180_000)
    with seen.page.expect_download() as coming:
        seen.page.get_by_role("link", name="Download zip").click()
    archive = zipfile.ZipFile(coming.value.path())
    run = api.generate(api.loads(DESIGN), out=tmp_path)
    theirs = {
        f"{run.folder.name}/{p.relative_to(run.folder).as_posix()}": p.read_bytes()
        for p in run.folder.rglob("*")
        if p.is_file()
    }
    assert {
        name: hashlib.sha256(archive.read(name)).hexdigest() for name in archive.namelist()
    } == {name: hashlib.sha256(content).hexdigest() for name, content in theirs.items()}
    slider = seen.page.get_by_label("Cut order")
    full = picture(seen, ".make .show")
    slider.fill("0")
    assert share_changed(full, picture(seen, ".make .show")) > 0.005
    seen.page.get_by_role("button", name="Play", exact=True).click()
    seen.until("Number(document.querySelector('.order').value) > 3")
    seen.page.locator("button[data-file='traveller.html']").click()
    page = seen.page.frame_locator(".make iframe")
    page.get_by_role("heading").first.wait_for()


def test_generate_can_be_cancelled(seen: Watched, folder: Path) -> None:
    seen.page.get_by_role("button", name="Make", exact=True).click()
    seen.page.get_by_label("into out/ of the folder").check()
    seen.page.get_by_role("button", name="Generate", exact=True).click()
    seen.until("document.querySelector('.make [role=status]').textContent.length > 8")
    seen.page.get_by_role("button", name="Cancel").click()
    seen.until("document.querySelector('.make [role=status]').textContent.startsWith('Cancelled')")
    seen.page.wait_for_timeout(4000)
    assert not (folder / "out" / "3dof-15mm").exists()


# 6. Share.


def test_a_link_holds_the_design(seen: Watched, chrome: Any, link: str) -> None:
    seen.say("studio.edit([['stack.balloons', '7']])")
    seen.ready()
    seen.page.get_by_role("button", name="Share", exact=True).click()
    shared = seen.page.get_by_label("Link that holds the design").input_value()
    assert "token" not in shared
    token = link.partition("#token=")[2]
    other = Watched(chrome, f"{shared}&token={token}")
    other.until("window.studio?.laminate?.balloons === 7")
    assert other.say("studio.text") == seen.say("studio.text")
    assert other.complaints == []
    other.close()
    for button, ending in (("Picture", ".png"), ("Section", ".png"), ("Design file", ".toml")):
        with seen.page.expect_download() as coming:
            seen.page.locator("dialog").get_by_role("button", name=button, exact=True).click()
        content = Path(coming.value.path()).read_bytes()
        assert coming.value.suggested_filename.endswith(ending)
        if ending == ".png":
            assert colours(Image.open(io.BytesIO(content)).convert("RGB")) > 4
        else:
            assert "balloons = 7" in content.decode()


def test_unsaved_work_survives_a_reload(seen: Watched) -> None:
    seen.say("studio.edit([['stack.balloons', '9']])")
    seen.until("studio.laminate.balloons === 9")
    seen.page.reload()
    seen.until("window.studio?.laminate?.balloons === 9")
    assert seen.say("studio.unsaved") is True


# Feel.


def test_no_tab_saves_over_what_the_other_has_saved(
    seen: Watched, chrome: Any, link: str, folder: Path
) -> None:
    other = Watched(chrome, link)
    other.ready()
    seen.say("studio.edit([['stack.balloons', '4']])")
    other.say("studio.edit([['stack.balloons', '11']])")
    seen.until("studio.text.includes('balloons = 4')")
    other.until("studio.text.includes('balloons = 11')")
    seen.page.keyboard.press("Control+s")
    seen.until("!studio.unsaved")
    # The other is told, and its own saving is refused until it has said that it means it.
    other.page.get_by_role("button", name="Load the file").wait_for(timeout=1000 * PATIENCE)
    asked: list[str] = []
    other.page.on("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
    other.page.keyboard.press("Control+s")
    other.page.wait_for_timeout(1000)
    assert asked == [f"{FILE} lies there already with other content. Save over it?"]
    assert "balloons = 4" in (folder / FILE).read_text(encoding="utf-8")
    assert other.say("studio.unsaved") is True
    # A tab without changes of its own follows.
    other.page.get_by_role("button", name="Load the file").click()
    other.until("studio.text.includes('balloons = 4') && !studio.unsaved")
    other.say("studio.edit([['stack.balloons', '5']])")
    other.until("studio.text.includes('balloons = 5')")
    other.page.keyboard.press("Control+s")
    seen.until("studio.text.includes('balloons = 5') && !studio.unsaved")
    other.close()


@pytest.mark.parametrize("source", ["template", "link", None])
def test_the_gallery_opens_only_where_no_design_is_given(
    chrome: Any, tmp_path: Path, source: str | None
) -> None:
    given = {"template": "1dof-10mm", "link": f"http://127.0.0.1/#design={packed(CONE)}"}
    with served(tmp_path, *([given[source]] if source else [])) as link:
        watched = Watched(chrome, link)
        watched.ready()
        dialog = watched.page.get_by_role("dialog", name="Open a design")
        assert dialog.is_visible() == (source is None)
        # What has changes that no file holds is a link's design alone.
        shown = {"template": "1dof-10mm", "link": "cone", None: "3dof-15mm"}[source]
        assert watched.say("studio.laminate.name") == shown
        assert watched.say("studio.unsaved") is (source == "link")
        assert watched.complaints == []
        watched.close()


def test_a_wrong_token_is_told_plainly(chrome: Any, link: str) -> None:
    watched = Watched(chrome, link.partition("#")[0] + "#token=wrong")
    watched.page.get_by_role("alert").wait_for()
    assert (
        "open the one that sbafab studio printed" in watched.page.get_by_role("alert").inner_text()
    )
    watched.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_phone_width(chrome: Any, link: str, scheme: str) -> None:
    watched = Watched(
        chrome, link, viewport={"width": 390, "height": 844}, color_scheme=scheme, has_touch=True
    )
    watched.ready()
    page = watched.page
    assert watched.say("document.documentElement.scrollWidth") <= 390
    ground = Image.open(io.BytesIO(page.screenshot())).convert("L").getpixel((195, 700))
    assert isinstance(ground, int)
    assert (ground > 200) == (scheme == "light")
    page.get_by_role("button", name="Design", exact=True).click()
    assert page.get_by_label("chamber.diameter, mm").is_visible()
    page.get_by_role("button", name="Findings").click()
    assert page.locator(".finding").first.is_visible()
    assert watched.say("document.documentElement.scrollWidth") <= 390
    page.evaluate("text => studio.open(text)", api.template("pouch"))
    watched.ready()
    page.get_by_role("button", name="Views").click()
    for name in ("Draw", "Nets"):
        page.get_by_role("tab", name=name).click()
        assert watched.say("document.documentElement.scrollWidth") <= 390
    page.locator("#view-nets .void").first.wait_for(state="attached")
    assert watched.complaints == []
    watched.close()


def test_everything_is_named_and_reached_by_keyboard(seen: Watched) -> None:
    nameless = seen.page.evaluate(
        """() => [...document.querySelectorAll('button, input, select, textarea, a[href]')]
        .filter(e => !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length
          || e.title)).map(e => e.outerHTML.slice(0, 90))"""
    )
    assert nameless == []
    seen.page.locator("#tab-solid").focus()
    seen.page.keyboard.press("ArrowRight")
    assert seen.page.locator("#tab-layers").get_attribute("aria-selected") == "true"
    field = seen.page.get_by_label("stack.balloons", exact=True)
    field.focus()
    seen.page.keyboard.press("ArrowDown")
    seen.until("studio.laminate.balloons === 14")
    seen.page.keyboard.press("Control+o")
    seen.page.get_by_role("dialog", name="Open a design").wait_for()
    seen.page.keyboard.press("Escape")
    snapshot = json.dumps(seen.page.locator("body").aria_snapshot())
    for part in ("tablist", "Findings", "Rules"):
        assert part in snapshot


def test_templates_are_pictures(seen: Watched) -> None:
    seen.page.get_by_role("button", name="sbafab", exact=True).click()
    for name in api.templates():
        image = seen.page.locator(f"img[src='templates/{name}.webp']")
        image.wait_for()
        seen.until(
            f"document.querySelector(\"img[src='templates/{name}.webp']\").naturalWidth === 320"
        )
    seen.page.locator(".gallery button", has_text="1dof-10mm").click()
    seen.until("studio.laminate.name === '1dof-10mm'")
    seen.page.get_by_role("button", name="sbafab", exact=True).click()
    seen.page.locator(".gallery button", has_text="brace").click()
    seen.until("studio.family === 'assembly' && !studio.stale.rules")
    assert seen.say("studio.findings.length") > 10
