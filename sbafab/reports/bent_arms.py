"""What an arm of an assembly meets, or how far it stays clear, when some chambers bend it.

Each chamber alone and each two side by side are pressed, the others empty, while every other
actuator stands inflated; what stands on the arm goes along with its tip.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sbafab.assemblies.build import Assembled, PlacedPart, PlacedSba
from sbafab.reports.inflated_parts import (
    TOUCHING,
    apart,
    as_it_is,
    carried,
    lifted,
    shared,
    solids,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sbafab.models.stack import Pose, Stack
    from sbafab.reports.inflated_parts import Solids

FARTHEST = 10.0
"""mm up to which clearances are looked for."""
SLIGHTEST = 0.1
"""kPa, the least at which an arm is looked at."""
HALVINGS = 5
FOOT = 3
"""Levels from below that may rest on what the arm stands on."""


class Clearance(NamedTuple):
    """Mm that are left between a bent arm, with what stands on it, and another part."""

    other: str
    chambers: str
    gap: float


class BentTouch(NamedTuple):
    """An arm that shares ``volume`` mm3 with another part when its ``chambers`` are pressed.

    It meets it from about ``from_kpa`` on, bent by ``bend`` degrees.
    """

    part: str
    other: str
    chambers: str
    volume: float
    from_kpa: float
    bend: float


class _Around(NamedTuple):
    """An arm and what is round it: ``carried`` are solids on its top, when it is flat."""

    placed: PlacedSba
    found: Stack
    lift: NDArray[np.float64]
    carried: Solids
    others: dict[str, Solids]


def bent_arms(
    assembled: Assembled,
    placed: PlacedSba,
    stacks: Mapping[str, Stack],
    rises: Mapping[str, NDArray[np.float64]],
    pressure: float,
    pause: Callable[[], None] = lambda: None,
) -> Iterator[Clearance | BentTouch]:
    """For each other part the least clearance, or each way of bending in which the arm meets it.

    ``rises`` says by what each actuator lifts what stands on it. Of what it stands
    on and of parts that stay farther away than ``FARTHEST`` no clearance is said.
    """
    found = stacks[placed.name]
    if found.chambers < 2:
        return
    around = _around(assembled, placed, stacks, rises, pressure)
    nearest: dict[str, Clearance] = {}
    met = set()
    for pressed in _ways(found.chambers):
        pause()
        names = " and ".join(placed.made.laminate.chambers[i].name for i in pressed)
        own = _moved(around, _bent(found, pressed, pressure))
        for other, theirs in around.others.items():
            volume = shared(own.beyond(other, placed), theirs)
            if volume > TOUCHING:
                met.add(other)
                first = _first(around, other, pressed, pressure)
                yield BentTouch(
                    placed.name, other, names, volume, first.pressures[pressed[0]], first.bend
                )
                continue
            if other == placed.part.on:
                continue
            gap = _gap(own.beyond(other, placed), theirs)
            if gap < min(FARTHEST, nearest[other].gap if other in nearest else FARTHEST):
                nearest[other] = Clearance(other, names, gap)
    yield from (one for other, one in nearest.items() if other not in met)


def _ways(chambers: int) -> list[tuple[int, ...]]:
    """Which chambers are pressed: each alone, and each two side by side."""
    alone: list[tuple[int, ...]] = [(i,) for i in range(chambers)]
    return alone + [(i, (i + 1) % chambers) for i in range(chambers) if chambers > 2]


def _bent(found: Stack, pressed: Sequence[int], pressure: float) -> Pose:
    return found.pose(tuple(pressure if i in pressed else 0.0 for i in range(found.chambers)))


def _around(
    assembled: Assembled,
    placed: PlacedSba,
    stacks: Mapping[str, Stack],
    rises: Mapping[str, NDArray[np.float64]],
    pressure: float,
) -> _Around:
    moving = carried(assembled, placed.name)
    lift = lifted(assembled, placed, rises)
    on_top: Solids = []
    others = {}
    for other in assembled.parts:
        if other.name == placed.name or other.part.kind == "line":
            continue
        raised = lifted(assembled, other, rises)
        if other.name in moving:
            raised = raised - rises[placed.name]
        if isinstance(other, PlacedSba) and other.name in stacks:
            own = stacks[other.name]
            made = solids(other, own, own.pose((pressure,) * own.chambers), raised)
        else:
            made = as_it_is(other, raised)
        if other.name in moving:
            on_top += made
        else:
            others[other.name] = made
    return _Around(placed, stacks[placed.name], lift, on_top, others)


class _Arm(NamedTuple):
    """A bent arm's solids with those that stand on it; ``foot`` are those of its lowest levels."""

    foot: Solids
    rest: Solids

    def beyond(self, other: str, placed: PlacedPart) -> Solids:
        """What may meet another part: not its foot what it stands on."""
        return self.rest if other == placed.part.on else self.foot + self.rest


def _moved(around: _Around, pose: Pose) -> _Arm:
    """The bent arm and what stands on it."""
    places = around.placed.upright(pose.frames[0]) + around.lift
    levels = (places[1:] + places[:-1]) / 2
    arm = _Arm([], [])
    for one in solids(around.placed, around.found, pose, around.lift):
        middle = np.array(one.bounding_box()).reshape(2, 3).mean(0)
        level = int(np.linalg.norm(levels - middle, axis=1).argmin())
        (arm.foot if level < FOOT else arm.rest).append(one)
    if not around.carried:
        return arm
    # From the flat arm's top to the bent one's, in the arm's own frame, then in the assembly's.
    tip = np.eye(4)
    tip[:3, :3] = pose.frames[1][-1]
    tip[:3, 3] = pose.tip - tip[:3, :3] @ np.array([0.0, 0.0, around.found.flat_height])
    frame = _frame(around.placed)
    frame[:3, 3] += around.lift
    rows = np.ascontiguousarray((frame @ tip @ np.linalg.inv(frame))[:3])
    return arm._replace(rest=arm.rest + [one.transform(rows) for one in around.carried])


def _frame(placed: PlacedPart) -> NDArray[np.float64]:
    """Matrix (4, 4) of a part's own frame in the assembly's."""
    corners = placed.upright(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
    found = np.eye(4)
    found[:3, 3] = corners[0]
    found[:3, :3] = (corners[1:] - corners[0]).T
    return found


def _gap(own: Solids, theirs: Solids) -> float:
    """Mm between the nearest two, at most ``FARTHEST``."""
    least = FARTHEST
    pairs = ((apart(a, b), a, b) for a in own for b in theirs)
    for boxes, a, b in sorted(pairs, key=lambda pair: pair[0]):
        if boxes >= least:
            break
        least = min(least, float(a.min_gap(b, least)))
    return least


def _first(around: _Around, other: str, pressed: Sequence[int], pressure: float) -> Pose:
    """About the first pose in which the arm meets another part, on the way to a pressure."""
    low, high = min(SLIGHTEST, pressure / 2), pressure
    pose = _bent(around.found, pressed, high)
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        tried = _bent(around.found, pressed, middle)
        own = _moved(around, tried).beyond(other, around.placed)
        if shared(own, around.others[other]) > TOUCHING:
            high, pose = middle, tried
        else:
            low = middle
    return pose
