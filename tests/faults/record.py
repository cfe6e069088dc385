"""What a fault is: its name, the rule that must catch it, and how it is put into a folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sbafab.laminate.laminate import Laminate
from tests.faults.specimen import Change, Pick, Specimen

Put = Callable[[Specimen], None]
PAPER = ("1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm")
"""The templates of the paper's families, which most faults are put into."""
WhyNot = Callable[[Laminate], str]
"""Why a fault does not apply to a laminate; empty where it does."""


@dataclass(frozen=True)
class Fault:
    """A kind of fault. ``settings`` are those of the good folder that it is put into.

    ``beside``: all that a run writes is in the folder, not the cut files alone. It is put into its
    ``templates`` alone.
    """

    name: str
    rule: str
    put: Put
    why_not: WhyNot = lambda laminate: ""
    settings: tuple[str, ...] = ()
    beside: bool = False
    templates: tuple[str, ...] = PAPER


@dataclass(frozen=True)
class Kind:
    """Faults of one kind, a table of their own."""

    title: str
    note: str
    faults: tuple[Fault, ...]


def redrawn(name: str, rule: str, pick: Pick, change: Change, *conditions: WhyNot) -> Fault:
    """A fault in one layer's profile, with its hash put right.

    It does not apply where a condition says so, or where the profile comes out as it was.
    """

    def put(specimen: Specimen) -> None:
        specimen.redraw([pick(specimen.clean)], change)
        specimen.doctor.rehash()

    def why_not(laminate: Laminate) -> str:
        said = first_reason(laminate, conditions)
        if said:
            return said
        profile = pick(laminate).profile
        changed = change(profile, laminate)
        apart = (profile | changed).area - (profile & changed).area
        return "it looks the same" if apart < 1e-6 else ""

    return Fault(name, rule, put, why_not)


def first_reason(laminate: Laminate, conditions: Sequence[WhyNot]) -> str:
    return next((said for why_not in conditions if (said := why_not(laminate))), "")


def one_chamber(laminate: Laminate) -> str:
    return "one chamber" if len(laminate.chambers) == 1 else ""


def no_lumen(laminate: Laminate) -> str:
    return "no lumen" if laminate.lumen is None else ""


def no_sheet(laminate: Laminate) -> str:
    return "" if any(layer.role == "sheet" for layer in laminate.layers) else "no sheet"
