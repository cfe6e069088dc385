"""Prediction of an inflated assembly: reach, load, grip in its lumen, contacts between parts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.assemblies.build import Assembled, PartDesign, PlacedPart, PlacedSba
from sbafab.assemblies.checks import TOUCH
from sbafab.assemblies.shapes import placed_surface
from sbafab.design.records import Discs, Slots
from sbafab.meshing.surface import Surface
from sbafab.models.balloons import balloons_of
from sbafab.models.closed_forms import cylinder_height, lens
from sbafab.models.elastic import free_rise
from sbafab.models.formulas import is_near_burst, is_the_papers_3dof, refuse_beyond_burst, sizes
from sbafab.models.intervals import factors_of
from sbafab.models.paper import counterpart
from sbafab.models.quantity import ANYWHERE, Conditions, ModelId, Quantity
from sbafab.models.stack import Stack, stack
from sbafab.reports.inflated import COARSE, inflated

if TYPE_CHECKING:
    import manifold3d
    from numpy.typing import NDArray

    from sbafab.models.stack import Pose

    Array = NDArray[np.float64]
    Solids = list[manifold3d.Manifold]

SCHEMA = "sbafab/assembly-predict@1"
"""Id of a prediction of an assembly as JSON."""
GRAVITY = 9.80665
MARBLE_G = 1.2
"""Mass of the marble that the paper's brace lifts, g (Sec. 5)."""
STACK = ModelId.ELASTIC_STACK.words
LENS = f"{ModelId.LENS.words}, virtual work p dV/dh"
STATIC = "statics"
IN_THE_LUMEN = (
    "height of a balloon in the lumen",
    "push of each stack on the wall",
    "friction",
)
PAPERS = ("aperture", "brace", "standing")
"""The assemblies built in the paper; only their figures have measured values beside them."""


@dataclass(frozen=True)
class AssemblyFigure:
    """One figure of a part: value in ``unit``, model, and the paper's remark, if any.

    ``measured`` is the paper's value for a single actuator, if the model is off by more than a
    quarter of it.
    """

    part: str
    name: str
    value: float
    unit: str
    model: str
    paper: str = ""
    measured: str = ""


@dataclass(frozen=True)
class Touch:
    """Two parts that share ``volume`` mm3 when the first one is inflated."""

    part: str
    other: str
    volume: float


@dataclass(frozen=True)
class BentTouch:
    """An arm that shares ``volume`` mm3 with another part when its ``chambers`` are pressed.

    Contact begins at about ``from_kpa``, at a bend of ``bend`` degrees; ``measured`` is the paper's
    bend if the model is off by more than a quarter of it.
    """

    part: str
    other: str
    chambers: str
    volume: float
    from_kpa: float
    bend: float
    measured: str = ""


@dataclass(frozen=True)
class AssemblyPrediction:
    """Figures at ``pressure_kpa``; ``touches`` are parts that collide when all are upright,
    ``bent_touches`` contacts of bent arms; ``left_out`` names what no model covers, ``near_burst``
    the parts above half of their estimated burst pressure.
    """

    name: str
    pressure_kpa: float
    load_g: float
    figures: tuple[AssemblyFigure, ...]
    touches: tuple[Touch, ...]
    left_out: tuple[str, ...]
    bent_touches: tuple[BentTouch, ...]
    near_burst: tuple[str, ...]

    def met(self) -> list[str]:
        """Sentences on contacts of inflated parts, and remedies."""
        sentences = [
            f"{touch.part} and {touch.other} meet when inflated: they share "
            f"{touch.volume:.2f} mm3; move them apart, or give less pressure"
            for touch in self.touches
        ]
        sentences += [
            f"press {bent.chambers} of {bent.part} to less than {bent.from_kpa:.2g} kPa, or move "
            f"{bent.other}: from there on, bent by {bent.bend:.0f} degrees, they meet, and at "
            f"{self.pressure_kpa:g} kPa they share {bent.volume:.2f} mm3"
            + (f" ({bent.measured})" if bent.measured else "")
            for bent in self.bent_touches
        ]
        if not self.touches:
            how = "standing straight" if self.bent_touches else "straight or bent"
            sentences.append(f"no inflated part meets another one, {how}")
        return sentences


