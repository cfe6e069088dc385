"""The size that is understood of an SVG is what resvg draws, or the drawing is refused.

``SBAFAB_SVGS`` sets how many random drawings are judged.
"""

from __future__ import annotations

import math
import os
import random
from pathlib import Path

import pytest

from sbafab.design.outline import understood
from sbafab.errors import DesignError
from sbafab.geometry.region import Region
from tests.design.judging_svg import PIXEL, seen

DRAWINGS = int(os.environ.get("SBAFAB_SVGS", "30"))
HALF = 25.4
PAGE = 'width="50.8mm" height="50.8mm" viewBox="-25.4 -25.4 50.8 50.8"'
"""A page of whole pixels."""
INCH = 'width="2in" height="2in" viewBox="-100 -100 200 200"'
BARE = 'width="60mm" height="60mm"'
RECT = '<rect x="-5" y="-3" width="10" height="6"/>'
DISC = '<circle r="4"/>'


def drawing(page: str, body: str) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f"{page}>{body}</svg>"
    )


def understood_as(folder: Path, text: str) -> Region:
    path = folder / "outline.svg"
    path.write_text(text, encoding="utf-8")
    found = understood(path)
    low_x, low_y, high_x, high_y = found.region.bounds
    assert f"{high_x - low_x:.3f} x {high_y - low_y:.3f} mm" in found.description
    return found.region


def assert_same(region: Region, page: str, body: str) -> None:
    """Size and area are those that are drawn; without a viewBox, of a copy that is moved."""
    on_page = f'<g transform="translate(100 100)">{body}</g>'
    picture = seen(drawing(page, body if "viewBox" in page else on_page))
    assert picture is not None, "nothing is drawn"
    assert picture.whole, "some of it may lie beyond the page"
    # Half shades along the edge are good to a seventh of a pixel.
    edge = sum(contour.length for contour in region.contours)
    assert region.area == pytest.approx(picture.area, abs=0.15 * PIXEL * edge)
    low_x, low_y, high_x, high_y = region.bounds
    assert (high_x - low_x, high_y - low_y) == pytest.approx(picture.size, abs=2.1 * PIXEL)
    if page == PAGE:
        ours = (low_x + HALF, low_y + HALF, high_x + HALF, high_y + HALF)
        assert ours == pytest.approx(picture.bounds, abs=1.1 * PIXEL)


