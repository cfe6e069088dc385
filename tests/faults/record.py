"""A written folder, what a fault in it is, and the rule that must catch it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any
from unittest.mock import patch

from sbafab.folders import as_cut
from sbafab.folders import build as builds
from sbafab.folders import check as as_built
from sbafab.folders.as_cut import CutPart, read_part
from sbafab.folders.check import check_folder
from sbafab.geometry.region import Region
from sbafab.laminate import laminate
from sbafab.laminate.laminate import Laminate, Layer, Role, interface_regions
from sbafab.rules import registration_worst_case, registration_yield
from sbafab.rules.deck import RULES, run_deck
from tests.folders.doctoring import Doctor

Change = Callable[[Region, Laminate], Region]
Pick = Callable[[Laminate], Layer]
Picks = Callable[[Laminate], Sequence[Layer]]

LEFT_OUT = (registration_worst_case.NAME, registration_yield.NAME)
"""Rules that foresee errors on the bench: no fault is theirs, and they take most of the time."""


@dataclass(frozen=True)
class Specimen:
    """A copy of a good folder, and the laminate that it was before any fault."""

    doctor: Doctor
    clean: Laminate

    def redraw(self, layers: Sequence[Layer], change: Change) -> None:
        """The layers' files with their profiles changed."""
        for layer in layers:
            self.doctor.redraw(layer.index, lambda region: change(region, self.clean))


@contextmanager
def quick(parts: dict[str, CutPart]) -> Iterator[None]:
    """Files of equal bytes are parsed, and layers of equal shape laid on each other, once.

    ``parts`` remembers what was parsed. The rules of LEFT_OUT are not run, and none when a good
    folder is written.
    """

    def known(path: Path, properties: Mapping[str, str], profile: Region, beam: Region) -> CutPart:
        digest = sha256(path.read_bytes()).hexdigest() + profile.key
        if digest not in parts:
            parts[digest] = read_part(path, properties, profile, beam)
        return parts[digest]

    def regions(below: Region, above: Region, masks: Sequence[Region]) -> tuple[Region, ...]:
        return _laid(below, above, *masks)

    rules = tuple(rule for rule in RULES if rule.name not in LEFT_OUT)
    with (
        patch.object(as_cut, "read_part", known),
        patch.object(laminate, "interface_regions", regions),
        patch.object(as_built, "RULES", rules),
        patch.object(builds, "run_deck", lambda *_: ()),
    ):
        yield


@contextmanager
def unabridged() -> Iterator[None]:
    """Every rule is run."""
    with patch.object(as_built, "RULES", RULES), patch.object(builds, "run_deck", run_deck):
        yield


@cache
def _laid(below: Region, above: Region, *masks: Region) -> tuple[Region, ...]:
    return interface_regions(below, above, masks)


def failing(folder: Path) -> tuple[str, ...]:
    """The rules that fail in a folder, in the order they are reported."""
    return tuple(dict.fromkeys(f.rule for f in check_folder(folder) if f.verdict == "fail"))


def layer_of(role: Role, balloon: int | None = None) -> Pick:
    """The lowest layer of a role, or the lowest of that role in a balloon."""
    return lambda stack: next(
        layer for layer in stack.layers if layer.role == role and balloon in (None, layer.balloon)
    )


base = layer_of("base")
cap = layer_of("cap")
sheet_mask = layer_of("separator-mask")
tabbed_wall = layer_of("wall", 1)
wall = layer_of("wall", 2)
separator = layer_of("separator-mask", 1)
inlet_mask = layer_of("chamber-mask", 1)
mask = layer_of("chamber-mask", 2)


# Faults.


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
