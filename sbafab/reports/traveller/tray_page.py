"""tray.html: the patterns with their counts, for a phone beside the tray."""

from __future__ import annotations

from dataclasses import dataclass

from sbafab.pressing.cycles import cycle_name
from sbafab.reports.drawing import layer_numbers
from sbafab.reports.html_templates import environment
from sbafab.reports.traveller import units
from sbafab.reports.traveller.batch import cycles_of
from sbafab.reports.traveller.job import HERE, SHORT_HASH, Work
from sbafab.reports.traveller.shapes import (
    definitions,
    flat_shape,
    pattern_regions,
    thumbnail,
)

TEMPLATE = "tray.html.j2"
MOST_CYCLES = 6
"""Up to this many cycles each has a box; otherwise cycles of one size share one."""


@dataclass(frozen=True)
class PatternCard:
    """The counts of a pattern: per laminate, and per cycle by its name."""

    pattern: str
    picture: str
    material: str
    role: str
    layers: str
    pieces: int
    each: int
    counts: tuple[tuple[str, int], ...]


def tray_html(work: Work) -> str:
    """Return the page."""
    laminate, runs = work.laminate, work.runs
    sizes = [(f"Cycle {cycle_name(n)}", size) for n, size in enumerate(runs.cycles, 1)]
    if len(sizes) > MOST_CYCLES:
        sizes = [(cycles_of(runs, size), size) for size in dict.fromkeys(runs.cycles)]
    cards = []
    for pattern, layers in laminate.patterns.items():
        first = layers[0]
        if laminate.cut_with(first) != first.index:
            continue
        region = laminate.as_cut(first)
        is_flat = first.turned or any(fold.lower == first.index for fold in laminate.folds)
        shape = flat_shape(pattern) if is_flat else pattern
        cards.append(
            PatternCard(
                pattern,
                thumbnail(f"thumb-{pattern}", shape, first.film, region.bounds),
                first.film.material,
                first.role.replace("-", " "),
                layer_numbers([layer.index for layer in layers]),
                len(region.pieces),
                len(layers),
                tuple((name, size * len(layers)) for name, size in sizes),
            )
        )
    values = {
        "name": laminate.name,
        "short_hash": work.job.design_sha256[:SHORT_HASH],
        "shapes": definitions(pattern_regions(laminate)),
        "cards": cards,
        "copies": units.count(runs.copies, "copy", "copies"),
        "is_batch": runs.copies > 1,
        "parts": sum(card.each for card in cards),
    }
    return environment(HERE).get_template(TEMPLATE).render(values)
