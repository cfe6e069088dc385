"""A written folder to put a fault into."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
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
