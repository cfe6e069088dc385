"""What moves in an assembly: poses of its actuators, and what the whole does inflated.

Each actuator is a fast stack by itself; the page carries along what stands on its top. Where parts
meet, and what hangs on tips, is the prediction's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from sbafab import api
from sbafab.errors import DesignError
from sbafab.studio.model import flat
from sbafab.studio.moving import asked_numbers, numbers, pose_model, stack_model, stack_of
from sbafab.studio.parts import packed

if TYPE_CHECKING:
    from sbafab.assemblies.build import Assembled, PlacedPart
    from sbafab.models.stack import Stack

PRESSURE_KPA, LOAD_G = 10.0, 1.2
"""What the prediction is asked for, unless the page says otherwise: the command's own defaults."""
MOST_PRESSURE, MOST_LOAD_G = 110.0, 1000.0


def moving_parts(assembled: Assembled) -> dict[str, Any]:
    """What the page has to know of each actuator: its stack, or its grip, or why it stays."""
    return {"kind": "movers", "movers": list(_movers(assembled))}


def _movers(assembled: Assembled) -> Iterator[dict[str, Any]]:
    for placed in assembled.parts:
        if placed.made is None:
            continue
        laminate = placed.made.laminate
        chambers = [chamber.name for chamber in laminate.chambers]
        known = {"part": placed.name, "chambers": chambers}
        held = api.grip(assembled, placed.name)
        if held is not None:
            found, surface = held
            yield {
                **known,
                "is": "grip",
                **found._asdict(),
                "surface": packed(surface),
            }
            continue
        try:
            stack = stack_of(placed.made.design)
        except DesignError as error:
            yield {**known, "is": "still", "message": str(error)}
            continue
        walls = [own for own in laminate.patterns.values() if own[0].role == "wall"]
        wall = max(walls, key=len)[0].profile if walls else laminate.outline
        yield {
            **stack_model(placed.made.design.name, stack),
            **known,
            "is": "stack",
            "frame": numbers(_frame(placed)),
            "wall": [flat(contour.vertices) for contour in wall.contours],
            "lumen": laminate.lumen,
        }


def part_poses(assembled: Assembled, asked: dict[str, Any]) -> dict[str, Any]:
    """The pose of each actuator whose pressures in kPa are asked for. Raises DesignError."""
    wanted = asked["parts"] if isinstance(asked["parts"], dict) else {}
    found = {}
    for placed in assembled.parts:
        if placed.made is None or placed.name not in wanted:
            continue
        stack: Stack = stack_of(placed.made.design)
        pressures = asked_numbers(wanted[placed.name], stack.chambers, "pressures")
        found[placed.name] = pose_model(stack.pose(pressures))
    return {"kind": "poses", "poses": found}


def whole_prediction(
    assembled: Assembled, asked: dict[str, Any], pause: Callable[[], None]
) -> dict[str, Any]:
    """The figures of ``sbafab predict`` for an assembly, in the words of a design's prediction."""
    pressure = _within(asked.get("pressure_kpa", PRESSURE_KPA), MOST_PRESSURE, "pressure", "kPa")
    load = _within(asked.get("load_g", LOAD_G), MOST_LOAD_G, "mass at the tips", "g")
    if pressure == 0:
        raise DesignError("pressure of a prediction must be above 0 kPa")
    found = api.predict_assembly(assembled, pressure_kpa=pressure, load_g=load, pause=pause)
    figures = [
        {
            "group": one.part,
            "name": one.name,
            "value": one.value,
            "unit": one.unit,
            "model": one.model,
            "trust": f"The paper: {one.paper}" if one.paper else "",
            "design_with": True,
            "measured": {"sentence": one.measured} if one.measured else None,
        }
        for one in found.figures
    ]
    left = [one.partition(": ") for one in found.left_out]
    return {
        "kind": "prediction",
        "asked": {"pressure_kpa": pressure, "load_g": load},
        "figures": figures,
        "left_out": [{"name": name, "reason": reason} for name, _, reason in left],
        "met": found.met(),
        "meets": bool(found.touches or found.bent_touches),
    }


def _within(value: Any, most: float, what: str, unit: str) -> float:
    if not isinstance(value, int | float) or not math.isfinite(value) or not 0 <= value <= most:
        raise DesignError(f"{what} must be from 0 to {most:g} {unit}")
    return float(value)


def _frame(placed: PlacedPart) -> Any:
    """Rows (3, 4) that take a part's own frame to the assembly's."""
    import numpy as np  # a page without a server may lack it

    corners = placed.upright(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
    return np.column_stack([*(corners[1:] - corners[0]), corners[0]])
