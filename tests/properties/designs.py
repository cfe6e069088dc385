"""Random designs of every family: valid by closed formulas, or with exactly one thing broken.

A drawn design is what a user would type: the tables of its TOML file, and the drawing beside it if
it names one. What makes it valid is worked out here, without any function of sbafab.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import tomli_w
from hypothesis import assume
from hypothesis import strategies as st

LEAST_FEATURE = 0.2
ROOM = 0.3
"""mm of free film that a valid design leaves between what must not meet."""
HALF_PLATEN = 75.0
PIN = 1.5
"""Diameter of the pins of ears."""


class Draft(NamedTuple):
    """A design file as tables, and the drawing of its pockets: file name and text."""

    tables: dict[str, Any]
    drawing: tuple[str, str] | None = None

    def write(self, folder: Path) -> Path:
        """The design file, written into ``folder``."""
        if self.drawing is not None:
            name, text = self.drawing
            (folder / name).write_text(text, encoding="utf-8")
        path = folder / "design.toml"
        path.write_text(tomli_w.dumps(self.tables), encoding="utf-8")
        return path

    def having(self, key: str, value: object) -> Draft:
        """The same design with one dotted key set."""
        tables = {name: dict(t) if isinstance(t, dict) else t for name, t in self.tables.items()}
        section, _, field = key.partition(".")
        if field:
            tables.setdefault(section, {})[field] = value
        else:
            tables[section] = value
        return Draft(tables, self.drawing)


def mm(low: float, high: float) -> st.SearchStrategy[float]:
    """Lengths to the um, the plain ones first when shrinking."""
    return st.integers(math.ceil(low * 1000 - 1e-6), math.floor(high * 1000 + 1e-6)).map(
        lambda um: um / 1000
    )


class Common(NamedTuple):
    """What every family shares, and what follows from it for the pockets."""

    tables: dict[str, Any]
    balloons: int
    bond: float
    overhang: float
    strip: float
    tab_length: float

    @property
    def setback(self) -> float:
        """How far film stands back from the masks' edge at bores and lumen."""
        return self.overhang if self.tables["registration"]["method"] == "ears" else 0.0

    @property
    def neck(self) -> float:
        """Radius of the neck ring; 0 where there is none."""
        bore = self.tables["bore"]["diameter"] / 2 + self.setback
        return float(bore + self.bond) if self.balloons > 1 else 0.0

    @property
    def ear(self) -> float:
        """How far the longest ear reaches out, about; 0 without ears."""
        if not self.setback:
            return 0.0
        return 4 * self.tables["fillet"]["radius"] + self.overhang + 3.0 + PIN + 2 * self.bond

    @property
    def tail(self) -> float:
        """How far a strip runs on past the tab's end and its overhang; 0 without ears."""
        width = PIN + 2 * self.bond
        return (width if self.balloons > 1 else 3 * width) if self.setback else 0.0

    @property
    def least_half(self) -> float:
        """What a pocket must leave free round its axis: neck ring, or the inlet strip's start."""
        return max(self.neck, self.strip / 2) + ROOM


