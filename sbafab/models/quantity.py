"""Quantity and conditions of a predicted figure.

Programs use these as keys. Display text is derived from them here and never parsed.
"""

from __future__ import annotations

import difflib
from enum import Enum, StrEnum
from typing import Any, NamedTuple, Self

from sbafab.errors import DesignError


class Conditions(NamedTuple):
    """State of the actuator for a figure; None if the figure does not depend on it.

    ``kpa`` is gauge pressure, negative for a vacuum; ``share`` is a fraction of the reference
    stroke, of a pocket's length as contraction, or of the free bend; ``rise`` in mm at which a
    force is blocked, instead of a share; ``chambers`` pressurised, the others empty or flat;
    ``angle`` of a bend in degrees; ``volume`` in ul per balloon; ``flow`` in ml/min; ``tube`` its
    diameter in mm; ``hinges`` in a row. ``of`` names one chamber of several; ``each`` is "sba" for
    one actuator of several side by side, "pouch" for one pouch of several.
    """

    kpa: float | None = None
    share: float | None = None
    chambers: int | None = None
    angle: float | None = None
    volume: float | None = None
    flow: float | None = None
    tube: float | None = None
    hinges: int | None = None
    of: str = ""
    each: str = ""
    rise: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the conditions that are given."""
        given = self._asdict().items()
        return {name: value for name, value in given if value is not None and value != ""}

    @classmethod
    def read(cls, text: str) -> Conditions:
        """Return the conditions in a text such as "kpa=10,share=0.25". Raises ValueError or
        KeyError for invalid text.
        """
        given = dict(part.split("=", 1) for part in text.split(",") if part)
        return cls(**{name: _CONDITIONS[name](value) for name, value in given.items()})

    def meet(self, asked: Conditions) -> bool:
        """Return True if these match the conditions ``asked`` for, which may be incomplete."""
        mine = self.as_dict()
        return all(mine.get(name) == value for name, value in asked.as_dict().items())


ANYWHERE = Conditions()
"""No conditions."""


class Quantity(Enum):
    """Quantities of figures: ``key`` for programs (the name in lower case), ``group`` in the
    output, ``unit``, and the ``words`` of their names, with placeholders for conditions.
    """

    def __init__(self, group: str, unit: str, words: str) -> None:
        self.key = self.name.lower()
        self.group, self.unit, self.words = group, unit, words

    OVERALL_DIAMETER = "size", "mm", "overall diameter"
    OUTLINE_DIAMETER = "size", "mm", "outline diameter"
    DEFLATED_DIAMETER = "size", "mm", "deflated diameter"
    REACHED_DIAMETER = "size", "mm", "reached diameter"
    INFLATED_DIAMETER = "size", "mm", "inflated diameter"
    PITCH = "size", "mm", "pitch"
    WIDTH = "size", "mm", "width"
    LENGTH = "size", "mm", "length"
    FOLDED_HEIGHT = "size", "mm", "folded height"
    FOLDED_DIAMETER = "size", "mm", "folded diameter"
    MASS = "size", "g", "mass"
    BEAM_DIAMETER = "size", "mm", "inflated diameter of a beam{of}"

    LARGEST_TUBE = "inlet", "mm", "largest tube that the inlet opens to"
    TUBE_ROOM = "inlet", "mm", "room round the tube of {tube} mm"

    BURST = "strength", "kPa", "burst pressure"

    REFERENCE_STROKE = "stroke", "mm", "reference stroke"
    REFERENCE_HEIGHT = "stroke", "mm", "reference height"
    REFERENCE_VOLUME = "stroke", "ul", "volume a balloon at the reference stroke"
    LARGEST_VOLUME = "stroke", "ul", "largest volume a balloon"
    LARGEST_STROKE = "stroke", "mm", "stroke at the largest volume"
    BALLOON_DIAMETER = "stroke", "mm", "balloon's diameter at the largest volume"
    VOLUME_STROKE = "stroke", "mm", "stroke at {volume} ul a balloon"
    FREE_STROKE = "stroke", "mm", "free stroke at {kpa} kPa"
    FREE_HEIGHT = "stroke", "mm", "free height at {kpa} kPa"
    BALLOON_VOLUME = "stroke", "ul", "volume a balloon at {kpa} kPa"
    CONTRACTION = "stroke", "mm", "free contraction{of}"
    CONTRACTION_SHARE = "stroke", "%", "free contraction{of}, share"

    BLOCKED_FORCE = "force", "N", "blocked force{of}{each} at {kpa} kPa, {stroke}"
    FORCE_BOUND = "force", "N", "blocked force{of}{each} at {kpa} kPa, flat, at most"
    BENT_FORCE = "force", "N", "force at {kpa} kPa in {chambers}, bent by {angle} deg"
    PULL = "force", "N", "pull{of} at {kpa} kPa, {percent} % shorter"
    MOMENT = "force", "N mm", "moment{of} at {kpa} kPa, {bent}"
    WRINKLING_LOAD = "force", "N", "load that wrinkles a beam{of} at {kpa} kPa"
    COLLAPSE_LOAD = "force", "N", "load that collapses a beam{of} at {kpa} kPa"
    SLIP_LOAD = "force", "N", "load that slips{of} at {kpa} kPa"

    TOTAL_VOLUME = "actuation", "ul", "volume of all chambers at the reference stroke"
    REFERENCE_TIME = "actuation", "s", "time to the reference stroke at {flow} ml/min"
    VOLUME_TIME = "actuation", "s", "time to {volume} ul a balloon at {flow} ml/min"
    WORK_BOUND = "actuation", "mJ", "pneumatic input work at {kpa} kPa"
    FREE_WORK = "actuation", "mJ", "pneumatic input work at {kpa} kPa, free"
    LOST_WORK = "actuation", "%", "input work lost in a cycle"
    POWER_DENSITY = (
        "actuation",
        "W/kg",
        "power density, blocked force flat at {kpa} kPa and {litres} l/min of air",
    )
    WATER_TIME = "actuation", "s", "time to {kpa} kPa at the pump, water at {flow} ml/min in all"
    WATER_HEIGHT = "actuation", "mm", "height when the water's pump shows {kpa} kPa"
    CONTRACTION_VOLUME = "actuation", "ul", "volume at free contraction{of}"

    REFERENCE_BEND = (
        "bending",
        "deg",
        "bend with {chambers} at the reference stroke, the others flat",
    )
    LARGEST_ASIDE = "bending", "mm", "maximum lateral tip displacement"
    BEND = "bending", "deg", "bend at {kpa} kPa in {chambers}, the others empty"
    RIM_ROOM = (
        "bending",
        "mm",
        "room between rims on the inner side, {kpa} kPa in {chambers}, the others empty",
    )
    CHAMBER_CLEARANCE = (
        "bending",
        "mm",
        "clearance between chambers, {kpa} kPa in {chambers}, the others empty",
    )
    ASIDE = "bending", "mm", "lateral tip displacement at {kpa} kPa in {chambers}, the others empty"
    FREE_BEND = "bending", "deg", "free bend{of}{hinges}"

    SECOND_MOMENT = "stiffness", "mm4", "second moment of area of the plate"
    REFERENCE_STIFFNESS = "stiffness", "N/mm", "lateral tip stiffness, inflated"
    HELD_STIFFNESS = "stiffness", "N/mm", "lateral tip stiffness at {kpa} kPa, pressure held"
    SHUT_STIFFNESS = "stiffness", "N/mm", "lateral tip stiffness at {kpa} kPa, chambers shut"
    JAMMING_RATIO = "stiffness", "", "jammed over loose stiffness{of}"
    LOOSE_STIFFNESS = "stiffness", "N mm2", "bending stiffness{of}, loose"
    JAMMED_STIFFNESS = "stiffness", "N mm2", "bending stiffness{of}, jammed"

    def named(self, at: Conditions) -> str:
        """Return the figure's display name."""
        return self.words.format_map(_texts(at))

    @classmethod
    def of(cls, key: str) -> Quantity:
        """Return the quantity of a key. Raises DesignError for any other, with the nearest ones."""
        keys = {quantity.key: quantity for quantity in cls}
        if key not in keys:
            near = difflib.get_close_matches(key.replace(" ", "_"), keys, 3, 0.3)
            mends = f"did you mean {' or '.join(near)}?" if near else "each figure states its own"
            raise DesignError(f"there is no quantity {key!r}; {mends}")
        return keys[key]


