"""piece-count: each layer consists of the number of pieces that its role requires."""

from __future__ import annotations

from sbafab.rules.boundary import middle
from sbafab.rules.finding import Finding, Place, judged
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Rule
from sbafab.rules.sentences import explained, layer_name

NAME = "piece-count"


def check(measures: Measures) -> list[Finding]:
    """Return the largest difference between a layer's number of pieces and the required number."""
    laminate = measures.laminate
    counts = {name: len(layers[0].profile.pieces) for name, layers in laminate.patterns.items()}
    worst = max(laminate.layers, key=lambda layer: abs(counts[layer.pattern] - layer.pieces))
    count, expected = counts[worst.pattern], worst.pieces
    if count == expected:
        return [judged(NAME, True, 0.0, 0.0, "pieces", Place(), "whole")]
    smallest = min(worst.profile.pieces, key=lambda piece: piece.area, default=None)
    place = Place(None, (worst.index,), *(middle(smallest) if smallest else ()))
    sentence, off = "more" if count > expected else "fewer", float(abs(count - expected))
    facts = {"layer": layer_name(worst), "count": count, "wanted": expected}
    return [judged(NAME, False, 0.0, off, "pieces", place, sentence, **facts)]


RULE = Rule(NAME, check, explained(NAME), at_most=True)
