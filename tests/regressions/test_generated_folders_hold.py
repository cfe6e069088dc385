"""Sound folders that the check of folders took for faulty ones: roles of openings, uneven kerfs."""

from __future__ import annotations

import math
from pathlib import Path

import ezdxf
import pytest

from sbafab.actuators import build, load_design
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.geometry.region import Region, disc
from sbafab.reports.traveller.lay_up import over_tab
from sbafab.rules.finding import Finding
from tests.folders.doctoring import Doctor
from tests.quick import few

FEW = ("rules.yield_builds=100", "registration.method=ears")
UNEVEN = ("laser.kerf_tpe=[0.12, 0.1]", "laser.kerf_ptfe=[0.08, 0.12]")
BONE = (
    "stack.balloons=1",
    "fillet.radius=1",
    "inlet.tab_length=0.001",
    "chamber.outline=bone.dxf",
    "chamber.count=4",
    "lumen.diameter=1.04",
    "rules.worst_bond_width=0",
    "rules.worst_mask_overhang=0",
    *UNEVEN,
)


def draw_bone(path: Path) -> None:
    """A closed spline, narrower in the middle than at its ends."""
    turns = [math.tau * n / 40 for n in range(40)]
    sizes = [3.2 + 1.1 * math.cos(2 * turn) for turn in turns]
    points = [(r * math.cos(t), r * math.sin(t), 0.0) for t, r in zip(turns, sizes, strict=True)]
    document = ezdxf.new("R2010", units=4)
    document.modelspace().add_spline([*points, points[0]])
    document.saveas(path)


@pytest.mark.parametrize(
    ("template", "settings"),
    few(
        [
            # A fillet wider than the tab takes its square corners: the ears were taken for tabs.
            ("3dof-15mm", ("stack.balloons=2", "fillet.radius=4")),
            # The window of the outer balloons is as wide as a tooling hole.
            ("radial-15mm", ("chamber.length=11.5",)),
            # The path round a concave corner does not tell the corner.
            ("3dof-15mm", BONE),
        ],
        2,
        names=2,
    ),
)
def test_what_was_written_holds_as_built(
    template: str, settings: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    draw_bone(Path("bone.dxf"))
    run = generate(RunRequest(load_design(template, [*FEW, *settings]), tmp_path, ("cut",)))
    assert not run.failed
    assert [f.message for f in check_folder(run.folder) if f.verdict == "fail"] == []


# A tab no longer than its fillet has no straight sides, and is an inlet all the same.


def test_a_tab_no_longer_than_its_fillet_is_found_as_built(tmp_path: Path) -> None:
    short = ["stack.balloons=2", "inlet.tab_length=1.0", "fillet.radius=1.0"]
    wide = ["chamber.width=25.5", "chamber.length=8", "tube.outer_diameter=47", "chamber.count=1"]
    film = "sheets.tpe.width=200"
    run = generate(RunRequest(load_design("radial-15mm", [*short, *wide, film]), tmp_path, ["cut"]))
    assert not run.failed
    assert [finding.rule for finding in check_folder(run.folder) if finding.verdict == "fail"] == []


def test_a_tab_that_its_fillet_takes_whole_is_found_as_built(tmp_path: Path) -> None:
    short = ["stack.balloons=1", "inlet.tab_length=1.0", "fillet.radius=2.561"]
    run = generate(
        RunRequest(load_design("1dof-5mm", [*short, "chamber.diameter=4.743"]), tmp_path, ["cut"])
    )
    assert not run.failed
    assert [finding.rule for finding in check_folder(run.folder) if finding.verdict == "fail"] == []


# Stacks whose parts differ: wider balloons above the tab, wide fillets between neighbours.


@pytest.mark.parametrize("above", [5.0, 10.0, 17.0])
def test_the_inlet_tab_never_bonds_to_the_balloon_above(above: float) -> None:
    sizes = ["stack.balloons=2", f"chamber.diameter=[5, {above}]"]
    _, separator, _ = build(load_design("1dof-5mm", sizes)).interfaces
    # The neck ring alone: bore 0.52, bond 0.75.
    assert separator.bond.area == pytest.approx(math.pi * (1.27**2 - 0.52**2))


@pytest.mark.parametrize("radius", [0.0, 1.0, 2.2, 3.0])
def test_a_fillet_joins_no_neighbouring_sbas(radius: float) -> None:
    # They stand 15.708 - 11.5 = 4.208 apart, less than two radii of the last two.
    laminate = build(load_design("radial-15mm", [f"fillet.radius={radius}"]))
    assert [len(layer.profile.pieces) for layer in laminate.layers] == [1, 3, 3, 3, 3]


# Masks that ended with the smaller neighbour let films weld past it; now the files are refused.


AXIS = (0.0, 0.0)


@pytest.fixture(scope="module")
def waisted(tmp_path_factory: pytest.TempPathFactory) -> Doctor:
    sizes = ["stack.balloons=3", "chamber.diameter=[8, 5, 8]", "name=waisted"]
    design = load_design("1dof-5mm", [*sizes, "rules.yield_builds=100"])
    generate(RunRequest(design, tmp_path_factory.mktemp("out"), ("cut",)))
    return Doctor(next(tmp_path_factory.getbasetemp().glob("out*/waisted")))


@pytest.mark.parametrize(
    ("sizes", "mask"), [([5, 5, 12], 8), ([8, 5, 8], None), ([5, 12, 5], 4), ([5, 5, 5], None)]
)
def test_the_traveller_knows_the_mask_over_the_tab(sizes: list[int], mask: int | None) -> None:
    laminate = build(load_design("1dof-5mm", ["stack.balloons=3", f"chamber.diameter={sizes}"]))
    found = over_tab(laminate, range(4, 11))
    assert (found and found.index) == mask


def facing(folder: Path) -> list[Finding]:
    return [finding for finding in check_folder(folder) if finding.rule == "facing-films"]


def test_the_mask_as_it_was_fails_as_built(waisted: Doctor) -> None:
    area, overhang = facing(waisted.folder)
    assert (area.verdict, area.measured) == ("pass", 0.0)
    assert (overhang.verdict, overhang.measured) == ("pass", pytest.approx(0.5, abs=1e-5))
    kept = waisted.path(8).read_text()

    def as_it_was(mask: Region) -> Region:
        return mask & disc(AXIS, 3.75)

    waisted.redraw(8, as_it_was)
    (found,) = facing(waisted.folder)
    waisted.path(8).write_text(kept, newline="\n")
    assert found.verdict == "fail"
    assert found.measured == pytest.approx(26.7035, abs=1e-4)
    assert found.where.layers == (3, 8, 9)