def _texts(at: Conditions) -> dict[str, str]:
    """Return conditions as text for the names of figures."""
    numbers = {name: f"{value:g}" for name, value in at.as_dict().items() if name not in _NAMES}
    share = at.share or 0.0
    stroke = f"at {100 * share:g} % of the reference stroke" if share else "flat"
    return numbers | {
        "of": f" of {at.of}" if at.of else "",
        "each": {"sba": " of one SBA", "pouch": " a pouch"}.get(at.each, ""),
        "chambers": chamber_count(at.chambers or 0),
        "hinges": f", {at.hinges} hinges" if at.hinges else "",
        "percent": f"{100 * share:g}",
        "stroke": stroke if at.rise is None else f"at {at.rise:g} mm",
        "bent": "half bent" if share else "straight",
        "litres": f"{(at.flow or 0.0) / 1000:g}",
    }


def chamber_count(number: int) -> str:
    """Return a number of chambers as text."""
    return "one chamber" if number == 1 else f"{number} chambers"


class ModelId(StrEnum):
    """Models of figures: ids for programs, and ``words``, the name without factors."""

    words: str

    def __new__(cls, key: str, words: str = "") -> Self:
        member = str.__new__(cls, key)
        member._value_, member.words = key, words
        return member

    GEOMETRY = "geometry", "plain geometry"
    FILMS = "films", "sum of the films"
    FILM_MASS = "film-mass", "area x thickness x density"
    TUBE_AND_FILMS = "tube-and-films", "tube and films"
    LENS = "lens", "lens of two arcs"
    CYLINDER = "cylinder", "cylinder of unstretched film"
    FOLDED_LOBES = "folded-lobes", "three lobes as chords of a circle"
    HALF_PERIMETER = "half-perimeter", "half the perimeter"
    FILM_STRESS = "film-stress", "film stress in proportion"
    SCALED_HEIGHT = "scaled-height", "the paper's height, scaled"
    LARGEST_VOLUME = "largest-volume", "the largest volume"
    EQ_4 = "eq-4", "Eq. 4"
    EQS_1_TO_3 = "eqs-1-to-3", "Eqs. 1-3"
    LENS_STROKE = "lens-stroke", "the lens of two arcs"
    WORK_ON_EQ_4 = "work-on-eq-4", "virtual work on Eq. 4"
    WORK_ON_EQS_1_TO_3 = "work-on-eqs-1-to-3", "virtual work on Eqs. 1-3"
    WORK_ON_LENS = "work-on-lens", "virtual work on the lens of two arcs"
    VOLUME_OVER_FLOW = "volume-over-flow", "volume over flow"
    EQ_4_OVER_FLOW = "eq-4-over-flow", "Eq. 4 over flow"
    LENS_OVER_FLOW = "lens-over-flow", "the lens of two arcs over flow"
    P_V_EQ_4 = "p-v-eq-4", "p v with Eq. 4"
    P_V_LENS = "p-v-lens", "p v with the lens of two arcs"
    POWER = "power", "F v / m"
    CONSTANT_CURVATURE = "constant-curvature", "constant curvature"
    CURVATURE_OVER_FLOW = "curvature-over-flow", "constant curvature, Eq. 4 over flow"
    CANTILEVER = "cantilever", "3 E I / l^3"
    FLAT_PLATES = "flat-plates", "pressure x pocket area"
    ELASTIC_BALLOON = "elastic-balloon", "elastic balloon"
    ELASTIC_STACK = "elastic-stack", "elastic stack"
    STACK_IN_TIME = "stack-in-time", "elastic stack in time"
    STACK_SHUT = "stack-shut", "elastic stack, chambers shut"
    POUCH_MOTOR = "pouch-motor", "pouch motor"
    POUCH_HINGE = "pouch-hinge", "pouch hinge"
    INFLATED_BEAM = "inflated-beam", "inflated beam"
    LAMINAR_JAMMING = "laminar-jamming", "laminar jamming"
    TEXTILE_POUCHES = (
        "textile-pouches",
        "pressure x pocket area; textile pouches pushed with 0.18 of it at 230 kPa",
    )


