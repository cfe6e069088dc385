"""Random designs with exactly one thing wrong, and the rule or the words that must refuse them."""

from __future__ import annotations

import math
from collections.abc import Callable

from hypothesis import strategies as st

from tests.properties.designs import Draft, lobed, mm, one_dof, radial, svg, valid

Broken = st.SearchStrategy[Draft]


def bond(draft: Draft) -> float:
    return float(draft.tables["bond"]["width"])


def strip(draft: Draft) -> float:
    """Width of the inlet strip, as asked for or half the tube's perimeter."""
    inlet = draft.tables["inlet"]
    return float(inlet.get("width", math.pi * inlet["tube_outer_diameter"] / 2))


def stacked(families: st.SearchStrategy[Draft]) -> st.SearchStrategy[Draft]:
    return families.filter(lambda draft: draft.tables["stack"]["balloons"] > 1)


@st.composite
def narrow_bond(draw: st.DrawFn) -> Draft:
    draft = draw(one_dof()).having("bond.width", draw(mm(0.3, 0.748)))
    return draft.having("rules.bond_width", 0.75)


@st.composite
def strict_bond(draw: st.DrawFn) -> Draft:
    draft = draw(valid())
    return draft.having("rules.bond_width", bond(draft) + draw(mm(0.002, 1.0)))


@st.composite
def short_overhang(draw: st.DrawFn) -> Draft:
    draft = draw(valid())
    short = draft.tables["mask"]["overhang"] + draw(mm(0.002, 1.0))
    return draft.having("rules.mask_overhang", short)


@st.composite
def narrow_strip(draw: st.DrawFn) -> Draft:
    draft = draw(valid())
    needed = math.pi * draft.tables["inlet"]["tube_outer_diameter"] / 2
    return draft.having("inlet.width", needed - draw(mm(0.002, 0.4)))


@st.composite
def thick_tube(draw: st.DrawFn) -> Draft:
    draft = draw(valid())
    width = strip(draft)
    thick = 2 * width / math.pi + draw(mm(0.002, 2.0))
    return draft.having("inlet.width", width).having("inlet.tube_outer_diameter", thick)


@st.composite
def coarse_laser(draw: st.DrawFn) -> Draft:
    draft = draw(one_dof() | lobed())
    # The strip is wider by what cutting takes.
    return draft.having("laser.least_feature", strip(draft) + draw(mm(0.5, 2.0)))


@st.composite
def wide_kerf(draw: st.DrawFn) -> Draft:
    """The kerf takes a bore that is narrower than itself."""
    draft = draw(stacked(one_dof() | lobed()))
    return draft.having("bore.diameter", draw(mm(0.2, 0.9))).having("laser.kerf_ptfe", 1.0)


@st.composite
def small_platen(draw: st.DrawFn) -> Draft:
    side = draw(st.sampled_from(["platen_width", "platen_length"]))
    return draw(valid()).having(f"press.{side}", draw(mm(1.0, 2.5)))


@st.composite
def slender_window(draw: st.DrawFn) -> Draft:
    return draw(radial()).having("window.width", draw(mm(0.25, 0.748)))


@st.composite
def pocket_within_strip(draw: st.DrawFn) -> Draft:
    draft = draw(one_dof()).having("stack.balloons", 1)
    diameter = strip(draft) * draw(mm(0.5, 0.95))
    draft = draft.having("inlet.width", strip(draft))
    return Draft({**draft.tables, "chamber": {"diameter": diameter}})


@st.composite
def wide_bore(draw: st.DrawFn) -> Draft:
    draft = draw(stacked(valid()))
    return draft.having("bore.diameter", draw(mm(60.0, 100.0)))


@st.composite
def near_axes(draw: st.DrawFn) -> Draft:
    draft = draw(lobed())
    nearest = draft.tables["lumen"]["diameter"] / 2 + bond(draft)
    return draft.having("chamber.axis_radius", draw(mm(0.01, nearest)))


@st.composite
def thin_tube(draw: st.DrawFn) -> Draft:
    draft = draw(radial().filter(lambda draft: draft.tables["chamber"]["count"] > 1))
    chamber = draft.tables["chamber"]
    most = chamber["count"] * chamber["width"] / math.pi
    return draft.having("tube.outer_diameter", most * draw(mm(0.2, 0.999)))


