"""A lab's file with one design and rows to store in it; output folders whose sheets are scanned."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from sbafab.cli import main
from sbafab.lab.builds import RecordedDesign
from sbafab.lab.records import HistoryEntry, Record
from sbafab.lab.store import Lab

SHA = "c0ffee" + 58 * "0"


def build(**changed: object) -> RecordedDesign:
    """What is stored of a design: predictions chosen by the test."""
    plain = {
        "sha256": SHA,
        "generator": "sbafab 1.0.0",
        "name": "arm",
        "family": "lobed",
        "method": "channel-pin",
        "toml": "",
        "predicted": {"stroke_mm": (17.5, "the paper's height, scaled")},
        "good_builds": (900, 1000),
        "actuator_sha256": changed.get("sha256", SHA),
    }
    return RecordedDesign(**{**plain, **changed})  # type: ignore[arg-type]


def result(serial: str, leak: str = "", **values: Any) -> Record:
    return Record(serial=serial, leak=leak, **values)


def step(serial: str = "A1", **values: Any) -> HistoryEntry:
    plain = {"step": "1", "initials": "AL", "temperature_c": 134.5, "minutes": 20}
    return HistoryEntry(serial=serial, **{**plain, **values})


@pytest.fixture
def make_build() -> Callable[..., RecordedDesign]:
    return build


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    return Lab(tmp_path / "lab.sqlite", 0.05, lambda: datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC))


# Small sheets, so that a scan is.


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six balloons on small sheets: pieces with inlets and without, with bores and without."""
    return cut(tmp_path_factory.mktemp("cut"), "1dof-10mm")


@pytest.fixture(scope="session")
def lobed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Masks of one size whose bores lie off their middle, separators and washers."""
    return cut(tmp_path_factory.mktemp("cut"), "3dof-15mm")


def cut(out: Path, template: str, *options: str) -> Path:
    with pytest.raises(SystemExit) as stop:
        main(["cut", template, "-o", str(out), "-q", *options])
    assert stop.value.code == 0
    return out / template