@st.composite
def common(
    draw: st.DrawFn, most_balloons: int = 20, longest_tab: float = 20.0, ears: bool = True
) -> Common:
    bond, overhang = draw(mm(0.75, 2.5)), draw(mm(0.5, 1.5))
    balloons = draw(st.integers(1, most_balloons))
    tube, mask = draw(mm(0.4, 3.0)), draw(mm(0.01, 0.1))
    # Tube and strip opened round, and 0.1 of cutting error on each edge and 0.1 of kerf.
    least = math.pi / 2 * (tube + mask) + 0.3
    inlet: dict[str, Any] = {
        "tube_outer_diameter": tube,
        "tab_length": draw(mm(1.0, longest_tab)),
    }
    strip = math.ceil(least / 0.05) * 0.05
    if draw(st.booleans()):
        inlet["width"] = strip = math.ceil(least * 1000) / 1000 + draw(mm(0, 1.5))
    method = "ears" if ears and draw(st.booleans()) else "channel-pin"
    tables = {
        "stack": {"balloons": balloons},
        "registration": {"method": method},
        "bond": {"width": bond},
        "mask": {"overhang": overhang},
        # Less would tear over a pin (rule pin-fit).
        "bore": {"diameter": draw(mm(0.8, 2.5))},
        "fillet": {"radius": draw(st.just(0.0) | mm(0.1, 3.0))},
        "inlet": inlet,
        "films": {
            "tpe": {"thickness": draw(mm(0.02, 0.2))},
            "ptfe": {"thickness": mask},
        },
        "rules": {
            "bond_width": draw(st.sampled_from([0.75, bond])),
            "mask_overhang": draw(st.sampled_from([0.5, overhang])),
            # What errors in cutting and pressing leave of them is another matter.
            "worst_bond_width": 0.0,
            "worst_mask_overhang": 0.0,
            "yield_builds": 100,
        },
        # As large as a press takes, for a sheet that is wrapped round a thick tube.
        "sheets": {film: {"width": 200.0, "length": 200.0} for film in ("tpe", "ptfe")},
    }
    if draw(st.booleans()):
        tables["laser"] = {"kerf_tpe": draw(mm(0, 0.15)), "kerf_ptfe": draw(mm(0, 0.15))}
    return Common(tables, balloons, bond, overhang, strip, inlet["tab_length"])


class Pockets(NamedTuple):
    """The pockets of a stack: how the design names them, their least and largest reach."""

    chamber: dict[str, Any]
    sizes: tuple[float, ...]
    drawing: tuple[str, str] | None = None

    @property
    def least_reach(self) -> float:
        return min(self.sizes)

    @property
    def reach(self) -> float:
        return max(self.sizes)


@st.composite
def pockets(draw: st.DrawFn, shared: Common, most: float) -> Pockets:
    """Discs of one diameter, tapered ones, or a drawing."""
    least = shared.least_half
    most = max(most, 1.3 * least + 0.5)
    kind = draw(st.sampled_from(["disc", "taper", "drawing"]))
    if kind == "drawing":
        return draw(drawings(least, most))
    if kind == "disc":
        diameter = draw(mm(2 * least, 2 * most))
        return Pockets({"diameter": diameter}, (diameter / 2,))
    size = shared.balloons
    few = draw(st.lists(mm(2 * least, 2 * most), min_size=1, max_size=3, unique=True))
    diameters = draw(st.lists(st.sampled_from(few), min_size=size, max_size=size))
    return Pockets({"diameter": diameters}, tuple(d / 2 for d in set(diameters)))


@st.composite
def drawings(draw: st.DrawFn, least: float, most: float) -> Pockets:
    """A convex closed path round (0, 0) that leaves ``least`` free there, as SVG or DXF."""
    a, b = draw(mm(1.3 * least, most)), draw(mm(1.3 * least, most))
    make = draw(st.sampled_from([svg_bezier, svg_rounded, dxf_stadium, dxf_polygon, dxf_ellipse]))
    name, text = draw(make(a, b, least))
    return Pockets({"outline": name}, (least, math.hypot(a, b)), (name, text))


def svg(path: str) -> tuple[str, str]:
    return "pocket.svg", f'<svg xmlns="http://www.w3.org/2000/svg"><path d="{path}"/></svg>'


@st.composite
def svg_bezier(draw: st.DrawFn, a: float, b: float, least: float) -> tuple[str, str]:
    """Four cubic curves between the ends of the axes; the middle of each is 0.87 out at least."""
    k = draw(mm(0.3, 0.8))
    x = draw(mm(-0.1 * least, 0.1 * least))
    return svg(
        f"M{x + a},0 C{x + a},{k * b} {x + k * a},{b} {x},{b} S{x - a},{k * b} {x - a},0 "
        f"S{x - k * a},{-b} {x},{-b} S{x + a},{-k * b} {x + a},0 Z"
    )


