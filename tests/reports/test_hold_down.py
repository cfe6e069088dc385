"""What the traveller says of holding film and its parts under the beam."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import ezdxf
import pytest
from lxml import html as lxml_html

from sbafab.actuators import load_design
from sbafab.runs.run import RunRequest, generate
from tests.quick import few
from tests.reports.bench_pages import page, words_of

FREE = r"{}, [\d.]+ mm thick: (.*?) No tab holds a part: (\d+) come free, the lightest of ([\d.]+)"


@pytest.mark.parametrize(
    ("template", "copies"), few([("1dof-5mm", 1), ("3dof-15mm", 2), ("radial-15mm", 1)], 1, names=2)
)
def test_every_free_part_of_every_film_is_counted(
    template: str, copies: int, tmp_path: Path
) -> None:
    few = ["stack.balloons=3"] if template != "radial-15mm" else []
    design = load_design(template, [*few, f"order.copies={copies}", "rules.yield_builds=100"])
    run = generate(RunRequest(design, tmp_path, ("cut", "press", "preview")))
    page = lxml_html.fromstring((run.folder / "traveller.html").read_text())
    cut = words_of(page.get_element_by_id("cut").getparent())
    for material in ("TPE", "PTFE"):
        said = re.search(FREE.format(material), cut)
        assert said is not None, material
        outlines = sum(
            len(ezdxf.readfile(path).modelspace().query('*[layer=="CUT_OUTER"]'))
            for path in (run.folder / "sheets").glob(f"{material}_*.dxf")
        )
        assert int(said[2]) == outlines


def test_a_mask_of_five_millimetres_weighs_a_milligram(sheet_files: Any) -> None:
    """A separator of 1dof-5mm: a disc of 5 + 2 x 0.75 + 2 x 0.5 mm less its bore, 0.025 thick."""
    cut = words_of(page(sheet_files, "1dof-5mm").get_element_by_id("cut").getparent())
    said = re.search(FREE.format("PTFE"), cut)
    assert said is not None
    disc = math.pi / 4 * 5**2 * 0.025 * 2200 / 1000
    assert 0.9 * disc < float(said[3]) < 2 * disc


@pytest.mark.parametrize(
    ("hold", "words"),
    few(
        [
            ("border", "all along its border with tape or magnets"),
            ("carrier", "carrier sheet of low tack, of paper or polyester and never of vinyl"),
            ("vacuum", "on the vacuum bed over a porous sheet"),
        ],
        2,
        names=2,
    ),
)
@pytest.mark.parametrize("material", ["TPE", "PTFE"])
def test_each_film_is_held_as_the_laser_holds_it(
    material: str, hold: str, words: str, sheet_files: Any
) -> None:
    tree = page(sheet_files, "1dof-5mm", f"laser.hold_{material.lower()}={hold}")
    cut = words_of(tree.get_element_by_id("cut").getparent())
    said = re.search(FREE.format(material), cut)
    assert said is not None
    assert words in said[1]
    assert ("must be silicone" in said[1]) == (material == "PTFE" and hold == "carrier")
    assert "Our proposal, not tried" in cut
    assert "Air assist off" in cut
