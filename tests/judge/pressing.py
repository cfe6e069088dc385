"""The press schedule against the stack: every layer joins once, in an order that can be laid."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tests.judge.folder import Disagreement, Folder

MINUTES = {
    "flash_bottom_minutes": 3.0,
    "bond_bottom_minutes": 12.0,
    "flash_middle_minutes": 10.0,
    "bond_all_minutes": 20.0,
}


def judge_press(folder: Folder) -> Iterator[Disagreement]:
    """Each layer is added once, lower before upper, and the press is set as asked for."""
    press = folder.press
    if press is None:
        yield Disagreement("press", "press.json is missing")
        return
    order = [layer.index for layer in folder.layers]
    added = [index for step in press["steps"] for index in step["adds"]]
    for index in order:
        if added.count(index) != 1:
            yield Disagreement("press", f"layer {index} is added {added.count(index)} times")
    lying: set[int] = set()
    for step in press["steps"]:
        yield from _step(folder, step, order, lying)
        lying |= set(step["adds"])
    steps = press["steps"]
    if not steps or steps[-1]["bond"] != "full" or steps[-1]["layers"] != order:
        yield Disagreement("press", "the last step is not a full bond of the whole laminate")
    total = sum(step["minutes"] for step in steps)
    if abs(total - press["total_press_minutes"]) > 1e-6:
        yield Disagreement("press", f"steps take {total:g} min, and the total says otherwise")


def _step(
    folder: Folder, step: dict[str, Any], order: list[int], lying: set[int]
) -> Iterator[Disagreement]:
    name = f"step {step['step']}"
    layers, adds = step["layers"], step["adds"]
    if layers != sorted(set(layers)) or not set(layers) <= set(order):
        yield Disagreement("press", f"{name} does not lay its layers lower before upper")
    elif layers and layers != order[order.index(layers[0]) : order.index(layers[-1]) + 1]:
        yield Disagreement("press", f"{name} leaves out layers between those it presses")
    if not set(adds) <= set(layers) or set(layers) - set(adds) - lying:
        yield Disagreement("press", f"{name} presses layers that it does not add and none added")
    wanted = float(folder.wish("press", "temperature_c", 135.0))
    if step["temperature_c"] != wanted:
        yield Disagreement(
            "press", f"{name} presses at {step['temperature_c']:g} C, not {wanted:g}"
        )
    asked = {float(folder.wish("press", key, usual)) for key, usual in MINUTES.items()}
    if step["minutes"] not in asked:
        yield Disagreement("press", f"{name} takes {step['minutes']:g} min, which nobody asked for")
    width, length = (float(folder.wish("press", f"platen_{k}", 152.4)) for k in ("width", "length"))
    force = float(folder.wish("press", "pressure_kpa", 110.0)) * width * length / 1000
    if abs(step["force_n"] - force) > 1e-3 * force:
        yield Disagreement("press", f"{name} presses with {step['force_n']:g} N, not {force:.1f}")