@st.composite
def svg_rounded(draw: st.DrawFn, a: float, b: float, least: float) -> tuple[str, str]:
    r = draw(mm(0.1, min(a, b) - 0.1))
    arc = f"a{r},{r} 0 0 1"
    return svg(
        f"M{-a + r},{-b} h{2 * (a - r)} {arc} {r},{r} v{2 * (b - r)} {arc} {-r},{r} "
        f"h{-2 * (a - r)} {arc} {-r},{-r} v{-2 * (b - r)} {arc} {r},{-r} Z"
    )


def dxf(add: Callable[[Any], object]) -> tuple[str, str]:
    """A DXF drawing of what ``add`` puts into its model space, as text."""
    import io

    import ezdxf

    document = ezdxf.new(units=4)
    add(document.modelspace())
    stream = io.StringIO()
    document.write(stream)
    return "pocket.dxf", stream.getvalue()


@st.composite
def dxf_stadium(draw: st.DrawFn, a: float, b: float, least: float) -> tuple[str, str]:
    """A rectangle whose two ends bulge outward as far as a half circle."""
    bulge = draw(mm(0.1, 1.0))
    length = max(a - bulge * b, least)
    points = [(-length, -b, 0.0), (length, -b, bulge), (length, b, 0.0), (-length, b, bulge)]
    return dxf(lambda space: space.add_lwpolyline(points, format="xyb", close=True))


@st.composite
def dxf_polygon(draw: st.DrawFn, a: float, b: float, least: float) -> tuple[str, str]:
    """A regular polygon of 5 to 12 sides, turned anyhow; its inner circle has 0.8 of the outer."""
    sides, turn = draw(st.integers(5, 12)), draw(st.integers(0, 359))
    points = [
        (min(a, b) * math.cos(angle), min(a, b) * math.sin(angle))
        for angle in (math.radians(turn + 360 * i / sides) for i in range(sides))
    ]
    return dxf(lambda space: space.add_lwpolyline(points, close=True))


@st.composite
def dxf_ellipse(draw: st.DrawFn, a: float, b: float, least: float) -> tuple[str, str]:
    long, short = max(a, b), min(a, b)
    angle = math.radians(draw(st.integers(0, 359)))
    axis = (long * math.cos(angle), long * math.sin(angle))
    return dxf(lambda space: space.add_ellipse((0, 0), axis, max(short / long, 0.05)))


def merged(shared: Common, family: str, **sections: dict[str, Any]) -> dict[str, Any]:
    tables = {"name": "drawn", "family": family, **shared.tables}
    for name, section in sections.items():
        tables[name] = {**tables.get(name, {}), **section}
    return tables


@st.composite
def one_dof(draw: st.DrawFn) -> Draft:
    shared = draw(common())
    stack = draw(pockets(shared, 16.0))
    return Draft(merged(shared, "1dof", chamber=stack.chamber), stack.drawing)


@st.composite
def lobed(draw: st.DrawFn, ears: bool = False) -> Draft:
    """Lobes round a lumen; whether ears find room between lobes and tabs has no closed formula."""
    shared = draw(common(longest_tab=12.0, ears=ears))
    stack = draw(pockets(shared, 6.0))
    count, lumen = draw(st.integers(2, 8)), draw(mm(0.95, 6.0))
    hole = lumen / 2 + shared.setback
    half = math.pi / count
    bond, reach = shared.bond, stack.reach
    # Far enough out for round pockets of this reach, whatever their outline.
    axis = max(hole + bond + reach, (bond / 2 + reach) / math.sin(half))
    chamber = {**stack.chamber, "count": count}
    if stack.drawing is not None or draw(st.booleans()):
        axis = math.ceil(axis * 1000) / 1000 + draw(mm(0, 4.0))
        chamber["axis_radius"] = axis
    lobe = reach + bond + shared.overhang
    assume(axis + lobe + max(shared.tab_length + shared.tail, shared.ear) < HALF_PLATEN)
    assume(_tabs_clear(axis, count, stack, shared))
    # Between lobes that hardly meet or part, films and masks end in a point unless it is rounded.
    if shared.tables["fillet"]["radius"] < shared.overhang + LEAST_FEATURE / 2:
        assume(stack.drawing is None)
        assume(all(_opens_wide(axis, count, hole, r, shared) for r in stack.sizes))
    tables = merged(shared, "lobed", chamber=chamber, lumen={"diameter": lumen})
    return Draft(tables, stack.drawing)


