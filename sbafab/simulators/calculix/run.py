"""CalculiX: the run of a deck, its results in one folder, and the interface of a simulator."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, cast

from sbafab.errors import DesignError, OutputError, VoidError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.element_mesh import volume_mesh
from sbafab.meshing.conforming.layup import MeshSettings, Symmetry, flat, images, layup
from sbafab.meshing.conforming.mesh import Mesh
from sbafab.process import Progress
from sbafab.simulators.calculix.deck import (
    JOB,
    DeckSettings,
    Procedure,
    deck_settings,
    started,
    write_deck,
)
from sbafab.simulators.calculix.results import (
    SAME_TIME,
    Frame,
    LoadedState,
    deformed_png,
    films_meet,
    history,
    history_csv,
    history_svg,
    read_frd,
    read_sta,
    write_deformed,
)
from sbafab.simulators.simulator import (
    Result,
    SimulationRequest,
    State,
    Stop,
    impossible,
    limits,
    program_path,
    run_program,
)

LOG = "ccx.log"
DIVERGED = Stop("diverged", "its iterations no longer converge, however small the step")


class Ending(NamedTuple):
    """End of a run: the last converged time in s, and the reason if it was stopped, else None."""

    time: float
    stopped: Stop | None


def find_ccx() -> str:
    """Path of the solver. Raises OutputError if it is not installed."""
    return program_path(
        "ccx",
        "install CalculiX; on Debian and Ubuntu: apt install calculix-ccx",
    )


def run_ccx(
    folder: Path,
    job: str,
    end: float,
    timeout: float,
    report: Callable[[float], None] | None = None,
) -> Ending:
    """Runs a deck in its folder to the time ``end``, for at most ``timeout`` seconds.

    The output of ccx goes to ``ccx.log`` there; ``report`` is called with the time reached, in s.
    """
    sta = folder / f"{job}.sta"

    def look() -> None:
        if report is not None:
            report(_reached(sta))

    code, stopped = run_program([find_ccx(), "-i", job], folder / LOG, timeout, look)
    reached = _reached(sta)
    if stopped is not None:
        return Ending(reached, stopped)
    is_there = reached >= end * (1 - SAME_TIME)
    return Ending(reached, _complaint(folder / LOG, code, is_there))


def _reached(sta: Path) -> float:
    return max(read_sta(sta), default=0.0)


def _complaint(log: Path, code: int, is_there: bool) -> Stop | None:
    """Return the failure, if any; ccx's exit code is not enough, since it may be 0 on failure.

    A diverging step that is retried with a smaller increment is not a failure.
    """
    text = log.read_text(encoding="utf-8", errors="replace")
    if is_there and code == 0 and "Job finished" in text:
        return None
    if re.search(r"diverge|increment size smaller than minimum", text):
        return DIVERGED
    error = re.search(r"\*ERROR[^:\n]*:?\s*(.+)", text)
    if error is not None:
        return Stop("failed", f"it reports: {error[1].strip().rstrip('.:')}")
    return Stop("failed", f"it ended with code {code} and without a word")


# A whole run in one folder: mesh, deck, ccx and results.


HISTORY = "history.csv"
KEPT = (".inp", ".frd", ".sta", ".dat")
DATED = re.compile(rb"(?m)^(    1U(?:DATE|TIME|HOST|USER|DIR)).*$")


def deck_mesh(laminate: Laminate, settings: MeshSettings) -> Mesh:
    """The flat volume mesh for a deck. Raises DesignError, OutputError as meshing does."""
    stack = layup(laminate, settings)
    return volume_mesh(stack, flat(stack))


def simulate(
    laminate: Laminate,
    mesh_settings: MeshSettings,
    settings: DeckSettings,
    folder: Path,
    timeout: float,
    progress: Progress,
) -> Result:
    """Inflates a laminate in CalculiX; ``folder`` receives deck, results, table and pictures.

    ``timeout`` is in seconds. A run that diverges or takes too long keeps its results so far.
    Raises OutputError if ccx is not installed or gives no results.
    """
    progress("mesh", 0, 1)
    mesh = deck_mesh(laminate, mesh_settings)
    find_ccx()
    _warn_of_hours(mesh, timeout)
    write_deck(mesh, settings, folder)
    top = settings.largest

    def report(reached: float) -> None:
        # Time does not show the load, which rises with its square, or the remaining duration:
        # steps get shorter when films wrinkle.
        progress(f"ccx, {top * settings.share(reached) + 0.0:.3g} of {top:g} kPa", 0, 1)

    report(0.0)
    ending = run_ccx(folder, JOB, settings.ramp, timeout, report)
    progress("results", 0, 1)
    run_mesh = started(mesh, settings)
    frames = converged_frames(folder / f"{JOB}.frd", run_mesh, ending)
    if not frames:
        stop = ending.stopped or Stop("failed", "it wrote no result")
        raise OutputError(
            f"ccx stopped at {_place(ending.time, settings)}, before the first result: "
            f"{stop.words}; {_advice(stop, settings)}"
        )
    states = history(run_mesh, laminate, mesh_settings.symmetry, settings, frames)
    wrong = _first_wrong(run_mesh, laminate, settings, frames, states)
    if wrong is not None:
        number, reason = wrong
        if number == 0:
            raise VoidError(
                f"the first result, at {_largest(states[1]):.3g} kPa, cannot be: {reason}; ask for "
                "less in one chamber, or for less vacuum"
            )
        frames, states = frames[:number], states[: number + 1]
    _write_results(run_mesh, laminate.name, mesh_settings.symmetry, states, frames[-1], folder)
    _tidy(folder)
    stopped = None
    if ending.stopped is not None:
        place, last = _place(ending.time, settings), _largest(states[-1])
        stopped = (
            f"ccx stopped at {place}: {ending.stopped.words}; results up to {last:.3g} kPa are "
            f"kept; {_advice(ending.stopped, settings)}"
        )
    if wrong is not None:
        stopped = (
            f"beyond {_largest(states[-1]):.3g} kPa the result cannot be: {wrong[1]}; results up "
            "to there are kept"
        )
    figures = {"stress": states[-1].stress, "work": states[-1].work}
    return Result("calculix", tuple(states), figures, stopped)


MEASURED_EQUATIONS, MEASURED_SECONDS, GROWTH = 147_513, 6.4, 1.5
"""Equations of a mesh, processor time in s of one iteration (CalculiX 2.20 with SPOOLES on one core
of a Xeon), and the exponent of the number of equations in that time: six meshes of 21,663 to
380,757 equations took 0.8 to 1.8 times the estimate from these three."""
LEAST_ITERATIONS = 100
"""Per run: a quarter of one balloon took 109, a quarter of fifteen 136; wrinkles take more."""
LONG = 3600.0
"""s"""


def _warn_of_hours(mesh: Mesh, timeout: float) -> None:
    """Warn before a run that cannot finish within an hour; ``timeout`` is in s."""
    equations = 3 * len(mesh.points)
    iteration = MEASURED_SECONDS * (equations / MEASURED_EQUATIONS) ** GROWTH
    least = LEAST_ITERATIONS * iteration
    if least > LONG:
        warnings.warn(
            f"ccx will not end in an hour: {len(mesh.cells):,} elements have some {equations:,} "
            f"equations, for which {LEAST_ITERATIONS} iterations of {iteration:.0f} s take "
            f"{least / 3600:.1f} hours, right within a factor of 2, and films that wrinkle take "
            f"several times as many. It is stopped after {timeout / 60:g} minutes. A larger --h, "
            "--symmetry and the other simulators take less",
            stacklevel=2,
        )


def _first_wrong(
    mesh: Mesh,
    laminate: Laminate,
    settings: DeckSettings,
    frames: Sequence[Frame],
    states: Sequence[LoadedState],
) -> tuple[int, str] | None:
    """Return the index of the first impossible frame, and the reason; decks have no contact."""
    can_be = limits(laminate, settings.pressures.values())
    drawn_in = [name for name, pressure in settings.pressures.items() if pressure < 0]
    for number, (frame, state) in enumerate(zip(frames, states[1:], strict=True)):
        if any(films_meet(mesh, name, frame) for name in drawn_in):
            return number, "the films meet, and the deck has no contact and no loose sheets"
        reason = impossible(state, replace(can_be, must_stand=False))
        if reason is not None:
            return number, reason
    return None


def converged_frames(frd: Path, mesh: Mesh, ending: Ending) -> list[Frame]:
    """The frames of a result file up to the last converged one.

    ccx adds an unconverged frame when it gives up. Raises OutputError if the file of a successful
    run is truncated.
    """
    if ending.stopped is not None and not frd.exists():
        return []
    frames = read_frd(frd, len(mesh.points), whole=ending.stopped is None)
    return [frame for frame in frames if frame.time <= ending.time * (1 + SAME_TIME)]


def _largest(state: State) -> float:
    """The pressure in kPa that is farthest from 0."""
    return max(state.pressures.values(), key=abs)


def _place(time: float, settings: DeckSettings) -> str:
    reached = settings.largest * settings.share(time)
    return f"{time:.4g} s, {reached:.3g} of {settings.largest:g} kPa"


def _advice(stop: Stop, settings: DeckSettings) -> str:
    if stop.kind == "interrupt":
        return "run it again for the rest"
    if stop.kind == "failed":
        return "see whether ccx runs on this machine; a larger --h takes less memory"
    if stop.kind == "time":
        return "give it more --minutes or a larger --h, or less to do with --symmetry"
    if settings.procedure == "static":
        return "take --procedure dynamic, which gets past wrinkles"
    return "ask for less pressure or a smaller --h"


def _write_results(
    mesh: Mesh,
    name: str,
    symmetry: Symmetry,
    states: Sequence[LoadedState],
    last: Frame,
    folder: Path,
) -> None:
    reached = states[-1]
    pressures = ", ".join(f"{c} {value:.3g} kPa" for c, value in reached.pressures.items())
    part = "" if symmetry == "full" else f", a {symmetry} of it"
    caption = f"{name}{part}: {pressures}, stroke {reached.stroke:.3f} mm, true to scale"
    (folder / HISTORY).write_text(history_csv(states), encoding="utf-8", newline="\n")
    plot = history_svg(f"{name}, CalculiX", states)
    (folder / "history.svg").write_text(plot, encoding="utf-8", newline="\n")
    (folder / "deformed.png").write_bytes(deformed_png(mesh, last, caption))
    write_deformed(mesh, last, folder / "deformed.vtu")


def _tidy(folder: Path) -> None:
    """Removes ccx's working files, and dates and names from its result file."""
    frd = folder / f"{JOB}.frd"
    frd.write_bytes(DATED.sub(rb"\1", frd.read_bytes()))
    of_ccx = [path for path in folder.glob(f"{JOB}.*") if path.suffix not in KEPT]
    for path in (*of_ccx, folder / "spooles.out", folder / LOG):
        path.unlink(missing_ok=True)


