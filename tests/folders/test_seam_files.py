"""Seam paths in files of their own: read back, verified, measured as made, read by others."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import ezdxf
import pytest
import tomli_w
from ezdxf import path as dxf_path
from ezdxf.document import Drawing

from sbafab.actuators import build, load_design
from sbafab.api import check_folder, generate, press
from sbafab.cutting.cut_settings import CutSettings
from sbafab.cutting.layer_files import path_difference, read_seam, write_seam_files
from sbafab.folders.check import read_folder, rules_as_cut
from sbafab.geometry.edges import Line, edge_from_bulge
from sbafab.geometry.region import disc
from sbafab.rules.finding import Finding
from tests.designs import tables
from tests.folders.doctoring import Doctor


@pytest.fixture(scope="module")
def welded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of a welded pouch."""
    folder = tmp_path_factory.mktemp("welded")
    data = tables("welded")
    # A small arc at one corner: seams keep true arcs.
    path = data["seams"][0]["path"]
    path[3:4] = [[-20, -18, math.tan(math.pi / 8)], [-18, -20]]
    design = folder / "welded.toml"
    design.write_text(tomli_w.dumps(data), encoding="utf-8")
    out = generate(design, out=folder / "out").folder
    return {
        path.relative_to(out).as_posix(): path.read_bytes()
        for path in out.rglob("*")
        if path.is_file()
    }


def laid_out(files: dict[str, bytes], folder: Path) -> Path:
    for name, data in files.items():
        path = folder / "welded" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    return folder / "welded"


SEAM_FILE = "layers/seam_001_rim.dxf"


def failures(folder: Path) -> dict[str, Finding]:
    return {f.rule: f for f in check_folder(folder) if f.verdict == "fail"}


def test_a_seam_file_is_read_by_others_with_its_arc(
    welded: dict[str, bytes], tmp_path: Path
) -> None:
    folder = laid_out(welded, tmp_path)
    assert failures(folder) == {}
    document = ezdxf.readfile(folder / SEAM_FILE)
    assert not document.audit().errors
    assert document.layers.get("SEAM").dxf.color == 3
    (path,) = document.modelspace().query('LWPOLYLINE[layer=="SEAM"]')
    assert not path.closed
    bulges = [bulge for *_, bulge in path.get_points("xyb") if bulge]
    assert bulges == pytest.approx([math.tan(math.pi / 8)])
    (claim,) = json.loads(welded["manifest.json"])["seams"]
    assert claim["file"] == SEAM_FILE
    # Seven straight runs less two times 2 mm at the round corner, and a quarter circle of 2 mm.
    assert claim["length"] == pytest.approx(176 - 4 + math.pi)
    press = json.loads(welded["press.json"])
    assert press["steps"] == []
    assert [(seam["seam"], seam["width_mm"]) for seam in press["seams"]] == [("rim", 1.0)]


def moved(document: Drawing, dx: float) -> None:
    """Move the right-hand side of the path."""
    (path,) = document.modelspace().query('LWPOLYLINE[layer=="SEAM"]')
    path.set_points(
        [(x + (dx if x > 19 else 0), y, *rest) for x, y, *rest in path.get_points("xyseb")],
        format="xyseb",
    )


def resave(folder: Path, change: Callable[[Drawing], None]) -> None:
    document = ezdxf.readfile(folder / SEAM_FILE)
    change(document)
    document.saveas(folder / SEAM_FILE)


def test_bonds_are_measured_on_the_seam_as_it_is_drawn(
    welded: dict[str, bytes], tmp_path: Path
) -> None:
    folder = laid_out(welded, tmp_path)
    # The middle of the tool runs 0.2 mm inside the film's edge at x = 23: 0.7 mm of it bond.
    resave(folder, lambda document: moved(document, 2.8))
    built = read_folder(folder)
    bond = next(f for f in rules_as_cut(built) if f.rule == "bond-width")
    assert (bond.verdict, bond.measured) == ("fail", pytest.approx(0.7, abs=1e-6))


def test_a_seam_file_saved_anew_is_a_warning(welded: dict[str, bytes], tmp_path: Path) -> None:
    folder = laid_out(welded, tmp_path)
    resave(folder, lambda document: None)
    assert failures(folder) == {}
    told = [f.message for f in check_folder(folder) if f.rule == "manifest-claims"]
    assert told[0] == f"saved anew by another program, same cuts to 1 um: {SEAM_FILE}"
    resave(folder, lambda document: moved(document, 0.002))
    assert set(failures(folder)) == {"manifest-claims", "as-designed"}


def test_a_path_that_is_moved_or_ends_early_is_found(
    welded: dict[str, bytes], tmp_path: Path
) -> None:
    folder = laid_out(welded, tmp_path)
    resave(folder, lambda document: moved(document, 0.3))
    found = failures(folder)
    assert "manifest-claims" in found
    assert "seam rim is not what design.toml makes: its path is 0.300 mm off" in (
        found["as-designed"].message
    )

    def shortened(document: Drawing) -> None:
        (path,) = document.modelspace().query('LWPOLYLINE[layer=="SEAM"]')
        path.set_points(path.get_points()[:-1])

    folder = laid_out(welded, tmp_path)
    resave(folder, shortened)
    assert "leaks to the outside" in failures(folder)["sealing"].message


