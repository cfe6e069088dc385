"""tray.pdf read back by PDFium, and tray.html: every part of every laminate once, in its order."""

from __future__ import annotations

import re
from collections import Counter

import pypdfium2
import pytest
import shapely
from lxml import html as lxml_html

from sbafab.actuators import build, load_design
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.cycles import Runs, design_runs
from sbafab.pressing.schedule import schedule
from sbafab.reports.traveller.batch import tray_html
from sbafab.reports.traveller.work import Work
from sbafab.reports.tray_plan import tray_pdf
from tests.reports.test_underlay import BLACK, FILM, MASK, MM, SHA, paths


def planned(template: str, *changes: str) -> tuple[Laminate, Runs, pypdfium2.PdfDocument]:
    design = load_design(template, changes)
    laminate = build(design)
    runs = design_runs(design, laminate)
    data = tray_pdf(laminate, runs, SHA, design.order.batch)
    assert data is not None
    return laminate, runs, pypdfium2.PdfDocument(data)


def words(document: pypdfium2.PdfDocument, page: int) -> str:
    return document[page].get_textpage().get_text_range()


@pytest.mark.parametrize(
    ("template", "changes", "pages"),
    [
        ("3dof-15mm", ("order.copies=20", "stack.balloons=5"), 1),
        ("1dof-10mm", ("order.copies=3", "registration.method=ears"), 1),
        ("radial-15mm", ("order.copies=2",), None),
        ("3dof-15mm", ("stack.balloons=30", "order.copies=2"), 2),
    ],
)
def test_every_part_of_a_laminate_has_its_place_at_full_size(
    template: str, changes: tuple[str, ...], pages: int | None
) -> None:
    laminate, runs, document = planned(template, *changes)
    each, rest = divmod(len(document), runs.together)
    assert not rest
    assert each == (pages or each)
    labels = []
    areas: Counter[tuple[bool, float]] = Counter()
    for page in range(each):
        width, height = document[page].get_size()
        labels += re.findall(r"(\d+) (P\d+)", words(document, page))
        hulls = []
        for colour in (FILM, MASK):
            for line in paths(document, colour, page):
                shape = shapely.Polygon(line)
                assert shapely.box(0, 0, width * MM, height * MM).contains(shape)
                areas[colour == MASK, round(shape.area, 1)] += 1
                hulls.append(shape)
        # Holes lie in their parts; nothing else lies on anything.
        tree = shapely.STRtree(hulls)
        for one, other in tree.query(hulls, predicate="intersects").T:
            if one != other:
                a, b = hulls[one], hulls[other]
                assert a.contains(b) or b.contains(a)
        across, down = sorted(
            (line for line in paths(document, BLACK, page) if shapely.LineString(line).length > 50),
            key=lambda line: abs(line[0][1] - line[-1][1]),
        )
        for bar in (across, down):
            assert shapely.LineString(bar).length == pytest.approx(100, abs=0.01)
    if template == "3dof-15mm":
        # The paper's order: the bottom balloon, its base below it, the middle, the cap.
        order = [2, 3, 1, *range(4, len(laminate.layers) + 1)]
        assert [int(number) for number, _ in labels] == order
    assert {int(n): p for n, p in labels} == {
        layer.index: layer.pattern for layer in laminate.layers
    }
    assert len(labels) == len(laminate.layers)
    # Curves are followed in chords, which lie within a hundredth of the area.
    expected = sum(abs(c.area) for layer in laminate.layers for c in layer.profile.contours)
    assert sum(a * n for (_, a), n in areas.items()) == pytest.approx(expected, rel=0.01)
    assert sum(areas.values()) == sum(len(x.profile.contours) for x in laminate.layers)


def test_each_place_of_a_cycle_has_its_pages_with_its_serials() -> None:
    _, runs, document = planned("1dof-5mm", "order.copies=20", "order.batch=24")
    assert runs.cycles == (7, 7, 6)
    for page in range(len(document)):
        place = page + 1
        names = [f"24-{c}-{place:02d}" for c in ("ABC" if place < 7 else "AB")]
        assert f"place {place} ({', '.join(names)})" in words(document, page)


def test_the_page_for_the_phone_counts_patterns_by_cycle() -> None:
    design = load_design("1dof-5mm", ["order.copies=9", "stack.balloons=3"])
    laminate = build(design)
    plan = schedule(laminate, design, design_runs(design, laminate).cycles)
    text = tray_html(Work(design, laminate, plan, ()))
    assert text is not None
    assert "<script" not in text
    assert "http" not in text.replace("w3.org", "")
    page = lxml_html.fromstring(text)
    cards = {card.findtext(".//h2"): card for card in page.xpath("//li")}
    patterns = Counter(layer.pattern for layer in laminate.layers)
    assert set(cards) == set(patterns)
    for name, card in cards.items():
        assert card.xpath(".//svg//use/@href") == [f"#shape-{name}"]
        # Nine copies in cycles of five and four.
        counts = [int(b.text) for b in card.xpath(".//label/b")]
        assert counts == [5 * patterns[name], 4 * patterns[name]]
        assert card.xpath(".//span[@class='each']")[0].text.startswith(f"{patterns[name]} each")
