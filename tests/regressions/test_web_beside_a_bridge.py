"""A web between two corners of which no edge faces the other was taken for 0.750 mm wide.

Strips of film cross the hollow between two drawn pockets and enclose a gap there; between the gap
and the outside the web is narrowest along a strip's side.
"""

from __future__ import annotations

import textwrap
from dataclasses import replace
from pathlib import Path

import pytest

from sbafab.actuators import build, load_design
from sbafab.geometry.edges import unit
from sbafab.geometry.region import strip, union
from sbafab.rules import bond_width
from sbafab.rules.measures import Measures

POCKET = """\
M7.4385,-0.5690 L7.1693,0.5514 L6.4333,1.4903 L5.4036,2.1357 L4.2995,2.4855 L3.3106,2.6463
L2.5349,2.7889 L1.9536,3.0784 L1.4512,3.6046 L0.8727,4.3405 L0.0950,5.1447 L-0.9149,5.8070
L-2.0789,6.1209 L-3.2302,5.9565 L-4.1733,5.3053 L-4.7559,4.2815 L-4.9272,3.0795
L-4.7578,1.9034 L-4.4150,0.8963 L-4.1010,0.0956 L-3.9778,-0.5690 L-4.1065,-1.2344
L-4.4243,-2.0372 L-4.7684,-3.0468 L-4.9365,-4.2242 L-4.7620,-5.4255 L-4.1755,-6.4462
L-3.2293,-7.0927 L-2.0767,-7.2520 L-0.9133,-6.9342 L0.0950,-6.2706 L0.8710,-5.4678
L1.4490,-4.7357 L1.9527,-4.2146 L2.5371,-3.9299 L3.3167,-3.7903 L4.3088,-3.6302
L5.4143,-3.2790 L6.4427,-2.6313 L7.1748,-1.6902 Z
"""
DESIGN = """
    name = "web"
    family = "lobed"
    [stack]
    balloons = 2
    [bore]
    diameter = 1.04
    [fillet]
    radius = 1
    [inlet]
    tab_length = 10.214
    width = 3.572
    [lumen]
    diameter = 4.194
    [chamber]
    outline = "pocket.svg"
    count = 3
    axis_radius = 9.384
"""
STRIPS = union(
    strip((0.0, 0.0), (9.5703 * x, 9.5703 * y), 1.0) for x, y in map(unit, (60, 180, 300))
)


def test_the_web_is_as_wide_as_shapely_finds_it(tmp_path: Path) -> None:
    view = 'viewBox="-50 -50 100 100" width="100mm" height="100mm"'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" {view}><path d="{POCKET}"/></svg>'
    (tmp_path / "pocket.svg").write_text(svg)
    (tmp_path / "web.toml").write_text(textwrap.dedent(DESIGN))
    design = load_design(str(tmp_path / "web.toml"))
    laminate = build(design)
    layers = [
        layer if layer.is_mask else replace(layer, profile=layer.profile | STRIPS)
        for layer in laminate.layers
    ]
    laminate = replace(laminate, layers=tuple(layers))
    (bond,) = laminate.interfaces[0].bond.shapely().geoms
    web = min(bond.exterior.distance(hole) for hole in bond.interiors)
    (finding,) = bond_width.check(Measures(laminate, design))
    assert finding.verdict == "fail"
    assert finding.measured == pytest.approx(web, abs=2e-3)
    assert web < 0.6
