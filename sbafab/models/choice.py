"""Which figure to design with where several models give one quantity."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from sbafab.models.figures import Figure

STACK = "elastic stack"
REACHED = "lens of two arcs"
WIDEST = "cylinder of unstretched film"
BEHIND = (
    # An upper bound: it says 140 degrees where the paper measured 81 and the stack says 69 to 83.
    ("bending", "constant curvature", STACK),
    # The modulus was measured, at a pressure that nobody knows; the stack's is a tenth of it.
    ("stiffness", STACK, "3 E I / l^3"),
    # No air drives a balloon to the cylinder that its film could be: short ones stay far below it.
    ("size", WIDEST, REACHED),
)
"""Group, what models begin with that stand behind, and what those begin with that they yield to."""
FREE = ", free"
"""What the name of the elastic balloon's work ends with, beside that of the upper bound."""


def chosen(figures: Iterable[Figure], to_come: tuple[str, ...] = ()) -> tuple[Figure, ...]:
    """The same figures, those marked as ``other`` that are not to be designed with.

    ``to_come`` are beginnings of models whose figures are left out for now. Of one name the first
    is chosen: the paper's Eq. 4, whose force is nearest to the six that the paper measured at 100
    kPa (0.76 to 1.24 times it; 0.74 to 1.65 times Eqs. 1-3, 0.47 to 0.86 times the elastic stack).
    """
    found = tuple(figures)
    return tuple(replace(one, other=_is_other(one, found, to_come)) for one in found)


def _is_other(one: Figure, figures: Sequence[Figure], to_come: tuple[str, ...]) -> bool:
    own = [figure for figure in figures if figure.group == one.group]
    if next(figure for figure in own if figure.name == one.name) is not one:
        return True
    if any(figure.name == one.name + FREE for figure in own):
        return True
    return any(
        one.group == group
        and one.model.name.startswith(behind)
        and (first in to_come or any(figure.model.name.startswith(first) for figure in own))
        for group, behind, first in BEHIND
    )
