"""Fabrication CAD for soft Stacked Balloon Actuators.

>>> import sbafab
>>> laminate = sbafab.build("3dof-15mm", stack={"balloons": 6})
>>> run = sbafab.generate("3dof-15mm", out="out")
"""

from __future__ import annotations

from sbafab.version import __version__ as __version__

# The module of this name takes longer to load than what is below; a type checker knows it anyway.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from sbafab.api import *  # noqa: F403


def __dir__() -> list[str]:
    return [*__getattr__("__all__"), "__version__"]


def __getattr__(name: str) -> Any:
    """Return the attribute of ``sbafab.api`` with this name, loaded on demand.

    A statement would load the geometry for ``sbafab --help``, and form a circle of imports.
    """
    if name == "__all__" or not name.startswith("_"):
        from importlib import import_module

        api = import_module("sbafab.api")
        if name == "__all__" or name in api.__all__:
            return getattr(api, name)
    raise AttributeError(f"module 'sbafab' has no attribute '{name}'")