def predict_assembly(
    assembled: Assembled,
    pressure_kpa: float = 10.0,
    load_g: float = MARBLE_G,
    pause: Callable[[], None] = lambda: None,
) -> AssemblyPrediction:
    """Predict the parts at one pressure, with a mass at the tips; the paper's marble has 1.2 g.

    ``pause`` is called between parts of the work, which takes seconds; an exception from it stops
    the work. Raises DesignError for pressures beyond the models or a part's estimated burst.
    """
    actuators = [placed for placed in assembled.parts if isinstance(placed, PlacedSba)]
    for placed in actuators:
        refuse_beyond_burst(placed.made.laminate, pressure_kpa)
    figures: list[AssemblyFigure] = []
    touches: list[Touch] = []
    bent: list[BentTouch] = []
    left_out: list[str] = []
    scene = _Scene(assembled, pressure_kpa)
    for placed in actuators:
        pause()
        hold = grip(assembled, placed)
        if hold is not None:
            figures += _grip_figures(hold, placed.made.design.form.stacks, pressure_kpa, load_g)
            if hold.push is None:
                left_out.append(f"{placed.name}, {', '.join(IN_THE_LUMEN)}: {hold.why_none}")
        elif placed.name in scene.stacks:
            figures += _arm_figures(placed, scene.stacks[placed.name], pressure_kpa, load_g)
            touches += scene.touches(placed)
            pause()
            for outcome in scene.bends(placed, pause):
                if isinstance(outcome, BentTouch):
                    bent.append(outcome)
                else:
                    figures.append(outcome)
        else:
            left_out.append(f"{placed.name}: no model knows the form of a drawn pocket outline")
    if assembled.assembly.name not in PAPERS:
        figures = [replace(figure, paper="") for figure in figures]
    return AssemblyPrediction(
        assembled.assembly.name,
        pressure_kpa,
        load_g,
        tuple(figures),
        tuple(touches),
        tuple(left_out),
        tuple(bent),
        tuple(p.name for p in actuators if is_near_burst(p.made.laminate, pressure_kpa)),
    )


def _arm_figures(
    placed: PlacedSba, arm: Stack, pressure: float, load_g: float
) -> Iterator[AssemblyFigure]:
    """Yield height, reach, bend and load of an actuator with round pockets."""
    design, laminate = placed.made.design, placed.made.laminate
    is_papers = is_the_papers_3dof(design.form, laminate)

    def figure(
        name: str,
        value: float,
        unit: str,
        quantity: Quantity,
        at: Conditions,
        paper: str = "",
        model: ModelId = ModelId.ELASTIC_STACK,
    ) -> AssemblyFigure:
        """Return a figure with the measured value beside that of a design's own prediction."""
        by = ModelId.FILMS if quantity is Quantity.FOLDED_HEIGHT else model
        beside = counterpart(design.form, quantity, at, by, arm.calibration, is_papers)
        measured = beside.sentence() if beside else ""
        return AssemblyFigure(placed.name, name, value, unit, model.words, paper, measured)

    at, alone = Conditions(kpa=pressure), Conditions(kpa=pressure, chambers=1)
    every = (pressure,) * arm.chambers
    free, flat = arm.pose(every), arm.flat_height
    # As in a design's own prediction: the stack's maps are approximate.
    stroke = free_rise(Counter(balloons_of(design, laminate, factors_of(design))), pressure).stroke
    paper = "about 1 (Sec. 6)"
    yield figure("height, flat", flat, "mm", Quantity.FOLDED_HEIGHT, ANYWHERE, paper)
    high, paper, balloon = flat + stroke, "about 20 (Sec. 5)", ModelId.ELASTIC_BALLOON
    yield figure("height, inflated", high, "mm", Quantity.FREE_HEIGHT, at, paper, balloon)
    push = arm.pose(every, plate=flat + 0.75 * stroke).force
    blocked = Conditions(kpa=pressure, share=0.75)
    yield figure("push at 75 % of its stroke", push, "N", Quantity.BLOCKED_FORCE, blocked)
    if arm.chambers > 1:
        single = arm.pose((pressure, *(0.0,) * (arm.chambers - 1)))
        yield figure("bend by one chamber", single.bend, "deg", Quantity.BEND, alone)
        aside = float(np.hypot(*single.tip[:2]))
        yield figure("maximum lateral tip displacement", aside, "mm", Quantity.ASIDE, alone)
    if load_g > 0:
        hung = arm.pose(every, tip_load=(load_g * 1e-3 * GRAVITY, 0.0, 0.0), near=free)
        sag = float(np.linalg.norm(hung.tip - free.tip))
        paper = "lifts 1.2 g (Sec. 5)" if load_g == MARBLE_G else ""
        words = f"sag of the tip, {load_g:g} g across it"
        # Sag is load over stiffness.
        yield figure(words, sag, "mm", Quantity.HELD_STIFFNESS, at, paper)


