"""The history of devices as CSV, JSON and PDF. The same records give the same bytes."""

from __future__ import annotations

import io
import json
import textwrap
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.errors import DesignError, OutputError
from sbafab.output.schema_ids import HISTORY_SCHEMA
from sbafab.reports.charts import STYLE
from sbafab.results.history import (
    ENTRY_FIELDS,
    READING_NAMES,
    StoredEntry,
    photograph_folder,
)
from sbafab.results.recording import RecordRow, all_rows, matching, row_number, row_words
from sbafab.results.records import COLUMNS, Build, Record
from sbafab.results.store import Lab
from sbafab.spreadsheet import csv_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class DeviceHistory:
    """All rows of one device, those that were corrected too, in the order of their numbers."""

    build: Build
    serial: str
    records: tuple[Record, ...]
    entries: tuple[StoredEntry, ...]

    @property
    def rows(self) -> list[RecordRow]:
        return all_rows(self.records, self.entries)

    @property
    def attempts(self) -> list[int]:
        return sorted({row.attempt for row in self.rows})

    def as_dict(self) -> dict[str, Any]:
        return {
            "serial": self.serial,
            "design": self.build.name,
            "actuator_sha256": self.build.actuator,
            "records": [record.as_dict() for record in self.records],
            "entries": [entry.as_dict() for entry in self.entries],
        }


@dataclass(frozen=True)
class LabHistory:
    """Devices by design and serial; ``hashes`` of the chain by table and row, and its head."""

    devices: tuple[DeviceHistory, ...]
    hashes: Mapping[tuple[str, str], str]
    head: str
    photographs: Path

    def as_dict(self) -> dict[str, Any]:
        """The document for JSON."""
        return {
            "schema": HISTORY_SCHEMA,
            "head": self.head,
            "devices": [device.as_dict() for device in self.devices],
        }


def lab_history(lab: Lab, text: str = "", serial: str = "") -> LabHistory:
    """Return the devices of a lab, or those that ``text`` and ``serial`` find.

    Raises DesignError where there are none.
    """
    records, builds = lab.contents()
    entries = lab.entries()
    if text or serial:
        records = matching(text or serial, serial, records, builds)
        entries = matching(text or serial, serial, entries, builds)
    if not records and not entries:
        raise DesignError(f"no device goes with {(text or serial)[:60]!r}; see --find")
    rows: dict[tuple[str, str], list[RecordRow]] = defaultdict(list)
    for row in all_rows(records, entries):
        rows[builds[row.design_sha256].actuator, row.serial].append(row)
    devices = tuple(
        DeviceHistory(
            builds[group[0].design_sha256],
            device_serial,
            tuple(row for row in group if isinstance(row, Record)),
            tuple(row for row in group if isinstance(row, StoredEntry)),
        )
        for (_, device_serial), group in rows.items()
    )
    links = lab.links()
    return LabHistory(
        tuple(sorted(devices, key=lambda device: (device.build.name, device.serial))),
        {(link.source, link.row): link.sha256 for link in links},
        links[-1].sha256 if links else "",
        photograph_folder(lab.path),
    )


def write_history(history: LabHistory, path: Path) -> None:
    """Write CSV, JSON or PDF, by the file's ending, beside and swapped in."""
    writers = {".csv": _csv_bytes, ".json": _json_bytes, ".pdf": pdf_bytes}
    writer = writers.get(path.suffix.lower())
    if writer is None:
        raise DesignError(f"{path} ends in none of {', '.join(writers)}; choose one of them")
    content = writer(history)
    fresh = path.with_name(f".{path.name}.new")
    try:
        fresh.write_bytes(content)
        fresh.replace(path)
    except OSError as error:
        fresh.unlink(missing_ok=True)
        raise OutputError(f"{path} cannot be written: {error.strerror or error}") from None


def _json_bytes(history: LabHistory) -> bytes:
    return (json.dumps(history.as_dict(), indent=2, ensure_ascii=False) + "\n").encode()


HEAD = ("row", "recorded", "design", "design_sha256", "attempt", "corrects", "withdrawn")
CSV_COLUMNS = tuple(dict.fromkeys((*HEAD, *ENTRY_FIELDS, "expired", *COLUMNS, "sha256")))


def _csv_bytes(history: LabHistory) -> bytes:
    rows = [
        [_cells(history, device, row).get(column, "") for column in CSV_COLUMNS]
        for device in history.devices
        for row in device.rows
    ]
    return csv_text([CSV_COLUMNS, *rows]).encode()


def _cells(history: LabHistory, device: DeviceHistory, row: RecordRow) -> dict[str, Any]:
    source = "entry" if isinstance(row, StoredEntry) else "result"
    cells: dict[str, Any] = {
        "row": row_number(row),
        "recorded": row.recorded,
        "design": device.build.name,
        "design_sha256": row.design_sha256,
        "attempt": row.attempt,
        "corrects": "" if row.corrects is None else row_number(row, row.corrects),
        "withdrawn": int(row.withdrawn),
        "sha256": history.hashes.get((source, str(row.id)), ""),
    }
    if isinstance(row, StoredEntry):
        texts = {name: getattr(row, name) for name in ENTRY_FIELDS if name not in READING_NAMES}
        return {**cells, **texts, **row.readings, "expired": int(row.is_expired)}
    errors = {name: " ".join(map(str, sizes)) for name, sizes in row.errors.items()}
    texts = {name: getattr(row, name) for name in ("serial", "leak", "operator", "kit", "note")}
    return {**cells, **texts, **row.numbers, **errors}


