"""The moving picture of the studio in README: ``python -m docs.scripts.studio_series``.

A knob is turned, a finding is opened at its place, the actuator bends; each as it is painted in
Chromium, with a line that says so. Writes ``docs/images/studio.webp``.
"""

from __future__ import annotations

import io
import math
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from docs.scripts.studio_pictures import without_timing
from sbafab import api
from tests.studio.browsing import Watched, browser, served

PICTURE = Path(__file__).parents[1] / "images" / "studio.webp"
PAGE = {"width": 1240, "height": 760}
WIDTH, QUALITY = 930, 62
"""Pixels across, and WebP's quality: letters are read, and the file stays below 1 MB."""
LINE = 34
Frame = tuple[Image.Image, int]
"""A picture and how long it stands, ms."""


def main() -> None:
    """Writes the picture."""
    with tempfile.TemporaryDirectory() as scratch, browser() as chromium:
        folder = Path(scratch)
        (folder / "arm.toml").write_text(api.template("3dof-15mm"), encoding="utf-8")
        with served(folder, "arm.toml") as link:
            seen = Watched(chromium, link, viewport=PAGE)
            seen.ready()
            without_timing(seen)
            frames = [*_knob(seen), *_finding(seen), *_motion(seen)]
            seen.close()
    pictures = [picture for picture, _ in frames]
    out = io.BytesIO()
    pictures[0].save(
        out,
        "WEBP",
        save_all=True,
        append_images=pictures[1:],
        duration=[duration for _, duration in frames],
        loop=0,
        quality=QUALITY,
        method=4,
    )
    PICTURE.write_bytes(out.getvalue())


def _knob(seen: Watched) -> list[Frame]:
    words = "Turn a knob: layers, section, rules and prediction follow"
    frames = [_frame(seen, words, 900)]
    for diameter in (5.6, 6.2, 6.8, 7.4):
        _set(seen, "chamber.diameter", diameter)
        frames.append(_frame(seen, words, 420))
    for balloons in (12, 9):
        _set(seen, "stack.balloons", balloons)
        frames.append(_frame(seen, words, 420))
    return [*frames[:-1], (frames[-1][0], 1200)]


def _finding(seen: Watched) -> list[Frame]:
    words = "A bond too narrow: the rule says so, and a click shows where"
    _set(seen, "bond.width", 0.6)
    frames = [_frame(seen, words, 1500)]
    seen.page.click("#tab-layers")
    seen.page.locator(".finding[data-rule=bond-width]").first.click()
    frames.append(_frame(seen, words, 2200))
    _set(seen, "bond.width", 0.75)
    return frames


def _motion(seen: Watched) -> list[Frame]:
    words = "Let it move: pressure a chamber, poses of the elastic stack"
    seen.page.click("#tab-motion")
    seen.until("Boolean(studio.motion.pose)")
    frames = []
    count = 16
    for number in range(count + 1):
        turn = math.tau * number / count
        share = min(1.0, number / 4)
        aims = [share * 15 * (1 + math.cos(turn - k * math.tau / 3)) for k in range(3)]
        kpa = [round(aim, 1) for aim in aims]
        seen.page.evaluate("kpa => { studio.motion.set(i => kpa[i]); }", kpa)
        seen.until(f"studio.motion.pose.pressures.join() === '{_joined(kpa)}'")
        frames.append(_frame(seen, words, 150, 900))
    return [*frames[:-1], (frames[-1][0], 1500)]


def _joined(numbers: list[float]) -> str:
    return ",".join(f"{number:g}" for number in numbers)


def _set(seen: Watched, key: str, value: float) -> None:
    """Turns a knob as its slider does and waits until all is current."""
    seen.page.get_by_label(f"{key} slider").fill(f"{value:g}")
    seen.page.wait_for_timeout(100)
    seen.ready()


def _frame(seen: Watched, words: str, duration: int, rest: int = 300) -> Frame:
    """The page as it is after ``rest`` ms, with the line below."""
    seen.page.wait_for_timeout(rest)
    page = Image.open(io.BytesIO(seen.page.screenshot())).convert("RGB")
    page = page.resize((WIDTH, round(page.height * WIDTH / page.width)), Image.Resampling.LANCZOS)
    made = Image.new("RGB", (WIDTH, page.height + LINE), "#0b5c9e")
    made.paste(page, (0, 0))
    draw, font = ImageDraw.Draw(made), ImageFont.load_default(17)
    draw.text((14, page.height + LINE / 2), words, fill="white", font=font, anchor="lm")
    return made, duration


if __name__ == "__main__":
    main()
