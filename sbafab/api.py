"""The program from Python: the commands' names, a line each.

>>> import sbafab
>>> laminate = sbafab.build("3dof-15mm", "stack.balloons=6")
>>> run = sbafab.generate("3dof-15mm", out="out")
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab import actuators
from sbafab.design.reading import template_names
from sbafab.design.records import Design

if TYPE_CHECKING:
    from sbafab.assemblies.build import Assembled
    from sbafab.assemblies.records import Assembly
    from sbafab.laminate.laminate import Laminate
    from sbafab.models.figures import Prediction
    from sbafab.output.assembly import AssemblyRun
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


def assemble(source: str | Path, *assignments: str) -> Assembled:
    """An assembly from a template's name or a TOML file: its parts with designs and places."""
    from sbafab.assemblies.build import assemble as put_together
    from sbafab.assemblies.reading import load_assembly

    return put_together(load_assembly(source, assignments))


def check(source: Source, *assignments: str) -> tuple[Finding, ...]:
    """What the rule deck finds in a design; of an assembly, also what is found between parts."""
    from sbafab.assemblies.records import Assembly
    from sbafab.output.assembly import check_assembly
    from sbafab.output.run import check as run_check

    found = _loaded(source, assignments)
    if isinstance(found, Assembly):
        return check_assembly(found).findings
    return run_check(found)[1]


def generate(source: Source, *assignments: str, out: str | Path = "out") -> Run | AssemblyRun:
    """Writes everything into ``out/<name>/``; the run tells whether a rule failed."""
    from sbafab.assemblies.records import Assembly
    from sbafab.output.assembly import generate_assembly
    from sbafab.output.run import generate as run_generate

    found = _loaded(source, assignments)
    if isinstance(found, Assembly):
        return generate_assembly(found, Path(out))
    return run_generate(found, Path(out))


def _loaded(source: Source, assignments: Sequence[str]) -> Design | Assembly:
    from sbafab.assemblies.reading import load as load_either

    if isinstance(source, Design):
        return load(source, *assignments)
    return load_either(source, assignments)


def predict(
    source: Source,
    *assignments: str,
    pressures_kpa: Sequence[float] = (10.0, 100.0),
    flow_ml_min: float = 35.0,
    volumes_ul: Sequence[float] = (),
    press_factor: float = 1.0,
    contact_factor: float = 1.0,
) -> Prediction:
    """What a design will do, by closed formulas; each figure names its model and its trust.

    Raises DesignError for what is out of every model's range.
    """
    from sbafab.models.figures import Asked, Calibration
    from sbafab.models.prediction import predict as model_predict

    factors = Calibration(press_factor, contact_factor)
    asked = Asked(tuple(pressures_kpa), flow_ml_min, tuple(volumes_ul), factors)
    return model_predict(load(source, *assignments), asked)


def schema() -> dict[str, Any]:
    """JSON schema of a design or assembly file."""
    from sbafab.assemblies.records import Assembly

    return actuators.schema(Assembly)
