"""Pictures in space in Chromium: surfaces, light, picking, hands, keys, and a driver that stops."""

from __future__ import annotations

import io
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from sbafab import api
from tests.studio.browsing import BROWSED, Watched, picture, share_changed

pytestmark = BROWSED
SOLID = "#view-solid .surface"
STATIC = Path(api.__file__).parents[1] / "studio" / "static"


def colour(name: str) -> list[int]:
    """Red, green and blue of a name in the light theme of the page."""
    code = re.search(rf"{name}: #(\w{{6}})", (STATIC / "studio.css").read_text(encoding="utf-8"))
    assert code is not None
    return list(bytes.fromhex(code[1]))


VOLUME = """({solid}) => { const {points: p, faces: f} = solid; let volume = 0, flat = 0;
    const at = (i) => [p[3 * f[i]], p[3 * f[i] + 1], p[3 * f[i] + 2]];
    for (let i = 0; i < f.length; i += 3) { const [a, b, c] = [at(i), at(i + 1), at(i + 2)];
      volume += (a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])) / 6;
      if (a[2] === 1 && b[2] === 1 && c[2] === 1)
        flat += Math.abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2; }
    return [volume, flat]; }"""


def test_a_prism_holds_the_area_of_its_film(seen: Watched) -> None:
    """Its faces enclose the area times 1 mm, and none of its top lies over another."""
    designs = (api.loads(api.template(name)) for name in api.templates())
    laminates = [api.build(design) for design in designs if design.family != "assembly"]
    assert len(laminates) > 8
    for laminate in laminates:
        for pattern, layers in laminate.patterns.items():
            region = layers[0].profile
            contours = [[n for v in contour.vertices for n in v] for contour in region.contours]
            volume, top = seen.page.evaluate(
                f"""shape => Promise.all([import('/meshes.js'), import('/shapes.js')]).then(
                ([{{prism}}, {{polygons}}]) => ({VOLUME})(prism(polygons(shape, 1e-5))))""",
                contours,
            )
            where = (laminate.name, pattern)
            assert (volume, top) == pytest.approx((region.area, region.area), rel=2e-4), where


def shown(seen: Watched) -> Image.Image:
    """The picture of the solid, one dot a pixel, after its last frame."""
    seen.page.wait_for_timeout(700)
    shot = seen.page.locator("#view-solid canvas").screenshot()
    return Image.open(io.BytesIO(shot)).convert("RGB")


def test_what_is_picked_is_what_is_seen(seen: Watched) -> None:
    """The film that a ray meets first has the hue of the dot there, also where the stack is cut."""
    names = {None: "--canvas", "TPE": "--tpe", "PTFE": "--ptfe"}
    hues = {material: np.array(colour(name)) for material, name in names.items()}
    for cut in (False, True):
        if cut:
            seen.page.get_by_role("button", name="Cut", exact=True).click()
        image = shown(seen)
        width, height = image.size
        dots = [(x, y) for x in range(4, width, 23) for y in range(4, height - 60, 19)]
        layers = seen.page.evaluate(
            """dots => { const box = studio.solid.stage.canvas.getBoundingClientRect();
            return dots.map(([x, y]) => studio.solid.hit(
              { clientX: box.left + x + 0.5, clientY: box.top + y + 0.5 })?.material ?? null); }""",
            [list(dot) for dot in dots],
        )
        assert {*layers} == {*hues}
        dot, edges = np.asarray(image, int), 0
        for (x, y), material in zip(dots, layers, strict=True):
            around = dot[y - 1 : y + 2, x - 1 : x + 2].reshape(9, 3)
            if np.ptp(around, axis=0).max() > 12:
                edges += 1
                continue
            # A film's light changes how bright it is, not which of its shares is the most.
            angles = {name: hue @ dot[y, x] / np.linalg.norm(hue) for name, hue in hues.items()}
            assert max(angles, key=angles.__getitem__) == material, (cut, x, y)
        assert edges < len(dots) / 2


