"""What is worked out of a contour and kept with it: bores and outlines bound several regions."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from sbafab.geometry.region import Contour

Made = TypeVar("Made")


def kept(contour: Contour, name: str, make: Callable[[Contour], Made]) -> Made:
    """What ``make`` says of a contour, asked once; it must not hold the contour itself."""
    known = contour.__dict__
    if name not in known:
        known[name] = make(contour)
    found: Made = known[name]
    return found
