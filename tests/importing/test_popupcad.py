"""popupCAD designs: layers against shapely on the raw coordinates, and what is not read by place.

The designs are written here in the form in which popupCAD saves them: YAML with tags of objects.
"""

from __future__ import annotations

import json
import math
import random
import re
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import shapely
from shapely import affinity

from sbafab.errors import DesignError
from sbafab.geometry.edges import Arc
from sbafab.geometry.region import Region
from sbafab.importing.layer_table import import_table
from sbafab.importing.popupcad import cad_layer
from sbafab.importing.records import write_imported
from tests.importing.conftest import Importing

pytest.importorskip("yaml")

OBJECT = "!!python/object:popupcad."
MATERIALS = ("rigid", "adhesive", "flexible")
IDS = (11, 12, 13)
QUARTER = 256
"""Chords in a quarter of a circle of the judge."""


def vertex(x: float, y: float) -> str:
    return f"!ShapeVertex_1 [7, {x!r}, {y!r}]"


def shape(
    kind: str, *points: tuple[float, float], construction: bool = False, holes: Any = ()
) -> str:
    outer = ", ".join(vertex(*point) for point in points)
    inner = ", ".join("[" + ", ".join(vertex(*p) for p in hole) + "]" for hole in holes)
    fields = f"construction: {str(construction).lower()}, exterior: [{outer}], interiors: [{inner}]"
    return f"{OBJECT}filetypes.genericshapes.{kind} {{{fields}, id: 5}}"


def sketch(name: str, *shapes: str) -> str:
    rows = ", ".join(shapes)
    return f"{OBJECT}filetypes.sketch.Sketch {{_basename: {name}, operationgeometry: [{rows}]}}"


def links(**named: list[int]) -> str:
    rows = (
        f"{key}: [{', '.join(f'!!python/tuple [{ref}, 0]' for ref in refs)}]"
        for key, refs in named.items()
    )
    return "{" + ", ".join(rows) + "}"


def operation(number: int, kind: str, name: str = "''", **fields: object) -> str:
    module = kind.lower()
    rows = "".join(f", {key}: {value}" for key, value in fields.items())
    return f"{OBJECT}manufacturing.{module}.{kind} {{id: {number}, customname: {name}{rows}}}"


def drawn(number: int, sketch_id: int, layers: tuple[int, ...] = IDS, name: str = "''") -> str:
    sketch_links = f"{{sketch: [{sketch_id}]}}"
    fields = {"layer_links": [*layers], "operation_links": "{}", "sketch_links": sketch_links}
    return operation(number, "SimpleSketchOp", name, **fields)


def combined(number: int, function: str, unary: list[int], binary: list[int]) -> str:
    found = links(unary=unary, binary=binary)
    return operation(number, "LaminateOperation2", function=function, operation_links=found)


def widened(number: int, parent: int, distance: float, kind: str = "BufferOperation3") -> str:
    return operation(number, kind, values=[distance, 4], operation_links=links(parent=[parent]))


def laid_by(number: int, parent: int, sketch_to: int = 6, **fields: object) -> str:
    """An operation that lays a result from the line of sketch 5 on each of another's."""
    fields = {"shift": 0, "flip": "false"} | fields
    lines = f"{{sketch_from: [5], sketch_to: [{sketch_to}]}}"
    found = links(**{"from": [parent]})
    return operation(
        number, "TransformInternal", sketch_links=lines, operation_links=found, **fields
    )


def turned(flip: bool, rotate: bool) -> list[str]:
    """Return operations that move two layers up by one, turned over or round."""
    flags = {"flip": str(flip).lower(), "rotate": str(rotate).lower()}
    return [
        drawn(1, 2, (11,)),
        drawn(2, 4, (13,)),
        combined(3, "union", [1, 2], []),
        operation(4, "ShiftFlip3", shift=1, **flags, operation_links=links(parent=[3])),
    ]