def test_hands_and_keys_turn_shift_and_near(seen: Watched) -> None:
    page, canvas = seen.page, seen.page.locator("#view-solid canvas")
    box = canvas.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def camera() -> tuple[np.ndarray, np.ndarray]:
        eye, target = seen.say("[studio.solid.stage.camera.eye, studio.solid.stage.camera.target]")
        return np.array(eye), np.array(target)

    def drag(dx: float, dy: float, button: Any = "left") -> None:
        page.mouse.move(x, y)
        page.mouse.down(button=button)
        page.mouse.move(x + dx, y + dy, steps=4)
        page.mouse.up(button=button)

    eye, target = camera()
    away = np.linalg.norm(eye - target)
    # As far across as the picture is high is a whole turn; a quarter of it is a quarter.
    drag(box["height"] / 4, 0)
    turned, same = camera()
    assert same == pytest.approx(target)
    before, after = (eye - target)[:2], (turned - target)[:2]
    assert before @ after == pytest.approx(0, abs=0.005 * before @ before)
    assert before[0] * after[1] - before[1] * after[0] < 0
    # What a right hand takes hold of goes with it: so many mm at the distance of the target.
    drag(40, -25, "right")
    eye, shifted = camera()
    scale = 2 * away * math.tan(math.radians(14)) / box["height"]
    assert np.linalg.norm(shifted - target) == pytest.approx(scale * math.hypot(40, 25), rel=0.005)
    # A step of the wheel is a twentieth.
    page.mouse.wheel(0, -100)
    seen.until("true")
    page.wait_for_timeout(100)
    eye, target = camera()
    assert np.linalg.norm(eye - target) == pytest.approx(0.95 * away)
    # Keys do the same, and 0 shows the whole again.
    canvas.focus()
    for key in ("ArrowLeft", "Shift+ArrowUp", "+"):
        page.keyboard.press(key)
    moved, beside = camera()
    assert np.linalg.norm(beside - target) == pytest.approx(scale * 0.95 * 10, rel=0.005)
    assert np.linalg.norm(moved - beside) == pytest.approx(0.95**3 * away)
    page.keyboard.press("0")
    _, middle = camera()
    low, high = seen.say("[studio.solid.stage.box.min, studio.solid.stage.box.max]")
    assert middle == pytest.approx(np.add(low, high) / 2)
    # Two fingers twice as far apart come twice as near.
    near = np.linalg.norm(np.subtract(*camera()))
    page.evaluate(
        """([x, y]) => { const canvas = document.querySelector('#view-solid canvas');
        const send = (type, pointerId, dx) => canvas.dispatchEvent(new PointerEvent(type,
          { pointerId, clientX: x + dx, clientY: y, buttons: 1, pointerType: 'touch' }));
        canvas.setPointerCapture = () => {};
        send('pointerdown', 11, -30); send('pointerdown', 12, 30);
        send('pointermove', 11, -60); send('pointermove', 12, 60);
        send('pointerup', 11, -60); send('pointerup', 12, 60);
        delete canvas.setPointerCapture; }""",
        [x, y],
    )
    assert np.linalg.norm(np.subtract(*camera())) == pytest.approx(near / 2)


def test_pictures_come_back_after_the_driver_stopped(seen: Watched) -> None:
    before = picture(seen, SOLID)
    seen.say(
        "window.driver = document.querySelector('#view-solid canvas').getContext('webgl2')"
        ".getExtension('WEBGL_lose_context'), driver.loseContext(), 0"
    )
    notice = seen.page.locator("#notice")
    notice.get_by_text("The graphics driver stopped").wait_for()
    # Nobody else's button has the name of the one that closes it.
    ids = seen.say("[...document.querySelectorAll('[id]')].map(e => e.id)")
    assert len(ids) == len({*ids})
    # What changes meanwhile is shown when it is back.
    seen.page.locator("#view-solid").get_by_label("Explode").fill("90")
    seen.say("driver.restoreContext(), 0")
    notice.wait_for(state="hidden")
    seen.page.wait_for_timeout(700)
    assert share_changed(before, picture(seen, SOLID)) > 0.05
    seen.page.locator("#view-solid").get_by_label("Explode").fill("42")
    seen.page.wait_for_timeout(700)
    assert share_changed(before, picture(seen, SOLID)) < 0.005
    # The loss itself is told by the browser as well.
    seen.complaints[:] = [words for words in seen.complaints if "CONTEXT_LOST" not in words]


def test_without_webgl2_every_view_says_so_and_the_rest_works(chrome: Any, link: str) -> None:
    watched = Watched(chrome, "about:blank")
    watched.context.add_init_script(
        "const own = HTMLCanvasElement.prototype.getContext;"
        "HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {"
        " return kind === 'webgl2' ? null : own.call(this, kind, ...rest); };"
    )
    watched.page.goto(link)
    watched.ready()
    said = watched.page.locator("#views .fallback").all_text_contents()
    assert len(said) == 7
    assert {words.partition(". ")[0] for words in said} == {
        "This view needs WebGL2, which this browser does not provide"
    }
    assert watched.page.locator("#view-solid .fallback").is_visible()
    watched.page.get_by_role("button", name="Top", exact=True).click()
    watched.say("studio.edit([['stack.balloons', '4']])")
    watched.until("studio.laminate.balloons === 4")
    watched.page.get_by_role("tab", name="Motion").click()
    watched.until("document.querySelector('#view-motion .reading')?.innerText.includes(' mm')")
    watched.page.evaluate("text => studio.open(text)", api.template("brace"))
    watched.until("Boolean(studio.parts) && !Object.values(studio.stale).some(Boolean)")
    for tab in ("Solid", "Plan", "Motion"):
        watched.page.get_by_role("tab", name=tab).click()
    assert watched.complaints == []
    watched.close()
