"""A laminate in a notebook: the drawing of its patterns."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

from sbafab.actuators import build, load_design
from sbafab.reports.layers_svg import layers_svg

SVG = "{http://www.w3.org/2000/svg}"


def test_a_notebook_shows_the_drawing_of_all_patterns() -> None:
    laminate = replace(build(load_design("3dof-15mm", ["stack.balloons=2"])), name="<b> & co")
    page = laminate._repr_html_()
    assert page.startswith("<svg ")
    assert layers_svg(laminate).endswith(page)
    title = ElementTree.fromstring(page).find(f"{SVG}title")
    assert title is not None
    assert str(title.text).startswith("<b> & co: layers")
