"""Every judge sees the fault that is its own, and says nothing of sound folders."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import ezdxf
import pytest
import shapely
import tomli_w
from ezdxf import bbox
from shapely import Point, Polygon, affinity, box
from shapely.geometry.base import BaseGeometry

from tests.judge import reading
from tests.judge.bonds import judge_bonds, judge_facing
from tests.judge.campaign import judged
from tests.judge.claims import judge_claims, judge_pockets
from tests.judge.drafts import blob
from tests.judge.folder import Folder, closed_by, open_folder, pieces
from tests.judge.overhangs import judge_overhangs
from tests.judge.pins import judge_pins
from tests.judge.pressing import judge_press
from tests.judge.sheets import judge_sheets
from tests.judge.using import sbafab
from tests.judge.voids import judge_voids
from tests.quick import few

# Faults put into a folder that the program wrote, without any function of it.

Box = tuple[float, float, float, float]
Change = Callable[[BaseGeometry], BaseGeometry]


class Patient:
    """A copy of a written folder; layers are counted from 1."""

    def __init__(self, folder: Path, design: Path) -> None:
        self.folder = folder
        self.design = design

    def opened(self) -> Folder:
        return open_folder(self.folder, self.design)

    def layer_file(self, layer: int) -> Path:
        entries = json.loads((self.folder / "manifest.json").read_text())["layers"]
        return self.folder / str(entries[layer - 1]["file"])

    def redraw(self, layers: Iterable[int], change: Change) -> None:
        """The layers' cut paths, changed."""
        folder = self.opened()
        for layer in layers:
            draw(self.layer_file(layer), change(folder.layers[layer - 1].path))

    def edit(self, name: str, change: Callable[[Any], object]) -> None:
        """A JSON file as ``change`` leaves it."""
        path = self.folder / name
        content = json.loads(path.read_text(encoding="utf-8"))
        change(content)
        path.write_text(json.dumps(content), encoding="utf-8")

    def edit_dxf(self, name: str, change: Callable[[Any], object]) -> None:
        """A DXF file's model space as ``change`` leaves it."""
        document = ezdxf.readfile(self.folder / name)
        change(document.modelspace())
        document.saveas(self.folder / name)


def draw(path: Path, region: BaseGeometry) -> None:
    """A cut file of the region, in straight lines."""
    document = ezdxf.new("R2010", units=4)
    space = document.modelspace()
    for part in pieces(region):
        add_part(space, part)
    document.saveas(path)


def add_part(space: Any, part: Polygon) -> None:
    space.add_lwpolyline(part.exterior.coords[:-1], close=True, dxfattribs={"layer": "CUT_OUTER"})
    for ring in part.interiors:
        space.add_lwpolyline(ring.coords[:-1], close=True, dxfattribs={"layer": "CUT_INNER"})


def parts_of(space: Any) -> list[tuple[Box, list[Any]]]:
    """The parts of a sheet: each one's extent, and its outline and holes."""
    outlines = [e for e in space if e.dxf.layer == "CUT_OUTER"]
    holes = [e for e in space if e.dxf.layer == "CUT_INNER"]
    found = []
    for outline in outlines:
        extent = extent_of(outline)
        inside = shapely.box(*extent)
        mine = [hole for hole in holes if inside.contains(shapely.box(*extent_of(hole)))]
        found.append((extent, [outline, *mine]))
    return found


def extent_of(entity: Any) -> Box:
    """Lowest and highest x and y."""
    low, high = bbox.extents([entity])
    return low.x, low.y, high.x, high.y


def shift(entities: Iterable[Any], x: float, y: float) -> None:
    for entity in entities:
        entity.translate(x, y, 0)


def moved_hole(region: BaseGeometry, number: int, x: float, y: float) -> BaseGeometry:
    """The first piece's hole of that number, moved."""
    first, *others = pieces(region)
    holes = list(first.interiors)
    holes[number] = affinity.translate(holes[number], x, y)
    return shapely.MultiPolygon([Polygon(first.exterior, holes), *others])


def without_hole(region: BaseGeometry, number: int) -> BaseGeometry:
    """The first piece with its hole of that number filled."""
    first, *others = pieces(region)
    holes = [hole for i, hole in enumerate(first.interiors) if i != number]
    return shapely.MultiPolygon([Polygon(first.exterior, holes), *others])


# Folders, and the faults.


RULES = {"yield_builds": 100, "worst_bond_width": 0, "worst_mask_overhang": 0}
BLOB = blob(Random(2), 2.2, 3.0)
DESIGNS: dict[str, dict[str, Any]] = {
    # Layers: 1 base, 2 pocket, 3 wall, 4 separator, 5 wall, 6 pocket, 7 wall ... 11 cap.
    "stack": {"family": "1dof", "stack": {"balloons": 3}},
    "pinned": {
        "family": "lobed",
        "stack": {"balloons": 2},
        "registration": {"method": "ears"},
        "laser": {"kerf_tpe": [0.12, 0.1], "kerf_ptfe": 0.08},
    },
    "drawn": {"family": "1dof", "stack": {"balloons": 2}, "chamber": {"outline": "pocket.svg"}},
}


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Patient]:
    """One folder a design, as the program writes it."""
    home = tmp_path_factory.mktemp("sound")
    made = {}
    (home / "pocket.svg").write_text(BLOB.text)
    for name, tables in DESIGNS.items():
        design = home / f"{name}.toml"
        design.write_text(tomli_w.dumps({"name": name, **tables, "rules": RULES}))
        for command in ("cut", "press"):
            ended = sbafab(command, design, "-o", home / "out")
            assert ended.code == 0, ended.said
        made[name] = Patient(home / "out" / name, design)
    return made