# A radial actuator in the assembly's lumen.


class Grip(NamedTuple):
    """A radial actuator: diameters ``deflated``, inflated ``free``, out of any lumen, and ``most``,
    the upper end, in mm.

    In the assembly's ``lumen`` a balloon is ``room`` mm high; each stack pushes on the wall with
    ``push`` N per kPa. Both are None if it reaches no lumen.
    """

    part: str
    deflated: float
    free: float
    most: float
    lumen: float | None = None
    room: float | None = None
    push: float | None = None

    @property
    def why_none(self) -> str:
        """The reason why no hold in the lumen is given."""
        if self.lumen is None:
            return "no lumen is given: set deploy.lumen_diameter"
        if self.deflated >= self.lumen:
            return (
                f"deflated it is {self.deflated:.2f} mm wide already, in a lumen of "
                f"{self.lumen:g} mm; make it narrower"
            )
        return (
            f"its stacks do not touch the wall: {self.free:.2f} mm by the lens of two arcs in a "
            f"lumen of {self.lumen:g} mm; use wider or longer chambers, more balloons or a thicker "
            "tube"
        )


def grip(assembled: Assembled, placed: PlacedSba) -> Grip | None:
    """Return hold of a radial actuator in the assembly's lumen; None for other forms."""
    design, laminate = placed.made.design, placed.made.laminate
    form = design.form
    pockets = form.pockets
    if not isinstance(pockets, Slots):
        return None
    tube = form.wrap.tube_diameter if form.wrap is not None else 2 * (placed.radius or 0.0)
    balloons = laminate.balloons
    deflated = tube + 2 * factors_of(design).folded(laminate).height
    pocket, widest = lens(pockets.width, pockets.run), cylinder_height(pockets.width)
    rise = pocket.largest_stroke
    free, most = (deflated + 2 * balloons * high for high in (rise, widest))
    lumen = assembled.assembly.deploy.lumen_diameter
    free_grip = Grip(placed.name, deflated, free, most, lumen)
    if lumen is None:
        return free_grip
    room = (lumen - deflated) / 2 / balloons
    if not 0 < room <= rise:
        return free_grip
    # 1 kPa mm2 is 1 mN.
    push = float(pocket.rate(room)) / 1000
    return free_grip._replace(room=room, push=push)