def design(operations: list[str], sketches: dict[int, str], subdesigns: str = "{}") -> str:
    layers = ", ".join(
        f"{OBJECT}filetypes.material2.Material2 "
        f"{{id: {number}, name: {name}, thickness: 0.05, color: !!python/tuple [0.1, 0.2]}}"
        for number, name in zip(IDS, MATERIALS, strict=True)
    )
    rows = ", ".join(f"{number}: {text}" for number, text in sketches.items())
    return (
        f"{OBJECT}filetypes.design.Design {{_basename: hinge.cad, "
        f"_layerdef: {OBJECT}filetypes.layerdef.LayerDef {{layers: [{layers}]}}, "
        f"operations: [{', '.join(operations)}], sketches: {{{rows}}}, subdesigns: {subdesigns}}}"
    )


PLATE = shape("GenericTwoPointRect", (-21.0, -16.0), (21.0, 16.0))
CIRCLE = shape("GenericCircle", (3.0, 1.0), (7.0, 4.0))
LINE = shape("GenericLine", (-30.0, 2.0), (30.0, 5.0))
BENT = shape("GenericPolyline", (-10.0, -10.0), (0.0, -4.0), (10.0, -10.0))
CORNERS = ((-8.0, -8.0), (12.0, -8.0), (12.0, 8.0), (-8.0, 8.0))
HOLED = shape("GenericPoly", *CORNERS, holes=[[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0)]])
GUIDE = shape("GenericLine", (0.0, 0.0), (9.0, 9.0), construction=True)
SKETCHES = {
    1: sketch("plate", PLATE, GUIDE),
    2: sketch("circle", CIRCLE),
    3: sketch("lines", LINE, BENT, "!DrawnPoint_1 [8, -15.0, 10.0, false]"),
    4: sketch("holed", HOLED),
    5: sketch("from", shape("GenericLine", (0.0, 0.0), (2.0, 0.0))),
    6: sketch("to", shape("GenericLine", (1.0, 1.0), (1.0, 4.0)), LINE),
    7: sketch("level", shape("GenericLine", (0.0, 0.0), (1.0, 0.0))),
}

# The judge: the same by shapely, from the same numbers.

RECTANGLE = shapely.box(-21, -16, 21, 16)
ROUND = shapely.Point(3, 1).buffer(5.0, quad_segs=QUARTER)
RULED = shapely.union_all(
    [
        shapely.LineString([(-30, 2), (30, 5)]),
        shapely.LineString([(-10, -10), (0, -4), (10, -10)]),
        shapely.Point(-15, 10),
    ]
)
FRAME = shapely.Polygon([(-8, -8), (12, -8), (12, 8), (-8, 8)], [[(0, 0), (4, 0), (4, 4)]])
NOTHING = shapely.Polygon()


def wide(geometry: shapely.Geometry, distance: float) -> shapely.Geometry:
    return geometry.buffer(distance, quad_segs=QUARTER)


def laid(geometry: shapely.Geometry, angle: float, scale: float, x: float, y: float) -> Any:
    """Turned by an angle in radians and scaled about the origin, then moved."""
    c, s = scale * math.cos(angle), scale * math.sin(angle)
    return affinity.affine_transform(geometry, [c, -s, s, c, x, y])


SLOPE, REACH = math.atan2(3, 60), math.hypot(60, 3)
ON_BOTH = shapely.union_all(
    [laid(FRAME, math.pi / 2, 1.5, 1, 1), laid(FRAME, SLOPE, REACH / 2, -30, 2)]
)
STRETCHED = {"transformtype_x": "custom", "transformtype_y": "custom"}


class Case(NamedTuple):
    """Operations, and what shapely makes of each layer by the last of them."""

    operations: list[str]
    judge: tuple[shapely.Geometry, ...]


