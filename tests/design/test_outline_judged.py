"""The size that is understood of an SVG is what resvg draws, or the drawing is refused.

``SBAFAB_SVGS`` sets how many random drawings are judged.
"""

from __future__ import annotations

import math
import os
import random
from pathlib import Path

import pytest

from sbafab.design.outline import described_outline
from sbafab.errors import DesignError
from sbafab.geometry.region import Region
from tests.design.judging_svg import PIXEL, seen

DRAWINGS = int(os.environ.get("SBAFAB_SVGS", "30"))
HALF = 25.4
PAGE = 'width="50.8mm" height="50.8mm" viewBox="-25.4 -25.4 50.8 50.8"'
"""A page of whole pixels."""
INCH = 'width="2in" height="2in" viewBox="-100 -100 200 200"'
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
    region, description = described_outline(path)
    low_x, low_y, high_x, high_y = region.bounds
    assert f"{high_x - low_x:.3f} x {high_y - low_y:.3f} mm" in description
    return region


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


CASES = [
    [part.strip(" ") for part in line.split(" |")]
    for line in Path(__file__).with_name("svgs.txt").read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
]


def filled(page: str, body: str) -> tuple[str, str]:
    """A page and a body of the table in full."""
    return (
        page.replace("PAGE", PAGE).replace("INCH", INCH),
        body.replace("{RECT}", RECT).replace("{DISC}", DISC),
    )


@pytest.mark.parametrize(("name", "page", "body", "words"), CASES)
def test_what_is_read_is_what_is_drawn_or_refused_in_a_sentence(
    tmp_path: Path, name: str, page: str, body: str, words: str
) -> None:
    page, body = filled(page, body)
    if not words:
        assert_same(understood_as(tmp_path, drawing(page, body)), page, body)
        return
    with pytest.raises(DesignError) as caught:
        understood_as(tmp_path, drawing(page, body))
    assert words in str(caught.value)
    assert str(tmp_path / "outline.svg") in str(caught.value)


def test_how_large_a_unit_is_is_said(tmp_path: Path) -> None:
    path = tmp_path / "outline.svg"
    for page, said in (
        (PAGE, "4.000 x 4.000 mm, read at 1 mm a unit"),
        ("", "4.000 x 4.000 mm, read at 1 mm a unit, for the page has no size in mm"),
        ('width="9mm"', "1.058 x 1.058 mm, read at 0.264583 mm a unit, 96 units an inch"),
    ):
        path.write_text(drawing(page, '<circle r="2"/>'))
        assert described_outline(path)[1] == f"drawn outline: {said}"


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
