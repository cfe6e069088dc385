"""Cut files of the templates as GDAL reads them: areas, closed rings, nothing off by 1 um."""

from __future__ import annotations

from pathlib import Path

import pytest
import shapely

from sbafab.actuators import load_design
from sbafab.cutting.dxf_read import read_profile
from sbafab.folders.run import RunRequest, generate

pyogrio = pytest.importorskip("pyogrio", reason="pyogrio is not installed")

TEMPLATES = ["1dof-5mm", "1dof-10mm", "3dof-15mm", "radial-15mm"]


@pytest.mark.parametrize("name", TEMPLATES)
def test_areas_within_a_hundredth_of_a_percent(name: str, tmp_path: Path) -> None:
    run = generate(RunRequest(load_design(name), tmp_path, ["cut"]))
    pyogrio.set_gdal_config_options({"OGR_ARC_STEPSIZE": "0.25"})
    for layers in run.laminate.patterns.values():
        table = pyogrio.raw.read(run.folder / "layers" / f"{layers[0].name}.dxf")
        kinds = list(table[3][list(table[0]["fields"]).index("Layer")])
        lines = shapely.from_wkb(table[2])
        area = 0.0
        for kind, line in zip(kinds, lines, strict=True):
            if kind == "REFERENCE":
                continue
            assert line.is_ring, (layers[0].name, kind)
            ring = shapely.Polygon(line).area
            area += ring if kind == "CUT_OUTER" else -ring
        assert area == pytest.approx(layers[0].profile.area, rel=1e-4)


@pytest.mark.parametrize("name", TEMPLATES)
def test_written_contours_within_a_micrometre_of_the_exact_edges(name: str, tmp_path: Path) -> None:
    run = generate(RunRequest(load_design(name), tmp_path, ["cut"]))
    for layers in run.laminate.patterns.values():
        exact = layers[0].profile
        written = read_profile(run.folder / "layers" / f"{layers[0].name}.dxf").region
        assert len(written.contours) == len(exact.contours)
        for one, other in ((written, exact), (exact, written)):
            farthest = max(
                other.distance_to_edge(edge.at(t / 8)) for edge in one.edges for t in range(8)
            )
            assert farthest < 0.001
