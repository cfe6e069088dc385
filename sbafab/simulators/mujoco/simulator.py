"""MuJoCo as one of the simulators."""

from __future__ import annotations

from pathlib import Path

from sbafab.laminate.laminate import Laminate
from sbafab.process import Progress
from sbafab.simulators.coarse.shell import PRESSURE
from sbafab.simulators.mujoco.model import why_no_model, write_model
from sbafab.simulators.mujoco.run import LEAST_TIME, RAMP, SECONDS, simulate
from sbafab.simulators.simulator import Result, Wish, chamber_pressures, refuse_time

USES = ("seconds",)


def why_not(laminate: Laminate) -> str | None:
    """The coarse mesh is made of rings: pockets must be round."""
    return why_no_model(laminate)


def export(laminate: Laminate, wish: Wish, folder: Path) -> None:
    """The model and a script that inflates it."""
    refuse_time(SECONDS if wish.seconds is None else wish.seconds, LEAST_TIME)
    write_model(laminate, folder, _pressures(laminate, wish))


def run(laminate: Laminate, wish: Wish, folder: Path, tell: Progress) -> Result:
    """The same, run to its end."""
    pressures = _pressures(laminate, wish)
    seconds = SECONDS if wish.seconds is None else wish.seconds
    found = simulate(laminate, folder, pressures, seconds, tell, limit=60 * wish.minutes)
    x, y, z = found.last.place
    share = min(1.0, found.last.time / RAMP)
    rows = [(name, share * value, "kPa") for name, value in pressures.items()]
    rows += [("tip x", x, "mm"), ("tip y", y, "mm"), ("tip z", z, "mm")]
    rows += [("tilt", found.last.tilt, "degrees"), ("stroke", found.stroke, "mm")]
    rows += [(f"air {name}", value, "ul") for name, value in found.volumes]
    rows += [("drift in 0.5 s", found.drift, "mm"), ("rate", found.rate, "steps/s")]
    tips = [{"time": tip.time, "place": tip.place, "tilt": tip.tilt} for tip in found.tips]
    figures = {"stroke": found.stroke, "volumes": dict(found.volumes), "tips": tips}
    figures |= {"drift": found.drift, "rate": found.rate}
    return Result(tuple(rows), figures, found.stopped)


def _pressures(laminate: Laminate, wish: Wish) -> dict[str, float]:
    return chamber_pressures([chamber.name for chamber in laminate.chambers], wish, PRESSURE)
