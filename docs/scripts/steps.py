"""Pictures of the tutorials' steps, made by the commands that the tutorials name."""

from __future__ import annotations

import re
import shutil
import tempfile
from pathlib import Path

import sbafab
from sbafab.cutting.sheets import STROKE

HAIRLINE = f'stroke-width="{STROKE:g}"'
ROOM = 8.0
"""mm of film that are shown above the parts."""
KEPT = ("preview/solid.png", "preview/layers.svg", "preview/stack.svg", "sheets/TPE_1.svg")


def write_steps(folder: Path) -> None:
    """What ``sbafab generate`` draws of the first actuator, and of the drawn outline."""
    gallery = Path(__file__).parents[1] / "gallery"
    with tempfile.TemporaryDirectory() as scratch:
        first = sbafab.generate("1dof-5mm", "stack.balloons=4", out=scratch, name="first")
        _keep(first.folder, folder / "first")
        oval = sbafab.generate(str(gallery / "oval.toml"), out=scratch)
        _keep(oval.folder, folder / "oval")


def _keep(made: Path, target: Path) -> None:
    target.mkdir()
    for name in KEPT:
        shutil.copyfile(made / name, target / Path(name).name)
    sheet = target / "TPE_1.svg"
    # A laser's lines are too fine for a small picture.
    thicker = sheet.read_text(encoding="utf-8").replace(HAIRLINE, 'stroke-width="0.6"')
    sheet.write_text(_lower_part(thicker), encoding="utf-8")


def _lower_part(drawing: str) -> str:
    """The part of a sheet that is cut, which begins below; the film above it is left out."""
    box = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', drawing)
    assert box is not None
    width, height = map(float, box.groups())
    cut = drawing.partition('id="REFERENCE"')[0]
    top = max(0.0, min(float(y) for y in re.findall(r"[ML][\d.]+ ([\d.]+)", cut)) - ROOM)
    shown = f'width="{width}mm" height="{height - top}mm" viewBox="0 {top} {width} {height - top}"'
    return re.sub(r'width="\S+" height="\S+" viewBox="[^"]+"', shown, drawing, count=1)
