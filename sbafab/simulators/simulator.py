"""What any simulator is asked for and gives back, and where to find it."""

from __future__ import annotations

import math
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol, cast

from sbafab.errors import DesignError, OutputError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.surface import Vector
from sbafab.process import Progress

Name = Literal["calculix", "sofa", "mujoco"]
NAMES: tuple[Name, ...] = ("calculix", "sofa", "mujoco")
LONGEST = 1e5
"""s of simulated time."""
MOST_PRESSURE = 1000.0
"""kPa: nearly three times what bursts the paper's actuators."""


@dataclass(frozen=True)
class Wish:
    """What a simulator is asked for; None where its own default will do.

    ``pressure`` in kPa for every chamber that ``chambers`` does not name; ``minutes`` is the most
    real time a run may take. Which of the rest counts is said by each simulator's ``USES``:
    ``h`` in mm, ``seconds`` of simulated time, ``volumes`` in ul above the start by chamber.
    """

    pressure: float | None = None
    chambers: Mapping[str, float] = field(default_factory=dict)
    minutes: float = 120.0
    h: float | None = None
    symmetry: str | None = None
    procedure: str | None = None
    scene: str | None = None
    seconds: float | None = None
    volumes: Mapping[str, float] = field(default_factory=dict)

    @property
    def given(self) -> list[str]:
        """Names of the fields that not every simulator knows and that were said."""
        names = ("h", "symmetry", "procedure", "scene", "seconds", "volumes")
        return [name for name in names if getattr(self, name) not in (None, {})]


@dataclass(frozen=True)
class Result:
    """What a run found: ``rows`` to print of label, value and unit; ``figures`` holds all of it.

    ``stopped`` is one sentence if it ended early; what it found until then holds.
    """

    rows: tuple[tuple[str, float, str], ...]
    figures: Mapping[str, Any]
    stopped: str | None = None


class Simulator(Protocol):
    """The module ``simulator`` of a simulator's folder."""

    USES: tuple[str, ...]

    def why_not(self, laminate: Laminate) -> str | None:
        """The reason why there can be no input for a laminate, None if there can."""

    def export(self, laminate: Laminate, wish: Wish, folder: Path) -> None:
        """Writes what the simulator reads, with all that it loads."""

    def run(self, laminate: Laminate, wish: Wish, folder: Path, tell: Progress) -> Result:
        """Writes it, runs it, and reads back what it found."""


def simulator(name: Name) -> Simulator:
    """The simulator of that name; what it imports is loaded only now."""
    return cast(Simulator, import_module(f"sbafab.simulators.{name}.simulator"))


def users(field_name: str) -> list[str]:
    """The simulators that use a field of a wish."""
    return [name for name in NAMES if field_name in simulator(name).USES]


def chamber_pressures(
    names: Sequence[str], wish: Wish, usual: float, most: float = MOST_PRESSURE
) -> dict[str, float]:
    """Pressure in kPa of every chamber: those named, and ``wish.pressure`` in the others.

    With nothing said it is the ``usual`` one in all of them; with single ones only, 0 in the
    others. Raises DesignError for a chamber that is not there and a pressure out of range.
    """
    refuse_unknown(names, wish.chambers, "pressure")
    in_all = (0.0 if wish.chambers else usual) if wish.pressure is None else wish.pressure
    found = {name: wish.chambers.get(name, in_all) for name in names}
    for name, value in found.items():
        if not (math.isfinite(value) and 0 <= value <= most):
            raise DesignError(f"pressure of {name} = {value:g} kPa must be from 0 to {most:g} kPa")
    if not any(found.values()):
        raise DesignError("pressure is 0 kPa in every chamber; give one of them more")
    return found


def refuse_time(seconds: float, least: float) -> None:
    """Raises DesignError for a simulated time out of range."""
    if not least <= seconds <= LONGEST:
        raise DesignError(
            f"simulated time = {seconds:g} s must lie between {least:g} and {LONGEST:g} s"
        )


