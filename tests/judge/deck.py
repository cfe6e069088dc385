"""All judges in turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from shapely import Polygon

from tests.judge.bonds import judge_bonds
from tests.judge.claims import judge_claims
from tests.judge.facing import judge_facing
from tests.judge.folder import Disagreement, Folder
from tests.judge.overhangs import judge_overhangs
from tests.judge.pins import judge_pins
from tests.judge.pockets import judge_pockets
from tests.judge.pressing import judge_press
from tests.judge.sheets import judge_sheets
from tests.judge.voids import judge_voids

Judge = Callable[[Folder], Iterator[Disagreement]]
JUDGES: tuple[Judge, ...] = (
    judge_facing,
    judge_bonds,
    judge_overhangs,
    judge_voids,
    judge_pins,
    judge_press,
    judge_claims,
)


def judged(folder: Folder, drawn: Sequence[Polygon] | None = None) -> list[Disagreement]:
    """What all judges say of one design's folder, its sheets included if it has its own."""
    said = [found for judge in JUDGES for found in judge(folder)]
    if folder.manifest.get("sheets"):
        said += judge_sheets([folder], folder.path, folder.manifest["sheets"])
    if drawn is not None:
        said += judge_pockets(folder, drawn)
    return said