@st.composite
def wide_window(draw: st.DrawFn) -> Draft:
    draft = draw(radial())
    side = draw(st.sampled_from(["width", "length"]))
    return draft.having(f"window.{side}", draft.tables["chamber"][side] + draw(mm(0.01, 5.0)))


@st.composite
def long_taper(draw: st.DrawFn) -> Draft:
    draft = draw(one_dof() | lobed())
    number = draft.tables["stack"]["balloons"] + draw(st.integers(1, 5))
    chamber = {key: value for key, value in draft.tables["chamber"].items() if key != "outline"}
    return Draft({**draft.tables, "chamber": {**chamber, "diameter": [40.0] * number}})


def drawn(path: str) -> Callable[[Draft], Draft]:
    def with_path(draft: Draft) -> Draft:
        name, text = svg(path)
        return Draft({**draft.tables, "chamber": {"outline": name}}, (name, text))

    return with_path


def wrong_value(key: str, values: list[object]) -> Broken:
    return st.builds(
        lambda draft, value: draft.having(key, value), valid(), st.sampled_from(values)
    )


LENGTHS = (
    "bond.width",
    "mask.overhang",
    "bore.diameter",
    "fillet.radius",
    "inlet.tab_length",
    "inlet.tube_outer_diameter",
    "press.platen_width",
    "laser.least_feature",
    "rules.bond_width",
)
NO_LENGTHS: list[object] = [-1, -0.001, 1e9, math.inf, math.nan, "wide", "2 furlongs", True, [1.0]]

RULES: dict[str, tuple[str, Broken]] = {
    "bond.width below its limit": ("bond-width", narrow_bond()),
    "rules.bond_width above the bonds": ("bond-width", strict_bond()),
    "window narrower than a bond": ("bond-width", slender_window()),
    "rules.mask_overhang above the masks": ("mask-overhang", short_overhang()),
    "strip below half the tube's perimeter": ("tube-fit", narrow_strip()),
    "tube above what the strip opens to": ("tube-fit", thick_tube()),
    "least feature above the strip": ("film-limits", coarse_laser()),
    "kerf wider than the bore": ("film-limits", wide_kerf()),
    "laminate larger than the platen": ("press-fit", small_platen()),
}
"""What is wrong: the rule that must fail, and designs with it."""

REFUSALS: dict[str, tuple[str, Broken]] = {
    "bore and neck ring fill the pocket": ("bore.diameter", wide_bore()),
    "axes too near": ("chamber.axis_radius", near_axes()),
    "tube too thin for its SBAs": ("tube.outer_diameter", thin_tube()),
    "window past the outline": ("window.", wide_window()),
    "too many diameters": ("chamber.diameter", long_taper()),
    "strip wider than its pocket": ("inlet.width", pocket_within_strip()),
    "open drawing": ("is open", one_dof().map(drawn("M-5,-5 H5 V5 H-5 V-4.9"))),
    "drawing that crosses itself": ("crosses", one_dof().map(drawn("M-5,-5 L5,5 H-5 L5,-5 Z"))),
    "drawing round nothing": (
        "centroid outside itself",
        one_dof().map(drawn("M0,0 H9 V9 H7 V1 H2 V9 H0 Z")),
    ),
    "two drawings": ("2 closed", lobed().map(drawn("M-5,-5 H5 V5 H-5 Z M-9,-9 H9 V9 H-9 Z"))),
    "no drawing": (
        "nowhere.svg",
        lobed().map(lambda d: Draft({**d.tables, "chamber": {"outline": "nowhere.svg"}})),
    ),
    "unknown key": ("bond.widht", valid().map(lambda d: d.having("bond.widht", 1.0))),
    "unknown family": ("family", valid().map(lambda d: d.having("family", "lobbed"))),
    "unknown rule": ("rules.waive", valid().map(lambda d: d.having("rules.waive", ["bonds"]))),
    "name that is a path": ("name", valid().map(lambda d: d.having("name", "../drawn"))),
    "balloons": ("stack.balloons", wrong_value("stack.balloons", [0, -3, 1001, 10**9, 2.5, "six"])),
    "count": ("chamber.count", lobed().map(lambda d: d.having("chamber.count", 9))),
    **{key: (key, wrong_value(key, NO_LENGTHS)) for key in LENGTHS},
}
"""What is wrong: words that the sentence must hold, and designs with it."""
