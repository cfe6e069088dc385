"""Settings for every test: hypothesis draws the same examples on every machine."""

from __future__ import annotations

import os

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
"""Whether tests that start other programs for long run too, as ``.ci/run`` has them."""
collect_ignore = (
    []
    if LONG
    else [
        f"interop/test_{name}.py"
        for name in (
            "klayout",
            "sheets_chromium",
            "sheets_inkscape",
            "sheets_librecad",
            "sheets_openscad",
        )
    ]
)