def on_sheets(folder: Folder) -> Iterator[str]:
    return judge_sheets([folder], folder.path, folder.manifest["sheets"])


def of_blob(folder: Folder) -> Iterator[str]:
    return judge_pockets(folder, [BLOB.pocket] * 2)


@pytest.mark.parametrize("name", few(DESIGNS, 2))
def test_sound_folders_are_left_alone(sound: dict[str, Patient], name: str) -> None:
    drawn = [BLOB.pocket] * 2 if name == "drawn" else None
    assert judged(sound[name].opened(), drawn) == []


def test_the_judge_counts_shapes_alike_when_it_forgets_drawings(
    sound: dict[str, Patient], monkeypatch: pytest.MonkeyPatch
) -> None:
    shapes = [layer.shape for layer in sound["stack"].opened().layers]
    monkeypatch.setattr(reading, "MOST_KEPT", 1)
    monkeypatch.setattr(reading, "_READ", {})
    assert [layer.shape for layer in sound["stack"].opened().layers] == shapes


def test_a_beam_leaves_an_elliptic_fillet_in_a_corner() -> None:
    notched = box(0, 0, 4, 4) - box(2, 2, 4, 4)
    left = (closed_by(notched, (0.1, 0.2)) - notched).area
    assert left == pytest.approx((1 - math.pi / 4) * 0.05 * 0.1, rel=0.02)


class Fault(NamedTuple):
    """What is done to a folder, and what its judge must say."""

    harm: Callable[[Patient], object]
    judge: Callable[[Folder], Iterator[str]]
    said: str
    patient: str = "stack"


Harm = Callable[[Patient], object]


def redraw(layer: int, change: Change) -> Harm:
    return lambda patient: patient.redraw([layer], change)


def edit(name: str, change: Callable[[Any], object]) -> Harm:
    """A change of a JSON file, or of a DXF file's model space."""
    return lambda patient: (patient.edit_dxf if ".dxf" in name else patient.edit)(name, change)


def step(number: int, **keys: object) -> Harm:
    return edit("press.json", lambda press: press["steps"][number].update(keys))


def claim(rows: str, row: int, **areas: float) -> Harm:
    return edit("manifest.json", lambda manifest: manifest[rows][row].update(areas))


def _shrunk_middle(patient: Patient) -> None:
    """The middle balloon becomes a smaller one, and so do the masks on either side of it."""
    patient.redraw([5, 7], lambda film: film & AXIS.buffer(2.6))
    patient.redraw([4, 8], lambda mask: mask & AXIS.buffer(2.9))


def _bridge(region: BaseGeometry) -> BaseGeometry:
    """Two pockets of a lobed balloon joined."""
    one, other = (part.centroid for part in list(region.geoms)[:2])
    return region | Polygon(
        [(one.x, one.y), (other.x, other.y), (other.x + 0.4, other.y), (one.x + 0.4, one.y)]
    )


def _swapped(manifest: dict[str, Any]) -> None:
    below, above = manifest["layers"][4], manifest["layers"][5]
    below["file"], above["file"] = above["file"], below["file"]


def _first_part_off(space: Any) -> None:
    for entity in parts_of(space)[0][1]:
        space.delete_entity(entity)


def _parts_near(space: Any) -> None:
    """The second part beside the first, nearer than 1 mm."""
    (one, _), (other, entities) = parts_of(space)[:2]
    shift(entities, one[2] - other[0] + 0.9, one[1] - other[1])


def _into_border(space: Any) -> None:
    extent, entities = parts_of(space)[0]
    shift(entities, 0.0, 9.99 - extent[1])


def _plate_hole_off(space: Any) -> None:
    hole = next(e for e in space if e.dxftype() == "CIRCLE" and e.dxf.layer == "CUT_INNER")
    hole.translate(0.05, 0, 0)