READ = {
    "inches": (INCH, '<circle r="20"/>'),
    "one size in px": ('width="40mm" height="100" viewBox="-20 -20 40 40"', RECT),
    "meet": (
        'width="60mm" height="30mm" viewBox="-20 -20 40 40" preserveAspectRatio="xMaxYMin meet"',
        DISC,
    ),
    "rounded by ry": (PAGE, '<rect x="-5" y="-3" width="10" height="6" ry="2"/>'),
    "rounded too much": (PAGE, '<rect x="-5" y="-3" width="10" height="6" rx="9" ry="1"/>'),
    "ellipse": (PAGE, '<ellipse cx="1" cy="-1" rx="6" ry="3"/>'),
    "exponents": (PAGE, '<path d="M-5e0-.3e1h1E1v6.0H-5.z"/>'),
    "smooth curves": (PAGE, '<path d="M-6 0C-6-6-2-5 0-4S5-3 6 0 2 5 0 5-6 4-6 0z"/>'),
    "smooth quadratics": (PAGE, '<path d="M-6 0Q-3-6 0-3T6 0T0 4T-6 0z"/>'),
    "a smooth curve after another kind": (
        PAGE,
        '<path d="M-5-3L5-3S8 4 0 5T-5 3z"/>',
    ),
    "a smooth curve after a quadratic": (PAGE, '<path d="M-5-3Q0-6 5-3S8 4 0 5T-6 5-5 0z"/>'),
    "flags without spaces": (PAGE, '<path d="M-4-3H4A3 3 0 014 3H-4A3 3 0 01-4-3z"/>'),
    "arcs that are too small": (PAGE, '<path d="M-4 0A1 2 0 0 1 4 0A4 3 0 0 1-4 0z"/>'),
    "turned arcs": (PAGE, '<path d="M-4 0A5 3 30 1 1 4 1A5 6-20 0 1-4 0z"/>'),
    "arcs without radius": (PAGE, '<path d="M-4-3A0 5 0 0 1 4-3A5 0 0 0 1 4 3H-4z"/>'),
    "an arc to where it begins": (PAGE, '<path d="M-4-3A5 5 0 1 1-4-3H4V3h-8z"/>'),
    "lines after a close": (PAGE, '<path d="M-4-3H4V3h-8zm0 0z"/>'),
    "arcs of negative radius": (PAGE, '<path d="M-4 0A-4-4 0 0 1 4 0A4 4 0 0 1-4 0z"/>'),
    "nested transforms": (
        PAGE,
        f'<g transform="rotate(20) scale(1.5,.8)"><a transform="skewX(10)">{RECT}</a></g>',
    ),
    "a list of transforms": (
        PAGE,
        f'<g transform="translate(1),rotate(30 1 1) skewY(5)matrix(1 0 0.1 1 0 -1)">{RECT}</g>',
    ),
    "mirrored": (PAGE, '<polygon points="-5,-3 5,-3 0,6" transform="scale(-1 1) rotate(90)"/>'),
    "style over attribute": (PAGE, f'<g display="inline" style="display:block">{DISC}</g>'),
    "hidden with effects": (PAGE, f'<g style="display:none" clip-path="url(#c)">{RECT}</g>{DISC}'),
    "attributes of programs": (
        PAGE,
        f'<g id="a" class="b" data-name="c" xml:space="preserve" style="fill:#00f;stroke:none;'
        f'stroke-width:0.1;-inkscape-stroke:none;clip-rule:evenodd;filter:none">{DISC}</g>',
    ),
    "stroke that does not scale": (PAGE, '<circle r="4" vector-effect="non-scaling-stroke"/>'),
    "definitions": (
        PAGE,
        f'<defs>{RECT}<symbol id="s">{RECT}</symbol></defs><clipPath id="c">{RECT}</clipPath>'
        f'<mask id="m">{RECT}</mask><marker id="k">{RECT}</marker><pattern>{RECT}</pattern>{DISC}',
    ),
}


@pytest.mark.parametrize("name", READ)
def test_what_is_read_is_what_is_drawn(tmp_path: Path, name: str) -> None:
    page, body = READ[name]
    region = understood_as(tmp_path, drawing(page, body))
    assert_same(region, page, body)


