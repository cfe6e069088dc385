"""The program from Python: the commands' names, a line each.

>>> import sbafab
>>> laminate = sbafab.build("3dof-15mm", "stack.balloons=6")
>>> run = sbafab.generate("3dof-15mm", out="out")
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab import actuators
from sbafab.design.reading import template_names
from sbafab.design.records import Design

if TYPE_CHECKING:
    from sbafab.laminate.laminate import Laminate
    from sbafab.output.run import Run
    from sbafab.rules.finding import Finding

Source = Design | str | Path


def templates() -> list[str]:
    """Names of the designs that ship."""
    return template_names()


def load(source: Source, *assignments: str) -> Design:
    """A design from a template's name or a TOML file, with ``"key=value"`` texts applied."""
    if isinstance(source, Design):
        if assignments:
            raise TypeError("assignments go with a name or a file, not with a loaded design")
        return source
    return actuators.load_design(source, assignments)


def build(source: Source, *assignments: str) -> Laminate:
    """The laminate of a design; in a notebook it shows itself as a picture."""
    return actuators.build(load(source, *assignments))


def check(source: Source, *assignments: str) -> tuple[Finding, ...]:
    """What the rule deck finds in a design."""
    from sbafab.output.run import check as run_check

    return run_check(load(source, *assignments))[1]


def generate(source: Source, *assignments: str, out: str | Path = "out") -> Run:
    """Writes everything into ``out/<name>/``; the run tells whether a rule failed."""
    from sbafab.output.run import generate as run_generate

    return run_generate(load(source, *assignments), Path(out))


def schema() -> dict[str, Any]:
    """JSON schema of a design file."""
    return actuators.schema()
