"""What a fault is: its name, the rule that must catch it, and how it is put into a folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sbafab.laminate.laminate import Laminate, Layer
from tests.faults.specimen import Change, Pick, Picks, Specimen

Put = Callable[[Specimen], None]
PAPER = ("1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm")
"""The templates of the paper's families, which most faults are put into."""
WhyNot = Callable[[Laminate], str]
"""Why a fault does not apply to a laminate; empty where it does."""


@dataclass(frozen=True)
class Fault:
    """A kind of fault. ``settings`` are those of the good folder that it is put into.

    ``beside``: all that a run writes is in the folder, not the cut files alone. It is put into its
    ``templates`` alone, and the ``hashes`` of files are put right afterwards.
    """

    name: str
    rule: str
    put: Put
    why_not: WhyNot = lambda laminate: ""
    settings: tuple[str, ...] = ()
    beside: bool = False
    templates: tuple[str, ...] = PAPER
    hashes: bool = True


@dataclass(frozen=True)
class Kind:
    """Faults of one kind, a table of their own."""

    title: str
    note: str
    faults: tuple[Fault, ...]


def redrawn(
    name: str, rule: str, pick: Pick | Picks, change: Change, *conditions: WhyNot, **more: Any
) -> Fault:
    """A fault in the profile of one layer or several.

    It does not apply where a condition says so, or where the profile comes out as it was.
    """

    def layers(laminate: Laminate) -> Sequence[Layer]:
        found = pick(laminate)
        return [found] if isinstance(found, Layer) else found

    def put(specimen: Specimen) -> None:
        specimen.redraw(layers(specimen.clean), change)

    def why_not(laminate: Laminate) -> str:
        said = next((said for why_not in conditions if (said := why_not(laminate))), "")
        if said:
            return said
        profile = layers(laminate)[0].profile
        changed = change(profile, laminate)
        apart = (profile | changed).area - (profile & changed).area
        return "it looks the same" if apart < 1e-6 else ""

    return Fault(name, rule, put, why_not, **more)


def edited(
    name: str,
    rule: str,
    file: Callable[[Specimen], Path],
    change: Callable[[bytes], bytes],
    **more: Any,
) -> Fault:
    """A file with other contents."""

    def put(specimen: Specimen) -> None:
        data = file(specimen).read_bytes()
        changed = change(data)
        assert changed != data
        file(specimen).write_bytes(changed)

    return Fault(name, rule, put, **more)


def of_text(change: Callable[[str], str]) -> Callable[[bytes], bytes]:
    return lambda data: change(data.decode("utf-8")).encode()


def told(name: str, change: Callable[[dict[str, Any]], object], **more: Any) -> Fault:
    """A manifest changed by hand; every file as it was written."""
    return Fault(name, "manifest-claims", lambda s: s.doctor.set_manifest(change), **more)


def one_chamber(laminate: Laminate) -> str:
    return "one chamber" if len(laminate.chambers) == 1 else ""


def no_lumen(laminate: Laminate) -> str:
    return "no lumen" if laminate.lumen is None else ""


def no_sheet(laminate: Laminate) -> str:
    return "" if any(layer.role == "sheet" for layer in laminate.layers) else "no sheet"
