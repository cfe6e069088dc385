"""Where labels stand on a part: every place measured in full gives the same order."""

from __future__ import annotations

import pytest

from sbafab.actuators import build, load_design
from sbafab.geometry.region import Region
from sbafab.reports.traveller.sheet_map import HOLE, OUTSIDE, PlacedLabel, labels


def profiles() -> list[Region]:
    laminate = build(load_design("3dof-15mm"))
    return [layers[0].profile.turned(33) for layers in laminate.patterns.values()]


def fault(label: PlacedLabel, part: Region) -> float:
    """What the holes under a label and the points of its box off the part cost."""
    low_x, low_y, high_x, high_y = label.box
    covered, off = 0, 0
    holes = [hole.bounds for hole in part.holes]
    covered = sum(
        low_x < box[2] and high_x > box[0] and low_y < box[3] and high_y > box[1] for box in holes
    )
    for x in (low_x, (low_x + high_x) / 2, high_x):
        for y in (low_y, high_y):
            in_hole = any(box[0] < x < box[2] and box[1] < y < box[3] for box in holes)
            off += not in_hole and not part.contains((x, y))
    return HOLE * covered + OUTSIDE * off


def distance(label: PlacedLabel, part: Region) -> float:
    """How far the middle of a label is off that of its part, 1 in the part's corners."""
    low_x, low_y, high_x, high_y = part.bounds
    x, y = (label.box[0] + label.box[2]) / 2, (label.box[1] + label.box[3]) / 2
    u, v = (2 * x - low_x - high_x) / (high_x - low_x), (2 * y - low_y - high_y) / (high_y - low_y)
    return float(((u**2 + v**2) / 2) ** 0.5)


@pytest.mark.parametrize("words", ["B", "3dof-15mm B"])
def test_labels_come_best_first_and_each_once(words: str) -> None:
    for part in profiles():
        found = list(labels(words, part))
        largest = max(label.size for label in found)
        costs = [
            fault(label, part) + distance(label, part) + (1 - label.size / largest)
            for label in found
        ]
        assert costs == pytest.approx(sorted(costs), abs=1e-9)
        assert len(set(found)) == len(found)
        # 13 x 13 places in each of the sizes that can be read.
        assert len(found) == 169 * len({label.size for label in found})


def test_the_first_label_stands_on_the_part_where_there_is_room() -> None:
    base = profiles()[0]
    assert fault(next(labels("B", base)), base) == 0
