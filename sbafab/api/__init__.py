"""The program from Python: a function for each command.

>>> import sbafab
>>> laminate = sbafab.build("3dof-15mm", stack={"balloons": 6})
>>> run = sbafab.generate("3dof-15mm", out="out")

A design is given as a template's name, a TOML file, or a ``Design``. Keys are changed by text,
``"stack.balloons=6"``, by dicts, ``{"stack.balloons": 6}``, or by keywords, ``stack={"balloons":
6}``. Bad input raises ``sbafab.DesignError``, a folder that cannot be written
``sbafab.errors.OutputError``, each with one sentence.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sbafab.api.checks import check, check_folder, checking, nets_of
    from sbafab.api.designs import (
        Source,
        assemble,
        build,
        drawing,
        load,
        loads,
        resolved,
        schema,
        solid,
        template,
        templates,
    )
    from sbafab.api.lab import kerf, record, record_history, record_sheet, report
    from sbafab.api.predictions import grip, motion, predict, predict_assembly, stack
    from sbafab.api.runs import cut, generate, import_design, mesh, nest, press, simulate
    from sbafab.api.search import compare, find, reach_yield, sweep
    from sbafab.design.laminate_file import read_laminate
    from sbafab.design.records import Design
    from sbafab.errors import DesignError
    from sbafab.laminate.laminate import Laminate
    from sbafab.models.stack import StackBatch
    from sbafab.reports.drawing import dimensions
    from sbafab.rules.finding import Findings

__all__ = [
    "Design",
    "DesignError",
    "Findings",
    "Laminate",
    "Source",
    "StackBatch",
    "assemble",
    "build",
    "check",
    "check_folder",
    "checking",
    "compare",
    "cut",
    "dimensions",
    "drawing",
    "find",
    "generate",
    "grip",
    "import_design",
    "kerf",
    "load",
    "loads",
    "mesh",
    "motion",
    "nest",
    "nets_of",
    "predict",
    "predict_assembly",
    "press",
    "reach_yield",
    "read_laminate",
    "record",
    "record_history",
    "record_sheet",
    "report",
    "resolved",
    "schema",
    "simulate",
    "solid",
    "stack",
    "sweep",
    "template",
    "templates",
]

MODULES = {
    "api.checks": ("check", "check_folder", "checking", "nets_of"),
    "api.lab": ("kerf", "record", "record_history", "record_sheet", "report"),
    "api.predictions": ("grip", "motion", "predict", "predict_assembly", "stack"),
    "api.runs": ("cut", "generate", "import_design", "mesh", "nest", "press", "simulate"),
    "api.search": ("compare", "find", "reach_yield", "sweep"),
    "design.laminate_file": ("read_laminate",),
    "models.stack": ("StackBatch",),
    "reports.drawing": ("dimensions",),
    "rules.finding": ("Findings",),
}
"""Functions and records by module; a module is loaded on first use. ``api.designs`` has the rest.

A script that builds laminates therefore loads no model, and a page that runs Python in a browser
may lack numpy.
"""


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    """Return a function or a record from its module."""
    if name not in __all__:
        raise AttributeError(f"module 'sbafab.api' has no attribute '{name}'")
    home = next((module for module, names in MODULES.items() if name in names), "api.designs")
    value = globals()[name] = getattr(import_module(f"sbafab.{home}"), name)
    return value
