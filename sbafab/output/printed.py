"""The ids of what commands print with ``--json``, beside those of files."""

RUN_SCHEMA = "sbafab/run@1"
NESTED_SCHEMA = "sbafab/nested@1"
RECORDS_SCHEMA = "sbafab/records@1"
REPORT_SCHEMA = "sbafab/report@1"
