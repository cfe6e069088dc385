"""The nets of a laminate in colour: a plan of every interface, with its faults marked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle

from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, path_data
from sbafab.laminate.laminate import Laminate
from sbafab.markup import escape
from sbafab.reports import drawing as draw
from sbafab.rules.nets import Connectivity, NetFault, declared

COLOURS = (
    *("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#b2a300", "#6a51a3"),
)
"""Colours of the nets in their order, repeated from the ninth on. Most are the colours that M.
Okabe and K. Ito (2008) chose to be distinct in colour blindness."""
NO_NET = "#bbbbbb"
FAULT = "#c00000"
WIDE = 180.0
MOST_COLUMNS, KEYS = 3, 6  # plans and rows of the key beside each other
GAP, HEAD, ROW = 4.0, 7.0, 5.0
RADIUS = 2.2


@dataclass(frozen=True)
class NetArea:
    """A void of an interface, counted from 1, with its net, "" if none, and the net's colour.

    ``nets`` are all its nets: more than one is a short.
    """

    net: str
    nets: tuple[str, ...]
    interface: int
    layers: tuple[int, ...]
    colour: str
    region: Region

    @property
    def path(self) -> str:
        """The area as SVG path data, mm, y up."""
        return path_data(self.region)


@dataclass(frozen=True)
class NetMap:
    """The nets of a laminate: names with colours, coloured areas, and faults with their places."""

    colours: dict[str, str]
    areas: tuple[NetArea, ...]
    faults: tuple[NetFault, ...]


def net_map(laminate: Laminate, connectivity: Connectivity) -> NetMap:
    """Return the areas of the voids by interface, bottom to top, in the colours of their nets."""
    colours = dict(zip((net.name for net in declared(laminate)), cycle(COLOURS)))
    areas = []
    for cavity, owners in zip(connectivity.cavities, connectivity.owners, strict=True):
        layers = laminate.interfaces[cavity.interface - 1].layer_indices
        name = owners[0] if owners else ""
        colour = colours.get(name, NO_NET)
        areas.append(NetArea(name, owners, cavity.interface, layers, colour, cavity.region))
    return NetMap(colours, tuple(areas), connectivity.faults)


def nets_svg(laminate: Laminate, connectivity: Connectivity) -> str:
    """Return a drawing 180 mm wide: a plan of every interface that has a void, and the key."""
    shown = net_map(laminate, connectivity)
    low_x, low_y, high_x, high_y = laminate.bounds
    numbers = sorted({area.interface for area in shown.areas if area.net or not area.nets})
    columns = min(MOST_COLUMNS, max(1, len(numbers)))
    cell = (WIDE - (columns + 1) * GAP) / columns
    scale = cell / (high_x - low_x)
    height = (high_y - low_y) * scale
    elements: list[str] = []
    for place, number in enumerate(numbers):
        row, column = divmod(place, columns)
        x, y = GAP + column * (cell + GAP), row * (height + HEAD + GAP) + HEAD
        to_page = scale, 0, 0, -scale, x - low_x * scale, y + high_y * scale
        elements += _plan(laminate, shown, number, (x, y), to_page)
        for count, fault in enumerate(shown.faults, start=1):
            if number in _levels(laminate, fault):
                at = x + (fault.at[0] - low_x) * scale, y + (high_y - fault.at[1]) * scale
                above = at[0], at[1] - RADIUS - 0.8
                elements.append(draw.circle(at, RADIUS, draw.style(FAULT, 0.6)))
                elements.append(draw.text(above, str(count), anchor="middle", bold=True))
    top = math.ceil(len(numbers) / columns) * (height + HEAD + GAP) + ROW
    keys = [*shown.colours.items(), ("no net", NO_NET)]
    for place, (name, colour) in enumerate(keys):
        row, column = divmod(place, KEYS)
        at = GAP + column * (WIDE - 2 * GAP) / KEYS, top + row * ROW
        elements.append(draw.key(at, draw.swatch(colour, "none"), name))
    end = top + math.ceil(len(keys) / KEYS) * ROW
    return draw.document(WIDE, end, f"{laminate.name}: nets", elements)


def _levels(laminate: Laminate, fault: NetFault) -> list[int]:
    """Return the interfaces at which a fault is drawn: its own, or those beside its layer."""
    if fault.interface is not None:
        return [fault.interface]
    gaps = laminate.interfaces
    return [gap.index for gap in gaps if {gap.below.index, gap.above.index} & {*fault.layers}]


def _plan(
    laminate: Laminate, shown: NetMap, number: int, corner: Point, to_page: Sequence[float]
) -> list[str]:
    gap = laminate.interfaces[number - 1]
    drawn = []
    for area in shown.areas:
        if area.interface == number:
            # A void of two nets is filled in one colour and outlined in the other.
            edge = shown.colours[area.nets[1]] if area.nets[1:] else "none"
            look = draw.style(edge, 0.4, fill=area.colour)
            title = escape(" and ".join(area.nets) or "no net")
            drawn.append(f'<path d="{area.path}" {look}><title>{title}</title></path>')
    matrix = " ".join(f"{part:.6g}" for part in to_page)
    title = f"interface {number}: layers {gap.below.index} and {gap.above.index}"
    return [
        draw.text((corner[0], corner[1] - 2), title),
        f'<g transform="matrix({matrix})">',
        draw.path(path_data(gap.contact), draw.style(draw.GREY, 0.1, fill="#f4f4f4")),
        *drawn,
        "</g>",
    ]