# PDF: pages of lines, then photographs, by matplotlib.


PAGE = (8.27, 11.69)
"""Inches, A4."""
WIDE, LINES, LINE, MARGIN = 104, 66, 0.158, 0.7
"""Characters of a line, lines of a page; inches of a line and of the margin."""
PDF_METADATA: dict[str, Any] = {
    "Title": "Device history",
    "Creator": "sbafab",
    "CreationDate": None,
    "Producer": None,
}


def pdf_bytes(history: LabHistory) -> bytes:
    """Return the history as PDF: a device begins on a page of its own. It has no dates of print."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_pdf import PdfPages

    written = io.BytesIO()
    with rc_context(STYLE), PdfPages(written, metadata=PDF_METADATA) as pages:
        for device in history.devices:
            for figure in _device_pages(history, device):
                pages.savefig(figure)
    return written.getvalue()


def _device_pages(history: LabHistory, device: DeviceHistory) -> Iterator[Figure]:
    title = f"{device.build.name}, serial {device.serial}"
    lines = list(_lines(history, device))
    for start in range(0, len(lines), LINES):
        figure = _page(history, title)
        for number, (text, is_bold) in enumerate(lines[start : start + LINES]):
            y = PAGE[1] - MARGIN - 0.45 - number * LINE
            weight = "bold" if is_bold else "normal"
            _write(figure, (MARGIN, y), text, fontsize=8, fontweight=weight)
        yield figure
    names = dict.fromkeys(entry.photograph for entry in device.entries if entry.photograph)
    paths = [history.photographs / name for name in names]
    for start in range(0, len(paths), 2):
        figure = _page(history, f"{title}: photographs")
        for place, path in enumerate(paths[start : start + 2]):
            _draw_photograph(figure, path, place)
        yield figure


def _page(history: LabHistory, title: str) -> Figure:
    from matplotlib.backends.backend_pdf import FigureCanvasPdf
    from matplotlib.figure import Figure

    figure = Figure(figsize=PAGE)
    FigureCanvasPdf(figure)
    _write(figure, (MARGIN, PAGE[1] - MARGIN), title, fontsize=12, fontweight="bold")
    _write(figure, (MARGIN, 0.4), f"Head of the hash chain: {history.head}", fontsize=7)
    return figure


def _write(figure: Figure, place: tuple[float, float], text: str, **style: Any) -> None:
    x, y = place
    figure.text(x / PAGE[0], y / PAGE[1], text, parse_math=False, **style)


def _lines(history: LabHistory, device: DeviceHistory) -> Iterator[tuple[str, bool]]:
    """Yield the lines of a device and whether each is bold."""
    yield f"Actuator sha256 {device.build.actuator}, recorded by {device.build.generator}", False
    newer = {
        row_number(row, row.corrects): row_number(row)
        for row in device.rows
        if row.corrects is not None
    }
    for attempt in device.attempts:
        yield "", False
        yield f"Attempt {attempt}", True
        for row in device.rows:
            if row.attempt != attempt:
                continue
            number = row_number(row)
            words = [f"{number}: {row_words(row)}"]
            words += ["EXPIRED"] if isinstance(row, StoredEntry) and row.is_expired else []
            words += [f"corrects {row_number(row, row.corrects)}"] if row.corrects else []
            words += [f"corrected by {newer[number]}"] if number in newer else []
            words += ["withdrawn"] if row.withdrawn else []
            words += [f"recorded {row.recorded}"]
            source = "entry" if isinstance(row, StoredEntry) else "result"
            words += [f"sha256 {history.hashes.get((source, str(row.id)), '')[:16]}"]
            lines = textwrap.wrap("; ".join(words), WIDE, subsequent_indent="      ")
            yield from ((line, False) for line in lines)


def _draw_photograph(figure: Figure, path: Path, place: int) -> None:
    """Draw a photograph in the upper or lower half of a page; a sentence where it is missing."""
    from PIL import Image, ImageOps

    low = 0.52 - 0.44 * place
    _write(figure, (MARGIN, PAGE[1] * (low - 0.015)), path.name, fontsize=7)
    try:
        with Image.open(path) as opened:
            picture = ImageOps.exif_transpose(opened).convert("RGB")
    except OSError:
        _write(figure, (MARGIN, PAGE[1] * (low + 0.2)), "This photograph is missing.", fontsize=9)
        return
    picture.thumbnail((1200, 1200))
    axes = figure.add_axes((0.1, low, 0.8, 0.38))
    axes.set_axis_off()
    axes.imshow(picture)
