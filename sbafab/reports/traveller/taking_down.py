"""After the press has opened: what comes off first, which side is held, how pins leave the films.

The order is ours; the paper gives none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
CELL, HIGH, WORDS = 35.0, 25.0, 2.2
PIN = "#6d737c"


def punch(diameter: float) -> float:
    """Return the diameter of the punch for pins of a diameter, mm."""
    return round(push_out(diameter) - PUNCH_PLAY, 2)


def taking_down(step: Step, product: str) -> list[Action]:
    """Return what is done from the opening of the press until the ``product`` lies free."""
    return [Action(text) for text in _lines(step, product)]


def _lines(step: Step, product: str) -> Iterator[str]:
    yield (
        "Open the press. Take plate, films and pad out together, level, with gloves: all of it is "
        "as hot as the platens. Set it on a heat-proof board."
    )
    yield (
        "Pad off first, straight up. The upper release film stays where it is until the plate is "
        "as cool as your hand: hot films still flow."
    )
    pierced = "; the pins may have pierced it: a new one for the next step" if step.pins else ""
    yield (
        "Upper release film off: hold the films down with a fingertip, and fold the film back on "
        f"itself, low, away from the finger{pierced}."
    )
    if step.pin_settings:
        yield from _pins_out(step)
    under = ", the underlay stays on the plate" if _has_underlay(step) else ""
    yield (
        f"Slide the lower release film off the plate with what lies on it{under}. At the bench's "
        "edge draw the film down and back below the bench: what lies on it comes off flat, this "
        "side up. Peel the film from the laminate, never the laminate from the film."
    )
    if _has_underlay(step):
        yield "Take off the underlay and its tape and throw them away: one print, one hot cycle."
    yield f"You now hold {product}."


def _pins_out(step: Step) -> Iterator[str]:
    sizes = sorted({(pin.diameter_mm, pin.seat_mm) for pin in step.pin_settings})
    how = listed(
        [
            f"⌀{say.millimetres(diameter)} with a punch of ⌀{say.millimetres(punch(diameter))}, "
            f"{say.millimetres(seat)} deep"
            for diameter, seat in sizes
        ]
    )
    names = listed([pin.pin for pin in step.pin_settings])
    yield (
        f"Turn plate and films over, films down, onto {_soft(step)}, cool, with a clean release "
        "film on it: it holds the films against the plate. Push each pin down through its push-out "
        f"hole until its seat is free ({how}): {names}. Turn all of it back."
    )
    yield (
        "Every pin now stands high. Hold the films down on both sides of it with flat tweezers and "
        "draw it straight up with pliers: the way in which the films went on, so that no edge of "
        "a hole folds back."
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


def taking_down_svg(step: Step, name: str) -> str:
    """The same in a row of small sections, not to scale."""
    cells = [("pad off", _pad_off), ("upper film back", _film_back)]
    if step.pin_settings:
        cells += [("turned over: pins down", _pushed), ("held, pins drawn up", _drawn)]
    cells.append(("lower film round the edge", _peeled))
    said = "; ".join(f"{number} {words}" for number, (words, _) in enumerate(cells, 1))
    width = CELL * len(cells)
    picture = Picture(name, width, HIGH, f"taking down step {step.step}: {said}")
    for number, (words, drawn) in enumerate(cells):
        left = CELL * number
        picture.add(*drawn(left, bool(step.pin_settings)))
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
