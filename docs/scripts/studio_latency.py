"""How fast the studio answers, measured in the browser: ``python -m docs.scripts.studio_latency``.

Turns the chamber's diameter of 3dof-15mm again and again and prints, from the change to what is
painted, the median and the 95th percentile; then poses drawn a second. Run it on an idle machine.
On a busy one ``python -m docs.scripts.studio_latency processor`` tells how much processor time a
worker has spent when each answer leaves it.
"""

from __future__ import annotations

import math
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

from sbafab import api
from sbafab.studio.jobs import JOBS
from tests.studio.browsing import Watched, browser, served

PARTS = {
    "geometry": "layers and section painted",
    "figures": "prediction by formulas",
    "deck": "rules but the yield",
    "all": "rules with the yield",
}

ANSWERS = {
    "laminate": "layers, section and solid",
    "prediction": "prediction by formulas",
    "registration-worst-case": "rules but the yield",
    "checked": "rules with the yield",
}
WARM = 3
"""Changes that are not counted: the first ones fetch modules."""


def main(changes: int = 25) -> None:
    """Prints a table in Markdown of what is seen in the browser."""
    with tempfile.TemporaryDirectory() as scratch, browser() as chromium:
        folder = Path(scratch)
        (folder / "arm.toml").write_text(api.template("3dof-15mm"), encoding="utf-8")
        with served(folder, "arm.toml") as link:
            seen = Watched(chromium, link, viewport={"width": 1280, "height": 800})
            seen.ready()
            seen.page.click("#tab-layers")
            _warm(seen)
            _turned(seen, changes)
            print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
            print("\n| from a change to | median ms | 95th percentile ms |\n|---|---|---|")
            for part, words in PARTS.items():
                _row(words, seen.say(f"studio.latency.{part}"))
            seen.page.click("#tab-solid")
            _warm(seen)
            _turned(seen, changes)
            _row("solid and section painted", seen.say("studio.latency.geometry"))
            seen.page.click("#tab-motion")
            seen.until("Boolean(studio.motion.pose)")
            seen.say("studio.motion.set(() => 15)")
            seen.page.get_by_role("button", name="Play", exact=True).click()
            seen.page.wait_for_timeout(1000)
            seen.say("studio.motion.times.length = 0")
            seen.page.wait_for_timeout(5000)
            rate = seen.say("studio.motion.rate()")
            costs = seen.say("studio.motion.costs.slice(-100)")
            each = statistics.median(costs)
            print(f"\nposes drawn a second: {rate:.0f}; drawing one: {each:.1f} ms")


def processor(changes: int = 25) -> None:
    """Prints a table in Markdown of the processor time until each answer of a worker."""
    spent: dict[str, list[float]] = {part: [] for part in ANSWERS}
    for number in range(-WARM, changes):
        edits = [("chamber.diameter", f"{5.1 + number / 50:.3f}")]
        job = {"text": api.template("3dof-15mm"), "edits": edits, "folder": ".", "path": "a.toml"}
        start = time.process_time()
        for answer in JOBS["live"](job, lambda: None):
            part = answer.get("rule", answer["kind"])
            if part in ANSWERS and number >= 0:
                spent[part].append(1000 * (time.process_time() - start))
    print("| answer | median ms | 95th percentile ms |\n|---|---|---|")
    for part, words in ANSWERS.items():
        _row(words, spent[part])


def _turned(seen: Watched, changes: int) -> None:
    for number in range(changes):
        seen.say(f"studio.edit([['chamber.diameter', '{5.05 + number / 50:.3f}']])")
        seen.page.wait_for_timeout(50)
        seen.ready()


def _row(words: str, measured: list[float]) -> None:
    times = sorted(measured)
    # The least of which 95 % are no longer; of 25 the last but one.
    late = times[math.ceil(0.95 * len(times)) - 1]
    print(f"| {words} | {statistics.median(times):.0f} | {late:.0f} |")


def _warm(seen: Watched) -> None:
    for value in ("5.3", "5.4", "5.01"):
        seen.say(f"studio.edit([['chamber.diameter', '{value}']])")
        seen.page.wait_for_timeout(50)
        seen.ready()
    seen.say("Object.values(studio.latency).forEach(times => { times.length = 0; })")


if __name__ == "__main__":
    if sys.argv[1:2] == ["processor"]:
        processor(*map(int, sys.argv[2:]))
    else:
        main(*map(int, sys.argv[1:]))
