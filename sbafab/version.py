"""The version of the program, and the name by which written files identify their generator."""

from __future__ import annotations

__version__ = "0.1.0"
GENERATOR = f"sbafab {__version__}"
