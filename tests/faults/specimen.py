"""A written folder to put a fault into, with its claims made to agree with what is then cut."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any
from unittest.mock import patch

from sbafab.as_built import check as as_built
from sbafab.as_built import cut_files
from sbafab.as_built.check import read_folder
from sbafab.as_built.cut_files import CutPart, read_part
from sbafab.as_built.expected import Expected
from sbafab.as_built.sheets import sheet_problems
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.order import cutting_order
from sbafab.geometry.region import Region
from sbafab.laminate import laminate
from sbafab.laminate.laminate import Laminate, Layer, Role, interface_regions
from sbafab.output import checked
from sbafab.output.checked import Checked, DesignPlan, cut_settings
from sbafab.output.manifest import manifest
from sbafab.rules import registration_worst_case, registration_yield
from sbafab.rules.deck import RULES, run_deck
from sbafab.runs import check_folder as whole
from sbafab.runs.check_folder import check_folder, design_problems_of
from tests.as_built.doctoring import Doctor

Change = Callable[[Region, Laminate], Region]
Pick = Callable[[Laminate], Layer]

LEFT_OUT = (registration_worst_case.NAME, registration_yield.NAME)
"""Rules that foresee errors on the bench: no fault is theirs, and they take most of the time."""


@dataclass(frozen=True)
class Specimen:
    """A copy of a good folder, and the laminate that it was before any fault."""

    doctor: Doctor
    clean: Laminate

    def redraw(self, layers: Sequence[Layer], change: Change) -> None:
        """The layers' files with their profiles changed, their patterns named after the shape."""
        names = {
            (layer.film.material, layer.profile.key): layer.pattern for layer in self.clean.layers
        }
        for layer in layers:
            path = self.doctor.path(layer.index)
            found = read_profile(path)
            region = change(found.region, self.clean)
            shape = layer.film.material, region.key
            pattern = names.setdefault(shape, f"P{sha256(repr(shape).encode()).hexdigest()[:6]}")
            text = dxf_text(cutting_order(region), {**found.properties, "PATTERN": pattern})
            path.write_text(text, newline="\n")
            self.doctor.set_manifest(_named(layer.index, pattern))

    def agree(self) -> None:
        """The manifest claims what lies on disk, so that only the geometry gives a fault away."""
        built = read_folder(self.doctor.folder)
        if built.laminate is not None:
            checked = Checked(built.design, built.laminate, ())
            planned = DesignPlan(checked, frozenset(), cut_settings(built.design, ()))
            told = manifest(planned, (), ())
            self.doctor.set_manifest(lambda claims: _retold(claims, told))
        self.doctor.rehash()


def _named(index: int, pattern: str) -> Callable[[dict[str, Any]], object]:
    return lambda claims: claims["layers"][index - 1].update(pattern=pattern)


def _retold(claims: dict[str, Any], told: dict[str, Any]) -> None:
    for key in ("sizes", "interfaces", "bores", "inlets"):
        claims[key] = told[key]
    for own, found in zip(claims["films"], told["films"], strict=True):
        own.update(found)
    claims["registration"]["pins"] = told["registration"]["pins"]
    for own, found in zip(claims["layers"], told["layers"], strict=True):
        own.update({key: found[key] for key in ("area", "pieces", "bores", "balloon")})


@contextmanager
def quick(parts: dict[str, CutPart]) -> Iterator[None]:
    """Files of equal bytes are parsed, and layers of equal shape laid on each other, once.

    ``parts`` remembers what was parsed. The rules of LEFT_OUT are not run, and none when a good
    folder is written; film sheets are not looked at.
    """

    def known(
        path: Path,
        chords_drawn: bool = False,
        told: Mapping[str, str] | None = None,
        expected: Expected | None = None,
    ) -> CutPart:
        shape = expected.profile.key if expected is not None else ""
        digest = sha256(path.read_bytes()).hexdigest() + shape
        if digest not in parts:
            parts[digest] = read_part(path, chords_drawn, told, expected)
        return parts[digest]

    def regions(below: Region, above: Region, masks: Sequence[Region]) -> tuple[Region, ...]:
        return _laid(below, above, *masks)

    rules = tuple(rule for rule in RULES if rule.name not in LEFT_OUT)
    with (
        patch.object(cut_files, "read_part", known),
        patch.object(laminate, "interface_regions", regions),
        patch.object(as_built, "RULES", rules),
        patch.object(as_built, "sheet_problems", lambda *_: []),
        patch.object(whole, "design_problems_of", lambda *_: []),
        patch.object(checked, "run_deck", lambda *_: ()),
    ):
        yield


@contextmanager
def unabridged() -> Iterator[None]:
    """Every rule is run, and all that lies in a folder is held against its design."""
    with (
        patch.object(as_built, "RULES", RULES),
        patch.object(whole, "design_problems_of", design_problems_of),
        patch.object(checked, "run_deck", run_deck),
    ):
        yield


@cache
def _laid(below: Region, above: Region, *masks: Region) -> tuple[Region, ...]:
    return interface_regions(below, above, masks)


def failing(folder: Path, layers: bool = True, sheets: bool = True) -> tuple[str, ...]:
    """The rules that fail in a folder, in the order they are reported.

    The deck is run with ``layers`` only, the film sheets are looked at with ``sheets`` only.
    """
    with (
        patch.object(as_built, "sheet_problems", sheet_problems if sheets else lambda *_: []),
        patch.object(as_built, "RULES", as_built.RULES if layers else ()),
    ):
        findings = check_folder(folder)
    return tuple(dict.fromkeys(f.rule for f in findings if f.verdict == "fail"))


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
