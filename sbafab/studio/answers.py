"""Laminates, findings, assemblies and their poses as data for the page: numbers and text.

A contour is a flat list of x, y and bulge (mm; the DXF convention), so arcs stay arcs on screen. A
shape is sent once under its key, and never to a page that names it as present.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from sbafab import api
from sbafab.api.checks import FindingEntry
from sbafab.errors import DesignError

if TYPE_CHECKING:
    from sbafab.api.checks import Finding, NetMap, Region
    from sbafab.api.designs import Assembled, Design, Laminate, PlacedPart, Surface
    from sbafab.api.predictions import Motion, Pose, Stack

Kept = TypeVar("Kept")
CancelCheck = Callable[[], None]
"""Called between steps of work; raises if the answer is not needed any longer."""


def of(record: object, *names: str) -> dict[str, Any]:
    """Return these attributes of a record by name."""
    return {name: getattr(record, name) for name in names}


@dataclass
class AnswerShapes:
    """The shapes of one answer; shapes that the page already ``has`` are only named."""

    has: Collection[str]
    new: dict[str, list[list[float]]] = field(default_factory=dict)

    def key(self, region: Region) -> str:
        """Return the name of a region, and add the region if the page lacks it."""
        key = region.key[:24]
        if key not in self.has and key not in self.new:
            self.new[key] = [flat(contour.vertices) for contour in region.contours]
        return key


def flat(vertices: Iterable[tuple[float, float, float]]) -> list[float]:
    """Return a contour in the page's format; its bulges are exact enough to write arcs back to a
    design.
    """
    rounded = ((round(x, 6), round(y, 6), round(bulge, 12)) for x, y, bulge in vertices)
    return [number for vertex in rounded for number in vertex]


def laminate_model(laminate: Laminate, has: Collection[str]) -> dict[str, Any]:
    """Return layers, patterns and positions, from which plan, section and solid are drawn."""
    shapes = AnswerShapes(has)
    patterns = {
        name: {
            "shape": shapes.key(group[0].profile),
            "layers": [layer.index for layer in group],
            "area": round(group[0].profile.area, 4),
            "bounds": group[0].profile.bounds,
            "marks": [asdict(mark) for mark in api.dimensions(laminate, group[0])],
        }
        for name, group in laminate.patterns.items()
    }
    layers = [
        {
            **of(layer, "index", "role", "balloon", "pattern", "z"),
            **of(layer.film, "material", "shade", "thickness"),
            "mask": layer.is_mask,
        }
        for layer in laminate.layers
    ]
    lists = ("chambers", "bores", "inlets", "pins")
    names = ("name", "family", "thickness", "balloons", "lumen", "bounds", "registration", "notes")
    return {
        "kind": "laminate",
        **of(laminate, *names),
        **{name: [asdict(row) for row in getattr(laminate, name)] for name in lists},
        "layers": layers,
        "patterns": patterns,
        "shapes": shapes.new,
    }


def shapes_model(drawn: Mapping[str, Region | None], has: Collection[str]) -> dict[str, Any]:
    """Return the named shapes of a design file, each with the key of its region or None."""
    shapes = AnswerShapes(has)
    named = {name: region and shapes.key(region) for name, region in drawn.items()}
    return {"kind": "shapes", "named": named, "shapes": shapes.new}


def nets_model(laminate: Laminate, nets: NetMap, has: Collection[str]) -> dict[str, Any]:
    """Voids with their nets by gap, the gaps of films, ports, and faults with their places."""
    shapes = AnswerShapes(has)
    gaps = [
        {"interface": gap.index, "layers": gap.layer_indices, "contact": shapes.key(gap.contact)}
        for gap in laminate.interfaces
    ]
    areas = [
        {**of(area, "nets", "interface", "colour"), "shape": shapes.key(area.region)}
        for area in nets.areas
    ]
    ports = [
        {"name": port.name, "layers": (port.below, port.above), "at": port.at}
        for port in laminate.ports
    ]
    names = ("kind", "nets", "interface", "layers", "at", "message")
    return {
        "kind": "nets",
        "declared": bool(laminate.nets),
        "colours": nets.colours,
        "gaps": gaps,
        "areas": areas,
        "ports": ports,
        "faults": [of(fault, *names) for fault in nets.faults],
        "shapes": shapes.new,
    }


def finding_model(finding: Finding) -> dict[str, Any]:
    """A finding as in ``checks.json``, its design (whose name the message omits) and its parts."""
    entry = FindingEntry.of(replace(finding, design=""))
    design = {"design": finding.design} if finding.design else {}
    return {**entry, **design, **of(finding, "by_user", "parts")}


# Assemblies: the surface of each part once, in the part's own frame, and its place.


PLACED_BY = {"on", "at", "angle", "along", "offset", "glue", "note", "design", "set"}
"""Keys of a part that do not change its own surface; an actuator's depends on its laminate."""


