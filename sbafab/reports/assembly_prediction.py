"""Prediction of an inflated assembly: reach, load, grip in its lumen, contacts between parts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.assemblies.build import Assembled, PartDesign, PlacedPart, PlacedSba
from sbafab.assemblies.checks import TOUCH, box_gap
from sbafab.assemblies.shapes import placed_surface
from sbafab.design.records import Discs, Slots
from sbafab.laminate.burst import is_near_burst, refuse_beyond_burst
from sbafab.meshing.surface import Surface
from sbafab.models.balloons import balloons_of
from sbafab.models.calibration import factors_of
from sbafab.models.closed_forms import cylinder_height, lens
from sbafab.models.elastic import free_rise
from sbafab.models.paper import counterpart
from sbafab.models.quantity import ANYWHERE, Conditions, ModelId, Quantity
from sbafab.models.sizes import is_the_papers_3dof, sizes
from sbafab.models.stack import Stack, stack
from sbafab.reports.inflated import COARSE, inflated

if TYPE_CHECKING:
    import manifold3d
    from numpy.typing import NDArray

    from sbafab.models.stack import Pose

    Array = NDArray[np.float64]
    Solids = list[manifold3d.Manifold]

SCHEMA = "sbafab/assembly-predict@1"  # id of a prediction of an assembly as JSON
GRAVITY = 9.80665
MARBLE_G = 1.2  # the paper's brace lifts this marble (Sec. 5)
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
    """A quantity of one part: value in ``unit``, model, and the paper's remark, if any.

    ``measured`` is the paper's value for a single actuator if the model deviates from it by more
    than a quarter.
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
    """Two parts that intersect in ``volume`` mm3 when the first one is inflated."""

    part: str
    other: str
    volume: float


