"""Makes the pictures that README and docs show, from the templates.

``python -m docs.scripts.pictures`` makes all of them, ``... pictures solid traveller`` some. That of
the traveller takes Chromium.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from PIL import Image

import sbafab
from sbafab.reports.charts import relation_svg
from sbafab.reports.layers_svg import layers_svg
from sbafab.reports.solid_pictures import PictureRequest, assembly_pngs, solid_png, write_picture
from sbafab.reports.stack_svg import stack_svg

IMAGES = Path(__file__).parents[1] / "images"
ARM = "3dof-15mm"
ROOM_ABOVE = 8.0
"""mm of film that are shown above the parts of a sheet."""
PAGE = "820,1160"
"""Pixels of the window in which a page of A4 is seen whole."""


def solid() -> None:
    """The solids of the templates and of an assembly."""
    for name in ("1dof-5mm", ARM, "radial-15mm"):
        (IMAGES / f"{name}-solid.png").write_bytes(solid_png(sbafab.build(name), 1200, 900))
    (IMAGES / "brace-assembled.png").write_bytes(assembly_pngs(sbafab.assemble("brace"))[0])


def flat() -> None:
    """Layers and section."""
    laminate = sbafab.build(ARM)
    (IMAGES / f"{ARM}-layers.svg").write_text(layers_svg(laminate), encoding="utf-8")
    (IMAGES / f"{ARM}-stack.svg").write_text(stack_svg(laminate), encoding="utf-8")


def tutorials() -> None:
    """What the tutorials generate: a first actuator of four balloons, and an oval outline."""
    with tempfile.TemporaryDirectory() as scratch:
        first = sbafab.generate("1dof-5mm", "stack.balloons=4", out=scratch, name="first").folder
        for name in ("solid.png", "layers.svg", "stack.svg"):
            shutil.copyfile(first / "preview" / name, IMAGES / f"first-{name}")
        # A laser's lines are too fine for a small picture.
        sheet = (first / "sheets" / "TPE_1.svg").read_text(encoding="utf-8")
        thicker = re.sub(r'stroke-width="[\d.]+"', 'stroke-width="0.6"', sheet)
        (IMAGES / "first-sheet.svg").write_text(_lower_part(thicker), encoding="utf-8")
        oval = sbafab.generate(str(IMAGES.with_name("gallery") / "oval.toml"), out=scratch).folder
        shutil.copyfile(oval / "preview" / "layers.svg", IMAGES / "oval-layers.svg")


def _lower_part(drawing: str) -> str:
    """The part of a sheet that is cut, which begins below; the film above it is left out."""
    box = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', drawing)
    assert box is not None
    width, height = map(float, box.groups())
    cut = drawing.partition('id="REFERENCE"')[0]
    top = max(0.0, min(float(y) for y in re.findall(r"[ML][\d.]+ ([\d.]+)", cut)) - ROOM_ABOVE)
    shown = f'width="{width}mm" height="{height - top}mm" viewBox="0 {top} {width} {height - top}"'
    return re.sub(r'width="\S+" height="\S+" viewBox="[^"]+"', shown, drawing, count=1)


def force() -> None:
    """Predicted and measured force."""
    for relation in sbafab.predict(ARM).relations:
        if relation.name == "force":
            plot = relation_svg(ARM, relation)
            (IMAGES / f"{ARM}-force.svg").write_text(plot, encoding="utf-8")


def inflated() -> None:
    """The actuator bent by two of its chambers, and with pressure going round all three."""
    laminate, stack = sbafab.build(ARM), sbafab.stack(ARM)
    bent = PictureRequest({"chamber1": 5.0, "chamber2": 5.0}, width=1200, height=900)
    write_picture(laminate, stack, bent, IMAGES / "inflated.png")
    round_all = PictureRequest({"": 5.0}, width=480, height=384, motion="circle", frames=36)
    write_picture(laminate, stack, round_all, IMAGES / "moving.webp")


def traveller() -> None:
    """The first page of the tutorial's traveller, as Chromium shows it."""
    with tempfile.TemporaryDirectory() as scratch:
        first = sbafab.generate("1dof-5mm", "stack.balloons=4", out=scratch, name="first")
        shot = f"--screenshot={IMAGES / 'traveller-first.png'}"
        asked = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", shot]
        page = (first.folder / "traveller.html").resolve().as_uri()
        subprocess.run(
            ["chromium", *asked, f"--window-size={PAGE}", page], check=True, capture_output=True
        )
    shown = Image.open(IMAGES / "traveller-first.png").convert("RGB").quantize(64)
    shown.save(IMAGES / "traveller-first.png", optimize=True)


MAKERS: dict[str, Callable[[], None]] = {
    made.__name__: made for made in (solid, flat, tutorials, force, inflated, traveller)
}


def main() -> None:
    for name in sys.argv[1:] or MAKERS:
        MAKERS[name]()


if __name__ == "__main__":
    main()
