"""What is carried from face to face is refused where it is wrong, never returned."""

from __future__ import annotations

import pytest

from sbafab.geometry import arrangement
from sbafab.geometry.arrangement import Arrangement, InconsistentError, merged, split_edges
from sbafab.geometry.boolean import GeometryError, union, wound
from sbafab.geometry.edges import Line
from sbafab.geometry.region import Region
from sbafab.geometry.shapes import disc, rectangle


def arranged(*regions: Region) -> Arrangement:
    edges = [edge for region in regions for edge in region.edges]
    return Arrangement(merged(piece for parts in split_edges(edges) for piece in parts))


def test_windings_of_nested_and_crossing_shapes() -> None:
    found = arranged(
        disc((0, 0), 3), disc((0, 0), 2), disc((2.5, 0), 1), rectangle((9, 0), (10, 1))
    )
    assert {turns for turns in found.left if turns is not None} == {0, 1, 2, 3}
    for half in range(len(found.origin)):
        edge = found.edge(half)
        (x, y), (ux, uy) = edge.at(0.5), edge.direction(edge.at(0.5))
        p = (x - 1e-4 * uy, y + 1e-4 * ux)
        inside = [r.contains(p) for r in (disc((0, 0), 3), disc((0, 0), 2), disc((2.5, 0), 1))]
        assert found.left[half] == sum(inside) + rectangle((9, 0), (10, 1)).contains(p)


def test_a_wrong_order_round_a_point_of_touch_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the touch only curvature tells which circle is the inner one."""
    assert arranged(disc((0, 0), 3), disc((2, 0), 1)).tangled
    right = arrangement._by_side
    monkeypatch.setattr(arrangement, "_by_side", lambda a, b: -right(a, b))
    with pytest.raises(InconsistentError):
        arranged(disc((0, 0), 3), disc((2, 0), 1))
    with pytest.raises(GeometryError, match="change a size"):
        union([disc((0, 0), 3), disc((2, 0), 1)])


def test_an_open_chain_is_refused() -> None:
    with pytest.raises(GeometryError, match="change a size"):
        wound([Line((0.0, 0.0), (1.0, 0.0)), Line((1.0, 0.0), (1.0, 1.0))], 0)
