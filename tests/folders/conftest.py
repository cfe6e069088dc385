"""Written folders to put faults into."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.folders.run import RunRequest, generate
from tests.faults.once import remembering
from tests.folders.doctoring import Doctor

FEW_BUILDS = "rules.yield_builds=100"


@pytest.fixture(scope="session")
def remember(
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[], AbstractContextManager[None]]:
    return remembering(tmp_path_factory.mktemp("anew"))


@pytest.fixture(scope="session")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Cut files of a 3-DoF actuator of four balloons: 15 layers, bores 4.25 mm off the axis."""
    out = tmp_path_factory.mktemp("clean")
    return generate(
        RunRequest(load_design("3dof-15mm", ["stack.balloons=4", FEW_BUILDS]), out, ("cut",))
    ).folder


@pytest.fixture
def lobed(clean: Path, tmp_path: Path) -> Doctor:
    return Doctor(Path(shutil.copytree(clean, tmp_path / "3dof-15mm")))


@pytest.fixture(scope="session")
def clean_column(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Cut files of a 1-DoF actuator of three balloons: 11 layers on one axis."""
    out = tmp_path_factory.mktemp("column")
    return generate(
        RunRequest(load_design("1dof-5mm", ["stack.balloons=3", FEW_BUILDS]), out, ("cut",))
    ).folder


@pytest.fixture
def doctor(clean_column: Path, tmp_path: Path) -> Doctor:
    return Doctor(Path(shutil.copytree(clean_column, tmp_path / "1dof-5mm")))
