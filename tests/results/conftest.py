"""A lab's file with one design, and results to store in it."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from sbafab.results.records import Build
from sbafab.results.store import Lab

SHA = "c0ffee" + 58 * "0"


def build(**changed: object) -> Build:
    """What is stored of a design: stated tolerances and predictions chosen by the test."""
    plain = {
        "sha256": SHA,
        "generator": "sbafab 1.0.0",
        "name": "arm",
        "family": "lobed",
        "method": "channel-pin",
        "toml": "",
        "predicted": {"stroke_mm": (17.5, "the paper's height, scaled")},
        "tolerances": {"offset_mm": 0.2, "turn_deg": 1.0, "cut_mm": 0.1},
        "good_builds": (900, 1000),
        "actuator_sha256": changed.get("sha256", SHA),
    }
    return Build(**{**plain, **changed})  # type: ignore[arg-type]


@pytest.fixture
def make_build() -> Callable[..., Build]:
    return build


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    return Lab(tmp_path / "lab.sqlite", 0.05, lambda: datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC))