def parts_model(assembled: Assembled, has: Collection[str]) -> dict[str, Any]:
    """Return parts with their places, in order of support, and surfaces that the page lacks."""
    surfaces: dict[str, dict[str, str]] = {}
    parts = []
    for placed in assembled.parts:
        key = _key(placed)
        if key not in has and key not in surfaces:
            surfaces[key] = packed(api.solid(placed))
        design = None
        if placed.made is not None:
            values = api.resolved(placed.made.design)
            design = {**of(placed.made.design, "name", "family"), "values": values}
        part = {**of(placed.part, "kind", "on", "at"), **of(placed.pose, "rows", "shift")}
        parts.append({**part, "name": placed.name, "design": design, "surface": key})
    return {"kind": "parts", "parts": parts, "surfaces": surfaces}


def _key(placed: PlacedPart) -> str:
    """Return a key for a surface, from everything that determines it."""
    decisive: list[Any] = [placed.turn, placed.radius]
    if placed.made is None:
        decisive.append(placed.part.model_dump(mode="json", exclude=PLACED_BY))
    else:
        layers = placed.made.laminate.layers
        decisive += [
            (layer.profile.key, layer.z, layer.film.thickness, layer.is_mask) for layer in layers
        ]
    return hashlib.sha256(repr(decisive).encode()).hexdigest()[:24]


def remembered(cache: dict[str, Kept], key: str, make: Callable[[], Kept], most: int) -> Kept:
    """Return the cached value of a key, computed if missing; at most ``most`` values are kept."""
    if key not in cache:
        cache[key] = make()
        while len(cache) > most:
            del cache[next(iter(cache))]
    return cache[key]


def packed(surface: Surface) -> dict[str, str]:
    """Return points and faces of a surface in the page's packed format."""
    arrays = {"points": surface.points.astype("<f4"), "faces": surface.faces.astype("<u4")}
    return {name: base64.b64encode(rows.tobytes()).decode() for name, rows in arrays.items()}


# Poses of the fast stack of a design.


CURVE = 25  # points of the curves beside the view
LONGEST_STEP = 0.2  # longest time spanned by one step of a motion, s
MOST_STACKS = 6
_STACKS: dict[str, Stack] = {}
MOST_LOAD = 0.5  # largest force of the user's pull on the tip, N


def stack_of(design: Design) -> Stack:
    """The stack of a design, cached for the next pose. Raises DesignError if there is none."""
    resolved = {**api.resolved(design), "name": None, "order": None}
    key = json.dumps(resolved, sort_keys=True, default=str)
    return remembered(_STACKS, key, lambda: api.stack(design), MOST_STACKS)


def stack_model(name: str, stack: Stack) -> dict[str, Any]:
    """Return radii, axes, pitch, and the highest pressure."""
    radii = ("neck", "pocket", "ring", "thickness")
    return {
        "kind": "stack",
        "name": name,
        "axes": numbers(stack.axes),
        **of(stack, "pitch", "flat_height", "outline"),
        "levels": [int(level) for level in stack.levels],
        "balloons": [of(balloon_map.balloon, *radii) for balloon_map in stack.maps],
        "most_pressure": min(balloon_map.most_pressure for balloon_map in stack.maps),
        "measured": stack.counterparts,
    }


