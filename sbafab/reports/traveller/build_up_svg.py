"""What lies between the platens in a step: a section, to scale in two classes of thickness.

Base plate and press pad stand 1:2; films, laminate and what of the pins stands over the plate are
enlarged by a factor that the picture names. Widths are not to scale.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from sbafab.pressing.build_up import BASE_PLATE, LAMINATE, PAD, UNDERLAY, BuildUpPart
from sbafab.pressing.dowels import PinSetting, push_out
from sbafab.pressing.schedule import Step, listed
from sbafab.reports import drawing as draw
from sbafab.reports.traveller import job as say
from sbafab.reports.traveller.shapes import Picture

WIDE, LABELS, EDGE = 26.0, 43.0, 1.0
THICK = 0.5
"""mm on the page for one of the base plate and the pad."""
PLATEN = 3.0
FACTORS = (50, 20, 10, 5, 2, 1)
TALLEST = 10.0
"""mm on the page of a laminate at most, where a factor allows it."""
DEEP = 0.7
"""Share of the pad that a pin may reach into on the page."""
STACK = 8.0, 19.0
"""Where the laminate lies along x."""
GAP = 3.0
LEAST = 24.0
"""mm on the page: room for the words beside the section."""
INKS = {
    "platen": "#c9ccd1",
    BASE_PLATE: "#e3e5e8",
    "film": "#e0872f",
    LAMINATE: "#bcd3ea",
    PAD: "#f3ddd6",
    UNDERLAY: "#ffffff",
}


def factor(step: Step) -> int:
    """By how much films are enlarged: pins that stand over the stack must end inside the pad."""
    pad = next(item.thickness_mm for item in step.build_up if item.part == PAD) * THICK
    over = max((pin.stands_mm for pin in step.pin_settings), default=step.top_mm) - step.top_mm
    paper = sum(item.thickness_mm for item in step.build_up if item.part == UNDERLAY)
    films = step.stack_mm + paper
    fits = (one for one in FACTORS if films * one <= TALLEST and over * one <= DEEP * pad)
    return next(fits, FACTORS[-1])


def build_up_svg(step: Step, name: str) -> str:
    """The section of one step, platen to platen, each part with its thickness beside it."""
    thick = {item.part: item for item in step.build_up}
    by = factor(step)
    plate, pad = thick[BASE_PLATE].thickness_mm * THICK, thick[PAD].thickness_mm * THICK
    release = thick["release film"].thickness_mm * by
    stack = step.stack_mm * by
    drawn = pad + 2 * release + stack + plate + 2 * PLATEN
    start = EDGE + max(0.0, LEAST - drawn) / 2
    top = start + PLATEN
    over = top + pad
    upper = over + release
    lower = upper + stack
    paper = thick[UNDERLAY].thickness_mm * by if UNDERLAY in thick else 0.0
    bed = lower + release
    face = bed + paper
    bottom = face + plate
    end = max(bottom + PLATEN, EDGE + LEAST)
    low, high = STACK
    words = "; ".join(f"{item.part} {item.thickness_mm:g} mm" for item in reversed(step.build_up))
    picture = Picture(name, WIDE + LABELS, end + 5.0, f"build-up of step {step.step}: {words}")
    for y in (start, bottom):
        picture.add(draw.box((EDGE, y), (WIDE, y + PLATEN), fill=INKS["platen"], stroke=draw.DARK))
    picture.add(
        draw.box((EDGE, face), (WIDE, bottom), fill=INKS[BASE_PLATE], stroke=draw.DARK),
        *_underlay(bed, face),
        _pad(top, over, bed - 2 * release, low, high),
        *_release(upper, bed, release, low, high),
        draw.box((low, upper), (high, lower), fill=INKS[LAMINATE], stroke=draw.DARK),
        *_pins(step.pin_settings, face, bottom, by, low, high),
    )
    said = [
        (start + PLATEN / 2, f"upper platen, {say.temperature(step.temperature_c)}"),
        (
            top + pad / 2,
            f"press pad {say.millimetres(thick[PAD].thickness_mm)}",
        ),
        (upper - release / 2, _release_words(step)),
        (
            upper + stack / 2,
            f"laminate {say.millimetres(step.stack_mm)}, ~{step.film_kpa:.0f} kPa",
        ),
        (bed - release / 2, "release film"),
        *_underlay_words(thick, (bed + face) / 2),
        (face + plate / 2, _plate_words(step, thick[BASE_PLATE].thickness_mm)),
        (bottom + PLATEN / 2, f"lower platen, {say.temperature(step.temperature_c)}"),
    ]
    rows = draw.spread([y for y, _ in said], GAP, EDGE + 2.0, end)
    for (y, text), row in zip(said, rows, strict=True):
        x = high - 1.5 if "laminate" in text else WIDE - 1.5
        picture.add(*draw.leader((x, y), (WIDE + 2.0, row), (WIDE + 3.5, row)))
        picture.add(draw.text((WIDE + 4.2, row + 0.8), text, size=2.3))
    scale = f"plate and pad 1:2; what lies between {by}:1; widths not"
    picture.add(draw.text((EDGE, end + 3.6), scale, size=2.2))
    return picture.svg()


def _underlay(top: float, bottom: float) -> list[str]:
    """The printed paper between plate and release film; nothing where there is none."""
    if top == bottom:
        return []
    return [draw.box((EDGE, top), (WIDE, bottom), fill=INKS[UNDERLAY], stroke=draw.DARK, width=0.1)]


def _underlay_words(thick: Mapping[str, BuildUpPart], y: float) -> list[tuple[float, str]]:
    if UNDERLAY not in thick:
        return []
    return [(y, f"underlay {say.millimetres(thick[UNDERLAY].thickness_mm)}, paper")]


def _release_words(step: Step) -> str:
    film = next(item for item in step.build_up if item.part == "release film")
    return f"release film {say.millimetres(film.thickness_mm)}"


def _plate_words(step: Step, plate: float) -> str:
    return f"base plate {say.millimetres(plate)}, {'pins in' if step.pin_settings else 'no pins'}"


def _pad(top: float, over: float, beside: float, low: float, high: float) -> str:
    """The pad, pressed together over the laminate; beside it, it comes down on the plate."""
    slope = min(4.0, beside - over)
    path = (
        f"M{EDGE} {top}H{WIDE}V{beside:.3f}H{high + slope:.3f}L{high} {over:.3f}"
        f"H{low}L{low - slope:.3f} {beside:.3f}H{EDGE}Z"
    )
    return f'<path d="{path}" fill="{INKS[PAD]}" stroke="{draw.DARK}" stroke-width="{draw.THIN}"/>'


def _release(upper: float, bed: float, release: float, low: float, high: float) -> list[str]:
    """The lower film lies flat; the upper one goes up over the laminate."""
    slope = min(4.0, bed - 2 * release - (upper - release))
    beside, over = bed - 1.5 * release, upper - release / 2
    ends = [(EDGE, beside), (low - slope, beside), (low, over), (high, over)]
    ends += [(high + slope, beside), (WIDE, beside)]
    flat = bed - release / 2
    return [
        draw.line([(EDGE, flat), (WIDE, flat)], colour=INKS["film"], width=release),
        draw.line(ends, colour=INKS["film"], width=release),
    ]


def _pins(
    settings: tuple[PinSetting, ...],
    face: float,
    bottom: float,
    by: int,
    low: float,
    high: float,
) -> list[str]:
    """The pins on the shoulders of their holes, seat 1:2, what stands over the plate enlarged.

    Below each is its push-out hole; the tips press into the pad.
    """
    parts = []
    for place, pin in enumerate(settings[:4]):
        x = low + (high - low) * (place + 1) / (min(len(settings), 4) + 1)
        half = pin.diameter_mm / 2
        tip, shoulder = face - pin.stands_mm * by, face + pin.seat_mm * THICK
        narrow = push_out(pin.diameter_mm) / 2
        parts += [
            draw.box(
                (x - narrow, shoulder), (x + narrow, bottom), fill="#ffffff", stroke=draw.DARK
            ),
            draw.box((x - half, tip), (x + half, shoulder), fill="#6d737c", stroke=draw.DARK),
        ]
    return parts


def pin_lines(step: Step) -> str:
    """Pins that are alike once: names, size, depth of the hole, height over plate and stack."""
    return "; ".join(
        f"{listed(names)}: ⌀{pin.diameter_mm:g} {draw.TIMES} {pin.length_mm:g} mm, "
        f"{pin.seat_mm:.2f} mm in the plate, {pin.stands_mm - pin.tolerance_mm:.2f} to "
        f"{pin.stands_mm + pin.tolerance_mm:.2f} mm over it, "
        f"{pin.stands_mm - pin.tolerance_mm - step.top_mm:.2f} mm or more over the stack"
        for names, pin in _alike(step)
    )


def _alike(step: Step) -> list[tuple[list[str], PinSetting]]:
    """Names of pins that are alike, and one of them."""
    groups: dict[PinSetting, list[str]] = {}
    for pin in sorted(step.pin_settings, key=lambda pin: (pin.diameter_mm, pin.length_mm)):
        groups.setdefault(replace(pin, pin=""), []).append(pin.pin)
    return [(names, pin) for pin, names in groups.items()]
