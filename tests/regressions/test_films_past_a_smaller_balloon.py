"""Masks that ended with the smaller neighbour let films weld past it; now the files are refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from sbafab.actuators import build, load_design
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from sbafab.geometry.region import Region, disc
from sbafab.reports.traveller.lay_up import over_tab
from sbafab.rules.finding import Finding
from tests.folders.doctoring import Doctor

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