FROZEN = (
    f"{OBJECT}filetypes.genericlaminate.GenericLaminate "
    f"{{geoms: {{? {OBJECT}filetypes.material2.Material2 {{id: 12}} : [{HOLED}]}}}}"
)
LAYERS = {"unary_layer_links": [11], "pair_layer_links": [12], "output_layer_links": [12, 13]}
CASES = {
    "difference of several": Case(
        [drawn(1, 1), drawn(2, 2), drawn(3, 4, (11,)), combined(4, "difference", [1], [2, 3])],
        (RECTANGLE - (ROUND | FRAME), RECTANGLE - ROUND, RECTANGLE - ROUND),
    ),
    "symmetric difference": Case(
        [drawn(1, 2), drawn(2, 4, (11, 12)), combined(3, "symmetric_difference", [1], [2])],
        (ROUND ^ FRAME, ROUND ^ FRAME, ROUND),
    ),
    "lines widened": Case([drawn(1, 3), widened(2, 1, 0.75)], (wide(RULED, 0.75),) * 3),
    "lines outside an area, widened": Case(
        [drawn(1, 3), drawn(2, 4), combined(3, "difference", [1], [2]), widened(4, 3, 1.0)],
        (wide(RULED - FRAME, 1.0),) * 3,
    ),
    "cleaned": Case(
        [drawn(1, 4), widened(2, 1, 1.0, "Cleanup2")],
        (wide(wide(wide(FRAME, -1.0), 2.0), -1.0),) * 3,
    ),
    "flipped and moved up": Case(turned(flip=True, rotate=False), (NOTHING, FRAME, NOTHING)),
    "turned round": Case(turned(flip=False, rotate=True), (FRAME, ROUND, NOTHING)),
    "layers of one": Case(
        [
            *(drawn(1, 1, (11,)), drawn(2, 4, (12,)), combined(3, "union", [1, 2], [])),
            operation(
                4, "LayerOp2", function="difference", **LAYERS, operation_links=links(parent=[3])
            ),
        ],
        (NOTHING, RECTANGLE - FRAME, RECTANGLE - FRAME),
    ),
    "laid on two lines": Case([drawn(1, 4, (11,)), laid_by(2, 1)], (ON_BOTH, NOTHING, NOTHING)),
    "mirrored and stretched": Case(
        [drawn(1, 4, (11,)), laid_by(2, 1, 7, shift=1, **STRETCHED, scalex=2.0, scaley=-0.5)],
        (NOTHING, affinity.affine_transform(FRAME, [2, 0, 0, -0.5, 0, 0]), NOTHING),
    ),
    "frozen": Case([operation(1, "Freeze", generic=FROZEN)], (NOTHING, FRAME, NOTHING)),
}


def saved(folder: Path, text: str, name: str = "hinge.cad") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def off(region: Region, judge: shapely.Geometry) -> float:
    """How far two areas are apart: what only one has, over the length of their edges, mm."""
    ours = shapely.union_all([region.shapely(1e-5)])
    return float((ours ^ judge).area / max(ours.length, judge.length))


@pytest.mark.parametrize("name", CASES)
def test_every_layer_is_that_of_shapely_on_the_raw_coordinates(name: str, tmp_path: Path) -> None:
    operations, judge = CASES[name]
    path = saved(tmp_path, design(operations, SKETCHES))
    last = len(operations)
    for number, geometry in enumerate(judge, 1):
        if geometry.is_empty:
            with pytest.raises(DesignError, match=f"layer {number} has no area"):
                cad_layer(path, f"{last}/{number}")
        else:
            region, _ = cad_layer(path, f"{last}/{number}")
            assert off(region, geometry) < 1e-4


def test_circles_and_offsets_are_true_arcs(tmp_path: Path) -> None:
    path = saved(tmp_path, design([drawn(1, 2), drawn(2, 1), widened(3, 2, 2.0)], SKETCHES))
    region, _ = cad_layer(path, "1/1")
    assert region.area == pytest.approx(25 * math.pi, rel=1e-12)
    region, remarks = cad_layer(path, "3/1")
    assert region.area == pytest.approx(42 * 32 + 2 * 2 * (42 + 32) + 4 * math.pi, rel=1e-12)
    assert sum(isinstance(edge, Arc) for edge in region.edges) == 4
    # Four chords to a quarter: 2 mm less their sagitta at an eighth of it.
    sagitta = 2 * (1 - math.cos(math.pi / 16))
    assert f"4 chords in a quarter of a circle, up to {sagitta:.2g} mm inside" in remarks[0]


