"""Index marks on a written sheet, read by ezdxf and measured by shapely."""

from __future__ import annotations

from pathlib import Path

import ezdxf
import ezdxf.path
import pytest
import shapely

from sbafab.actuators import load_design
from sbafab.folders.check import check_folder
from sbafab.folders.run import Run, RunRequest, generate

BORDER = 10.0
SPACING = 2.5


def written(folder: Path, *changes: str) -> Run:
    few = ("stack.balloons=2", "order.copies=4", "rules.yield_builds=100")
    spacing = [f"sheets.{film}.spacing={SPACING}" for film in ("tpe", "ptfe")]
    return generate(
        RunRequest(load_design("1dof-5mm", [*few, *spacing, *changes]), folder, ("cut",))
    )


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return written(tmp_path_factory.mktemp("marked"), "sheets.index_marks=true")


def shapes(path: Path) -> tuple[list[shapely.Polygon], list[shapely.LineString]]:
    """Outlines of the parts, and the engraved strokes inside the border."""
    drawing = ezdxf.readfile(path)
    outlines, strokes = [], []
    frame = shapely.box(BORDER, BORDER, 152.4 - BORDER, 152.4 - BORDER)
    for entity in drawing.modelspace():
        line = [(p.x, p.y) for p in ezdxf.path.make_path(entity).flattening(0.001)]
        if entity.dxf.layer == "CUT_OUTER":
            outlines.append(shapely.Polygon(line))
        elif entity.dxf.layer == "ENGRAVE" and frame.contains(shapely.LineString(line)):
            strokes.append(shapely.LineString(line))
    return outlines, strokes


@pytest.mark.parametrize("film", ["TPE", "PTFE"])
def test_marks_lie_in_the_skeleton_beside_their_parts(marked: Run, film: str) -> None:
    outlines, strokes = shapes(marked.folder / "sheets" / f"{film}_1.dxf")
    assert strokes
    # Strokes of one mark are less than 0.7 mm apart, two marks more than 0.5 mm and their digits.
    united = shapely.unary_union([stroke.buffer(0.35) for stroke in strokes])
    marks = [mark.buffer(-0.349) for mark in getattr(united, "geoms", [united])]
    assert len(outlines) / 2 < len(marks) <= len(outlines)
    parts = []
    for mark in marks:
        away = [mark.distance(outline) for outline in outlines]
        assert 0.499 < min(away) < 2.6
        parts.append(away.index(min(away)))
    assert len({*parts}) == len(parts)


def test_a_marked_folder_passes_and_its_marks_keep_off_the_parts(marked: Run) -> None:
    assert not [f for f in check_folder(marked.folder) if f.verdict == "fail"]
    outlines, strokes = shapes(marked.folder / "sheets" / "TPE_1.dxf")
    assert strokes
    assert min(a.distance(b) for a in outlines for b in strokes) >= 0.5 - 1e-3
