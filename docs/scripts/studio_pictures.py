"""Pictures of the studio for the docs, and of the templates for its gallery.

``python -m docs.scripts.studio_pictures`` with Chromium installed writes both.
"""

from __future__ import annotations

import base64
import io
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageChops

from sbafab import api
from tests.studio.browsing import Watched, browser, served

ROOT = Path(__file__).parents[2]
IMAGES = ROOT / "docs" / "images"
GALLERY = ROOT / "sbafab" / "studio" / "static" / "templates"
THUMB = (320, 240)
EDGE = 30


def main() -> None:
    """Writes the pictures that are named, or all."""
    wanted = sys.argv[1:] or ["gallery", "docs", "draw", "assembly", "phone"]
    with tempfile.TemporaryDirectory() as scratch, browser() as chromium:
        folder = Path(scratch)
        (folder / "arm.toml").write_text(api.template("3dof-15mm"), encoding="utf-8")
        with served(folder, "arm.toml") as link:
            if "gallery" in wanted:
                _gallery(Watched(chromium, link, device_scale_factor=2), folder)
            if "docs" in wanted:
                _docs(Watched(chromium, link))
            if "draw" in wanted:
                _draw(Watched(chromium, link))
            if "assembly" in wanted:
                _assembly(Watched(chromium, link))
            if "phone" in wanted:
                _phone(Watched(chromium, link, viewport={"width": 390, "height": 844}))


def _gallery(seen: Watched, folder: Path) -> None:
    GALLERY.mkdir(exist_ok=True)
    seen.ready()
    for name in api.templates():
        if 'family = "assembly"' in api.template(name):
            run = api.generate(name, out=folder / "out")
            picture = Image.open(next((run.folder / "preview").glob("*.png")))
            # Without the legend below.
            _thumb(picture.crop((0, 0, picture.width, int(0.82 * picture.height))), name)
            continue
        seen.page.evaluate("text => studio.open(text)", api.template(name))
        seen.until(f"studio.laminate?.name === '{name}'")
        seen.page.click("#tab-solid")
        seen.page.wait_for_timeout(1500)
        url = seen.say("document.querySelector('#view-solid canvas').toDataURL('image/png')")
        _thumb(Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))), name)
    seen.close()


def _thumb(picture: Image.Image, name: str) -> None:
    """Writes the picture cropped to what is drawn, in the middle of its ground."""
    image = picture.convert("RGB")
    ground = image.getpixel((2, 2))
    blank = Image.new("RGB", image.size, ground)
    image = image.crop(ImageChops.difference(image, blank).getbbox())
    width, height = 2 * THUMB[0], 2 * THUMB[1]
    image.thumbnail((width - 2 * EDGE, height - 2 * EDGE))
    made = Image.new("RGB", (width, height), ground)
    made.paste(image, ((width - image.width) // 2, (height - image.height) // 2))
    made.resize(THUMB, Image.Resampling.LANCZOS).save(GALLERY / f"{name}.webp", quality=82)


def _docs(seen: Watched) -> None:
    page = seen.page
    seen.ready()
    page.wait_for_timeout(500)
    _keep(seen, "solid")
    page.click("#tab-layers")
    page.click(".finding[data-rule=bond-width]")
    page.wait_for_timeout(600)
    _keep(seen, "finding")
    page.click("#tab-motion")
    seen.until("Boolean(studio.motion.pose)")
    seen.say("studio.motion.set(i => [30, 12, 0][i])")
    page.wait_for_timeout(2500)
    _keep(seen, "motion")
    page.click("#theme")
    page.click("#pin")
    seen.say("studio.edit([['chamber.diameter', '6'], ['lumen.diameter', '3']])")
    page.wait_for_timeout(800)
    seen.ready()
    page.wait_for_timeout(500)
    _keep(seen, "compare")
    page.click("#pin")
    page.click("#make")
    page.get_by_role("button", name="Generate", exact=True).click()
    seen.until("Boolean(document.querySelector('.make .list button'))")
    page.get_by_label("Cut order").fill("150")
    page.wait_for_timeout(600)
    _keep(seen, "make")
    seen.close()


def _draw(seen: Watched) -> None:
    """A pocket with one side bent, and the next point under way to the grid."""
    seen.ready()
    seen.page.evaluate("text => studio.open(text)", api.template("pouch"))
    seen.until("studio.laminate?.name === 'pouch'")
    seen.page.click("#tab-draw")
    seen.page.locator("[data-handle=corner-1]").click()
    seen.page.locator("#view-draw .surface").press("a")
    seen.until("studio.text.includes('path =')")
    seen.ready()
    seen.page.locator("#view-draw").get_by_role("button", name="Fit", exact=True).click()
    corner = seen.page.locator("[data-handle=corner-3]").bounding_box()
    assert corner is not None
    x, y = corner["x"] + corner["width"] / 2, corner["y"] + corner["height"] / 2
    seen.page.mouse.move(x, y)
    seen.page.mouse.down()
    seen.page.mouse.move(x - 25, y + 33, steps=5)
    seen.page.wait_for_timeout(400)
    seen.ready()
    _keep(seen, "draw")
    seen.page.mouse.up()
    seen.close()


def _assembly(seen: Watched) -> None:
    seen.ready()
    seen.page.evaluate("text => studio.open(text)", api.template("brace"))
    seen.until("Boolean(studio.parts) && !Object.values(studio.stale).some(Boolean)")
    seen.page.click("#tab-plan")
    plan = seen.page.locator("#view-plan")
    plan.get_by_role("button", name="Front", exact=True).click()
    plan.get_by_role("button", name="Section", exact=True).click()
    seen.until("(studio.prediction?.figures ?? []).length > 0")
    seen.page.wait_for_timeout(500)
    _keep(seen, "assembly")
    seen.page.click("#tab-swing")
    seen.until("document.querySelectorAll('#view-swing .reading').length > 0")
    seen.page.wait_for_timeout(1500)
    _keep(seen, "assembly-motion")
    seen.close()


def _phone(seen: Watched) -> None:
    seen.ready()
    seen.page.wait_for_timeout(500)
    _keep(seen, "phone")
    seen.close()


def without_timing(seen: Watched) -> None:
    """Hides how long this machine took, which says nothing of another one."""
    seen.page.evaluate("() => { document.querySelector('#timing').style.visibility = 'hidden'; }")


def _keep(seen: Watched, name: str) -> None:
    without_timing(seen)
    image = Image.open(io.BytesIO(seen.page.screenshot()))
    image.quantize(256, Image.Quantize.FASTOCTREE).save(
        IMAGES / f"studio-{name}.png", optimize=True
    )


if __name__ == "__main__":
    main()
