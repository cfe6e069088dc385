"""Designs of tests: the one whose limits laminates are held against, and drawn layers by name."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from sbafab.actuators import build, load_design
from sbafab.design.files import design_path
from sbafab.laminate.laminate import Laminate
from sbafab.rules.deck import run_deck

PAPER = load_design("1dof-5mm", ["registration.pin_error=0.004"])
"""The paper's limits. The pins' error is stated, so that no rule speaks of the plate's machine."""
FEW = PAPER.with_("rules.yield_builds=100")
DRAWN = Path(__file__).parent / "drawn"


def errors(
    cutting: float = 0, pin: float = 0, placement: float = 0, turn: float = 0
) -> dict[str, float]:
    """Return keys of ``registration``: errors of cutting, pins and hand, mm and degrees."""
    return {
        "cutting_error": cutting,
        "pin_error": pin,
        "hand_placement": placement,
        "hand_turn": turn,
    }


def tables(name: str) -> dict[str, Any]:
    """The tables of a design of ``tests/drawn``, or of a template."""
    own = DRAWN / f"{name}.toml"
    return tomllib.loads((own if own.exists() else design_path(name)).read_text(encoding="utf-8"))


def put(data: Any, key: str, value: object) -> None:
    """Set a dotted key; numbers in it are places in lists."""
    *parts, last = key.split(".")
    for part in parts:
        data = data[int(part)] if part.isdigit() else data.setdefault(part, {})
    if isinstance(data, list):
        data[int(last) : int(last) + 1] = [value]
    else:
        data[last] = value


def drawn(folder: Path, data: dict[str, Any]) -> Laminate:
    """The laminate of a design's tables, by way of its file."""
    path = folder / "drawn.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    return build(load_design(path))


def failing(laminate: Laminate) -> set[str]:
    """The rules that a laminate fails."""
    return {finding.rule for finding in run_deck(laminate, FEW) if finding.verdict == "fail"}
