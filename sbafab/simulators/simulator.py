"""The interface of a simulator, its requests and results, and the processes that run it."""

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
from numbers import Real
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
LARGEST_VACUUM = 101.325
"""kPa below the air outside, which no vacuum exceeds."""


CHOICES = {
    "symmetry": ("full", "half", "quarter", "sector"),
    "procedure": ("dynamic", "static"),
    "scene": ("shell", "frames", "volume", "beam"),
}
"""What a setting of a request may be, by its name."""


@dataclass(frozen=True)
class SimulationRequest:
    """Settings of a simulation; None where the simulator's default will do.

    ``pressure`` in kPa for every chamber that ``chambers`` does not name; ``minutes`` is the most
    real time a run may take. Each simulator's ``USES`` names the others that it reads:
    ``h`` in mm, ``seconds`` of simulated time, ``volumes`` in ul above the start by chamber;
    ``CHOICES`` tells the words of the rest. Raises DesignError for another word, and for what is
    no number.
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

    def __post_init__(self) -> None:
        for name, words in CHOICES.items():
            word = getattr(self, name)
            if word not in (None, *words):
                raise DesignError(f'{name} = "{word}" must be one of {", ".join(words)}')
        numbers = {name: getattr(self, name) for name in ("pressure", "h", "seconds", "minutes")}
        numbers |= {f"pressure of {name}": value for name, value in self.chambers.items()}
        numbers |= {f"volume in {name}": value for name, value in self.volumes.items()}
        for name, number in numbers.items():
            if number is not None and not isinstance(number, Real):
                raise DesignError(f"{name} = {number!r} must be a number")
        if not 0 < self.minutes < math.inf:
            raise DesignError(f"minutes = {self.minutes:g} must be a finite number above 0")

    @property
    def specific_fields(self) -> list[str]:
        """Names of the set fields that not every simulator reads."""
        names = ("h", "symmetry", "procedure", "scene", "seconds", "volumes")
        return [name for name in names if getattr(self, name) not in (None, {})]


@dataclass(frozen=True)
class Result:
    """Result of a run: ``rows`` to print of label, value and unit; ``figures`` holds all of it.

    ``stopped`` is one sentence if it ended early; the results until then are valid.
    """

    rows: tuple[tuple[str, float, str], ...]
    figures: Mapping[str, Any]
    stopped: str | None = None


class Simulator(Protocol):
    """The module ``run`` of a simulator's folder."""

    USES: tuple[str, ...]

    def why_not(self, laminate: Laminate) -> str | None:
        """Return the reason why there can be no input for a laminate, or None."""

    def export(self, laminate: Laminate, request: SimulationRequest, folder: Path) -> None:
        """Write the simulator's input, with all that it loads."""

    def run(
        self, laminate: Laminate, request: SimulationRequest, folder: Path, progress: Progress
    ) -> Result:
        """Write the input, run it, and read the results back."""


def simulator(name: Name) -> Simulator:
    """Return the simulator of that name; its imports are loaded only now. Raises DesignError."""
    if name not in NAMES:
        raise DesignError(f'simulator = "{name}" must be one of {", ".join(NAMES)}')
    return cast(Simulator, import_module(f"sbafab.simulators.{name}.run"))


def refuse_unused(name: Name, request: SimulationRequest) -> None:
    """Raises DesignError for an unknown simulator, and for a setting that it does not use."""
    used = simulator(name).USES
    for name_of_field in request.specific_fields:
        if name_of_field not in used:
            users = [other for other in NAMES if name_of_field in simulator(other).USES]
            raise DesignError(
                f"{name_of_field} is for {' and '.join(users)}; leave it out with {name}"
            )


def chamber_pressures(
    names: Sequence[str],
    request: SimulationRequest,
    default: float,
    most: float = MOST_PRESSURE,
    least: float = 0.0,
) -> dict[str, float]:
    """Return the pressure in kPa of every chamber: named, ``request.pressure`` elsewhere.

    Without any it is the ``default`` in all of them; with single ones only, 0 in the others. Raises
    DesignError for a chamber that is not there and a pressure out of range.
    """
    if not names:
        raise DesignError(
            "the design has no chamber, and a simulation fills chambers; add chambers to it"
        )
    refuse_unknown(names, request.chambers, "pressure")
    in_all = (
        (0.0 if request.chambers else default) if request.pressure is None else request.pressure
    )
    pressures = {name: request.chambers.get(name, in_all) for name in names}
    for name, value in pressures.items():
        if not (math.isfinite(value) and least <= value <= most):
            raise DesignError(
                f"pressure of {name} = {value:g} kPa must be from {least:g} to {most:g} kPa"
            )
    if not any(pressures.values()):
        raise DesignError("pressure is 0 kPa in every chamber; give one of them more")
    return pressures


def refuse_time(seconds: float, least: float) -> None:
    """Raises DesignError for a simulated time out of range."""
    if not least <= seconds <= LONGEST:
        raise DesignError(
            f"simulated time = {seconds:g} s must lie between {least:g} and {LONGEST:g} s"
        )


def refuse_unknown(names: Sequence[str], requested: Mapping[str, float], quantity: str) -> None:
    """Raises DesignError for a chamber that is not there."""
    unknown = next((name for name in requested if name not in names), None)
    if unknown is not None:
        raise DesignError(
            f"{quantity} names chamber {unknown}, which is not there; "
            f"the chambers are {', '.join(names)}"
        )


# A program started, watched, and stopped after its time or on an interrupt.


LOOK_EVERY = 0.1
"""s between two looks at how far a run is."""
STOP_WITHIN = 10.0
"""s that a program has to end by itself before it is killed."""
INTERRUPTED = "it was interrupted"
OUT_OF_TIME = "it was stopped after"


class Ended(NamedTuple):
    """End of a program: its exit code, and why it was stopped, None if it ended by itself."""

    code: int
    stopped: str | None


def program_path(name: str, install: str) -> str:
    """Path of an installed program. Raises OutputError that says how to ``install`` it."""
    path = shutil.which(name)
    if path is None:
        raise OutputError(f"{name} was not found; {install}")
    return path


def run_program(
    command: Sequence[str],
    log: Path,
    limit: float | None,
    look: Callable[[], None],
) -> Ended:
    """Run a command in the folder of its ``log``, which takes what it prints.

    ``look`` is called while it runs; after ``limit`` seconds it is stopped. Ctrl-C and SIGTERM
    stop the run, not the program that started it, so that partial results can be kept. One
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


# Place and lean of the tip, from the nodes that mark it.


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
