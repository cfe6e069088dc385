"""Settings for every test: hypothesis draws the same examples on every machine."""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "sbafab",
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("sbafab")

LONG = "SBAFAB_LONG" in os.environ
"""Whether only the tests marked ``long`` run, as ``.ci/run`` has them beside the suite."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The suite leaves out what is marked ``long``; with ``SBAFAB_LONG=1`` only that runs."""
    left_out = [item for item in items if (item.get_closest_marker("long") is not None) != LONG]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in set(left_out)]
