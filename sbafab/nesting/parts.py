"""The parts to cut for a laminate: the pieces of its patterns, equal ones counted together."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from sbafab.nesting.records import NestPart


def no_spares(needed: int) -> int:
    """Return zero spares, whatever number is needed."""
    return 0


def parts_of(
    laminate: Laminate,
    paths: Mapping[str, Region],
    copies: int,
    spares: Callable[[int], int] = no_spares,
) -> tuple[NestPart, ...]:
    """Every piece of every pattern, by pattern in stacking order.

    ``paths`` holds each pattern's path of the beam, kerf compensated; ``spares`` tells
    how many more of a pattern are cut than the ``copies`` take. Pieces of one pattern that differ
    only in their place are one part, named after the first of them. None where the layers are
    registered sheets: these are not nested.
    """
    if laminate.panel is not None:
        return ()
    parts: list[NestPart] = []
    for pattern, layers in laminate.patterns.items():
        needed = len(layers) * copies
        layers_cut = needed + spares(needed)
        alike: dict[Region, list[int]] = {}
        pieces = paths[pattern].pieces
        for number, piece in enumerate(pieces):
            low_x, low_y, _, _ = piece.bounds
            alike.setdefault(piece.moved(-low_x, -low_y), []).append(number)
        for numbers in alike.values():
            parts.append(
                NestPart(
                    design=laminate.name,
                    pattern=pattern,
                    piece=numbers[0] + 1,
                    material=layers[0].film.material,
                    region=pieces[numbers[0]],
                    count=len(numbers) * layers_cut,
                )
            )
    return tuple(parts)
