"""Path data, read back by svgelements and measured by shapely."""

from __future__ import annotations

import pytest
from shapely.geometry import Polygon
from svgelements import Arc, Path

from sbafab.geometry.offset import fillet
from sbafab.geometry.region import Region, disc, path_data, rectangle, stadium, strip
from tests.quick import few

PLATE = fillet(disc((0.0, 0.0), 3.25) | strip((0.0, 0.0), (8.25, 0.0), 3.1), 1.0)


def measured_area(data: str) -> float:
    """Signed area enclosed by a path, its arcs sampled finely."""
    area = 0.0
    for piece in Path(data).as_subpaths():
        points = []
        for segment in Path(piece):
            steps = 2000 if isinstance(segment, Arc) else 1
            if segment.start is not None and type(segment).__name__ != "Move":
                points += [segment.point(i / steps) for i in range(steps)]
        ring = Polygon([(p.x, p.y) for p in points])
        area += ring.area if ring.exterior.is_ccw else -ring.area
    return area


@pytest.mark.parametrize(
    "region",
    few(
        [
            disc((4.25, 0.0), 2.5),
            PLATE,
            PLATE - disc((0.0, 0.0), 0.5),
            stadium((1.0, 2.0), 11.5, 20.0) - rectangle((0.0, 0.0), (1.0, 1.0)),
        ],
        2,
    ),
    ids=["disc", "tabbed", "bored", "oblong"],
)
def test_area_survives_the_way_through_svg(region: Region) -> None:
    assert measured_area(path_data(region)) == pytest.approx(region.area, rel=1e-4)


def test_arcs_stay_arcs() -> None:
    data = path_data(disc((0.0, 0.0), 3.25))
    assert data.count("A3.25 3.25 0 0 1") == 4
    assert data.count("M") == data.count("Z") == 1


def test_an_empty_region_has_no_path() -> None:
    assert path_data(Region()) == ""
