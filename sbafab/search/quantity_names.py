"""The quantities that a requirement may name, with their units.

Nothing else is loaded, so that ``sbafab find --help`` stays quick.
"""

from __future__ import annotations

from typing import NamedTuple


class QuantityName(NamedTuple):
    """A quantity as people write it, with its unit, and what it is."""

    written: str
    unit: str
    meaning: str

    @property
    def name(self) -> str:
        """The name without stroke and pressure."""
        return self.written.partition("@")[0]


QUANTITIES = (
    QuantityName("overall_diameter", "mm", "all that is cut, inlet tabs included"),
    QuantityName("outline_diameter", "mm", "the films without tabs and ears"),
    QuantityName("deflated_diameter", "mm", "flat, round a tube"),
    QuantityName("inflated_diameter", "mm", "round a tube; safer of two models"),
    QuantityName("reached_diameter", "mm", "the lower one of these two"),
    QuantityName("width", "mm", "of the flat laminate, likewise length"),
    QuantityName("length", "mm", ""),
    QuantityName("height", "mm", "folded: the sum of the films"),
    QuantityName("lumen", "mm", "diameter of the lumen"),
    QuantityName("mass", "g", "of the films"),
    QuantityName("yield", "", "share of builds that hold, 0.95 or 95%"),
    QuantityName("stroke", "mm", "full stroke: the paper's, in proportion"),
    QuantityName("stroke@P", "mm", "free stroke at P kPa, elastic balloon"),
    QuantityName("bend@P", "deg", "one chamber at P kPa; two: bend@2chambers@P"),
    QuantityName("force@H@P", "N", "blocked at the stroke H mm, at P kPa"),
    QuantityName("lateral_stiffness@P", "N/mm", "of the tip, chambers shut at P kPa"),
    QuantityName("time", "s", "to 10 kPa with water at --flow"),
)
"""In the order of the help; names that stand twice take a pressure or none."""


def quantity_lines() -> str:
    """Return the table as lines for the help of a command."""
    width = max(len(quantity.written) for quantity in QUANTITIES)
    rows = [
        f"{quantity.written:{width}}  {quantity.unit:4}  {quantity.meaning}".rstrip()
        for quantity in QUANTITIES
    ]
    return "\n".join([*rows, f"{'KEY':{width}}  {'':4}  any key of the design, chamber.diameter"])