INNER, ENGRAVED = {"layer": "CUT_INNER"}, {"layer": "ENGRAVE"}
AXIS = Point(0, 0)
FIXTURE, TPE, PTFE = "sheets/fixture.dxf", "sheets/TPE_1.dxf", "sheets/PTFE_1.dxf"
MORE = Polygon([(120, 120), (126, 120), (126, 126), (120, 126)])
FAULTS = {
    "films that meet past a smaller balloon": Fault(_shrunk_middle, judge_facing, "films 3 and 9"),
    "a layer in another's place": Fault(
        edit("manifest.json", _swapped), judge_bonds, "nothing bonds at interface 3"
    ),
    "a narrowed ring": Fault(
        redraw(6, lambda m: m.buffer(0.01)), judge_bonds, "interface 3 is 0.7397"
    ),
    "a narrowed neck": Fault(
        redraw(4, lambda m: m.buffer(0.01)), judge_bonds, "interface 2 is 0.7397"
    ),
    "a missing mask": Fault(redraw(4, lambda m: m & box(2, 2, 9, 9)), judge_bonds, "no bore"),
    "a bond where none belongs": Fault(
        redraw(4, lambda m: m - Point(0, 2.4).buffer(0.5)), judge_bonds, "where there is no bore"
    ),
    "a short overhang": Fault(
        redraw(8, lambda m: m & AXIS.buffer(3.74, 256)),
        judge_overhangs,
        "interface 4 the mask reaches only 0.49",
    ),
    "a bore without overhang": Fault(
        redraw(5, lambda film: film.buffer(0.02)),
        judge_overhangs,
        "past the edge of film 5",
        "pinned",
    ),
    "merged pockets": Fault(redraw(6, _bridge), judge_voids, "pockets", "pinned"),
    "a closed bore": Fault(
        redraw(5, lambda film: without_hole(film, 0)),
        judge_voids,
        "no inlet reaches the pocket at interface 3",
    ),
    "a leak": Fault(
        redraw(6, lambda mask: mask | box(-5, 1.0, 0, 1.5)), judge_voids, "leaks to the outside"
    ),
    "no inlet": Fault(redraw(2, lambda mask: mask & AXIS.buffer(2.6)), judge_voids, "0 inlets"),
    "a narrow inlet": Fault(
        redraw(2, lambda mask: mask - box(2.4, 0.5, 20, 2)), judge_voids, "the tube takes"
    ),
    "a shifted tooling hole": Fault(
        redraw(1, lambda film: moved_hole(film, -1, 0.05, 0)), judge_pins, "layer 1", "pinned"
    ),
    "a hole of the plate off its place": Fault(
        edit(FIXTURE, _plate_hole_off), judge_pins, "no hole for pin"
    ),
    "a hole of the plate for nothing": Fault(
        edit(FIXTURE, lambda space: space.add_circle((1, 1), 0.75, dxfattribs=INNER)),
        judge_pins,
        "hole for no pin",
    ),
    "a film across a pin": Fault(
        redraw(7, lambda film: without_hole(film, 0)), judge_pins, "stands in layer 7"
    ),
    "pins that are out": Fault(step(0, pins=[]), judge_pins, "0 pins hold a piece of layer"),
    "a missing part": Fault(edit(TPE, _first_part_off), on_sheets, "the sheets lack 1"),
    "a part of no layer": Fault(
        edit(TPE, lambda space: add_part(space, MORE)), on_sheets, "no piece of a layer"
    ),
    "parts too near": Fault(edit(TPE, _parts_near), on_sheets, "apart at"),
    "a part in the border": Fault(edit(PTFE, _into_border), on_sheets, "in the border"),
    "a stray line": Fault(
        edit(TPE, lambda space: space.add_line((0, 0), (150, 150), dxfattribs=ENGRAVED)),
        on_sheets,
        "crosses a part",
    ),
    "a layer that the sheets do not cut": Fault(
        redraw(5, lambda film: film.buffer(0.01)), on_sheets, "no piece of a layer", "pinned"
    ),
    "a wrong area": Fault(claim("layers", 2, area=30.0), judge_claims, "layer 3 has"),
    "a wrong bond area": Fault(
        claim("interfaces", 1, bond_area=1.0), judge_claims, "the bond of interface 2"
    ),
    "kerf that was not compensated": Fault(
        redraw(3, lambda film: film.buffer(-0.05)), judge_claims, "layer 3 has", "pinned"
    ),
    "a layer that is never added": Fault(step(1, adds=[]), judge_press, "layer 1 is added 0 times"),
    "an upper layer before a lower one": Fault(
        step(0, adds=[3, 2], layers=[3, 2]), judge_press, "lower before upper"
    ),
    "a missing step": Fault(
        edit("press.json", lambda press: press["steps"].pop()),
        judge_press,
        "not a full bond of the whole",
    ),
    "a pocket turned over": Fault(
        redraw(6, lambda m: affinity.scale(m, 1, -1, origin=(0, 0))),
        of_blob,
        "of what was drawn",
        "drawn",
    ),
    "a pocket of another size": Fault(
        redraw(6, lambda m: affinity.scale(m, 1.01, 1.01, origin=(0, 0))),
        of_blob,
        "has more by",
        "drawn",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_seen_by_its_judge(name: str, sound: dict[str, Patient], tmp_path: Path) -> None:
    harm, judge, said, made = FAULTS[name]
    patient = Patient(tmp_path / "copy", sound[made].design)
    shutil.copytree(sound[made].folder, patient.folder)
    harm(patient)
    found = list(judge(patient.opened()))
    assert any(said in sentence for sentence in found), found
