"""Runs the decks of the drawn templates in CalculiX, coarse, and keeps what came out:
docs/measured/drawn_decks.json (static) and drawn_decks_furthest.json (with inertia).

python -m docs.scripts.drawn_runs takes about ten minutes for all decks at a low pressure, and
python -m docs.scripts.drawn_runs furthest up to 20 of processor time for how far they go on the way
to a working pressure; names of templates after these run those alone. It needs ccx and the extra
"mesh", and Linux to tell processor time.
"""

from __future__ import annotations

import math
import os
import re
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import NamedTuple

import numpy as np

import sbafab
from docs.scripts.measured import FOLDER, Record, keep, record
from docs.scripts.tables import Table
from sbafab.errors import OutputError
from sbafab.meshing.conforming.layup import MeshSettings, Symmetry
from sbafab.runtime import Progress
from sbafab.simulators.calculix import (
    DIVERGED,
    JOB,
    RING,
    SAME_TIME,
    DeckSettings,
    Procedure,
    deck_mesh,
    deck_settings,
    read_frd,
    simulate,
)
from sbafab.simulators.simulator import Result, SimulationRequest

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


class Working(NamedTuple):
    """Pressure in kPa to which a design may be taken, the seconds in which it rises to it, None
    where no inertia is needed, how often results are written, and the minutes of processor time
    after which a run is stopped.

    Inertia carries films from one pattern of wrinkles to the next, the more the quicker the rise;
    the table says what part of the energy is kinetic.
    """

    pressure: float
    ramp: float | None
    outputs: int = 16
    minutes: float = 2.5


WORKING: Mapping[str, Working] = {
    "array": Working(230.0, 0.01),
    "diode": Working(10.0, 0.005, minutes=5),
    "finger": Working(10.0, None),
    "folded": Working(10.0, 0.02),
    "gripper": Working(10.0, None, 4),
    "pouch": Working(1.0, 0.02),
    "truss": Working(10.0, None),
}
"""The source's pressure of the array, else ours. The vacuum's films meet before that."""
SLOW: Mapping[str, str] = {
    "diode": "the film between its channel and pocket has air on both sides",
    "folded": "its pocket wrinkles along seams and fold",
    "gripper": "its 27,000 nodes take 10 s an iteration",
    "truss": "its lower beam's edge wrinkles beside the inlet",
}
"""Why a run takes so long: where ccx's largest residuals lie."""
FLYING = 10.0
"""Percent of kinetic energy, from which on inertia bears more than a small part of the pressure."""
FURTHEST = "furthest"
ENERGY = re.compile(r"total (internal|kinetic) energy .* time +(\S+)\s+(\S+)")
REACHED = (
    "template",
    "asked, kPa",
    "reached, kPa",
    "thicker by, mm",
    "air, ul",
    "stress, MPa",
    "kinetic energy, %",
    "end",
)


def run_deck(name: str, folder: Path) -> Result:
    """Return the history of a template's deck; its files stay in ``folder``."""
    case = DECKS[name]
    settings = _settings(name, case.pressure, "static", outputs=case.outputs)
    return _run(name, settings, folder, lambda *_: None)


def run_furthest(name: str, folder: Path) -> Result | None:
    """Return the history on the way to a working pressure, as far as its time goes; None without
    a result.
    """
    pressure, ramp, outputs, minutes = WORKING[name]
    procedure: Procedure = "static" if ramp is None else "dynamic"
    settings = _settings(name, pressure, procedure, outputs=outputs, ramp=ramp or 1.0)
    try:
        return _run(name, settings, folder, stop_after(60 * minutes))
    except OutputError as error:
        print(error, flush=True)
        return None


def _settings(
    name: str, pressure: float, procedure: Procedure, outputs: int, ramp: float = 1.0
) -> DeckSettings:
    settings = deck_settings(sbafab.build(name), SimulationRequest(pressure), procedure)
    return replace(settings, outputs=outputs, ramp=ramp)


def _run(name: str, settings: DeckSettings, folder: Path, progress: Progress) -> Result:
    case = DECKS[name]
    mesh = MeshSettings(h=case.h, symmetry=case.symmetry, gaps=settings.has_vacuum)
    return simulate(sbafab.build(name), mesh, settings, folder, HOUR, progress)


def stop_after(seconds: float) -> Progress:
    """Return a progress that interrupts a run after so much processor time (Linux)."""

    def look(what: str, done: int, total: int) -> None:
        ticks = 0
        for children in Path("/proc/self/task").glob("*/children"):
            for process in children.read_text(encoding="ascii").split():
                stat = Path(f"/proc/{process}/stat").read_text(encoding="utf-8")
                ticks += sum(map(int, stat.rpartition(")")[2].split()[11:13]))
        if ticks > seconds * os.sysconf("SC_CLK_TCK"):
            raise KeyboardInterrupt

    return look