def test_a_design_within_is_laid_by_its_line(tmp_path: Path) -> None:
    inner = design([drawn(21, 4, (11,)), widened(22, 21, 1.0)], SKETCHES)
    outer = operation(
        1,
        "TransformExternal",
        shift=0,
        flip="false",
        design_links="{subdesign: [99]}",
        sketch_links="{sketch_to: [6]}",
        subopref="!!python/tuple [22, 0]",
        sub_sketch_id=5,
        operation_links="{}",
    )
    path = saved(tmp_path, design([outer], SKETCHES, f"{{99: {inner}}}"))
    region, remarks = cad_layer(path, "1/1")
    judge = [
        laid(wide(FRAME, 1.0), math.pi / 2, 1.5, 1, 1),
        laid(wide(FRAME, 1.0), SLOPE, REACH / 2, -30, 2),
    ]
    assert off(region, shapely.union_all(judge)) < 1e-4
    assert any(
        line.startswith("hinge.cad, operation 1 (TransformExternal), design") for line in remarks
    )


ROWS = "file,role,layer\nhinge.cad,base,film/1\nhinge.cad,chamber-mask,4/2\nhinge.cad,cap,film/3\n"
CHAMBERS = "name,x,y,mouth_x,mouth_y,angle,width\npouch,0,0,0,24,90,2\n"
TAB = shape("GenericTwoPointRect", (-2.0, 10.0), (2.0, 24.0))
BOTH = (drawn(2, 8, (12,)), drawn(3, 9, (12,)), combined(4, "union", [2, 3], []))
POUCH = design(
    [drawn(1, 1, name="film"), *BOTH],
    {
        1: sketch("plate", PLATE, TAB),
        8: sketch("pocket", shape("GenericTwoPointRect", (-20.0, -15.0), (20.0, 15.0))),
        9: sketch("strip", shape("GenericTwoPointRect", (-1.0, 10.0), (1.0, 24.5))),
    },
)


def pouch(folder: Path, text: str = POUCH, rows: str = ROWS) -> Path:
    source = folder / "cad pouch"
    source.mkdir()
    saved(source, text)
    (source / "layers.csv").write_text(rows)
    (source / "chambers.csv").write_text(CHAMBERS)
    return source


def test_a_table_of_its_layers_makes_it_a_laminate(importing: Importing, tmp_path: Path) -> None:
    source = pouch(tmp_path)
    made = write_imported(import_table(source), tmp_path / "again.toml", source.name)
    areas = [layer.profile.area for layer in made.laminate.layers]
    film = 42 * 32 + 4 * 8
    assert areas == pytest.approx([film, 40 * 30 + 2 * 9.5, film], rel=1e-12)
    said = json.loads(importing(source, "--json").stdout)["remarks"]
    assert (
        "hinge.cad, operation 1 (film), layer 1: rigid, 0.05 mm there; the table and the kit say"
        in said[0]
    )


def test_a_design_alone_says_what_is_missing_and_what_is_not_read(
    importing: Importing, tmp_path: Path
) -> None:
    joint = operation(3, "JointOperation3", operation_links=links(parent=[2]))
    path = saved(tmp_path, design([drawn(1, 1), widened(2, 1, 1.0), joint], SKETCHES))
    said = importing(path).output
    assert "hinge.cad has 3 layers but not their roles; write layers.csv" in said
    assert '"hinge.cad,ROLE,OPERATION/NUMBER"' in said
    assert "operations that are not read: 3 (JointOperation3)" in said


