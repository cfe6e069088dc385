"""piece-count: each layer falls into exactly the pieces that its role asks for."""

from __future__ import annotations

from sbafab.laminate.laminate import Laminate
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import Limits

NAME = "piece-count"


def check(laminate: Laminate, limits: Limits) -> list[Finding]:
    """The largest departure of any layer's number of pieces from the one it should have."""
    del limits
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
