"""GDAL reads from the cut files of random designs the areas of their profiles."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pyogrio
import pytest
from hypothesis import given, settings

from sbafab.actuators import build, load_design
from tests.interop.judging import areas
from tests.properties.designs import Draft, valid


@pytest.fixture(autouse=True, scope="module")
def fine_arcs() -> Iterator[None]:
    """Chords of a quarter degree keep an area to 3e-6."""
    pyogrio.set_gdal_config_options({"OGR_ARC_STEPSIZE": "0.25"})
    yield
    pyogrio.set_gdal_config_options({"OGR_ARC_STEPSIZE": None})


@settings(max_examples=8)
@given(valid())
def test_every_layer_of_a_random_design_has_its_area(draft: Draft) -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        laminate = build(load_design(draft.write(folder)))
        for ours, theirs in areas(laminate, folder):
            assert theirs == pytest.approx(ours, rel=1e-4)
