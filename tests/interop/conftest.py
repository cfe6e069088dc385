from __future__ import annotations

from collections.abc import Iterator

import pyogrio
import pytest

from tests.interop.made import DESIGNS, NAMES, PROFILES, Sheet, sheet_of, write_design


@pytest.fixture(scope="session")
def sheets(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Sheet]:
    folder = tmp_path_factory.mktemp("sheets")
    made = {
        design: {profile: write_design(design, profile, folder) for profile in PROFILES}
        for design in DESIGNS
    }
    return {
        f"{design} {material}": sheet_of(runs, material)
        for design, runs in made.items()
        for material in ("TPE", "PTFE")
    }


@pytest.fixture(params=NAMES)
def sheet(request: pytest.FixtureRequest, sheets: dict[str, Sheet]) -> Sheet:
    return sheets[request.param]


@pytest.fixture(scope="session")
def fine_arcs() -> Iterator[None]:
    """GDAL turns arcs into chords; those of a quarter degree keep an area to 3e-6."""
    pyogrio.set_gdal_config_options({"OGR_ARC_STEPSIZE": "0.25"})
    yield
    pyogrio.set_gdal_config_options({"OGR_ARC_STEPSIZE": None})
