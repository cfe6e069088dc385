"""The traveller against the files: what is counted, cut, drilled and bought by its words.

The pages of one design are read as a technician reads them, by the headings of their tables and
the sentences of the steps. Travellers of several designs on common sheets are not judged.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any

from lxml import html

from tests.judge.folder import Folder, pieces
from tests.judge.laying import HOLE, judge_laying, role
from tests.judge.page import NUMBERS, TIMES, Part, Tags, parts, pin_holes, rows, words
from tests.judge.reading import read

LENGTH = 1.0
"""mm by which the cut of a part may differ from what is said in whole ones."""


def judge_traveller(folder: Folder) -> Iterator[str]:
    """Parts, sheets, holes, lay-up and press steps as the files have them."""
    path = folder.path / "traveller.html"
    if not path.is_file():
        return
    texts = [one.read_text(encoding="utf-8") for one in (path, folder.path / "bench.html")]
    for text in texts:
        yield from _nesting(text)
    page, bench = map(html.fromstring, texts)
    # The plate's holes are on the page of the bench.
    page.append(bench)
    by_name = {part.pattern: part for part in parts(page)}
    of = {index: part.pattern for part in by_name.values() for index in part.layers}
    if sorted(of) != [layer.index for layer in folder.layers]:
        yield f"its list of parts has the layers {sorted(of)}"
        return
    yield from _counted(folder, by_name.values())
    yield from _on_sheets(folder, page, by_name)
    yield from _drilled(folder, page)
    yield from _amounts(folder, page)
    yield from judge_laying(folder, page, of)


def _nesting(text: str) -> Iterator[str]:
    tags = Tags()
    tags.feed(text)
    yield from tags.wrong[:1] or [f"<{tag}> is never closed" for tag in tags.open[:1]]


def _counted(folder: Folder, named: Iterable[Part]) -> Iterator[str]:
    copies = folder.copies
    for part in named:
        layers = [layer for layer in folder.layers if layer.index in part.layers]
        if len({layer.shape for layer in layers}) != 1:
            yield f"{part.pattern} is several shapes"
            continue
        first = layers[0]
        told = {part.film} | set(part.role.split(", "))
        if {layer.material for layer in layers} | {role(layer) for layer in layers} != told:
            yield f"{part.pattern} is said to be {part.film} {part.role}"
        wanted = copies * len(layers), folder.spares(copies * len(layers))
        if (part.count, part.spares) != wanted:
            yield f"{part.pattern} is counted {part.count} + {part.spares}, not {wanted}"
        if part.pieces != len(list(pieces(first.path))):
            yield f"{part.pattern} is said to be {part.pieces} pieces"
        if abs(part.cut - first.path.length) > LENGTH + 2e-4 * part.cut:
            yield f"{part.pattern} cuts {first.path.length:.1f} mm, not {part.cut:.0f}"


def _on_sheets(folder: Folder, page: Any, named: dict[str, Part]) -> Iterator[str]:
    """Every piece is on a sheet that names it, and a sheet has as many outlines as it says."""
    told: Counter[str] = Counter()
    meters = 0.0
    is_alone = bool(folder.manifest.get("sheets"))  # no other design on its sheets
    for figure in page.xpath("//figure[figcaption][.//input]"):
        name = words(figure.xpath(".//b")[0])
        said = Counter(
            {
                p: int(n)
                for n, p in re.findall(rf"(\d+) {TIMES} (P\d+)", words(figure.find("figcaption")))
            }
        )
        told += said
        path = folder.path / name
        if not path.is_file():
            yield f"{name} is named and is no file"
            continue
        drawing = read(path)
        outlines = len(drawing.on("CUT_OUTER"))
        if is_alone and outlines != sum(said.values()):
            yield f"{name} cuts {outlines} parts, and {sum(said.values())} are named"
        meters += sum(c.line.length for c in drawing.contours if c.layer.startswith("CUT")) / 1000
    if not told:
        return
    for part in named.values():
        wanted = (part.count + part.spares) * part.pieces
        if told[part.pattern] != wanted:
            yield f"the sheets have {told[part.pattern]} of {part.pattern}, not {wanted}"
    stated = re.search(r"([\d.]+) m of cut", words(page))
    if is_alone and stated and abs(float(stated.group(1)) - meters) > 0.0051 + 3e-4 * meters:
        yield f"the laser cuts {meters:.3f} m, and {stated.group(1)} are said"


def _drilled(folder: Folder, page: Any) -> Iterator[str]:
    """Holes of the plate's file: those of the table, in its first place, from its corner."""
    said = pin_holes(page)
    if folder.plate is None:
        if said:
            yield "it has holes for a plate that has no file"
        return
    outlines = [c.line.bounds for c in folder.plate.contours if c.layer == "CUT_OUTER"]
    left, low = min(b[0] for b in outlines), min(b[1] for b in outlines)
    drilled = [(hole.x - left, hole.y - low, 2 * hole.radius) for hole in folder.holes]
    for hole in said:
        wanted = (*hole.corner, hole.diameter)
        if not any(math.dist(wanted, one) < HOLE for one in drilled):
            yield f"pin {hole.pin} is said to be at {wanted}, and no hole is there"
    offsets = {
        (round(h.corner[0] - h.datum[0], 2), round(h.corner[1] - h.datum[1], 2)) for h in said
    }
    if len(offsets) > 1:
        yield f"corner and datum are apart by {sorted(offsets)}"


def _amounts(folder: Folder, page: Any) -> Iterator[str]:
    """Film needed, and thickness of the whole."""
    copies = folder.copies
    bill = {row["Item"]: row["What"] for row in rows(page, "Item", "What", "Quantity")}
    for film in ("TPE", "PTFE"):
        layers = [layer for layer in folder.layers if layer.material == film]
        stated = re.search(r"([\d.]+) cm² of parts in (\d+) layers?", bill.get(f"{film} film", ""))
        if stated is None:
            yield f"no {film} film is among its materials"
            continue
        area = copies * sum(layer.profile.area for layer in layers) / 100
        slack = copies * folder.chord_error * sum(layer.path.length for layer in layers) / 100
        if abs(float(stated.group(1)) - area) > 0.051 + 2e-3 * area + slack:
            yield f"{film} parts are {area:.2f} cm2, not {stated.group(1)}"
        if int(stated.group(2)) != copies * len(layers):
            yield f"{len(layers)} {film} layers, not {stated.group(2)}"
    height = sum(layer.thickness for layer in folder.layers)
    facts = {words(term): words(term.getnext()) for term in page.iter("dt")}
    flat = float(NUMBERS.findall(facts["Thickness, sum of the films as bought"])[0])
    if abs(flat - height) > 0.0006:
        yield f"the laminate is {height:.3f} mm thick, not {flat:g}"
