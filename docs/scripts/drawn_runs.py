"""Runs the decks of the drawn templates in CalculiX, coarse and at a low pressure, and keeps what came
out: docs/measured/drawn_decks.json.

python -m docs.scripts.drawn_runs takes about ten minutes; it needs ccx and the extra "mesh".
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import NamedTuple

import sbafab
from docs.scripts.measured import FOLDER, Record, keep, record
from docs.scripts.tables import Table
from sbafab.meshing.conforming.layup import MeshSettings, Symmetry
from sbafab.simulators.calculix.deck import deck_settings
from sbafab.simulators.calculix.run import History, simulate
from sbafab.simulators.simulator import SimulationRequest

COMMAND = "python -m docs.scripts.drawn_runs"
NAME = "drawn_decks"
HOUR = 3600.0
COLUMNS = ("template", "kPa", "part", "side, mm", "thicker by, mm", "air, ul", "stress, MPa")


class DeckCase(NamedTuple):
    """Pressure in kPa of every chamber, what is meshed, the triangles' side in mm, and how often
    results are written.
    """

    pressure: float
    symmetry: Symmetry
    h: float
    outputs: int = 1


DECKS: Mapping[str, DeckCase] = {
    "array": DeckCase(2.0, "half", 2.0),
    "diode": DeckCase(0.001, "half", 3.0),
    "finger": DeckCase(1.0, "half", 3.0),
    "folded": DeckCase(0.01, "half", 2.0),
    "gripper": DeckCase(1.0, "full", 3.0),
    "pouch": DeckCase(0.0002, "half", 1.0),
    "truss": DeckCase(0.1, "half", 3.0),
    # Sheets are not meshed: the films meet at this vacuum, which is next to none.
    "vacuum": DeckCase(-0.0001, "half", 4.0, 8),
}
"""Static, so low that films hardly wrinkle; dynamic runs at working pressures take hours."""


def run_deck(name: str, folder: Path) -> History:
    """Return the history of a template's deck; its files stay in ``folder``."""
    case = DECKS[name]
    laminate = sbafab.build(name)
    mesh = MeshSettings(h=case.h, symmetry=case.symmetry, gaps=case.pressure < 0)
    settings = deck_settings(laminate, SimulationRequest(case.pressure), "static")
    settings = replace(settings, outputs=case.outputs)
    return simulate(laminate, mesh, settings, folder, HOUR, lambda *_: None)


def row_of(name: str, history: History) -> list[str]:
    """Return the table's row of a run, from its last state."""
    case, last = DECKS[name], history.states[-1]
    kilopascals = max(last.pressures.values(), key=abs)
    air = sum(last.volumes.values())
    return [
        name,
        f"{kilopascals:.3g}",
        case.symmetry,
        f"{case.h:g}",
        f"{last.stroke:.3f}",
        f"{air:.4g}",
        f"{last.stress:.3g}",
    ]


def main(names: Sequence[str]) -> None:
    """Run the named decks, or all; rows of others stay as they were measured."""
    rows = {}
    if (FOLDER / f"{NAME}.json").is_file():
        rows = {row[0]: list(row) for row in record(NAME).tables["decks"].rows}
    for name in names or DECKS:
        with tempfile.TemporaryDirectory() as place:
            rows[name] = row_of(name, run_deck(name, Path(place)))
            print(*rows[name], flush=True)
        table = Table(COLUMNS, [rows[key] for key in DECKS if key in rows])
        keep(
            NAME, Record(COMMAND, date.today().isoformat(), {"CalculiX": "2.20"}, {"decks": table})
        )


if __name__ == "__main__":
    main(sys.argv[1:])
