"""SOFA as one of the simulators."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.progress import Progress
from sbafab.simulators.coarse.actuator import PRESSURE
from sbafab.simulators.simulator import Result, Wish, chamber_pressures, refuse_time
from sbafab.simulators.sofa.files import why_no_scene, write_scenes
from sbafab.simulators.sofa.parts import TIP_PERIOD
from sbafab.simulators.sofa.run import USUAL, Scene, SofaJob, simulate

USES = ("scene", "seconds", "volumes")


def why_not(laminate: Laminate) -> str | None:
    """The coarse mesh is made of rings: pockets must be round."""
    return why_no_scene(laminate)


def export(laminate: Laminate, wish: Wish, folder: Path) -> None:
    """All the scenes."""
    refuse_time(USUAL.seconds if wish.seconds is None else wish.seconds, TIP_PERIOD)
    write_scenes(laminate, folder, _pressures(laminate, wish), wish.volumes or None)


def run(laminate: Laminate, wish: Wish, folder: Path, tell: Progress) -> Result:
    """All the scenes; one of them run with runSofa."""
    if wish.volumes and wish.scene != "volume":
        raise DesignError("--volume is for --scene volume; the other scenes are told pressures")
    pressures = _pressures(laminate, wish)
    seconds = USUAL.seconds if wish.seconds is None else wish.seconds
    scene = cast(Scene, wish.scene or USUAL.scene)
    job = SofaJob(scene, seconds, 60 * wish.minutes, wish.volumes or None)
    found = simulate(laminate, folder, pressures, job, tell)
    x, y, z = found.last.place
    rows = [] if scene == "volume" else [(name, p, "kPa") for name, p in pressures.items()]
    rows += [("tip x", x, "mm"), ("tip y", y, "mm"), ("tip z", z, "mm")]
    rows += [("tilt", found.last.tilt, "degrees")]
    rows += [] if found.rate is None else [("rate", found.rate, "steps/s")]
    tips = [{"time": tip.time, "place": tip.place, "tilt": tip.tilt} for tip in found.tips]
    figures = {"scene": found.scene.name, "tips": tips, "rate": found.rate}
    return Result(tuple(rows), figures, found.stopped)


def _pressures(laminate: Laminate, wish: Wish) -> dict[str, float]:
    return chamber_pressures([chamber.name for chamber in laminate.chambers], wish, PRESSURE)