@dataclass(frozen=True)
class BentTouch:
    """An arm that intersects another part in ``volume`` mm3 when its ``chambers`` are pressurised.

    Contact begins at about ``from_kpa``, at a bend of ``bend`` degrees; ``measured`` is the paper's
    bend if the model deviates from it by more than a quarter.
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
    """Figures at ``pressure_kpa``. ``touches`` are parts that collide when all are upright,
    ``bent_touches`` contacts of bent arms; ``left_out`` names quantities without a model,
    ``near_burst`` the parts above half of their estimated burst pressure.
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
        """Sentences about contacts of inflated parts, and remedies."""
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

    ``pause`` is called between parts of the work, which takes seconds; an exception in it stops the
    work. Raises DesignError for pressures beyond the models or a part's estimated burst.
    """
    actuators = [placed for placed in assembled.parts if isinstance(placed, PlacedSba)]
    for placed in actuators:
        refuse_beyond_burst(placed.made.laminate, pressure_kpa)
    items: list[AssemblyFigure | Touch | BentTouch] = []
    left_out: list[str] = []
    scene = _Scene(assembled, pressure_kpa)
    for placed in actuators:
        pause()
        hold = grip(assembled, placed)
        if hold is not None:
            items += _grip_figures(hold, placed.made.design.form.stacks, pressure_kpa, load_g)
            if hold.push is None:
                left_out.append(f"{placed.name}, {', '.join(IN_THE_LUMEN)}: {hold.why_none}")
        elif placed.name in scene.stacks:
            items += _arm_figures(placed, scene.stacks[placed.name], pressure_kpa, load_g)
            items += scene.touches(placed)
            pause()
            items += scene.bends(placed, pause)
        else:
            left_out.append(f"{placed.name}: no model knows the form of a drawn pocket outline")
    figures = [item for item in items if isinstance(item, AssemblyFigure)]
    name = assembled.assembly.name
    if name not in PAPERS:
        figures = [replace(figure, paper="") for figure in figures]
    touches = tuple(item for item in items if isinstance(item, Touch))
    bent = tuple(item for item in items if isinstance(item, BentTouch))
    near = tuple(p.name for p in actuators if is_near_burst(p.made.laminate, pressure_kpa))
    return AssemblyPrediction(
        name, pressure_kpa, load_g, tuple(figures), touches, tuple(left_out), bent, near
    )


def _arm_figures(
    placed: PlacedSba, arm: Stack, pressure: float, load_g: float
) -> Iterator[AssemblyFigure]:
    """Yield height, reach, bend and load of an actuator with round pockets."""
    design, laminate = placed.made.design, placed.made.laminate
    is_papers = is_the_papers_3dof(design.form, laminate)
    every, at = (pressure,) * arm.chambers, Conditions(kpa=pressure)
    free, flat = arm.pose(every), arm.flat_height
    # As in a design's own prediction: the stack's maps are approximate.
    stroke = free_rise(Counter(balloons_of(design, laminate, factors_of(design))), pressure).stroke
    push = arm.pose(every, plate=flat + 0.75 * stroke).force
    blocked, bent = at._replace(share=0.75), at._replace(chambers=1)
    rows: list[tuple[str, float, Quantity, Conditions, str]] = [
        ("height, flat", flat, Quantity.FOLDED_HEIGHT, ANYWHERE, "about 1 (Sec. 6)"),
        ("height, inflated", flat + stroke, Quantity.FREE_HEIGHT, at, "about 20 (Sec. 5)"),
        ("push at 75 % of its stroke", push, Quantity.BLOCKED_FORCE, blocked, ""),
    ]
    if arm.chambers > 1:
        single = arm.pose((pressure, *(0.0,) * (arm.chambers - 1)))
        aside = float(np.hypot(*single.tip[:2]))
        rows.append(("bend by one chamber", single.bend, Quantity.BEND, bent, ""))
        rows.append(("maximum lateral tip displacement", aside, Quantity.ASIDE, bent, ""))
    if load_g > 0:
        hung = arm.pose(every, tip_load=(load_g * 1e-3 * GRAVITY, 0.0, 0.0), near=free)
        sag = float(np.linalg.norm(hung.tip - free.tip))
        paper = "lifts 1.2 g (Sec. 5)" if load_g == MARBLE_G else ""
        # Sag is load over stiffness.
        rows.append(
            (f"sag of the tip, {load_g:g} g across it", sag, Quantity.HELD_STIFFNESS, at, paper)
        )
    for words, value, quantity, where, paper in rows:
        unit = "mm" if quantity is Quantity.HELD_STIFFNESS else quantity.unit
        is_balloon = quantity is Quantity.FREE_HEIGHT
        model = ModelId.ELASTIC_BALLOON if is_balloon else ModelId.ELASTIC_STACK
        # The measured value beside a figure is that of a design's own prediction.
        by = ModelId.FILMS if quantity is Quantity.FOLDED_HEIGHT else model
        beside = counterpart(design.form, quantity, where, by, arm.calibration, is_papers)
        measured = beside.sentence if beside else ""
        yield AssemblyFigure(placed.name, words, value, unit, model.words, paper, measured)


# A radial actuator in the assembly's lumen.


class Grip(NamedTuple):
    """A radial actuator: diameters ``deflated``, inflated ``free`` of any lumen, and ``most``, the
    upper end, in mm.

    In the assembly's ``lumen`` a balloon is ``room`` mm high; each stack presses on the wall with
    ``push`` N per kPa. Both are None if it does not reach a lumen.
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
        """The reason why the grip in the lumen is omitted."""
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
    """Return the grip of a radial actuator in the assembly's lumen; None for other forms."""
    design, laminate = placed.made.design, placed.made.laminate
    form, pockets = design.form, design.form.pockets
    if not isinstance(pockets, Slots):
        return None
    tube = form.wrap.outer_diameter if form.wrap is not None else 2 * (placed.radius or 0.0)
    balloons = laminate.balloons
    deflated = tube + 2 * factors_of(design).folded(laminate).height
    pocket, widest = lens(pockets.width, pockets.run), cylinder_height(pockets.width)
    rise = pocket.largest_stroke
    free, most = (deflated + 2 * balloons * high for high in (rise, widest))
    lumen = assembled.assembly.deploy.lumen_diameter
    room = 0.0 if lumen is None else (lumen - deflated) / 2 / balloons
    if not 0 < room <= rise:
        return Grip(placed.name, deflated, free, most, lumen)
    # 1 kPa mm2 is 1 mN.
    push = float(pocket.rate(room)) / 1000
    return Grip(placed.name, deflated, free, most, lumen, room, push)


def _grip_figures(
    hold: Grip, stacks: int, pressure: float, load_g: float
) -> Iterator[AssemblyFigure]:
    """Yield diameters of a radial actuator, and the grip of its stacks in the assembly's lumen."""
    widest, height, push, friction = "about 28 (Sec. 2.1)", *IN_THE_LUMEN
    rows = [
        ("diameter, deflated", hold.deflated, "mm", "tube and films", "15.33 (Sec. 2.1)"),
        ("diameter, inflated free", hold.free, "mm", ModelId.LENS.words, widest),
        ("diameter, inflated at most", hold.most, "mm", ModelId.CYLINDER.words, widest),
    ]
    if hold.room is not None and hold.push is not None:
        force = pressure * hold.push
        rows.append((f"{height} of {hold.lumen:g} mm", hold.room, "mm", STATIC, ""))
        rows.append((push, force, "N", LENS, "holds (Sec. 5)"))
        if load_g > 0:
            needed = load_g * 1e-3 * GRAVITY / (stacks * force)
            words = f"{friction} that holds {load_g:g} g along the lumen"
            rows.append((words, needed, "", STATIC, ""))
    yield from (AssemblyFigure(hold.part, *row) for row in rows)