def _grip_figures(hold: Grip, stacks: int, pressure: float, load_g: float) -> list[AssemblyFigure]:
    """Diameter of a radial actuator, and the hold of its stacks in the assembly's lumen."""
    widest = "about 28 (Sec. 2.1)"
    rows = [
        ("diameter, deflated", hold.deflated, "mm", "tube and films", "15.33 (Sec. 2.1)"),
        ("diameter, inflated free", hold.free, "mm", ModelId.LENS.words, widest),
        ("diameter, inflated at most", hold.most, "mm", ModelId.CYLINDER.words, widest),
    ]
    if hold.room is not None and hold.push is not None:
        force = pressure * hold.push
        height, push, friction = IN_THE_LUMEN
        rows.append((f"{height} of {hold.lumen:g} mm", hold.room, "mm", STATIC, ""))
        rows.append((push, force, "N", LENS, "holds (Sec. 5)"))
        if load_g > 0:
            needed = load_g * 1e-3 * GRAVITY / (stacks * force)
            words = f"{friction} that holds {load_g:g} g along the lumen"
            rows.append((words, needed, "", STATIC, ""))
    return [AssemblyFigure(hold.part, *row) for row in rows]


# Contacts and clearances between parts, of arms upright and bent by some of their chambers.
#
# Each chamber alone and each pair of neighbours are pressurised, the others empty, while every
# other actuator is inflated; parts on the arm move with its tip.


FARTHEST = 10.0
"""Clearances are computed up to this distance, mm."""
SLIGHTEST = 0.1
"""Lowest pressure at which an arm is checked, kPa."""
HALVINGS = 5
FOOT = 3
"""Levels from below that may rest on the part under the arm."""


class _Arm(NamedTuple):
    """An arm, the solids ``carried`` on its top when it is flat, and the parts ``beside`` it."""

    placed: PlacedSba
    stack: Stack
    carried: Solids
    beside: dict[str, Solids]


class _Bent(NamedTuple):
    """A bent arm with the parts on it: solids of its lowest levels, which may rest on the part
    ``on``, and the others.
    """

    pose: Pose
    on: str | None
    foot: Solids
    rest: Solids

    def facing(self, part: str) -> Solids:
        """Return the solids that must not meet a part."""
        return self.rest if part == self.on else self.foot + self.rest


