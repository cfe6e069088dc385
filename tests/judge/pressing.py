"""The press schedule against the stack: every layer joins once, in an order that can be laid."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tests.judge.folder import Folder

MINUTES = {
    "flash_bottom_minutes": 3.0,
    "bond_bottom_minutes": 12.0,
    "flash_middle_minutes": 10.0,
    "bond_all_minutes": 20.0,
}


def judge_press(folder: Folder) -> Iterator[str]:
    """Each layer is added once, lower before upper, and the press is set as asked for."""
    press = folder.press
    if press is None:
        yield "press.json is missing"
        return
    order = [layer.index for layer in folder.layers]
    added = [index for step in press["steps"] for index in step["adds"]]
    for index in order:
        if added.count(index) != 1:
            yield f"layer {index} is added {added.count(index)} times"
    lying: set[int] = set()
    for step in press["steps"]:
        yield from _step(folder, step, order, lying)
        lying |= set(step["adds"])
    steps = press["steps"]
    if not steps or steps[-1]["bond"] != "full" or steps[-1]["layers"] != order:
        yield "the last step is not a full bond of the whole laminate"
    if not _is_stated(folder):
        if any(step["minutes"] is not None for step in steps) or press["total_press_minutes"]:
            yield "minutes for a film that nobody stated any for"
        return
    total = sum(step["minutes"] for step in steps)
    if abs(total - press["total_press_minutes"]) > 1e-6:
        yield f"steps take {total:g} min, and the total says otherwise"


def _is_stated(folder: Folder) -> bool:
    """Whether the minutes were stated for every film that bonds, to a tenth of its thickness."""
    stated = folder.wish("press", "minutes_for", ["Stretchlon 200, 0.038 mm"])
    known = [(text.rpartition(",")[0], float(text.split()[-2])) for text in stated]
    bonding = {layer.material for layer in folder.films}
    return all(
        any(
            film["product"] == product and abs(film["thickness"] - thick) <= thick / 10 + 1e-9
            for product, thick in known
        )
        for film in folder.manifest["films"]
        if film["material"] in bonding
    )


def _size(folder: Folder, step: dict[str, Any]) -> Iterator[str]:
    """The laminate of a step is as large as its layers are cut."""
    boxes = [layer.profile.bounds for layer in folder.layers if layer.index in step["layers"]]
    low_x, low_y, high_x, high_y = zip(*boxes, strict=True)
    cut = (max(high_x) - min(low_x), max(high_y) - min(low_y))
    (told,) = [part["size_mm"] for part in step["build_up"] if part["part"] == "laminate"]
    if any(abs(a - b) > 0.02 for a, b in zip(cut, told, strict=True)):
        yield f"step {step['step']}: films of {cut[0]:.3f} x {cut[1]:.3f} mm, told {told}"


def _step(folder: Folder, step: dict[str, Any], order: list[int], lying: set[int]) -> Iterator[str]:
    name = f"step {step['step']}"
    layers, adds = step["layers"], step["adds"]
    if layers != sorted(set(layers)) or not set(layers) <= set(order):
        yield f"{name} does not lay its layers lower before upper"
    elif layers and layers != order[order.index(layers[0]) : order.index(layers[-1]) + 1]:
        yield f"{name} leaves out layers between those it presses"
    if not set(adds) <= set(layers) or set(layers) - set(adds) - lying:
        yield f"{name} presses layers that it does not add and none added"
    wanted = float(folder.wish("press", "temperature_c", 135.0))
    if step["temperature_c"] != wanted:
        yield f"{name} presses at {step['temperature_c']:g} C, not {wanted:g}"
    asked = {float(folder.wish("press", key, usual)) for key, usual in MINUTES.items()}
    yield from _size(folder, step)
    if step["minutes"] is not None and step["minutes"] not in asked:
        yield f"{name} takes {step['minutes']:g} min, which nobody asked for"
    width, length = (float(folder.wish("press", f"platen_{k}", 152.4)) for k in ("width", "length"))
    force = float(folder.wish("press", "pressure_kpa", 110.0)) * width * length / 1000
    if abs(step["force_n"] - force) > 1e-3 * force:
        yield f"{name} presses with {step['force_n']:g} N, not {force:.1f}"
