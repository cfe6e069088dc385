"""Measurements by others and the lab, compared with the models and used to fit them."""

from __future__ import annotations

from sbafab.design.files import read_toml, shown
from sbafab.design.toml_table import NAME_PATTERN
from sbafab.folders.swap import replace_text
from sbafab.lab.evidence import load_source
from sbafab.models.calibration import NONE, PAPER, UNKNOWNS, load_calibration
from sbafab.validation.comparison import ComparedCurve, ComparisonDocument, compare
from sbafab.validation.evidence import AXES, QUANTITIES
from sbafab.validation.fit import CalibrationFit, HeldOutPoint, calibration_text, fit
from sbafab.validation.paper_table import TITLE, PaperTable
from sbafab.validation.paper_table import as_json as table_json