def poses(stack: Stack, request: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Return the requested pose; with ``curves`` also the poses toward it, as lists of figures, and
    whether the balloons' maps are valid for it.

    Raises DesignError beyond the model's range.
    """
    pressures = finite_numbers(request.get("pressures"), stack.chambers, "pressures")
    final = stack.pose(pressures, **_loads(request))
    yield pose_model(final)
    if not request.get("curves"):
        return
    most = max(pressures) or 1.0
    rows = []
    for number in range(CURVE):
        share = number / (CURVE - 1)
        try:
            pose = stack.pose([share * p for p in pressures], gravity=bool(request.get("gravity")))
        except DesignError:
            break
        rows.append((share * most, pose.height, pose.bend, float(sum(pose.volumes))))
    columns = zip(("pressure", "height", "bend", "volume"), zip(*rows, strict=True), strict=False)
    by_name = {name: numbers(column) for name, column in columns}
    yield {"kind": "curves", "holds": stack.within(final), **by_name}


class Filling:
    """Motion driven through the tubes of one tab: the state at the start of its next step."""

    def __init__(self) -> None:
        self.setting: tuple[object, ...] = ()
        self.motion: Motion | None = None

    def step(self, stack: Stack, request: dict[str, Any]) -> dict[str, Any]:
        """Return the pose after ``dt`` s, with pressures in kPa at the valves. Raises DesignError.

        It restarts, vented, for another stack, tube or load, or on ``restart``.
        """
        tube = request["tube"] if isinstance(request.get("tube"), dict) else {}
        pressures = finite_numbers(request.get("pressures"), stack.chambers, "pressures")
        length, diameter, dt = finite_numbers(
            [tube.get("length"), tube.get("diameter"), tube.get("dt")], 3, "tube"
        )
        load = _loads(request)
        setting = (id(stack), length, diameter, repr(load))
        if self.motion is None or setting != self.setting or tube.get("restart"):
            self.setting = setting
            self.motion = api.motion(stack, length=length, diameter=diameter, **load)
        pose = self.motion.step(min(max(dt, 1e-4), LONGEST_STEP), pressures=pressures)
        return {**pose_model(pose), "valves": pressures, "time": round(self.motion.time, 4)}


def _loads(request: dict[str, Any]) -> dict[str, Any]:
    """Return the loads on the tip: pull, weight, outer plate."""
    load = finite_numbers(request.get("load") or [0, 0, 0], 3, "load")
    size = math.hypot(*load)
    if size > MOST_LOAD:
        load = [part * MOST_LOAD / size for part in load]
    plate = request.get("plate")
    height = float(plate) if isinstance(plate, int | float) else None
    return {"tip_load": load, "gravity": bool(request.get("gravity")), "plate": height}


def pose_model(pose: Pose) -> dict[str, Any]:
    origins, axes = pose.frames
    return {
        "kind": "pose",
        "pressures": list(pose.pressures),
        "origins": numbers(origins),
        "axes": numbers(axes.reshape(len(axes), 9)),
        "gaps": numbers(pose.gaps),
        "height": round(pose.height, 4),
        "bend": round(pose.bend, 3),
        "direction": round(pose.direction, 2),
        "volumes": numbers(pose.volumes),
        "force": round(float(pose.force), 6),
        "stable": bool(pose.stable),
    }


def finite_numbers(values: Any, count: int, name: str) -> list[float]:
    good = isinstance(values, list) and len(values) == count
    if not good or not all(isinstance(v, int | float) and math.isfinite(v) for v in values):
        raise DesignError(f"{name} must be {count} finite numbers")
    return [float(value) for value in values]


def numbers(values: Any) -> Any:
    """Return nested lists rounded to five decimals: 10 nm."""
    if hasattr(values, "tolist"):
        values = values.tolist()
    if isinstance(values, Sequence):
        return [numbers(value) for value in values]
    return round(float(values), 5)


# Assemblies: poses of the actuators, and the prediction of the whole.
#
# Each actuator is a separate fast stack; the page moves the parts on its top. Contacts between
# parts, and loads on tips, come from the prediction.


PRESSURE_KPA, LOAD_G = 10.0, 1.2  # defaults of the prediction's request, as in the command
MOST_PRESSURE, MOST_LOAD_G = 110.0, 1000.0


def movers(assembled: Assembled) -> Iterator[dict[str, Any]]:
    """Yield the stack or the grip of each actuator, or the reason why it does not move."""
    for placed in assembled.parts:
        if placed.made is None:
            continue
        laminate = placed.made.laminate
        chambers = [chamber.name for chamber in laminate.chambers]
        actuator = {"part": placed.name, "chambers": chambers}
        gripper = api.grip(assembled, placed.name)
        if gripper is not None:
            grip, surface = gripper
            yield {**actuator, "is": "grip", **grip._asdict(), "surface": packed(surface)}
            continue
        try:
            stack = stack_of(placed.made.design)
        except DesignError as error:
            yield {**actuator, "is": "still", "message": str(error)}
            continue
        walls = [layers for layers in laminate.patterns.values() if layers[0].role == "wall"]
        wall = max(walls, key=len)[0].profile if walls else laminate.outline
        # Rows that map the part's own frame to the assembly's.
        corners = placed.upright(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
        yield {
            **stack_model(placed.made.design.name, stack),
            **actuator,
            "is": "stack",
            "frame": numbers(np.column_stack([*(corners[1:] - corners[0]), corners[0]])),
            "wall": [flat(contour.vertices) for contour in wall.contours],
            "lumen": laminate.lumen,
        }


def part_poses(assembled: Assembled, request: dict[str, Any]) -> dict[str, Any]:
    """Return the pose of each actuator with requested pressures in kPa. Raises DesignError."""
    pressures_of = request["parts"] if isinstance(request["parts"], dict) else {}
    poses_of = {}
    for placed in assembled.parts:
        if placed.made is None or placed.name not in pressures_of:
            continue
        stack = stack_of(placed.made.design)
        pressures = finite_numbers(pressures_of[placed.name], stack.chambers, "pressures")
        poses_of[placed.name] = pose_model(stack.pose(pressures))
    return {"kind": "poses", "poses": poses_of}


def whole_prediction(
    assembled: Assembled, request: dict[str, Any], pause: Callable[[], None]
) -> dict[str, Any]:
    """The figures of ``sbafab predict`` for an assembly, in the format of a design's prediction."""
    pressure = _within(request.get("pressure_kpa", PRESSURE_KPA), MOST_PRESSURE, "pressure", "kPa")
    load = _within(request.get("load_g", LOAD_G), MOST_LOAD_G, "mass at the tips", "g")
    if pressure == 0:
        raise DesignError("pressure of a prediction must be above 0 kPa")
    prediction = api.predict_assembly(assembled, pressure_kpa=pressure, load_g=load, pause=pause)
    figures = [
        {
            **of(figure, "name", "value", "unit", "model"),
            "group": figure.part,
            "trust": f"The paper: {figure.paper}" if figure.paper else "",
            "design_with": True,
            "measured": {"sentence": figure.measured} if figure.measured else None,
        }
        for figure in prediction.figures
    ]
    omitted = [figure.partition(": ") for figure in prediction.left_out]
    return {
        "kind": "prediction",
        "asked": {"pressure_kpa": pressure, "load_g": load},
        "figures": figures,
        "left_out": [{"name": name, "reason": reason} for name, _, reason in omitted],
        "met": prediction.met(),
        "meets": bool(prediction.touches or prediction.bent_touches),
    }


def _within(value: Any, most: float, name: str, unit: str) -> float:
    if not isinstance(value, int | float) or not math.isfinite(value) or not 0 <= value <= most:
        raise DesignError(f"{name} must be from 0 to {most:g} {unit}")
    return float(value)