def kinetic_shares(name: str, history: Result, folder: Path) -> dict[int, float]:
    """Return the part of kinetic energy in that of each state, in percent, 0 of a static run; one
    that was stopped may not have written its last.
    """
    if WORKING[name].ramp is None:
        return dict.fromkeys(range(1, len(history.states)), 0.0)
    text = (folder / f"{JOB}.dat").read_text(encoding="ascii")
    energies = [(kind, float(at), float(value)) for kind, at, value in ENERGY.findall(text)]
    shares = {}
    for number, state in enumerate(history.states):
        of_state = {
            kind: value
            for kind, at, value in energies
            if math.isclose(at, state.time, rel_tol=SAME_TIME)
        }
        if len(of_state) == 2:
            shares[number] = 100 * of_state["kinetic"] / sum(of_state.values())
    return shares


def row_of(name: str, history: Result) -> list[str]:
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


def furthest_row(name: str, history: Result | None, folder: Path) -> list[str]:
    """Return the row of a run to a working pressure: the last result, and what ended it and why.

    Results in which films still fly are none.
    """
    pressure, _, _, minutes = WORKING[name]
    shares = {} if history is None else kinetic_shares(name, history, folder)
    settled = [number for number, share in shares.items() if share < FLYING]
    if history is None or not settled:
        flying = f"no result after {minutes:g} minutes: films still fly"
        flying += f", as {SLOW[name]}" if name in SLOW else ""
        return [name, f"{pressure:g}", "", "", "", "", "", flying]
    last = settled[-1]
    _, reached, _, _, *figures = row_of(
        name, history.model_copy(update={"states": history.states[: last + 1]})
    )
    ended = "reached"
    if history.stopped is not None:
        ended = "no convergence" if DIVERGED in history.stopped else f"{minutes:g} minutes"
        ended += f": {SLOW[name]}" if name in SLOW else ""
    return [name, f"{pressure:g}", reached, *figures, f"{shares[last]:.2g}", ended]


def array_rises(history: Result, folder: Path) -> Table:
    """Return the array's rise on the way, and how far its bonds then lie off a plane."""
    case = DECKS["array"]
    mesh = deck_mesh(sbafab.build("array"), MeshSettings(h=case.h, symmetry=case.symmetry))
    bond = mesh.node_sets[RING]
    plane = np.column_stack([np.ones(len(bond)), mesh.points[bond, :2]])
    frames = read_frd(folder / f"{JOB}.frd", len(mesh.points), whole=history.stopped is None)
    rows = []
    for state, frame in zip(history.states[1:], frames, strict=False):
        moved = frame.displacement[bond, 2]
        off = moved - plane @ np.linalg.lstsq(plane, moved, rcond=None)[0]
        kilopascals = max(state.pressures.values())
        rows.append([f"{kilopascals:.4g}", f"{state.stroke:.3f}", f"{np.ptp(off):.3f}"])
    return Table(("kPa", "thicker by, mm", "bonds off a plane, mm"), rows)


def main(names: Sequence[str]) -> None:
    """Run the named decks, or all; rows of others stay as they were measured."""
    chosen = [name for name in names if name != FURTHEST]
    if FURTHEST in names:
        for name in chosen or WORKING:
            _keep(f"{NAME}_{FURTHEST}", f"{COMMAND} {FURTHEST}", REACHED, furthest_tables, name)
    else:
        for name in chosen or DECKS:
            _keep(NAME, COMMAND, COLUMNS, low_tables, name)


def low_tables(name: str, folder: Path) -> tuple[list[str], dict[str, Table]]:
    """Return the row of a template at its low pressure."""
    return row_of(name, run_deck(name, folder)), {}


def furthest_tables(name: str, folder: Path) -> tuple[list[str], dict[str, Table]]:
    """Return the row of a template towards its working pressure, and further tables."""
    history = run_furthest(name, folder)
    further = {}
    if name == "array" and history is not None:
        further["array"] = array_rises(history, folder)
    return furthest_row(name, history, folder), further


def _keep(
    name: str,
    command: str,
    columns: Sequence[str],
    run: Callable[[str, Path], tuple[list[str], dict[str, Table]]],
    template: str,
) -> None:
    """Run a template's deck, and put its row into a record."""
    tables: dict[str, Table] = {}
    if (FOLDER / f"{name}.json").is_file():
        tables |= record(name).tables
    with tempfile.TemporaryDirectory() as place:
        row, further = run(template, Path(place))
    print(*row, flush=True)
    rows = {old[0]: list(old) for old in tables["decks"].rows} if "decks" in tables else {}
    rows[template] = row
    tables |= {"decks": Table(columns, [rows[key] for key in DECKS if key in rows]), **further}
    keep(name, Record(command, date.today().isoformat(), {"CalculiX": "2.20"}, tables))


if __name__ == "__main__":
    main(sys.argv[1:])
