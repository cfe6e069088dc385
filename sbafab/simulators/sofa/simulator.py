"""SOFA as one of the simulators."""

from __future__ import annotations

import math
from pathlib import Path
from typing import cast

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.process import Progress
from sbafab.simulators.coarse.shell import PRESSURE
from sbafab.simulators.simulator import Result, Wish, chamber_pressures, refuse_time
from sbafab.simulators.sofa.files import why_no_scene, write_scenes
from sbafab.simulators.sofa.run import USUAL, Scene, SofaJob, SofaRun, read_points, simulate
from sbafab.simulators.sofa.scenes import TIP_FILE, TIP_PERIOD

USES = ("scene", "seconds", "volumes")


def why_not(laminate: Laminate) -> str | None:
    """A film whose modulus is not known."""
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
    rows = [] if scene == "volume" else [(name, p, "kPa") for name, p in pressures.items()]
    rows += _reached(laminate, found)
    rows += [] if found.rate is None else [("rate", found.rate, "steps/s")]
    tips = [{"time": tip.time, "place": tip.place, "tilt": tip.tilt} for tip in found.tips]
    figures = {"scene": found.scene.name, "tips": tips, "rate": found.rate}
    return Result(tuple(rows), figures, found.stopped)


def _reached(laminate: Laminate, found: SofaRun) -> list[tuple[str, float, str]]:
    """The tip's place and lean, or how far the crowns of balloons lie from their tube's axis."""
    if laminate.tube is not None:
        _, crowns = read_points(found.scene.with_name(TIP_FILE))[-1]
        across = [2 * math.hypot(x, y) for x, y, _ in crowns]
        return [("diameter over the crowns", sum(across) / len(across), "mm")]
    x, y, z = found.last.place
    tip = [("tip x", x, "mm"), ("tip y", y, "mm"), ("tip z", z, "mm")]
    drift = math.dist(found.last.place, found.before(1.0).place)
    return [*tip, ("tilt", found.last.tilt, "degrees"), ("drift in 1 s", drift, "mm")]


def _pressures(laminate: Laminate, wish: Wish) -> dict[str, float]:
    return chamber_pressures([chamber.name for chamber in laminate.chambers], wish, PRESSURE)
