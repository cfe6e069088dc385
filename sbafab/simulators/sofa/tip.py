"""What SOFA wrote: the tip's record, and the log that tells whether to believe it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

Vector = tuple[float, float, float]

TROUBLE = re.compile(r"\[ERROR\]|\bnan\b|Division by zero|Null determinant", re.IGNORECASE)
DONE = re.compile(r"(\d+) iterations done in (\S+) s \(\s*(\S+) FPS\s*\)")


@dataclass(frozen=True)
class Tip:
    """The tip at a time in s: its place in mm, and how far it leans off the axis in degrees."""

    time: float
    place: Vector
    tilt: float


@dataclass(frozen=True)
class Log:
    """What the log tells: its first line of trouble, steps done, s taken and steps per s."""

    trouble: str | None
    steps: int | None
    seconds: float | None
    rate: float | None


def read_tips(path: Path) -> list[Tip]:
    """The records in time up to the first that is cut short or is no finite number."""
    if not path.is_file():
        return []
    found: list[Tip] = []
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
            points = list(_points(numbers))
            found.append(Tip(time, _mean(points), _tilt(points)))
    return found


def read_log(text: str) -> Log:
    trouble = next((line.strip() for line in text.splitlines() if TROUBLE.search(line)), None)
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


def _mean(points: list[Vector]) -> Vector:
    x, y, z = (sum(values) / len(points) for values in zip(*points, strict=True))
    return x, y, z


def _tilt(points: list[Vector]) -> float:
    """Angle between the axis and the normal of the polygon the points go round."""
    nx = ny = nz = 0.0
    for (ax, ay, az), (bx, by, bz) in zip(points, points[1:] + points[:1], strict=True):
        nx += ay * bz - az * by
        ny += az * bx - ax * bz
        nz += ax * by - ay * bx
    return math.degrees(math.atan2(math.hypot(nx, ny), nz))
