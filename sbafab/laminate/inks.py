"""The colours of films, alike in every picture and on every page."""

from __future__ import annotations

from typing import NamedTuple

from sbafab.laminate.films import Film


class Ink(NamedTuple):
    """Fill and line colour of a film."""

    fill: str
    line: str


# Blue against orange: told apart in every common colour blindness, and in grey by lightness.
# Further films follow in hues apart from both; masks stay light, and pictures hatch them.
STRUCTURAL = (
    Ink("#a9cfea", "#0b4f86"),
    Ink("#8fd0b5", "#0b6b4b"),
    Ink("#c9b8e6", "#54308f"),
    Ink("#b9c2cc", "#3c4650"),
)
MASKS = (
    Ink("#fbe3bd", "#b35a00"),
    Ink("#f8cfd4", "#a3213a"),
    Ink("#ecebae", "#6f6a00"),
)


def ink(film: Film) -> Ink:
    """The colours of a film; the fifth of a kind begins again with the first one's."""
    inks = MASKS if film.is_mask else STRUCTURAL
    return inks[film.shade % len(inks)]