def refuse_unknown(names: Sequence[str], given: Mapping[str, float], what: str) -> None:
    """Raises DesignError for a chamber that is not there."""
    unknown = next((name for name in given if name not in names), None)
    if unknown is not None:
        raise DesignError(
            f"{what} names chamber {unknown}, which is not there; "
            f"the chambers are {', '.join(names)}"
        )


# Starting a program, watching it, and stopping it when it takes too long or is interrupted.


LOOK_EVERY = 0.1
"""s between two looks at how far a run is."""
STOP_WITHIN = 10.0
"""s that a program has to end by itself before it is killed."""
INTERRUPTED = "it was interrupted"
OUT_OF_TIME = "it was stopped after"


class Ended(NamedTuple):
    """How a program ended: its exit code, and why it was stopped, None if it ended by itself."""

    code: int
    stopped: str | None


def program_path(name: str, install: str) -> str:
    """Path of an installed program. Raises OutputError that says how to ``install`` it."""
    found = shutil.which(name)
    if found is None:
        raise OutputError(f"{name} was not found; {install}")
    return found


def run_program(
    command: Sequence[str],
    log: Path,
    limit: float | None,
    look: Callable[[], None],
) -> Ended:
    """Runs a command in the folder of its ``log``, which takes what it prints.

    ``look`` is called while it runs; after ``limit`` seconds it is stopped. Ctrl-C and SIGTERM
    stop the run, not the program that started it, so that what was reached can be kept. One
    thread, unless OMP_NUM_THREADS says otherwise. Raises OutputError where it cannot be started.
    """
    began = time.monotonic()
    stopped: str | None = None
    with log.open("wb") as opened:
        try:
            # In a session of its own: the command may be a script that starts the real program.
            process = subprocess.Popen(
                command,
                cwd=log.parent,
                stdin=subprocess.DEVNULL,
                stdout=opened,
                stderr=subprocess.STDOUT,
                env={"OMP_NUM_THREADS": "1", **os.environ},
                start_new_session=True,
            )
        except OSError as reason:
            raise OutputError(
                f"{command[0]} could not be started ({reason.strerror}); see whether it is a "
                "program that runs on this machine"
            ) from reason
        try:
            while stopped is None:
                try:
                    process.wait(LOOK_EVERY)
                    break
                except subprocess.TimeoutExpired:
                    look()
                if limit is not None and time.monotonic() - began >= limit:
                    stopped = f"{OUT_OF_TIME} {limit / 60:g} minutes"
        except KeyboardInterrupt:
            # Hours of computing are not thrown away with the rest of them.
            stopped = INTERRUPTED
        finally:
            _end(process)
    return Ended(process.returncode, stopped)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ends the program and what it started."""
    for number in (signal.SIGTERM, getattr(signal, "SIGKILL", signal.SIGTERM)):
        if process.poll() is not None:
            return
        if hasattr(os, "killpg"):
            os.killpg(process.pid, number)
        else:
            process.terminate()
        try:
            process.wait(STOP_WITHIN)
        except subprocess.TimeoutExpired:
            continue


# Where the tip is and how it leans, from the nodes that mark it.


@dataclass(frozen=True)
class Tip:
    """The tip at a time in s: its place in mm, and how far it leans off the axis in degrees."""

    time: float
    place: Vector
    tilt: float


def tip_at(time: float, points: Sequence[Vector]) -> Tip:
    """The mean of points that go round it, and the lean of their polygon's normal."""
    x, y, z = (sum(values) / len(points) for values in zip(*points, strict=True))
    nx = ny = nz = 0.0
    for (ax, ay, az), (bx, by, bz) in zip(points, [*points[1:], points[0]], strict=True):
        nx += ay * bz - az * by
        ny += az * bx - ax * bz
        nz += ax * by - ay * bx
    return Tip(time, (x, y, z), math.degrees(math.atan2(math.hypot(nx, ny), nz)))
