"""The press schedule against the stack: every layer joins once, in an order that can be laid."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tests.judge.folder import Folder


def judge_press(folder: Folder) -> Iterator[str]:
    """Each layer is added once, lower before upper, to what lies there; the last step has all."""
    if folder.press is None:
        yield "press.json is missing"
        return
    order = [layer.index for layer in folder.layers]
    steps = folder.press["steps"]
    added = [index for step in steps for index in step["adds"]]
    for index in order:
        if added.count(index) != 1:
            yield f"layer {index} is added {added.count(index)} times"
    lying: set[int] = set()
    for step in steps:
        yield from _step(step, order, lying)
        lying |= set(step["adds"])
    if not steps or steps[-1]["bond"] != "full" or steps[-1]["layers"] != order:
        yield "the last step is not a full bond of the whole laminate"


def _step(step: dict[str, Any], order: list[int], lying: set[int]) -> Iterator[str]:
    name = f"step {step['step']}"
    layers, adds = step["layers"], step["adds"]
    if layers != sorted(set(layers)) or not set(layers) <= set(order):
        yield f"{name} does not lay its layers lower before upper"
    elif layers and layers != order[order.index(layers[0]) : order.index(layers[-1]) + 1]:
        yield f"{name} leaves out layers between those it presses"
    if not set(adds) <= set(layers) or set(layers) - set(adds) - lying:
        yield f"{name} presses layers that it does not add and none added"
