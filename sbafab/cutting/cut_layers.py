"""The layers of a cut file, in the order a laser program takes them."""

from __future__ import annotations

ENGRAVE = "ENGRAVE"
CUT_INNER = "CUT_INNER"
CUT_OUTER = "CUT_OUTER"
CUT_SHEET = "CUT_SHEET"
REFERENCE = "REFERENCE"

COLOURS = {ENGRAVE: 7, CUT_INNER: 5, CUT_OUTER: 1, CUT_SHEET: 6, REFERENCE: 8}
"""AutoCAD colour index of every layer; REFERENCE is neither cut nor plotted."""

CUT_SEQUENCE = (ENGRAVE, CUT_INNER, CUT_OUTER, CUT_SHEET)
"""What is cut first comes first: a hole cut after its outline would be cut in a loose part."""
