"""Runs the decks of the drawn templates in CalculiX, coarse and static, and keeps what came out:
docs/measured/drawn_decks.json and drawn_decks_furthest.json.

python -m docs.scripts.drawn_runs takes about ten minutes for all decks at a low pressure, and
python -m docs.scripts.drawn_runs furthest up to 40 for how far they go on the way to a working
pressure; names of templates after these run those alone. It needs ccx and the extra "mesh".
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import NamedTuple

import sbafab
from docs.scripts.measured import FOLDER, Record, keep, record
from docs.scripts.tables import Table
from sbafab.errors import OutputError
from sbafab.meshing.conforming.layup import MeshSettings, Symmetry
from sbafab.simulators.calculix.deck import deck_settings
from sbafab.simulators.calculix.run import DIVERGED, History, simulate
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
"""Static, so low that films hardly wrinkle, and quick."""

WORKING: Mapping[str, float] = {
    "array": 230.0,
    "diode": 10.0,
    "finger": 10.0,
    "folded": 10.0,
    "gripper": 10.0,
    "pouch": 1.0,
    "truss": 10.0,
}
"""kPa to which a design may be taken: the source's of the array, else ours. The vacuum's films meet
before that.
"""
RISE = 16
"""Results on the way there; pressures rise with the square of time."""
MINUTES = 5.0
"""By the clock, after which a run on the way to its working pressure is stopped."""
FURTHEST = "furthest"
REACHED = (
    "template",
    "asked, kPa",
    "reached, kPa",
    "thicker by, mm",
    "air, ul",
    "stress, MPa",
    "end",
)


def run_deck(name: str, folder: Path) -> History:
    """Return the history of a template's deck; its files stay in ``folder``."""
    case = DECKS[name]
    return _run(name, case.pressure, case.outputs, folder, HOUR)


def run_furthest(name: str, folder: Path) -> History | None:
    """Return the history on the way to a working pressure, as far as ``MINUTES`` take it; None
    without a result.
    """
    try:
        return _run(name, WORKING[name], RISE, folder, 60 * MINUTES)
    except OutputError as error:
        print(error, flush=True)
        return None


def _run(name: str, pressure: float, outputs: int, folder: Path, seconds: float) -> History:
    case = DECKS[name]
    laminate = sbafab.build(name)
    mesh = MeshSettings(h=case.h, symmetry=case.symmetry, gaps=pressure < 0)
    settings = deck_settings(laminate, SimulationRequest(pressure), "static")
    settings = replace(settings, outputs=outputs)
    return simulate(laminate, mesh, settings, folder, seconds, lambda *_: None)


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


def furthest_row(name: str, history: History | None) -> list[str]:
    """Return the row of a run to a working pressure: the last result, and what ended it; None of a
    run that had no result.
    """
    if history is None:
        first = WORKING[name] / RISE**2
        return [name, f"{WORKING[name]:g}", f"less than {first:.2g}", "", "", "", "no result"]
    _, reached, _, _, *figures = row_of(name, history)
    ended = "reached"
    if history.stopped is not None:
        ended = "no convergence" if DIVERGED in history.stopped else f"{MINUTES:g} minutes"
    return [name, f"{WORKING[name]:g}", reached, *figures, ended]


def main(names: Sequence[str]) -> None:
    """Run the named decks, or all; rows of others stay as they were measured."""
    is_furthest = FURTHEST in names
    chosen = [name for name in names if name != FURTHEST]
    if is_furthest:
        _keep_rows(f"{NAME}_{FURTHEST}", f"{COMMAND} {FURTHEST}", REACHED, WORKING, chosen)
    else:
        _keep_rows(NAME, COMMAND, COLUMNS, DECKS, chosen)


def _keep_rows(
    name: str, command: str, columns: Sequence[str], cases: Iterable[str], chosen: Sequence[str]
) -> None:
    rows = {}
    if (FOLDER / f"{name}.json").is_file():
        rows = {row[0]: list(row) for row in record(name).tables["decks"].rows}
    for template in chosen or cases:
        with tempfile.TemporaryDirectory() as place:
            if name == NAME:
                rows[template] = row_of(template, run_deck(template, Path(place)))
            else:
                rows[template] = furthest_row(template, run_furthest(template, Path(place)))
            print(*rows[template], flush=True)
        table = Table(columns, [rows[key] for key in cases if key in rows])
        keep(
            name, Record(command, date.today().isoformat(), {"CalculiX": "2.20"}, {"decks": table})
        )


if __name__ == "__main__":
    main(sys.argv[1:])