REFUSED = {
    "clone": ('<defs><g id="a"><circle r="4"/></g></defs><use href="#a"/>', "holds <use>"),
    "picture in the picture": ('<svg width="50%" viewBox="0 0 1 1"><circle r="4"/></svg>', "<svg>"),
    "shape in a shape": (f'<path d="">{DISC}</path>', "no closed path"),
    "clip": (
        f'<clipPath id="c"><circle r="2"/></clipPath><g clip-path="url(#c)">{DISC}</g>',
        'clip-path "url(#c)" on <g>',
    ),
    "origin": (
        '<rect x="-5" y="-3" width="9" height="6" transform="rotate(9)" transform-origin="1 0"/>',
        'transform-origin "1 0" on <rect>',
    ),
    "style escape": (r'<circle r="4" style="\72:8px"/>', r"\72"),
    "sheet radius": (f"<style>circle{{fill:red; R : 8px}}</style>{DISC}", "has R in a style sheet"),
    "sheet turn": (f"<style>@media all{{circle{{rotate:9deg}}}}</style>{DISC}", "rotate"),
    "sheet import": (f'<style>@import "a.css";</style>{DISC}', "imports"),
    "animation": (
        '<circle r="4"><animate attributeName="r" from="8" to="8"/></circle>',
        "<animate>",
    ),
    "unknown element": (f"<blob>{DISC}</blob>", "<blob>"),
    "attribute of another shape": ('<circle r="4" d="M0 0"/>', 'd "M0 0" on <circle>'),
    "mm": ('<circle r="4mm"/>', 'r "4mm" on <circle>, no coordinate'),
    "sum": ('<circle r="calc(2px + 2px)"/>', "calc"),
    "negative": ('<circle r="-4"/>', "negative"),
    "half an ellipse": ('<ellipse rx="4"/>', "only one of rx and ry"),
    "odd points": ('<polygon points="-5 -3 5 -3 0"/>', 'damaged at "0"'),
    "bad path": ('<path d="M-5-3h10v6 12 x H-5z"/>', "damaged at"),
    "short path": ('<path d="M-5-3h10v6C1 2 3 4 5H-5z"/>', 'damaged at "C1 2 3 4 5H-5z"'),
    "bad transform": ('<circle r="4" transform="scale(2) rotate(1 2)"/>', "damaged at"),
    "capital attribute": (f'<g display="NONE">{RECT}</g>{DISC}', 'display "NONE"'),
    "space of another kind": ('<circle r="4\u00a0"/>', "no coordinate"),
    "hidden": ('<circle r="4" visibility="hidden"/>', 'visibility "hidden"'),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_programs_read_differently_is_refused(tmp_path: Path, name: str) -> None:
    body, message = REFUSED[name]
    with pytest.raises(DesignError) as caught:
        understood_as(tmp_path, drawing(PAGE, body))
    assert message in str(caught.value)


BAD_PAGES = {
    "percent": (
        'width="40mm" height="50%" viewBox="-20 -20 40 40"',
        "only one of width and height",
    ),
    "fit": (f'{PAGE} preserveAspectRatio="cover"', "preserveAspectRatio"),
    "stretched": (f'{PAGE} preserveAspectRatio="none"', "preserveAspectRatio"),
    "transform": (f'{PAGE} transform="scale(2)"', 'transform "scale(2)" on <svg>'),
    "short view": ('width="40mm" viewBox="0 0 40"', "viewBox"),
}


@pytest.mark.parametrize("name", BAD_PAGES)
def test_a_page_that_programs_read_differently_is_refused(tmp_path: Path, name: str) -> None:
    page, message = BAD_PAGES[name]
    with pytest.raises(DesignError) as caught:
        understood_as(tmp_path, drawing(page, DISC))
    assert message in str(caught.value)


def test_how_large_a_unit_is_is_said(tmp_path: Path) -> None:
    path = tmp_path / "outline.svg"
    for page, said in (
        (PAGE, "4.000 x 4.000 mm, read at 1 mm a unit"),
        ("", "4.000 x 4.000 mm, read at 1 mm a unit, for the page has no size in mm"),
        ('width="9mm"', "1.058 x 1.058 mm, read at 0.264583 mm a unit, 96 units an inch"),
    ):
        path.write_text(drawing(page, '<circle r="2"/>'))
        assert understood(path).description == f"drawn outline: {said}"


def a_shape(dice: random.Random, size: float) -> str:
    """A shape of about ``size`` user units round the origin."""

    def of(share: float) -> str:
        return f"{share * size:.9f}{dice.choice(('', 'px'))}"

    kind = dice.randrange(7)
    if kind == 0:
        return f'<circle cx="{of(0.1)}" cy="{of(-0.1)}" r="{of(0.5)}"/>'
    if kind == 1:
        return f'<ellipse cy="{of(0.1)}" rx="{of(0.6)}" ry="{of(0.4)}"/>'
    if kind == 2:
        corner = f'x="{of(-0.5)}" y="{of(-0.4)}" ry="{of(0.2)}"'
        return f'<rect {corner} width="{of(1)}" height="{of(0.7)}"/>'
    if kind == 3:
        s = size / 2
        return (
            f'<path d="M{-s} {-s / 2}h{2 * s}a{s / 2} {s} {dice.randrange(90)} 0 1 0,{s}H{-s}z"/>'
        )
    if kind > 4:
        return a_path(dice, size / 2)
    s = size
    return f'<polygon points="{-s / 2},{-s / 2} {s / 2},{-s / 3} {s / 4} {s / 2}"/>'


def a_path(dice: random.Random, radius: float) -> str:
    """A closed path round the origin of commands by chance."""
    stops = [
        (radius * math.cos(turn), radius * math.sin(turn))
        for turn in (k * math.tau / 7 + dice.uniform(-0.2, 0.2) for k in range(7))
    ]

    def near(k: int) -> str:
        return " ".join(f"{v * dice.uniform(0.9, 1.3):.6f}" for v in stops[k % 7])

    parts = []
    for k in range(1, 7):
        x, y = stops[k]
        far = (x - stops[k - 1][0], y - stops[k - 1][1])
        arc = f"{radius * 1.5:.6f} {radius * 2:.6f} {dice.randrange(180)} 0{dice.randrange(2)}"
        end = f"{x:.6f},{y:.6f}"
        parts.append(
            dice.choice(
                (
                    f"L{end}",
                    f"l{far[0]:.6f} {far[1]:.6f}",
                    f"H{x:.6f}V{y:.6f}",
                    f"C{near(k - 1)} {near(k)} {end}",
                    f"S{near(k)} {end}",
                    f"Q{near(k)} {end}",
                    f"T{end}",
                    f"A{arc}{end}",
                    f"a{arc} {far[0]:.6f}{far[1]:+.6f}",
                )
            )
        )
    return f'<path d="M{stops[0][0]:.6f} {stops[0][1]:.6f}{"".join(parts)}z"/>'


def a_transform(dice: random.Random, size: float) -> str:
    choices = (
        f"translate({size * dice.uniform(-0.1, 0.1):.6f} {size * dice.uniform(-0.1, 0.1):.6f})",
        f"rotate({dice.uniform(-180, 180):.6f})",
        f"rotate({dice.uniform(-20, 20):.6f},{size / 9:.6f},0)",
        f"scale({dice.uniform(0.7, 1.4):.6f})",
        f"scale({dice.uniform(0.7, 1.4):.6f} {-dice.uniform(0.7, 1.4):.6f})",
        f"skewX({dice.uniform(-20, 20):.6f})",
        f"matrix(1 .1 {dice.uniform(-0.3, 0.3):.6f} 1 0 0)",
    )
    return " ".join(dice.choice(choices) for _ in range(dice.randrange(3)))


def a_drawing(dice: random.Random) -> tuple[str, str]:
    """A page and what is drawn on it, about 9 mm across."""
    unit = dice.choice((1.0, 0.1, 25.4 / 96, 25.4 / 72, 2.0))
    high = dice.choice((38.1, 50.8))
    ratio = dice.choice((1.0, 1.25))
    view = high / unit
    fit = dice.choice(("xMidYMid meet", "xMinYMax"))
    page = (
        f'width="{high * ratio / 10:.9f}cm" height="{high:.9f}mm" '
        f'viewBox="{-view / 2:.9f} {-view / 2:.9f} {view:.9f},{view:.9f}" '
        f'preserveAspectRatio="{fit}"'
    )
    size = 9 / unit
    body = a_shape(dice, size)
    for _ in range(dice.randrange(3)):
        body = f'<g transform="{a_transform(dice, size)}">{body}</g>'
    return page, body


def test_random_drawings_are_read_as_they_are_drawn(tmp_path: Path) -> None:
    dice = random.Random(12)
    read = 0
    for number in range(DRAWINGS):
        page, body = a_drawing(dice)
        try:
            region = understood_as(tmp_path, drawing(page, body))
        except DesignError as error:
            said = str(error)
            known = ("origin", "crosses or touches itself", "cusp")
            assert any(word in said for word in known), (number, page, body, said)
            continue
        read += 1
        assert_same(region, page, body)
    assert read > 0.7 * DRAWINGS
