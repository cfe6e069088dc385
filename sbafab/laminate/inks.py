"""The colours of films, alike in every picture and on every page."""

from __future__ import annotations

from typing import NamedTuple

from sbafab.laminate.films import Material


class Ink(NamedTuple):
    """Fill and line colour of a film."""

    fill: str
    line: str


# Blue against orange: told apart in every common colour blindness, and in grey by lightness.
INK: dict[Material, Ink] = {
    "TPE": Ink("#a9cfea", "#0b4f86"),
    "PTFE": Ink("#fbe3bd", "#b35a00"),
}
