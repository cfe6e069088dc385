"""Fabrication CAD for soft Stacked Balloon Actuators.

>>> import sbafab
>>> laminate = sbafab.build("3dof-15mm", stack={"balloons": 6})
>>> run = sbafab.generate("3dof-15mm", out="out")
"""

from __future__ import annotations

# The module of this name takes longer to load than what is below; a type checker knows it anyway.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from sbafab.api import (
        assemble,
        build,
        check,
        check_folder,
        checking,
        cut,
        dimensions,
        drawing,
        find,
        generate,
        grip,
        kerf,
        load,
        loads,
        mesh,
        motion,
        nest,
        predict,
        predict_assembly,
        press,
        record,
        report,
        resolved,
        schema,
        simulate,
        solid,
        stack,
        sweep,
        template,
        templates,
    )

__version__ = "0.1.0"
__all__ = [
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


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


def __getattr__(name: str) -> Any:
    # The functions are fetched when first asked for, so that `sbafab --help` loads no geometry.
    if name in __all__:
        from sbafab import api

        return getattr(api, name)
    raise AttributeError(f"module 'sbafab' has no attribute '{name}'")
