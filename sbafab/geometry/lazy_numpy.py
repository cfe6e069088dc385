"""NumPy, imported at first use so that the help of commands starts fast."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
else:

    class _NumPy:
        def __getattr__(self, name: str) -> Any:
            self.__dict__.update(vars(import_module("numpy")))
            return getattr(import_module("numpy"), name)

    np = _NumPy()

__all__ = ["np"]
