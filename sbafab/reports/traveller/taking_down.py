"""After the press has opened: what comes off first, which side is held, how pins leave the films.

The order is ours; the paper gives none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sbafab.geometry.edges import Point
from sbafab.pressing.build_up import BASE_PLATE, LAMINATE, PAD, UNDERLAY
from sbafab.pressing.dowels import push_out
from sbafab.pressing.schedule import Step
from sbafab.pressing.words import listed
from sbafab.reports import drawing as draw
from sbafab.reports.traveller import quantities as say
from sbafab.reports.traveller.action import Action
from sbafab.reports.traveller.build_up_svg import INKS
from sbafab.reports.traveller.shapes import Picture

PUNCH_PLAY = 0.1
"""mm by which the punch is thinner than the push-out hole."""
CELL, HIGH, WORDS = 35.0, 24.0, 2.2
PIN = "#6d737c"


def punch(diameter: float) -> float:
    """Return the diameter of the punch for pins of a diameter, mm."""
    return round(push_out(diameter) - PUNCH_PLAY, 2)


@dataclass(frozen=True)
class TakingDown:
    """The order of taking down, once for all steps: a picture and its numbered sentences."""

    picture: str
    lines: tuple[str, ...]


def order_of(steps: Sequence[Step]) -> TakingDown:
    """Return what is done after every press step, in the numbers that the steps name."""
    pinned = any(step.pin_settings for step in steps)
    lines = [
        "Pad off first, straight up. The upper release film stays on until the plate is as cool as "
        "your hand: hot films still flow.",
        "Upper release film: hold the films down with a fingertip and fold the release film back "
        "on itself, low, away from the finger. Pins may have pierced it: a new one for each step.",
    ]
    if pinned:
        lines += [
            "Pins, if there are any: turn plate and films over, films down, onto something soft, "
            "cool, with a clean release film on it. It holds the films against the plate while the "
            "punch pushes each pin down through its push-out hole, until its seat is free. Turn "
            "all of it back.",
            "Every pin now stands high. Hold the films down on both sides of it with flat tweezers "
            "and draw it straight up with pliers: the way in which the films went on, so that no "
            "edge of a hole folds back.",
        ]
    lines.append(
        "Slide the lower release film off the plate with what lies on it. At the bench's edge draw "
        "it down and back below the bench: what lies on it comes off flat, this side up. Peel the "
        "release film from the films, never the films from it."
    )
    return TakingDown(_picture(pinned), tuple(lines))


def taking_down(step: Step, product: str, is_pinned: bool) -> Iterator[Action]:
    """The boxes to tick of one step, from the opening of the press to the ``product``.

    ``is_pinned``: some step of the design has pins, and the order five numbers, not three.
    """
    last = 5 if is_pinned else 3
    yield Action(
        "Plate, films and pad out together, level, all hot. Pad off, cool it (1). Upper release "
        "film off (2)."
    )
    if step.pin_settings:
        yield Action(
            f"Turned over onto {_soft(step)}, push the pins out of their seats (3): "
            f"{_punches(step)}. Turned back, hold the films down and draw the pins (4)."
        )
    away = "; underlay off the plate and away" if _has_underlay(step) else ""
    yield Action(f"Lower release film off ({last}){away}. You now hold {product}.")


def _punches(step: Step) -> str:
    sizes = sorted({(pin.diameter_mm, pin.seat_mm) for pin in step.pin_settings})
    return listed(
        [
            f"⌀{diameter:g} by {say.millimetres(seat)}, punch ⌀{say.millimetres(punch(diameter))}"
            for diameter, seat in sizes
        ]
    )


def _soft(step: Step) -> str:
    """What the films lie on while pins are pushed into it."""
    top = step.top_mm
    out = max(pin.stands_mm + pin.tolerance_mm - top + pin.seat_mm for pin in step.pin_settings)
    pad = next(item.thickness_mm for item in step.build_up if item.part == PAD)
    if pad > out:
        return "the press pad"
    return f"soft foam at least {say.millimetres(out + 1)} thick"


def _has_underlay(step: Step) -> bool:
    return any(item.part == UNDERLAY for item in step.build_up)


def _picture(is_pinned: bool) -> str:
    """The same in a row of small sections, not to scale."""
    cells = [("pad off", _pad_off), ("upper film back", _film_back)]
    if is_pinned:
        cells += [("turned over: pins down", _pushed), ("held, pins drawn up", _drawn)]
    cells.append(("lower film round the edge", _peeled))
    said = "; ".join(f"{number} {words}" for number, (words, _) in enumerate(cells, 1))
    picture = Picture("taking-down", CELL * len(cells), HIGH, f"taking down: {said}")
    for number, (words, drawn) in enumerate(cells):
        left = CELL * number
        picture.add(*drawn(left, is_pinned))
        picture.add(draw.text((left + 1.0, HIGH - 1.0), f"{number + 1}  {words}", size=WORDS))
    return picture.svg()


def _box(left: float, low: Sequence[float], high: Sequence[float], part: str) -> str:
    corners: list[Point] = [(left + p[0], p[1]) for p in (low, high)]
    return draw.box(corners[0], corners[1], fill=INKS[part], stroke=draw.DARK)


def _film(left: float, points: Sequence[Point]) -> str:
    return draw.line([(left + x, y) for x, y in points], colour=INKS["film"], width=0.5)


def _to(left: float, start: Point, end: Point) -> list[str]:
    """An arrow from one place to another."""
    (x, y), (u, v) = (left + start[0], start[1]), (left + end[0], end[1])
    length = max(abs(u - x), abs(v - y))
    return [
        draw.line([(x, y), (u, v)], width=0.35),
        draw.arrow((u, v), ((u - x) / length, (v - y) / length)),
    ]


def _lying(left: float, is_pinned: bool, stands: float = 1.5) -> list[str]:
    """Plate, lower film, films on it, and a pin in its hole."""
    parts = [
        _box(left, (2.0, 16.0), (31.0, 20.5), BASE_PLATE),
        _film(left, [(2.0, 15.7), (31.0, 15.7)]),
        _box(left, (10.0, 13.0), (23.0, 15.4), LAMINATE),
    ]
    if is_pinned:
        tip = 13.0 - stands
        x = left + 15.7
        parts.append(draw.box((x, tip), (x + 1.6, tip + 8.0), fill=PIN, stroke=draw.DARK))
    return parts


def _pad_off(left: float, is_pinned: bool) -> list[str]:
    return [
        *_lying(left, is_pinned),
        _film(
            left, [(2.0, 15.1), (7.0, 15.1), (9.5, 12.0), (23.5, 12.0), (26.0, 15.1), (31.0, 15.1)]
        ),
        _box(left, (2.0, 4.5), (31.0, 8.5), PAD),
        *_to(left, (28.0, 4.0), (28.0, 1.0)),
    ]


def _film_back(left: float, is_pinned: bool) -> list[str]:
    return [
        *_lying(left, is_pinned),
        _film(left, [(17.5, 12.4), (22.5, 12.4), (23.3, 11.4), (21.5, 10.2), (6.0, 9.2)]),
        *_to(left, (14.0, 7.6), (8.0, 7.2)),
        *_to(left, (26.5, 8.0), (24.0, 12.6)),
    ]


def _pushed(left: float, is_pinned: bool) -> list[str]:
    del is_pinned
    x = left + 15.7
    return [
        _box(left, (2.0, 14.4), (31.0, 20.5), PAD),
        _box(left, (2.0, 7.5), (31.0, 12.0), BASE_PLATE),
        _box(left, (10.0, 12.0), (23.0, 14.4), LAMINATE),
        draw.box((x, 11.0), (x + 1.6, 19.0), fill=PIN, stroke=draw.DARK),
        draw.box((x + 0.4, 3.5), (x + 1.2, 11.0), fill="#ffffff", stroke=draw.DARK),
        *_to(left, (16.5, 0.6), (16.5, 3.4)),
    ]


def _drawn(left: float, is_pinned: bool) -> list[str]:
    return [
        *_lying(left, is_pinned, stands=6.0),
        *_to(left, (16.5, 5.0), (16.5, 1.0)),
        *_to(left, (12.5, 8.5), (12.5, 12.8)),
        *_to(left, (20.5, 8.5), (20.5, 12.8)),
    ]


def _peeled(left: float, is_pinned: bool) -> list[str]:
    del is_pinned
    return [
        draw.box((left + 2.0, 14.0), (left + 19.0, 16.5), fill="#d9c7a8", stroke=draw.DARK),
        _film(left, [(2.0, 13.6), (19.3, 13.6), (19.8, 14.2), (8.0, 19.0)]),
        _box(left, (10.0, 10.9), (24.5, 13.3), LAMINATE),
        *_to(left, (11.5, 20.0), (7.0, 20.9)),
        *_to(left, (25.5, 12.1), (30.0, 12.1)),
    ]
