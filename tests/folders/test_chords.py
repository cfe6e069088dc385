"""Chords keep bonds, overhangs and pins: measured by shapely on the vertices that ezdxf reads."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import ezdxf
import pytest
import shapely
from shapely import LinearRing, Polygon

from sbafab.actuators import build, load_design
from sbafab.cutting.cut_settings import Curves
from sbafab.cutting.kerf import in_chords
from sbafab.errors import DesignError
from sbafab.folders.run import RunRequest, generate
from sbafab.geometry.region import disc, rectangle
from tests.folders.doctoring import Doctor
from tests.quick import few

EARS = "registration.method=ears"
FEW = ("stack.balloons=2", "rules.yield_builds=100")
BOND, OVERHANG, TOLERANCE = 0.75, 0.5, 1e-3
CASES = [
    ("1dof-5mm", (), 0.005),
    ("1dof-5mm", (), 0.1),
    pytest.param("3dof-15mm", (), 0.02, marks=pytest.mark.long),
    pytest.param("radial-15mm", (), 0.1, marks=pytest.mark.long),
]


def written(template: str, settings: tuple[str, ...], error: float, out: Path) -> Doctor:
    design = load_design(template, [*FEW, *settings])
    return Doctor(generate(RunRequest(design, out, ("cut",), Curves("chords", error))).folder)


@cache
def part(path: Path) -> shapely.Geometry:
    """What a layer's or sheet's file cuts, from its vertices alone."""
    cut = {"CUT_OUTER": [], "CUT_INNER": []}  # type: dict[str, list[Polygon]]
    for entity in ezdxf.readfile(path).modelspace().query("LWPOLYLINE"):
        assert not any(bulge for *_, bulge in entity.get_points("xyb"))
        if entity.dxf.layer in cut:
            cut[entity.dxf.layer].append(Polygon(entity.get_points("xy")))
    return shapely.union_all(cut["CUT_OUTER"]) - shapely.union_all(cut["CUT_INNER"])


def holes(shape: shapely.Geometry) -> list[LinearRing]:
    return [ring for piece in shapely.get_parts(shape) for ring in piece.interiors]


def outlines(shape: shapely.Geometry) -> list[LinearRing]:
    return [piece.exterior for piece in shapely.get_parts(shape)]


def layers(doctor: Doctor, gap: dict[str, Any]) -> tuple[shapely.Geometry, shapely.Geometry]:
    """The contact and the mask of an interface."""
    below, above = (part(doctor.path(gap[side])) for side in ("below", "above"))
    return below & above, part(doctor.path(gap["masks"][0]))


@pytest.mark.parametrize(("template", "settings", "error"), few(CASES, 1, names=3))
def test_chords_keep_bonds_overhangs_and_pins(
    template: str, settings: tuple[str, ...], error: float, tmp_path: Path
) -> None:
    doctor = written(template, settings, error, tmp_path)
    manifest = doctor.manifest
    tabbed = 1
    for gap in manifest["interfaces"]:
        contact, mask = layers(doctor, gap)
        if gap["kind"] == "separator":
            rings = [
                shapely.distance(window, hole)
                for window in holes(mask)
                for hole in holes(contact)
                if Polygon(window).contains(Polygon(hole)) and shapely.distance(window, hole) > 0.01
            ]
            reach = [
                min(shapely.distance(edge, other) for other in outlines(mask))
                for edge in outlines(contact)
            ]
            assert min(reach) >= OVERHANG - TOLERANCE
            assert min(rings, default=BOND) >= BOND - TOLERANCE
        elif tabbed:
            tabbed = 0
        else:
            pockets = outlines(mask)
            apart = [
                shapely.distance(pocket, other)
                for pocket in pockets
                for other in [*outlines(contact), *holes(contact), *pockets]
                if other is not pocket and not Polygon(pocket).contains(other)
            ]
            assert BOND - TOLERANCE <= min(apart) <= BOND + 2 * error
    for bore in manifest["bores"]:
        centre = shapely.Point(bore["x"], bore["y"])
        for layer in manifest["layers"]:
            if bore["chamber"] in layer["bores"]:
                shape = part(doctor.path(layer["index"]))
                room = min(shapely.distance(centre, ring) for ring in holes(shape))
                assert room >= bore["diameter"] / 2 - 1e-6


@pytest.mark.parametrize(
    ("template", "settings", "error"), [*CASES[:2], ("1dof-10mm", (EARS,), 0.05)]
)
def test_edges_stay_within_the_chord_error(
    template: str, settings: tuple[str, ...], error: float
) -> None:
    laminate = build(load_design(template, [*FEW, *settings]))
    for of_pattern in laminate.patterns.values():
        layer = of_pattern[0]
        exact, drawn = (
            shapely.union_all([Polygon(*(rings[0], rings[1:])) for rings in region.polygons(1e-4)])
            for region in (layer.profile, in_chords(layer.profile, layer.role, error))
        )
        assert shapely.hausdorff_distance(exact, drawn) <= error + 2e-4
        outer, own = (shapely.union_all([*map(Polygon, outlines(s))]) for s in (exact, drawn))
        lost, gained = shapely.area(outer - own), shapely.area(own - outer)
        room = 1e-4 * outer.length
        assert (gained if layer.role == "chamber-mask" else lost) <= room


def test_chords_too_coarse_are_refused_by_name(tmp_path: Path) -> None:
    """A ring of chamber mask round the bore is just as wide as the laser can cut."""
    fits = load_design("1dof-5mm", [*FEW, "bore.diameter=2", "laser.least_feature=1.49"])
    generate(RunRequest(fits, tmp_path, ("cut",), Curves("chords", 0.005)))
    with pytest.raises(DesignError, match=r"chords within 0\.1 mm break film-lim.*--chord-error"):
        generate(RunRequest(fits, tmp_path / "coarse", ("cut",), Curves("chords", 0.1)))
    assert not (tmp_path / "coarse").exists() or not any((tmp_path / "coarse").rglob("*.dxf"))


def test_round_holes_open_and_corners_stay() -> None:
    region = rectangle((-5.0, -5.0), (5.0, 5.0)) - disc((1.0, 2.0), 0.5)
    for role in ("wall", "chamber-mask", "separator-mask"):
        drawn = in_chords(region, role, 0.1)  # type: ignore[arg-type]
        assert [contour.area for contour in drawn.outers] == [pytest.approx(100.0)]
        (hole,) = drawn.holes
        room = [edge.nearest((1.0, 2.0)) for edge in hole.edges]
        assert min(shapely.Point(1.0, 2.0).distance(shapely.Point(p)) for p in room) > 0.5 - 1e-9
        assert max(shapely.Point(1.0, 2.0).distance(shapely.Point(p)) for p in room) < 0.5005


def test_sheets_are_cut_as_the_layers_are(tmp_path: Path) -> None:
    doctor = written("1dof-5mm", ("order.spares=0", "order.spare_share=0"), 0.1, tmp_path)

    def cut(rows: list[dict[str, Any]]) -> list[tuple[str, int, float]]:
        return sorted(
            (row["material"], len(piece.exterior.coords), piece.area)
            for row in rows
            for piece in shapely.get_parts(part(doctor.folder / row["file"]))
        )

    layers, sheets = cut(doctor.manifest["layers"]), cut(doctor.manifest["sheets"])
    assert [row[:2] for row in sheets] == [row[:2] for row in layers]
    assert [row[2] for row in sheets] == pytest.approx([row[2] for row in layers], abs=1e-6)
