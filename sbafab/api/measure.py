"""Coupons and cut sheets measured: what ``sbafab kerf`` and ``inspect`` take from the lab."""

from __future__ import annotations

from sbafab.design.films import FILM_NAME, is_kerf
from sbafab.folders.swap import replace_text
from sbafab.lab.coupon import (
    RESOLUTIONS,
    Calibration,
    Estimate,
    Measurement,
    Value,
    calibrated,
    read_measurements,
    write_coupon,
)
from sbafab.lab.inspection import (
    Inspection,
    InspectionDocument,
    drawing,
    history,
    sizes_csv,
)
from sbafab.lab.scan import Reference, Scan, ScanPicture, read_cut_sheet, read_picture
