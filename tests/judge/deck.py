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
from tests.judge.reading import UnreadableError
from tests.judge.sheets import judge_sheets
from tests.judge.traveller import judge_traveller
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
    judge_traveller,
)


def judged(folder: Folder, drawn: Sequence[Polygon] | None = None) -> list[Disagreement]:
    """What all judges say of one design's folder, its sheets included if it has its own."""
    found = [said for judge in JUDGES for said in _heard(lambda judge=judge: judge(folder))]
    if folder.manifest.get("sheets"):
        found += _heard(lambda: judge_sheets([folder], folder.path, folder.manifest["sheets"]))
    if drawn is not None:
        found += _heard(lambda: judge_pockets(folder, drawn))
    return found


def _heard(judge: Callable[[], Iterator[Disagreement]]) -> list[Disagreement]:
    """What a judge says; a file that no cutter could follow does not silence the others."""
    try:
        return list(judge())
    except UnreadableError as error:
        return [Disagreement("reading", str(error))]