def _tabs_clear(axis: float, count: int, stack: Pockets, shared: Common) -> bool:
    """Whether every inlet tab, from where it leaves its lobe on, clears the next lobe and tab."""
    if count < 4:
        return True
    half, half_tab = math.pi / count, shared.strip / 2 + shared.bond
    out = axis + math.sqrt((stack.least_reach + shared.bond) ** 2 - half_tab**2)
    x, y = axis * math.cos(2 * half), axis * math.sin(2 * half)
    to_lobe = math.hypot(out - x, y - half_tab) - (stack.reach + shared.bond)
    to_tab = 2 * (out * math.sin(half) - half_tab * math.cos(half))
    return min(to_lobe, to_tab) > shared.overhang


def _opens_wide(axis: float, count: int, hole: float, pocket: float, shared: Common) -> bool:
    """Whether two lobes and the hub leave a slot that can be cut, or a notch of 16 degrees."""
    half = math.pi / count
    hub = max(hole + shared.bond, axis - pocket, axis * math.cos(half))
    for grown in (0.0, shared.overhang):
        radius = pocket + shared.bond + grown
        level = min(hub + grown - axis * math.cos(half), radius)
        slot = 2 * (axis * math.sin(half) - math.sqrt(radius**2 - level**2))
        if slot > 0 and slot < LEAST_FEATURE + 0.01:
            return False
        if slot <= 0 and 2 * math.acos(axis * math.sin(half) / radius) < math.radians(16):
            return False
    return True


@st.composite
def radial(draw: st.DrawFn) -> Draft:
    shared = draw(common(most_balloons=6, longest_tab=15.0))
    bond, overhang = shared.bond, shared.overhang
    count = draw(st.integers(1, 12))
    gap = 2 * overhang + LEAST_FEATURE
    widest = 2 * HALF_PLATEN / count - gap
    least = 2 * (shared.least_half + bond)
    assume(widest > least + 0.1)
    width, length = draw(mm(least, min(widest, 30.0))), draw(mm(least, 30.0))
    least_tube = count * (width + gap) / math.pi + 0.001
    tube = draw(mm(least_tube, max(2 * HALF_PLATEN / math.pi, least_tube + 0.01)))
    sections: dict[str, dict[str, Any]] = {
        "chamber": {"count": count, "width": width, "length": length},
        "tube": {"outer_diameter": tube},
        "sheet": {"margin": draw(mm(0.2, 10.0)), "overlap": draw(st.just(0.0) | mm(0.2, 2.0))},
        "inlet": {"manifold": draw(st.booleans())},
    }
    if draw(st.booleans()):
        small = min(width, length)
        side = draw(mm(max(0.75, bond), small / math.sqrt(2)))
        sections["window"] = {"width": side, "length": draw(mm(max(0.75, bond), side))}
    if not _ears_clear(width, tube, count, shared):
        sections["registration"] = {"method": "channel-pin"}
    return Draft(merged(shared, "radial", **sections))


def _ears_clear(width: float, tube: float, count: int, shared: Common) -> bool:
    """Whether the ears of a radial laminate stand apart and on the platen."""
    bond, overhang = shared.bond, shared.overhang
    fillet, ear = shared.tables["fillet"]["radius"], PIN + 2 * bond
    between_film = width / 2 - ear
    beside_tab = max(shared.strip / 2, 0.8 * PIN) + bond + 2 * overhang + ear / 2
    between_mask = math.pi * tube / count - 2 * beside_tab - ear
    length = math.pi * tube + 2 * (fillet + 2 * overhang + 4.0 + ear)
    room = 2 * fillet + 2.5 * overhang + ROOM
    return min(between_film, between_mask) > room and length < 2 * HALF_PLATEN


def valid() -> st.SearchStrategy[Draft]:
    """Designs of every family that break no rule."""
    return one_dof() | lobed() | radial()
