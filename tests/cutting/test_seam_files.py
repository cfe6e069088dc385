"""Files of seam paths: read by ezdxf and back, and refused where they hold anything else."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import ezdxf
import pytest
from ezdxf import path as dxf_path

from sbafab.actuators import build, load_design
from sbafab.cutting.properties import CutSettings
from sbafab.cutting.seam_files import (
    path_difference,
    read_seam,
    seam_path,
    stated_width,
    write_seam_files,
)
from sbafab.errors import OutputError
from sbafab.geometry.edges import Edge, Line, Point, edge_from_bulge
from sbafab.geometry.region import disc
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Laminate

SETTINGS = CutSettings("folded", "0" * 64, "sbafab")
CHAIN = (
    Line((0.0, 0.0), (10.0, 0.0)),
    edge_from_bulge((10.0, 0.0), (10.0, 5.0), math.tan(math.pi / 8)),
)
"""A line, and a quarter of a circle."""
ROUND = disc((20.0, 3.0), 2.0).outers[0].edges


def with_path(*chains: tuple[Edge, ...]) -> tuple[Laminate, Seam]:
    """The template of a folded film, its first seam along other chains."""
    laminate = build(load_design("folded"))
    seam = replace(laminate.seams[0], path=chains)
    return replace(laminate, seams=(seam,)), seam


def written(folder: Path, *chains: tuple[Edge, ...]) -> Path:
    laminate, seam = with_path(*chains)
    write_seam_files(laminate, folder, SETTINGS)
    return folder / seam_path(seam)


def ends_of(flat: list[Point]) -> tuple[Point, Point]:
    return flat[0], flat[-1]


def test_an_open_path_ends_where_it_ends_and_a_round_one_where_it_began(tmp_path: Path) -> None:
    """As ezdxf reads them: two polylines on SEAM, of the lengths of their lines and arcs."""
    document = ezdxf.readfile(written(tmp_path, CHAIN, ROUND))  # type: ignore[attr-defined]
    runs = list(document.modelspace().query('LWPOLYLINE[layer=="SEAM"]'))
    assert [run.closed for run in runs] == [False, True]
    flats = [[(p.x, p.y) for p in dxf_path.make_path(run).flattening(1e-4)] for run in runs]
    assert ends_of(flats[0]) == (pytest.approx((0.0, 0.0)), pytest.approx((10.0, 5.0)))
    lengths = [sum(map(math.dist, flat, flat[1:])) for flat in flats]
    # The arc over a chord of 5 mm with a quarter of a turn has a radius of 5 / sqrt(2).
    assert lengths[0] == pytest.approx(10 + math.pi / 2 * 5 / math.sqrt(2), abs=0.001)
    assert lengths[1] == pytest.approx(2 * math.pi * 2, abs=0.002)
    assert document.audit().errors == []


def test_a_seam_is_read_back_as_its_path(tmp_path: Path) -> None:
    path = written(tmp_path, CHAIN, ROUND)
    chains, properties = read_seam(path)
    assert path_difference(chains, (CHAIN, ROUND)) is None
    assert stated_width(properties) == 2.0
    assert properties["ORDER"] == "1"


def test_a_shorter_turned_or_second_path_is_another() -> None:
    line, short = Line((0.0, 0.0), (10.0, 0.0)), Line((0.0, 0.0), (9.0, 0.0))
    turned = Line((10.0, 0.0), (0.0, 0.0))
    assert "1.000 mm off at x 10.000, y 0.000" in str(path_difference(((short,),), ((line,),)))
    assert "1.000 mm off" in str(path_difference(((line,),), ((short,),)))
    assert "10.000 mm off" in str(path_difference(((turned,),), ((line,),)))
    assert path_difference(((line,), (short,)), ((line,),)) == "it has 2 paths, not 1"


def test_a_file_that_holds_more_or_no_path_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, CHAIN)
    more = "it holds more than a path on SEAM; remove what is on ENGRAVE"
    for layer, words in (("ENGRAVE", more), ("REFERENCE", "it has no path on SEAM")):
        document = ezdxf.readfile(path)  # type: ignore[attr-defined]
        for run in document.modelspace().query("LWPOLYLINE"):
            run.dxf.layer = layer
        other = tmp_path / f"{layer}.dxf"
        document.saveas(other)
        with pytest.raises(OutputError, match=words):
            read_seam(other)
