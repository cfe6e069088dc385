"""Folders of drawings and polygons with a table: areas by closed formulas, faults by their line."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import ezdxf
import pytest

from sbafab.importing.layer_table import import_table
from sbafab.importing.records import Written, write_imported
from sbafab.rules.deck import run_deck
from tests.designs import PAPER
from tests.importing.conftest import Importing

LAYERS = """file,role,film,layer,pieces
pouch.dxf,base,,FILM,
pouch.dxf,chamber-mask,,MASK,
cover.svg,cap,,,
"""
CHAMBERS = "name;x;y;mouth_x;mouth_y;angle;width\npouch;0;0;0;24;90;2\n"
FILM = [(-21, -16), (21, -16), (21, 16), (2, 16), (2, 24), (-2, 24), (-2, 16), (-21, 16)]
MASK = [
    *[(-20, -15), (20, -15), (20, 15), (1, 15), (1, 24.5), (-1, 24.5), (-1, 15), (-20, 15)],
]
FILM_AREA, MASK_AREA = 42 * 32 + 4 * 8, 40 * 30 + 2 * 9.5
POINTS = " ".join(f"{x},{-y}" for x, y in FILM)
SVG = f"""<svg xmlns="http://www.w3.org/2000/svg" width="60mm" height="60mm"
viewBox="-30 -30 60 60"><polygon points="{POINTS}"/></svg>"""


def pouch(folder: Path, layers: str = LAYERS, chambers: str = CHAMBERS) -> Path:
    """A folder with both films and the mask of a pouch of 40 x 30 mm, bonded by 1 mm."""
    source = folder / "drawn pouch"
    source.mkdir()
    drawing = ezdxf.new(units=4)
    for layer, points in (("FILM", FILM), ("MASK", MASK)):
        drawing.modelspace().add_lwpolyline(points, close=True, dxfattribs={"layer": layer})
    drawing.saveas(source / "pouch.dxf")
    (source / "cover.svg").write_text(SVG)
    (source / "layers.csv").write_text(layers)
    (source / "chambers.csv").write_text(chambers)
    return source


def written(source: Path) -> Written:
    return write_imported(import_table(source), source.parent / "again.toml", source.name)


def failing(made: Written) -> set[str]:
    findings = run_deck(made.laminate, PAPER.with_("rules.yield_builds=100"))
    return {finding.rule for finding in findings if finding.verdict == "fail"}


def test_a_folder_of_drawings_is_a_laminate_that_keeps_the_rules(tmp_path: Path) -> None:
    made = written(pouch(tmp_path))
    areas = [layer.profile.area for layer in made.laminate.layers]
    assert areas == pytest.approx([FILM_AREA, MASK_AREA, FILM_AREA], rel=1e-9)
    assert made.design.name == "drawn-pouch"
    assert made.laminate.inlets[0].mouth == (0, 24)
    assert failing(made) == set()


def test_drawings_that_no_row_names_are_named(importing: Importing, tmp_path: Path) -> None:
    source = pouch(tmp_path)
    (source / "old.dxf").write_text("")
    result = importing(source, "--json")
    remark = "old.dxf: layers.csv does not name it, so it is not imported"
    assert json.loads(result.stdout)["remarks"] == [remark]


MOUTHLESS = "name,x,y\npouch,0,0\n"
REFUSED = [
    ("role", "layer", CHAMBERS, "layers.csv has two columns layer; keep one"),
    ("cap", "lid", CHAMBERS, "layers.csv, line 4: role = 'lid' must be 'base'"),
    ("cover", "lid", CHAMBERS, "layers.csv, line 4: drawing "),
    ("cover.svg", "cover.png", CHAMBERS, "line 4: file = 'cover.png' is no"),
    ("FILM,", "FILM,many", CHAMBERS, "line 2: pieces = 'many' must be a whole number"),
    ("cap,,,\n", "cap,,,\na,b,c,d,e,f\n", CHAMBERS, "line 5 has 6 cells, but the header has 5"),
    ("", "", MOUTHLESS, "chambers.csv, line 2 is the first row of pouch but has no mouth_x"),
    ("", "", f"{CHAMBERS}pouch;5;5;;;;2\n", "line 3: width of pouch is given in an earlier"),
]


@pytest.mark.parametrize(("old", "new", "chambers", "sentence"), REFUSED)
def test_a_fault_of_a_table_is_named_by_its_line(
    old: str, new: str, chambers: str, sentence: str, importing: Importing, tmp_path: Path
) -> None:
    layers = LAYERS.replace(old, new, 1)
    assert sentence in importing(pouch(tmp_path, layers, chambers)).output


# Polygons of foldable_robotics.

HOLED = "POLYGON ((-21 -16, 21 -16, 21 16, -21 16, -21 -16), (0 0, 4 0, 4 3, 0 0))"
STRIP = "POLYGON ((-2 15, 2 15, 2 24, -2 24, -2 15))"
POLYGONS: dict[str, Any] = {
    "id": 1,
    "layers": [
        {"id": 2, "geoms": [HOLED, STRIP]},
        {"id": 3, "geoms": ["MULTIPOLYGON (((-20 -15, 20 -15, 20 15, -20 15, -20 -15)))"]},
        {"id": 4, "geoms": [HOLED.split("), (", maxsplit=1)[0] + "))"]},
    ],
}
ROWS = "file,role,layer\nlam.json,base,1\nlam.json,chamber-mask,2\nlam.json,cap,3\n"


def polygons(folder: Path, document: Any, rows: str = ROWS) -> Path:
    source = folder / "polygons"
    source.mkdir()
    (source / "lam.json").write_text(json.dumps(document))
    (source / "layers.csv").write_text(rows)
    (source / "chambers.csv").write_text(CHAMBERS)
    return source


def test_layers_of_polygons_are_drawings_with_their_areas(tmp_path: Path) -> None:
    made = written(polygons(tmp_path, POLYGONS))
    areas = [layer.profile.area for layer in made.laminate.layers]
    assert areas == pytest.approx([42 * 32 - 6 + 4 * 8, 40 * 30, 42 * 32], rel=1e-9)
    assert math.isclose(made.laminate.layers[0].profile.bounds[3], 24)


def test_yaml_of_foldable_robotics_is_read_alike(tmp_path: Path) -> None:
    yaml = pytest.importorskip("yaml")
    source = polygons(tmp_path, POLYGONS, ROWS.replace(".json", ".yaml"))
    lines = ["id: 1", "layers:"]
    for row in POLYGONS["layers"]:
        lines += ["- !Layer", f"  id: {row['id']}", "  geoms:"]
        lines += [f"  - {geom}" for geom in row["geoms"]]
    (source / "lam.yaml").write_text("\n".join(lines))
    plain = yaml.safe_load("\n".join(lines).replace("!Layer\n  id", "id"))
    assert plain == POLYGONS
    areas = [layer.profile.area for layer in written(source).laminate.layers]
    assert areas == pytest.approx([42 * 32 - 6 + 4 * 8, 40 * 30, 42 * 32], rel=1e-9)


@pytest.mark.parametrize(
    ("geom", "sentence"),
    [
        ("LINESTRING (1 2, 3 4)", "layer 1, geometry 1 has a LineString at x 1, y 2"),
        ("POLYGON ((0 0, 4 4, 4 0, 0 4, 0 0))", "layer 1, geometry 1: Self-intersection[2 2]"),
        ("POLYGON", "layer 1, geometry 1 is 'POLYGON', which is not valid WKT"),
        (7, "layer 1 has no list of geoms as text"),
        (None, "layer 1 has no polygon; omit its row"),
    ],
)
def test_a_geometry_that_is_no_polygon_is_named_at_its_place(
    geom: object, sentence: str, importing: Importing, tmp_path: Path
) -> None:
    first = {"geoms": [] if geom is None else [geom]}
    document = {"layers": [first, *POLYGONS["layers"][1:]]}
    assert sentence in importing(polygons(tmp_path, document)).output


def test_yaml_without_pyyaml_names_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, importing: Importing
) -> None:
    source = polygons(tmp_path, POLYGONS, ROWS.replace(".json", ".yaml"))
    (source / "lam.yaml").write_text("id: 1\n")
    monkeypatch.setitem(sys.modules, "yaml", None)
    assert 'pip install "sbafab[yaml]"' in importing(source).output


@pytest.mark.parametrize(
    ("text", "place"),
    [('{"a": 1,,}', "line 1 column 9"), ('{"components":\n [1,,]}', "line 2 column 5")],
)
def test_broken_json_is_named_with_its_place(
    text: str, place: str, importing: Importing, tmp_path: Path
) -> None:
    (tmp_path / "broken.json").write_text(text)
    assert f"broken.json is not valid JSON: {place}" in importing(tmp_path / "broken.json").output
