"""Ids of the formats that commands print with ``--json``, and of predictions and balloon maps."""

from __future__ import annotations

RECORDS_SCHEMA = "sbafab/records@1"
HISTORY_SCHEMA = "sbafab/history@1"
EXPLAIN_SCHEMA = "sbafab/explain@1"
EXPLAINED_SCHEMA = "sbafab/explained@1"
SIMULATE_SCHEMA = "sbafab/simulate@2"
ASSEMBLY_PREDICT_SCHEMA = "sbafab/assembly-predict@1"
CALIBRATE_SCHEMA = "sbafab/calibrate@1"
TEMPLATES_SCHEMA = "sbafab/templates@1"
DESIGN_SCHEMA = "sbafab/design@1"
