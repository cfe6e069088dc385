"""Ids of the formats that commands print with ``--json``, and of predictions and balloon maps."""

from __future__ import annotations

RUN_SCHEMA = "sbafab/run@1"
NESTED_SCHEMA = "sbafab/nested@1"
RECORDS_SCHEMA = "sbafab/records@1"
REPORT_SCHEMA = "sbafab/report@1"
SWEEP_SCHEMA = "sbafab/sweep@1"
MAP_SCHEMA = "sbafab/balloon-map@1"
KERF_SCHEMA = "sbafab/kerf@1"
EXPLAIN_SCHEMA = "sbafab/explain@1"
EXPLAINED_SCHEMA = "sbafab/explained@1"
SIMULATE_SCHEMA = "sbafab/simulate@1"
PREDICTION_SCHEMA = "sbafab/predict@1"
ASSEMBLY_PREDICT_SCHEMA = "sbafab/assembly-predict@1"
REPRODUCTION_SCHEMA = "sbafab/reproduction@1"
TEMPLATES_SCHEMA = "sbafab/templates@1"
