"""What SOFA wrote: the tip's record, and the log that tells whether to believe it."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from sbafab.meshing.surface import Vector
from sbafab.simulators.coarse.tip import Tip, tip_at

TROUBLE = re.compile(r"\[ERROR\]|\bnan\b|Division by zero|Null determinant", re.IGNORECASE)
NO_PLUGIN = re.compile(r"\[ERROR\].*Plugin not found: \"([^\"]*)\"")
NEEDED = re.compile(r'<RequiredPlugin name="([^"]*)"')
DONE = re.compile(r"(\d+) iterations done in (\S+) s \(\s*(\S+) FPS\s*\)")


@dataclass(frozen=True)
class Log:
    """What the log tells: its first line of trouble, steps done, s taken and steps per s."""

    trouble: str | None
    steps: int | None
    seconds: float | None
    rate: float | None


def read_tips(path: Path) -> list[Tip]:
    """The tip's records in time up to the first that is cut short or is no finite number."""
    return [tip_at(time, points) for time, points in read_points(path)]


def read_points(path: Path) -> list[tuple[float, list[Vector]]]:
    """Time in s and places in mm of the recorded nodes, as far as ``read_tips`` reads them."""
    if not path.is_file():
        return []
    found: list[tuple[float, list[Vector]]] = []
    time: float | None = None
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True):
        key, _, values = line.strip().partition("=")
        numbers = _numbers(values)
        if numbers is None or not line.endswith("\n"):
            break
        if key == "T" and len(numbers) == 1:
            time = numbers[0]
        elif key == "X" and time is not None:
            if len(numbers) < 9 or len(numbers) % 3:
                break
            found.append((time, list(_points(numbers))))
    return found


def plugins_needed(scene: Path) -> list[str]:
    """The plugins that a scene asks for."""
    return NEEDED.findall(scene.read_text(encoding="utf-8")) if scene.is_file() else []


def read_log(text: str, plugins: Collection[str] = ()) -> Log:
    """What a log tells of a run whose scene asks for these plugins; others may be missing."""

    def voids(line: str) -> bool:
        missing = NO_PLUGIN.search(line)
        return missing is None or missing[1] in plugins

    lines = (line.strip() for line in text.splitlines() if TROUBLE.search(line))
    trouble = next(filter(voids, lines), None)
    done = DONE.search(text)
    if done is None:
        return Log(trouble, None, None, None)
    return Log(trouble, int(done[1]), float(done[2]), float(done[3]))


def _numbers(text: str) -> list[float] | None:
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return None
    return numbers if all(map(math.isfinite, numbers)) else None


def _points(numbers: list[float]) -> Iterator[Vector]:
    for i in range(0, len(numbers), 3):
        yield numbers[i], numbers[i + 1], numbers[i + 2]