SIMPLIFIED = operation(2, "Simplify2", operation_links=links(parent=[1]))
HOLED_BY = operation(1, "HoleOperation", "holes", operation_links="{}")
UNREAD: dict[str, list[str]] = {
    "hinge.cad, operation 2 (Simplify2): operations of class Simplify2 are not supported": [
        *(drawn(1, 1), SIMPLIFIED)
    ],
    # What rests on it is named by what it rests on.
    "hinge.cad, operation 1 (holes): operations of class HoleOperation are not supported": [
        *(HOLED_BY, combined(2, "union", [1], []))
    ],
    "refers to operation 2, which does not": [combined(1, "union", [2], []), drawn(2, 1)],
    "operation 1 (SimpleSketchOp) refers to a missing sketch": [drawn(1, 77)],
    "operation 1 (SimpleSketchOp) is damaged; save the design again": [
        drawn(1, 1).replace("sketch: [1]", "sketch: 1")
    ],
    "sketch bow, shape 1 is a polygon with Self-intersection[2 2]": [drawn(1, 32)],
    "operation 1 (SimpleSketchOp), layer 1 has contours that touch at x 4.0000, y 4.0000": [
        drawn(1, 35)
    ],
    "operation 3 (LaminateOperation2) takes the difference of lines that meet": [
        *(drawn(1, 3), drawn(2, 6), combined(3, "difference", [1], [2]))
    ],
    "scales arcs by 1.5 along its line and 0.5 across it, but ellipses are not supported": [
        *(drawn(1, 2), laid_by(2, 1, transformtype_y="custom", scaley=0.5))
    ],
}
ODD = {
    32: sketch("bow", shape("GenericPoly", (0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0))),
    35: sketch(
        "corners",
        shape("GenericTwoPointRect", (0.0, 0.0), (4.0, 4.0)),
        shape("GenericTwoPointRect", (4.0, 4.0), (9.0, 9.0)),
    ),
}


@pytest.mark.parametrize("sentence", UNREAD)
def test_what_is_not_read_is_named_at_its_place(
    sentence: str, importing: Importing, tmp_path: Path
) -> None:
    operations = UNREAD[sentence]
    rows = ROWS.replace("film/", f"{len(operations)}/").replace("4/2", "1/2")
    source = pouch(tmp_path, design(operations, SKETCHES | ODD), rows)
    assert sentence in importing(source).output


def test_values_put_in_at_random_are_refused_or_read(tmp_path: Path) -> None:
    draw = random.Random(7)
    places = [found.span(1) for found in re.finditer(r": (\[?[^\s,\[\]{}]+)[,}\]]", POUCH)]
    values = ("null", "[]", "{}", "1.5", "-3", ".nan", "x", "2001-01-01", "!!python/tuple [1]")
    refused = 0
    for _ in range(80):
        start, end = draw.choice(places)
        path = saved(tmp_path, POUCH[:start] + draw.choice(values) + POUCH[end:])
        try:
            cad_layer(path, f"{draw.randint(1, 4)}/{draw.randint(1, 3)}")
        except DesignError:
            refused += 1
    assert 10 < refused < 80


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (POUCH.replace("{_basename", "{{_basename", 1), "is not valid YAML for popupCAD"),
        ("layers: []", "hinge.cad is not a popupCAD design"),
    ],
)
def test_a_damaged_design_is_refused(
    text: str, sentence: str, importing: Importing, tmp_path: Path
) -> None:
    assert sentence in importing(pouch(tmp_path, text)).output


def test_no_object_is_made_and_no_code_is_run(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    evil = f"!!python/object/apply:os.mkdir ['{mark}']"
    path = saved(tmp_path, POUCH.replace("subdesigns: {}", f"subdesigns: {evil}"))
    region, _ = cad_layer(path, "film/1")
    assert region.area == pytest.approx(42 * 32 + 4 * 8)
    assert not mark.exists()


@pytest.mark.parametrize(
    ("layer", "sentence"),
    [
        ("1", "layer '1' of hinge.cad is not OPERATION/NUMBER"),
        (
            "lid/1",
            "'lid/1' of hinge.cad is not OPERATION/NUMBER; the operation is a number from 1 to 4",
        ),
        ("film/9", "hinge.cad has no layer '9'; its layers are 1 to 3"),
        ("9/1", "the operation is a number from 1 to 4"),
    ],
)
def test_a_layer_that_is_not_there_is_refused(
    layer: str, sentence: str, importing: Importing, tmp_path: Path
) -> None:
    assert sentence in importing(pouch(tmp_path, rows=ROWS.replace("film/1", layer))).output
