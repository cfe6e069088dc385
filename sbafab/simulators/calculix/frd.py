"""Results of CalculiX: the text ``.frd`` with fields at nodes, and ``.sta``.

The layout is that of the CalculiX GraphiX manual: fixed columns, a record a line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sbafab.errors import OutputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

COMPONENTS = {b"DISP": 3, b"STRESS": 6}
NODE, VALUE = 13, 12
"""Columns of a line's key and node number, and of each value."""
BLOCK = re.compile(rb"\n  100CL.{6}(.{12})(.{12}).*\n -4  (\S+).*\n(?: -5.*\n)+")
"""Time, number of nodes and name of what follows."""
SAME_TIME = 2e-5
"""Relative: times have six digits."""


@dataclass(frozen=True)
class Frame:
    """Fields at one time in s: displacement (n, 3) mm, stress (n, 6) MPa as xx yy zz xy yz zx."""

    time: float
    displacement: NDArray[np.float64]
    stress: NDArray[np.float64]

    @property
    def von_mises(self) -> NDArray[np.float64]:
        """Equivalent stress (n,) in MPa."""
        xx, yy, zz, xy, yz, zx = self.stress.T
        direct = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
        found: NDArray[np.float64] = np.sqrt(direct / 2 + 3 * (xy**2 + yz**2 + zx**2))
        return found


def read_frd(path: Path, nodes: int, whole: bool = True) -> list[Frame]:
    """The frames of a result file in order of time.

    ``nodes`` is how many the mesh has. Without ``whole`` the file may end anywhere, as that of a
    run that was stopped does; full frames before the end are returned. Raises OutputError where
    the file cannot be read, is of another mesh or, if asked to be whole, is cut short.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise OutputError(f"{path.name} cannot be read: {error.strerror}; run ccx again") from None
    if whole and not content.rstrip().endswith(b"9999"):
        raise _cut_short(path)
    frames: list[Frame] = []
    at: float | None = None
    moved = None
    for time, name, values in _blocks(path, content, nodes, whole):
        if name == b"DISP":
            at, moved = time, values
        elif moved is not None and time == at:
            frames.append(Frame(time, moved, values))
    if whole and not frames:
        raise OutputError(f"{path.name} holds no displacement and stress; run ccx again")
    return frames


def _cut_short(path: Path) -> OutputError:
    return OutputError(f"{path.name} is cut short: its last block is not whole; run ccx again")


def _blocks(
    path: Path, content: bytes, nodes: int, whole: bool
) -> Iterator[tuple[float, bytes, NDArray[np.float64]]]:
    """Time, name and values (n, components) of each block of a known name."""
    for head in BLOCK.finditer(content):
        size = COMPONENTS.get(head[3])
        if size is None:
            continue
        if int(head[2]) != nodes:
            raise OutputError(
                f"{path.name} is of a mesh of {int(head[2])} nodes, not of this one of {nodes}; "
                "run ccx again"
            )
        width = NODE + VALUE * size + 1
        rows = np.frombuffer(content[head.end() : head.end() + nodes * width], dtype="S1")
        if len(rows) < nodes * width or content[head.end() + len(rows) :][:3] != b" -3":
            if whole:
                raise _cut_short(path)
            return
        cells = rows.reshape(nodes, width)[:, NODE:-1]
        texts = np.ascontiguousarray(cells).view(f"S{VALUE}")
        try:
            yield float(head[1]), head[3], texts.astype(np.float64)
        except ValueError:
            raise OutputError(
                f"{path.name} holds something that is no number at time {float(head[1]):g} s; "
                "run ccx again"
            ) from None


def read_sta(path: Path) -> list[float]:
    """Times in s at which a run has converged so far; a line being written is left out."""
    found = []
    lines = path.read_text(encoding="ascii", errors="replace").split("\n") if path.is_file() else []
    for line in lines[2:-1]:
        fields = line.split()
        # A number of attempts with U behind it is of an increment that did not converge.
        if len(fields) == 7 and fields[2].isdigit():
            found.append(float(fields[4]))
    return found
