"""What simulators read, for all of them that can take a design."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from sbafab.errors import DesignError, OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.simulators.simulator import NAMES, Wish, simulator


def write_decks(laminate: Laminate, folder: Path) -> Iterable[tuple[str, str]]:
    """Writes a folder for each simulator; the names of those without one, and the reasons."""
    for name in NAMES:
        why = simulator(name).why_not(laminate)
        if why is None:
            try:
                simulator(name).export(laminate, Wish(), folder / name)
            except (DesignError, OutputError) as error:
                # The meshes of CalculiX take an extra, which may be missing.
                why = str(error)
        if why is not None:
            yield name, why
