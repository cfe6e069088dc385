"""The lines that a prediction opens with: what it reaches, how sure that is, what is left out."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from sbafab.models import paper, printed
from sbafab.models.counterparts import EQ_4

if TYPE_CHECKING:
    from sbafab.models.figures import Figure, Prediction

LEFT_OUT = "left out"
STROKES = ("full stroke", "free stroke at ", "reached diameter")
BENDS = ("bend at ", "bend with one chamber")
RADIUS = 2.5
"""Pocket radius in mm of the actuators whose forces were measured."""
FULL = "as the paper measured on one actuator of d = 5, in proportion to d; its error is not known"


class VerdictLine(NamedTuple):
    """One line of a verdict: the ``quantity`` ("stroke", "bend", "force" or "left out"), what it
    comes to, and in ``note`` how far that is to be trusted.
    """

    quantity: str
    figure: str
    note: str


def verdict(found: Prediction) -> tuple[VerdictLine, ...]:
    """Return the lines of a prediction: strokes, a bend, a force, then what is left out and why."""
    lines = [VerdictLine(what, _shown(figure), _note(figure)) for what, figure in _main(found)]
    why: dict[str, list[str]] = {}
    for one in found.left_out:
        why.setdefault(one.reason, []).append(one.name)
    lines += [VerdictLine(LEFT_OUT, ", ".join(names), reason) for reason, names in why.items()]
    return tuple(lines)


def _main(found: Prediction) -> Iterator[tuple[str, Figure]]:
    """What is asked of an actuator first, each by the model to design with."""
    figures = [figure for figure in found.figures if not figure.other]
    for begins in STROKES:
        yield from (("stroke", one) for one in _first(figures, begins))
    for begins in BENDS:
        bend = _first(figures, begins)
        if bend:
            yield "bend", bend[0]
            break
    flat = [one for one in figures if one.name.startswith("blocked force") and ", flat" in one.name]
    flat = [one for one in flat if not one.name.endswith("at most")] or flat
    if flat:
        # Of the highest pressure that was asked for.
        at = f"at {max(found.asked.pressures_kpa):g} kPa"
        yield "force", next(one for one in flat if at in one.name)


def _first(figures: list[Figure], begins: str) -> list[Figure]:
    return [one for one in figures if one.name.startswith(begins)][:1]


def _shown(one: Figure) -> str:
    return f"{one.value:.4g} {one.unit}, {one.name} ({one.model.name})"


def _note(one: Figure) -> str:
    """The measured counterpart, else the interval that measurements give, else the trust."""
    if one.measured or one.between:
        return one.aside
    if one.model.name.startswith("the paper's full height"):
        return FULL
    if one.model.name.startswith(EQ_4):
        low, high = eq_4_ratios()
        return (
            f"{low * one.value:.3g} to {high * one.value:.3g} N by the paper's six forces at "
            f"{paper.FORCE_KPA:g} kPa, {low:.2f} to {high:.2f} times this model"
        )
    return one.model.trust


@lru_cache(maxsize=1)
def eq_4_ratios() -> tuple[float, float]:
    """Return the least and the most of the paper's forces (Sec. 4.3) over virtual work on Eq. 4."""
    full = paper.FULL_SHARE * RADIUS
    ratios = [
        measured.value / (chambers * paper.FORCE_KPA / 1000 * float(printed.rate(h, RADIUS)))
        for chambers, forces in ((1, paper.FORCE_1DOF), (3, paper.FORCE_3DOF))
        for h, measured in zip([s * full for s in paper.HEIGHTS], forces, strict=True)
    ]
    return min(ratios), max(ratios)
