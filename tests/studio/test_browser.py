"""The studio in Chromium: what a person sees, point by point; nothing complains, nobody is asked.

These start a server, its workers and a browser, and so run at length (``long``).
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import signal
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from PIL import Image, ImageChops

from sbafab import api
from tests.studio.browsing import Watched, browser, chromium, served

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(chromium() is None, reason="no Chromium"),
]
DESIGN = api.template("3dof-15mm")
FILE = "gripper.toml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("chosen")


@pytest.fixture(scope="module")
def link(folder: Path) -> Iterator[str]:
    (folder / FILE).write_text(DESIGN, encoding="utf-8")
    with served(folder, FILE) as found:
        yield found


@pytest.fixture(scope="module")
def chrome() -> Iterator[Any]:
    with browser() as found:
        yield found


@pytest.fixture
def seen(chrome: Any, link: str, folder: Path) -> Iterator[Watched]:
    """The page with the design as the template has it; afterwards nothing may have complained."""
    (folder / FILE).write_text(DESIGN, encoding="utf-8")
    watched = Watched(chrome, link)
    watched.ready()
    yield watched
    assert watched.complaints == []
    assert len(watched.hosts) == 1
    assert next(iter(watched.hosts)).startswith("127.0.0.1:")
    watched.close()


def picture(seen: Watched, selector: str) -> Image.Image:
    seen.page.wait_for_timeout(250)
    return Image.open(io.BytesIO(seen.page.locator(selector).screenshot())).convert("RGB")


def share_changed(a: Image.Image, b: Image.Image) -> float:
    """The share of pixels that differ."""
    grey = ImageChops.difference(a, b).convert("L").point(lambda value: 255 * (value > 8))
    return grey.histogram()[255] / (a.width * a.height)


def colours(image: Image.Image) -> int:
    return len(image.quantize(32).getcolors() or ())


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
    seen.page.get_by_role("button", name="Keep mine").click()
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
    seen.page.get_by_label("Explode").fill("90")
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
    from sbafab.geometry.section import section

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


def test_undo_and_redo(seen: Watched) -> None:
    seen.say("studio.edit([['stack.balloons', '6']])")
    seen.until("studio.laminate.balloons === 6 && studio.history.length === 2")
    seen.page.get_by_role("button", name="Undo").click()
    seen.until("studio.laminate.balloons === 15")
    assert seen.say("studio.text") == DESIGN
    seen.page.keyboard.press("Control+Shift+z")
    seen.until("studio.laminate.balloons === 6")


def test_two_designs_side_by_side(seen: Watched) -> None:
    seen.page.get_by_role("button", name="Compare").click()
    assert seen.page.locator(".diffs").inner_text().startswith("No key differs")
    seen.say("studio.edit([['lumen.diameter', '3']])")
    seen.ready()
    told = seen.page.locator(".diffs").inner_text()
    assert "lumen.diameter" in told
    assert "Prediction" in told
    # What differs is painted in a colour that nothing else has.
    drawn = picture(seen, ".half >> nth=0")
    marked = sum(n for n, c in drawn.getcolors(1 << 20) or () if c[2] > c[0] > c[1] and c[2] > 220)
    assert marked > 200


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
    assert f"{pose.height:.2f} mm" in seen.page.locator(".reading").inner_text()
    assert share_changed(first, picture(seen, "#view-motion .surface")) > 0.02
    seen.until("document.querySelectorAll('#view-motion svg.plot').length === 3")
    seen.say("studio.motion.set(() => 20)")
    seen.page.get_by_label("Plate", exact=True).check()
    seen.until("studio.motion.pose.force > 0 && !studio.motion.asking")
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
        """() => { const m = studio.motion, { camera, controls } = m.stage;
        const v = controls.target.clone().set(...m.pose.origins.at(-1)).project(camera);
        return [(v.x + 1) / 2, (1 - v.y) / 2]; }"""
    )
    x, y = box["x"] + at[0] * box["width"], box["y"] + at[1] * box["height"]
    seen.page.mouse.move(x, y)
    seen.page.mouse.down()
    seen.page.mouse.move(x + 40, y, steps=4)
    seen.until("studio.motion.pose.bend > 2")
    assert "Pull" in seen.page.locator(".reading").inner_text()
    seen.page.mouse.up()
    seen.until("studio.motion.pose.bend < 0.1")


def test_a_design_out_of_the_model_s_range_says_so_on_the_spot(seen: Watched) -> None:
    seen.page.get_by_role("tab", name="Motion").click()
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
    seen.page.get_by_role("button", name="Share").click()
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


# Feel.


def test_unsaved_work_survives_a_reload(seen: Watched) -> None:
    seen.say("studio.edit([['stack.balloons', '9']])")
    seen.until("studio.laminate.balloons === 9")
    seen.page.reload()
    seen.until("window.studio?.laminate?.balloons === 9")
    assert seen.say("studio.unsaved") is True


def test_two_tabs_do_not_disturb_each_other(seen: Watched, chrome: Any, link: str) -> None:
    other = Watched(chrome, link)
    other.ready()
    other.say("studio.edit([['stack.balloons', '4']])")
    seen.say("studio.edit([['stack.balloons', '11']])")
    other.ready()
    seen.ready()
    assert (seen.say("studio.laminate.balloons"), other.say("studio.laminate.balloons")) == (11, 4)
    assert other.complaints == []
    other.close()


def test_a_dead_worker_is_a_message_and_work_goes_on(chrome: Any, tmp_path: Path) -> None:
    (tmp_path / FILE).write_text(DESIGN, encoding="utf-8")
    with served(tmp_path, FILE) as link:
        watched = Watched(chrome, link)
        watched.ready()
        port = link.split(":")[2].split("/")[0]
        for pid in workers_of(port):
            os.kill(pid, signal.SIGKILL)
        watched.say("studio.edit([['stack.balloons', '5']])")
        watched.until("studio.laminate.balloons === 5 || studio.error?.kind === 'crashed'")
        watched.say("studio.edit([['stack.balloons', '8']])")
        watched.until("studio.laminate.balloons === 8")
        watched.close()


def workers_of(port: str) -> list[int]:
    """Processes that the server at this port has started, for its workers."""
    listing = subprocess.run(
        ["ps", "-eo", "pid,ppid,args"], capture_output=True, text=True, check=True
    )
    rows = [line.split(None, 2) for line in listing.stdout.splitlines()[1:]]
    servers = {
        pid
        for pid, _, words in rows
        if "studio" in words and str(os.getpid()) in _parents(pid, rows)
    }
    assert port
    return [int(pid) for pid, parent, words in rows if parent in servers and "spawn_main" in words]


def _parents(pid: str, rows: list[list[str]]) -> set[str]:
    above = {one: parent for one, parent, _ in rows}
    found = set()
    while pid in above:
        pid = above[pid]
        found.add(pid)
    return found


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
    seen.page.get_by_role("button", name="sbafab").click()
    for name in api.templates():
        image = seen.page.locator(f"img[src='templates/{name}.webp']")
        image.wait_for()
        seen.until(
            f"document.querySelector(\"img[src='templates/{name}.webp']\").naturalWidth === 320"
        )
    seen.page.locator(".gallery button", has_text="1dof-10mm").click()
    seen.until("studio.laminate.name === '1dof-10mm'")
    seen.page.get_by_role("button", name="sbafab").click()
    seen.page.locator(".gallery button", has_text="brace").click()
    seen.until("studio.family === 'assembly' && !studio.stale.rules")
    assert seen.say("studio.findings.length") > 10