WORK_ON = {
    ModelId.EQ_4: ModelId.WORK_ON_EQ_4,
    ModelId.EQS_1_TO_3: ModelId.WORK_ON_EQS_1_TO_3,
    ModelId.LENS_STROKE: ModelId.WORK_ON_LENS,
}
OVER_FLOW = {
    ModelId.EQ_4: ModelId.EQ_4_OVER_FLOW,
    ModelId.LENS_STROKE: ModelId.LENS_OVER_FLOW,
}
P_V = {ModelId.EQ_4: ModelId.P_V_EQ_4, ModelId.LENS_STROKE: ModelId.P_V_LENS}
"""Models derived from a pocket's volume: virtual work, time, largest work."""
OF_STACK = (ModelId.ELASTIC_STACK, ModelId.STACK_IN_TIME, ModelId.STACK_SHUT)
"""Models of the elastic stack."""


class FigureKey(NamedTuple):
    """The key that identifies a figure within a prediction."""

    quantity: Quantity
    at: Conditions
    model: ModelId

    def __str__(self) -> str:
        """The key as text for programs: blocked_force@kpa=10,share=0.25|elastic-stack."""
        at = ",".join(f"{name}={value}" for name, value in self.at.as_dict().items())
        return f"{self.quantity.key}@{at}|{self.model}"

    @classmethod
    def read(cls, text: str) -> FigureKey:
        """Return the key parsed from its text. Raises DesignError or ValueError for other text."""
        of, _, model = text.partition("|")
        quantity, _, at = of.partition("@")
        return cls(Quantity.of(quantity), Conditions.read(at), ModelId(model))

    @property
    def heading(self) -> str:
        """The heading of the figure, with its model if there are several, and its unit."""
        model = f", {self.model.words}" if self.quantity in BY_SEVERAL else ""
        return f"{self.quantity.named(self.at)}{model} [{self.quantity.unit}]"


_NAMES = ("of", "each")
_CONDITIONS: dict[str, Any] = {
    **dict.fromkeys(("kpa", "share", "rise", "angle", "volume", "flow", "tube"), float),
    **dict.fromkeys(("chambers", "hinges"), int),
    **dict.fromkeys(_NAMES, str),
}
BY_SEVERAL = (
    Quantity.BLOCKED_FORCE,
    Quantity.LARGEST_VOLUME,
    Quantity.LARGEST_STROKE,
    Quantity.REFERENCE_VOLUME,
    Quantity.VOLUME_STROKE,
)
"""Quantities that several models give."""
