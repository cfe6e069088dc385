"""The program from Python: the commands' names, each a function.

>>> import sbafab
>>> laminate = sbafab.build("3dof-15mm", stack={"balloons": 6})
>>> run = sbafab.generate("3dof-15mm", out="out")

A design is given as a template's name, a TOML file, or a ``Design``. Keys are changed by texts,
``"stack.balloons=6"``, by dicts, ``{"stack.balloons": 6}``, or by keywords, ``stack={"balloons":
6}``. Bad input raises ``sbafab.errors.DesignError``, a folder that cannot be written
``OutputError``, each with one sentence.
"""

from __future__ import annotations

from sbafab.api.designs import (
    Source,
    assemble,
    build,
    check,
    check_folder,
    checking,
    dimensions,
    drawing,
    load,
    loads,
    resolved,
    schema,
    solid,
    template,
    templates,
)
from sbafab.api.making import cut, generate, kerf, mesh, nest, press, record, report, simulate
from sbafab.api.predicting import find, grip, motion, predict, predict_assembly, stack, sweep

__all__ = [
    "Source",
    "assemble",
    "build",
    "check",
    "check_folder",
    "checking",
    "cut",
    "dimensions",
    "drawing",
    "find",
    "generate",
    "grip",
    "kerf",
    "load",
    "loads",
    "mesh",
    "motion",
    "nest",
    "predict",
    "predict_assembly",
    "press",
    "record",
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
