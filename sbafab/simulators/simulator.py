"""What any simulator is asked for and gives back, and where to find it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, Protocol, cast

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.progress import Progress

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
