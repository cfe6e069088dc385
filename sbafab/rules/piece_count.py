"""piece-count: each layer falls into exactly the pieces that its role asks for."""

from __future__ import annotations

from sbafab.rules.finding import Finding, Place
from sbafab.rules.measures import Measures
from sbafab.rules.rule import Explanation, Rule

NAME = "piece-count"


def check(measures: Measures) -> list[Finding]:
    """The largest departure of any layer's number of pieces from the one it should have."""
    laminate = measures.laminate
    counts = {name: len(layers[0].profile.pieces) for name, layers in laminate.patterns.items()}
    worst = max(laminate.layers, key=lambda layer: abs(counts[layer.pattern] - layer.pieces))
    count = counts[worst.pattern]
    off = abs(count - worst.pieces)
    if off == 0:
        message = "every layer falls into the pieces its role asks for"
        return [Finding(NAME, "pass", 0.0, 0.0, "pieces", Place(), message)]
    x = y = None
    if count:
        smallest = min(worst.profile.pieces, key=lambda piece: piece.area)
        low_x, low_y, high_x, high_y = smallest.bounds
        x, y = (low_x + high_x) / 2, (low_y + high_y) / 2
    pieces = "1 piece" if count == 1 else f"{count} pieces"
    remedy = (
        "remove the stray one or join it to the rest"
        if count > worst.pieces
        else "separate what has grown together or restore what is lost"
    )
    message = (
        f"layer {worst.index} ({worst.name}) falls into {pieces} and should fall into "
        f"{worst.pieces}; {remedy}"
    )
    place = Place(None, (worst.index,), x, y)
    return [Finding(NAME, "fail", 0.0, float(off), "pieces", place, message)]


RULE = Rule(
    NAME,
    check,
    Explanation(
        "every layer falls into the pieces that its role says",
        "A film in two pieces is no film; a mask in one piece too many shifts in the press.",
        "Make the chamber larger or the bond narrower, so that the layer hangs together.",
        ("chamber.diameter", "bond.width"),
    ),
    at_most=True,
)