class _Scene:
    """The parts of an assembly as solids at one pressure.

    ``stacks`` are those of actuators with round pockets, and ``rises`` the vectors (3,) in mm by
    which these lift the parts on their tops.
    """

    def __init__(self, assembled: Assembled, pressure: float) -> None:
        self.assembled, self.pressure = assembled, pressure
        made = cache(_stack_of)
        self.stacks = {
            placed.name: made(placed.made)
            for placed in assembled.parts
            if isinstance(placed, PlacedSba) and isinstance(placed.made.design.form.pockets, Discs)
        }
        self.rises: dict[str, Array] = {}
        for name, its_stack in self.stacks.items():
            heights = its_stack.flat_height, self._free(its_stack).height
            low, high = assembled[name].upright(np.array([[0.0, 0.0, z] for z in heights]))
            self.rises[name] = high - low

    def _free(self, its_stack: Stack) -> Pose:
        return its_stack.pose((self.pressure,) * its_stack.chambers)

    def _lift(self, placed: PlacedPart) -> Array:
        """Return the vector (3,), mm, by which the actuators under a part lift it."""
        lift = np.zeros(3)
        while placed.part.on is not None:
            if placed.part.at == "top":
                lift = lift + self.rises.get(placed.part.on, 0.0)
            placed = self.assembled[placed.part.on]
        return lift

    def _solids(self, placed: PlacedPart, lift: Array | None = None) -> Solids:
        """Return a part lifted, by default by what is under it, with all others inflated."""
        lift = self._lift(placed) if lift is None else lift
        if isinstance(placed, PlacedSba) and placed.name in self.stacks:
            its_stack = self.stacks[placed.name]
            return _posed(placed, its_stack, self._free(its_stack), lift)
        return _as_it_is(placed, lift)

    def _carried(self, name: str) -> set[str]:
        """Return a part and everything fixed on it, directly or not."""
        names = {name}
        for part in self.assembled.parts:
            if part.part.on in names:
                names.add(part.name)
        return names

    def touches(self, placed: PlacedSba) -> Iterator[Touch]:
        """Yield the parts that an actuator meets when all are upright, each pair once."""
        own = self._solids(placed)
        # Parts on it move along; the part under it touches it as when flat.
        apart = {*self._carried(placed.name), placed.part.on}
        names = [part.name for part in self.assembled.parts]
        apart.update(name for name in names[: names.index(placed.name)] if name in self.stacks)
        for other in self._others(placed):
            if other.name not in apart:
                volume = _shared_volume(own, self._solids(other))
                if volume > TOUCH:
                    yield Touch(placed.name, other.name, volume)

    def bends(
        self, placed: PlacedSba, pause: Callable[[], None]
    ) -> Iterator[AssemblyFigure | BentTouch]:
        """Yield each bend at which an arm meets another part, then the least clearance to others.

        No clearance is given for the part under the arm and for parts farther away than
        ``FARTHEST``.
        """
        its_stack = self.stacks[placed.name]
        if its_stack.chambers < 2:
            return
        arm = self._arm(placed)
        nearest: dict[str, tuple[float, str]] = {}
        met = set()
        for chambers in _ways(its_stack.chambers):
            pause()
            names = " and ".join(placed.made.laminate.chambers[i].name for i in chambers)
            bent = self._bent(arm, chambers, self.pressure)
            for part, theirs in arm.beside.items():
                volume = _shared_volume(bent.facing(part), theirs)
                if volume > TOUCH:
                    met.add(part)
                    first = self._first(arm, part, chambers, bent.pose)
                    start, measured = max(first.pressures), its_stack.counterparts.get("bend", "")
                    yield BentTouch(placed.name, part, names, volume, start, first.bend, measured)
                elif part != placed.part.on:
                    least = nearest.get(part, (FARTHEST, ""))
                    gap = _gap(bent.facing(part), theirs, least[0])
                    nearest[part] = least if gap >= least[0] else (gap, names)
        for part, (gap, names) in nearest.items():
            if part not in met and gap < FARTHEST:
                words = f"clearance to {part}, bent by {names}"
                yield AssemblyFigure(placed.name, words, gap, "mm", STACK)

    def _arm(self, placed: PlacedSba) -> _Arm:
        arm = _Arm(placed, self.stacks[placed.name], [], {})
        moving = self._carried(placed.name)
        for part in self._others(placed):
            if part.name in moving:
                lift = self._lift(part) - self.rises[placed.name]
                arm.carried.extend(self._solids(part, lift))
            else:
                arm.beside[part.name] = self._solids(part)
        return arm

    def _others(self, placed: PlacedPart) -> list[PlacedPart]:
        parts = self.assembled.parts
        return [part for part in parts if part is not placed and part.part.kind != "line"]

    def _bent(self, arm: _Arm, chambers: Sequence[int], pressure: float) -> _Bent:
        """Return the arm bent by some chambers, and the parts on it."""
        count = range(arm.stack.chambers)
        pose = arm.stack.pose(tuple(pressure if i in chambers else 0.0 for i in count))
        lift = self._lift(arm.placed)
        places = arm.placed.upright(pose.frames[0]) + lift
        levels = (places[1:] + places[:-1]) / 2
        bent = _Bent(pose, arm.placed.part.on, [], [])
        for solid in _posed(arm.placed, arm.stack, pose, lift):
            middle = np.array(solid.bounding_box()).reshape(2, 3).mean(0)
            level = int(np.linalg.norm(levels - middle, axis=1).argmin())
            (bent.foot if level < FOOT else bent.rest).append(solid)
        # From the flat arm's top to the bent one's, in the arm's own frame, then in the assembly's.
        tip = np.eye(4)
        tip[:3, :3] = pose.frames[1][-1]
        tip[:3, 3] = pose.tip - tip[:3, :3] @ np.array([0.0, 0.0, arm.stack.flat_height])
        corners = arm.placed.upright(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
        frame = np.eye(4)
        frame[:3, 3] = corners[0] + lift
        frame[:3, :3] = (corners[1:] - corners[0]).T
        rows = np.ascontiguousarray((frame @ tip @ np.linalg.inv(frame))[:3])
        bent.rest.extend(solid.transform(rows) for solid in arm.carried)
        return bent

    def _first(self, arm: _Arm, part: str, chambers: Sequence[int], pose: Pose) -> Pose:
        """Return approximately the first pose in contact with another part, at the latest this."""
        low, high = min(SLIGHTEST, self.pressure / 2), self.pressure
        for _ in range(HALVINGS):
            middle = math.sqrt(low * high)
            tried = self._bent(arm, chambers, middle)
            if _shared_volume(tried.facing(part), arm.beside[part]) > TOUCH:
                high, pose = middle, tried.pose
            else:
                low = middle
        return pose


def _stack_of(made: PartDesign) -> Stack:
    return stack(made.design, made.laminate, factors=factors_of(made.design))


def _ways(chambers: int) -> list[tuple[int, ...]]:
    """Return the sets of pressurised chambers: each alone, and each two side by side."""
    alone: list[tuple[int, ...]] = [(i,) for i in range(chambers)]
    return alone + [(i, (i + 1) % chambers) for i in range(chambers) if chambers > 2]


def _posed(placed: PlacedSba, its_stack: Stack, pose: Pose, lift: Array) -> Solids:
    """Return an inflated actuator's balloons and webs in a pose, in place."""
    pieces = []
    for part in inflated(placed.made.laminate, its_stack, pose, COARSE):
        points = placed.upright(part.surface.points) + lift
        pieces += Surface(points, part.surface.faces).manifold().decompose()
    return pieces


def _as_it_is(placed: PlacedPart, lift: Array) -> Solids:
    """A part without an elastic stack, its pockets filled; one around a tube is its free inflated
    cylinder.
    """
    if placed.made is not None:
        widest = sizes(placed.made.design, placed.made.laminate).get("inflated_diameter")
        if widest is not None:
            import manifold3d

            _, low, _, high = placed.made.laminate.layers[0].profile.turned(placed.turn).bounds
            cylinder = manifold3d.Manifold.cylinder(high - low, widest / 2)
            rows = np.column_stack([np.array(placed.pose.rows), np.array(placed.pose.shift) + lift])
            return [cylinder.translate((0.0, 0.0, low)).transform(rows)]
    surface = placed_surface(placed, filled=True)
    return [surface.manifold().translate(tuple(lift.tolist()))]


def _shared_volume(first: Solids, second: Solids) -> float:
    """Return the volume of their intersection, mm3."""
    return sum(float((a ^ b).volume()) for a in first for b in second if _box_gap(a, b) <= 0)


def _box_gap(a: manifold3d.Manifold, b: manifold3d.Manifold) -> float:
    """Return the distance between the boxes of two solids, mm; 0 or less if they meet."""
    box_a, box_b = (np.array(solid.bounding_box()).reshape(2, 3) for solid in (a, b))
    return float(np.maximum(box_a[0] - box_b[1], box_b[0] - box_a[1]).max())


def _gap(arm: Solids, theirs: Solids, least: float) -> float:
    """Return the distance in mm between the nearest two, at most ``least``."""
    pairs = ((_box_gap(a, b), a, b) for a in arm for b in theirs)
    for boxes, a, b in sorted(pairs, key=lambda pair: pair[0]):
        if boxes >= least:
            break
        least = min(least, float(a.min_gap(b, least)))
    return least