# The interface of a simulator.


USES = ("h", "symmetry", "procedure")


def why_not(laminate: Laminate) -> str | None:
    """Every laminate can be meshed."""
    return None


def export(laminate: Laminate, request: SimulationRequest, folder: Path) -> None:
    """Write the deck, and the mesh that it includes."""
    mesh, settings = _settings(laminate, request)
    write_deck(deck_mesh(laminate, mesh), settings, folder)


def run(laminate: Laminate, request: SimulationRequest, folder: Path, progress: Progress) -> Result:
    """Run the deck; the folder holds deck, results, table and pictures."""
    mesh, settings = _settings(laminate, request)
    return simulate(laminate, mesh, settings, folder, 60 * request.minutes, progress)


def _settings(laminate: Laminate, request: SimulationRequest) -> tuple[MeshSettings, DeckSettings]:
    defaults = MeshSettings()
    mesh = MeshSettings(
        h=defaults.h if request.h is None else request.h,
        symmetry=cast(Symmetry, request.symmetry or defaults.symmetry),
        wrapped=False,
    )
    settings = deck_settings(laminate, request, cast(Procedure, request.procedure or "dynamic"))
    if settings.has_vacuum:
        # Films that lie on each other leave no gap for drawing them together.
        mesh = replace(mesh, gaps=True)
    for name, meshed in images(laminate, mesh.symmetry).items():
        if settings.pressures[name] != settings.pressures[meshed]:
            raise DesignError(
                f"symmetry {mesh.symmetry} computes {meshed} in place of {name}: give both one "
                "pressure, or take symmetry full"
            )
    return mesh, settings