SPOILED: list[tuple[Callable[[Drawing], object], str]] = [
    (
        lambda d: d.modelspace().add_circle((0, 0), 1, dxfattribs={"layer": "CUT_OUTER"}),
        "holds more than a path on SEAM",
    ),
    (
        lambda d: [d.modelspace().delete_entity(e) for e in d.modelspace().query("LWPOLYLINE")],
        "has no path on SEAM",
    ),
    (lambda d: d.header.__setitem__("$INSUNITS", 1), "not in millimetres"),
]


@pytest.mark.parametrize(("spoil", "words"), SPOILED)
def test_an_unsound_seam_file_is_named(
    spoil: Callable[[Drawing], object], words: str, welded: dict[str, bytes], tmp_path: Path
) -> None:
    folder = laid_out(welded, tmp_path)
    resave(folder, lambda document: (spoil(document), None)[1])
    found = failures(folder)
    assert words in found["file-integrity"].message


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("TOOL", "laser"),
        ("DESIGN_SHA256", "0" * 64),
        ("TOOL_OFFSET", "1, 2"),
        ("LAYERS", "2, 3"),
        ("ORDER", "2"),
        ("SEAM", "other"),
        ("KIND", "fin"),
        ("UNITS", "inch"),
    ],
)
def test_what_a_seam_file_states_is_held_against_the_design(
    name: str, value: str, welded: dict[str, bytes], tmp_path: Path
) -> None:
    """With the manifest's hash of the file put right."""
    doctor = Doctor(laid_out(welded, tmp_path))

    def change(document: Drawing) -> None:
        properties = document.header.custom_vars
        assert properties.get(name) != value
        properties.remove(name, all=True) if properties.has_tag(name) else None
        properties.append(name, value)

    resave(doctor.folder, lambda document: None)
    doctor.rehash()
    assert failures(doctor.folder) == {}
    resave(doctor.folder, change)
    doctor.rehash()
    found = failures(doctor.folder)
    assert set(found) == {"manifest-claims"}
    assert f"{SEAM_FILE}): custom property {name} is {value!r}, not" in (
        found["manifest-claims"].message
    )


def test_a_missing_file_and_another_width_are_named(
    welded: dict[str, bytes], tmp_path: Path
) -> None:
    folder = laid_out(welded, tmp_path)
    narrow = welded[SEAM_FILE].replace(
        b"TOOL_WIDTH\n  9\n$CUSTOMPROPERTY\n  1\n1\n",
        b"TOOL_WIDTH\n  9\n$CUSTOMPROPERTY\n  1\n0.5\n",
    )
    assert narrow != welded[SEAM_FILE]
    (folder / SEAM_FILE).write_bytes(narrow)
    found = failures(folder)
    assert found["bond-width"].measured == pytest.approx(0.5, abs=1e-6)
    (folder / SEAM_FILE).unlink()
    assert SEAM_FILE in failures(folder)["file-integrity"].message


def test_seams_stay_listed_when_another_part_is_written(
    welded: dict[str, bytes], tmp_path: Path
) -> None:
    folder = laid_out(welded, tmp_path)
    press(folder / "design.toml", out=tmp_path)
    (claim,) = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["seams"]
    assert claim["file"] == SEAM_FILE
    assert failures(folder) == {}


def test_an_open_path_ends_where_it_ends_and_a_round_one_where_it_began(tmp_path: Path) -> None:
    """As ezdxf reads them: two polylines on SEAM, of the lengths of their lines and arcs."""
    quarter = edge_from_bulge((10.0, 0.0), (10.0, 5.0), math.tan(math.pi / 8))
    chains = (Line((0.0, 0.0), (10.0, 0.0)), quarter), disc((20.0, 3.0), 2.0).outers[0].edges
    laminate = build(load_design("folded"))
    laminate = replace(laminate, seams=(replace(laminate.seams[0], path=chains),))
    write_seam_files(laminate, tmp_path, CutSettings("folded", "0" * 64, "sbafab"))
    (path,) = tmp_path.rglob("seam_*.dxf")
    assert path_difference(read_seam(path)[0], chains) is None
    document = ezdxf.readfile(path)
    assert document.audit().errors == []
    runs = list(document.modelspace().query('LWPOLYLINE[layer=="SEAM"]'))
    assert [run.closed for run in runs] == [False, True]
    flats = [[(p.x, p.y) for p in dxf_path.make_path(run).flattening(1e-4)] for run in runs]
    assert flats[0][-1] == pytest.approx((10.0, 5.0))
    lengths = [sum(map(math.dist, flat, flat[1:])) for flat in flats]
    # The arc over a chord of 5 mm with a quarter of a turn has a radius of 5 / sqrt(2).
    expected = [10 + math.pi / 2 * 5 / math.sqrt(2), 2 * math.pi * 2]
    assert lengths == pytest.approx(expected, abs=0.002)