# Contacts and clearances between parts, of arms upright and bent by some of their chambers.
#
# Each chamber alone and each pair of neighbours are pressurised, the others empty, while every
# other actuator is inflated; parts on the arm move with its tip.


FARTHEST = 10.0  # mm: up to this distance clearances are computed
SLIGHTEST = 0.1  # kPa: lowest pressure at which an arm is checked
HALVINGS = 5
FOOT = 3  # levels from below that may rest on the part under the arm


class _Scene:
    """The parts of an assembly as solids, all actuators inflated to ``pressure`` kPa.

    ``stacks`` are those of actuators with round pockets, by part; ``solids`` are in place.
    """

    def __init__(self, assembled: Assembled, pressure: float) -> None:
        self.assembled, self.pressure = assembled, pressure
        stack_of = cache(_stack_of)
        self.stacks = {
            placed.name: stack_of(placed.made)
            for placed in assembled.parts
            if isinstance(placed, PlacedSba) and isinstance(placed.made.design.form.pockets, Discs)
        }
        self.poses = {
            name: arm.pose((pressure,) * arm.chambers) for name, arm in self.stacks.items()
        }

    @cached_property
    def solids(self) -> dict[str, Solids]:
        return {p.name: self._solids(p, self.poses) for p in self.assembled.parts if _is_seen(p)}

    def _move(self, placed: PlacedPart, poses: Mapping[str, Pose]) -> Array:
        """Return the matrix (4, 4) by which actuators in these poses move a part mounted on them
        when flat.
        """
        host = placed.part.on
        if host is None:
            return np.eye(4)
        under = self.assembled[host]
        move = self._move(under, poses)
        if placed.part.at != "top" or host not in poses:
            return move
        # From the flat actuator's top to its tip, in its own frame, then in the assembly's.
        pose, tip, frame = poses[host], np.eye(4), np.eye(4)
        tip[:3, :3] = pose.frames[1][-1]
        tip[:3, 3] = pose.tip - tip[:3, 2] * self.stacks[host].flat_height
        corners = under.upright(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
        frame[:3, 3], frame[:3, :3] = corners[0], (corners[1:] - corners[0]).T
        moved: Array = move @ frame @ tip @ np.linalg.inv(frame)
        return moved

    def _solids(self, placed: PlacedPart, poses: Mapping[str, Pose]) -> Solids:
        rows = np.ascontiguousarray(self._move(placed, poses)[:3])
        return [solid.transform(rows) for solid in _unmoved(placed, self.stacks, poses)]

    def _moving(self, name: str) -> dict[str, PlacedPart]:
        """Return the parts fixed to a part, directly or indirectly, by name."""
        names: dict[str, PlacedPart] = {}
        for part in self.assembled.parts:
            if part.part.on == name or part.part.on in names:
                names[part.name] = part
        return names

    def touches(self, placed: PlacedSba) -> Iterator[Touch]:
        """Yield the parts in contact with an actuator when all are upright, each pair once."""
        # Parts on it move along; the part under it touches it as when flat.
        apart = {placed.name, placed.part.on, *self._moving(placed.name)}
        names = [part.name for part in self.assembled.parts]
        apart.update(name for name in names[: names.index(placed.name)] if name in self.stacks)
        for second, theirs in self.solids.items():
            volume = 0.0
            if second not in apart:
                volume = _shared_volume(self.solids[placed.name], theirs)
            if volume > TOUCH:
                yield Touch(placed.name, second, volume)

    def bends(
        self, placed: PlacedSba, pause: Callable[[], None]
    ) -> Iterator[AssemblyFigure | BentTouch]:
        """Yield each bend at which an arm touches another part, then the least clearance to others.

        The clearance excludes the part under the arm and parts farther away than ``FARTHEST``.
        """
        arm = self.stacks[placed.name]
        if arm.chambers < 2:
            return
        moving = {placed.name, *self._moving(placed.name)}
        nearest: dict[str, tuple[float, str]] = {}
        met = set()
        for chambers in _ways(arm.chambers):
            pause()
            names = " and ".join(placed.made.laminate.chambers[i].name for i in chambers)
            pose, facing = self._bent(placed, chambers, self.pressure)
            for part, theirs in self.solids.items():
                if part in moving:
                    continue
                volume = _shared_volume(facing(part), theirs)
                if volume > TOUCH:
                    met.add(part)
                    first = self._first_contact(placed, chambers, part, pose)
                    start, measured = max(first.pressures), arm.counterparts.get("bend", "")
                    yield BentTouch(placed.name, part, names, volume, start, first.bend, measured)
                elif part != placed.part.on:
                    least = nearest.get(part, (FARTHEST, ""))
                    gap = _gap(facing(part), theirs, least[0])
                    nearest[part] = least if gap >= least[0] else (gap, names)
        for part, (gap, names) in nearest.items():
            if part not in met and gap < FARTHEST:
                words = f"clearance to {part}, bent by {names}"
                yield AssemblyFigure(placed.name, words, gap, "mm", ModelId.ELASTIC_STACK.words)

    def _bent(
        self, placed: PlacedSba, chambers: Sequence[int], pressure: float
    ) -> tuple[Pose, Callable[[str], Solids]]:
        """Return the pose of an arm bent by some chambers, and its solids, with all parts fixed to
        it, that may touch a part. The lowest levels are omitted for the part under it, on which
        they may rest.
        """
        arm = self.stacks[placed.name]
        pose = arm.pose(tuple(pressure if i in chambers else 0.0 for i in range(arm.chambers)))
        poses = {**self.poses, placed.name: pose}
        places = placed.upright(pose.frames[0]) + self._move(placed, poses)[:3, 3]
        levels = (places[1:] + places[:-1]) / 2
        foot: Solids = []
        rest: Solids = []
        for solid in self._solids(placed, poses):
            middle = np.array(solid.bounding_box()).reshape(2, 3).mean(0)
            level = int(np.linalg.norm(levels - middle, axis=1).argmin())
            (foot if level < FOOT else rest).append(solid)
        for part in filter(_is_seen, self._moving(placed.name).values()):
            rest += self._solids(part, poses)
        return pose, lambda part: rest if part == placed.part.on else foot + rest

    def _first_contact(
        self, placed: PlacedSba, chambers: Sequence[int], part: str, pose: Pose
    ) -> Pose:
        """Return the approximate first pose in contact with a part, at the latest this pose."""
        low, high = min(SLIGHTEST, self.pressure / 2), self.pressure
        for _ in range(HALVINGS):
            middle = math.sqrt(low * high)
            tried, facing = self._bent(placed, chambers, middle)
            if _shared_volume(facing(part), self.solids[part]) > TOUCH:
                high, pose = middle, tried
            else:
                low = middle
        return pose


def _is_seen(placed: PlacedPart) -> bool:
    return placed.part.kind != "line"


def _stack_of(part: PartDesign) -> Stack:
    return stack(part.design, part.laminate, factors=factors_of(part.design))


def _ways(chambers: int) -> list[tuple[int, ...]]:
    """Return the sets of pressurised chambers: each one, and each adjacent pair."""
    alone: list[tuple[int, ...]] = [(i,) for i in range(chambers)]
    return alone + [(i, (i + 1) % chambers) for i in range(chambers) if chambers > 2]


def _unmoved(placed: PlacedPart, stacks: Mapping[str, Stack], poses: Mapping[str, Pose]) -> Solids:
    """Return a part on flat hosts: balloons and webs of a stack in its pose; for others the part
    with its pockets filled, or the free inflated cylinder of one around a tube.
    """
    part_design = placed.made
    if part_design is not None and placed.name in stacks:
        parts = inflated(part_design.laminate, stacks[placed.name], poses[placed.name], COARSE)
        surfaces = (Surface(placed.upright(x.surface.points), x.surface.faces) for x in parts)
        return [piece for surface in surfaces for piece in surface.manifold().decompose()]
    round_tube = {} if part_design is None else sizes(part_design.design, part_design.laminate)
    if part_design is None or "inflated_diameter" not in round_tube:
        return [placed_surface(placed, filled=True).manifold()]
    import manifold3d

    _, low, _, high = part_design.laminate.layers[0].profile.turned(placed.turn).bounds
    cylinder = manifold3d.Manifold.cylinder(high - low, round_tube["inflated_diameter"] / 2)
    rows = np.column_stack([np.array(placed.pose.rows), np.array(placed.pose.shift)])
    return [cylinder.translate((0.0, 0.0, low)).transform(rows)]


def _shared_volume(first: Solids, second: Solids) -> float:
    """Return the volume of the intersection, mm3."""
    return sum(float((a ^ b).volume()) for a in first for b in second if box_gap(a, b) <= 0)


def _gap(arm: Solids, theirs: Solids, least: float) -> float:
    """Return the distance in mm between the nearest two, at most ``least``."""
    pairs = ((box_gap(a, b), a, b) for a in arm for b in theirs)
    for boxes, a, b in sorted(pairs, key=lambda pair: pair[0]):
        if boxes >= least:
            break
        least = min(least, float(a.min_gap(b, least)))
    return least
