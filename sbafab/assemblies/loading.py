"""A design or an assembly from a file, whichever it holds.

The records of assemblies are loaded for an assembly alone: most files hold a design.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sbafab.actuators import load_design
from sbafab.design.reading import ASSEMBLY, Change, design_path, override, read_toml
from sbafab.design.records import Design

if TYPE_CHECKING:
    from sbafab.assemblies.records import Assembly


def load(
    source: str | Path, changes: Iterable[Change] = (), waivers: Sequence[str] = ()
) -> Design | Assembly:
    """A design or an assembly, whichever the file holds. Raises DesignError."""
    changes = list(changes)
    path = design_path(source)
    data = override(read_toml(path), changes)
    if data.get("family") != ASSEMBLY:
        return load_design(source, changes, waivers)
    from sbafab.assemblies.reading import changed_assembly

    return changed_assembly(data, path, changes, waivers)
