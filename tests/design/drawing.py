"""Drawings to read outlines from."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf

PAGE = 'width="40mm" height="40mm" viewBox="-20 -20 40 40"'
ARROW = [(6, 0), (6, 5), (0, 2), (-5, 5), (-6, 0), (-5, -5), (0, -3), (5, -5)]


def dxf(
    folder: Path, draw: Callable[[Any], object], units: int = 4, version: str = "R2010"
) -> Path:
    document = ezdxf.new(version)
    if version != "R12":
        document.header["$INSUNITS"] = units
    draw(document.modelspace())
    path = folder / "outline.dxf"
    document.saveas(path)
    return path


def svg(folder: Path, body: str, page: str = PAGE) -> Path:
    path = folder / "outline.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {page}>{body}</svg>')
    return path
