"""Pins, the holes of the plate they stand in, and the films that hang on them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from shapely import Point, Polygon

from tests.judge.folder import Folder, Hole, Layer, pieces, place

FITS = 0.004
"""mm in radius or place by which a layer's hole may differ from its pin and still hold it."""


class Pin(NamedTuple):
    """A pin of the schedule, standing in a hole of the plate."""

    name: str
    hole: Hole


def judge_pins(folder: Folder) -> Iterator[str]:
    """Each pin finds its hole in the plate and in films, and each film the pins it needs."""
    if folder.press is None:
        return
    pins, said = _pins(folder)
    yield from said
    held: dict[str, int] = dict.fromkeys(pins, 0)
    holding: dict[int, list[Pin]] = {layer.index: [] for layer in folder.layers}
    known: dict[tuple[str, int], str] = {}
    by_index = {layer.index: layer for layer in folder.layers}
    for step in folder.press["steps"]:
        for name in step["pins"]:
            pin = pins.get(name)
            if pin is None:
                yield f"step {step['step']} names pin {name}, of no hole"
                continue
            for index in step["layers"]:
                key = (name, by_index[index].shape)
                known.setdefault(key, _meets(folder, pin, by_index[index]))
                if known[key] == "film":
                    yield f"in step {step['step']} pin {name} stands in layer {index}"
                if known[key] == "held" and index in step["adds"]:
                    held[name] += 1
                    holding[index].append(pin)
    for name, count in held.items():
        if not count:
            yield f"the plate has a hole for pin {name}, which holds no layer in any step"
    yield from _unheld(folder, holding)


def _pins(folder: Folder) -> tuple[dict[str, Pin], list[str]]:
    """The pins by name, each in its hole of the plate, and holes or pins that have no partner."""
    said = []
    pins = {}
    left = list(folder.holes)
    for entry in folder.manifest["registration"]["pins"]:
        x, y, diameter = entry["x"], entry["y"], entry["diameter"]
        hole = next(
            (
                hole
                for hole in left
                if math.dist((x, y), hole[:2]) < FITS and abs(hole.radius - diameter / 2) < FITS
            ),
            None,
        )
        if hole is None:
            said.append(f"the plate has no hole for pin {entry['name']}")
            continue
        left.remove(hole)
        pins[entry["name"]] = Pin(entry["name"], hole)
    said += _at_other_places(folder, pins.values(), left)
    said += [f"the plate has a hole for no pin at x {h.x:.3f}, y {h.y:.3f}" for h in left]
    return pins, said


def _at_other_places(folder: Folder, pins: Iterable[Pin], left: list[Hole]) -> Iterator[str]:
    """Takes the same holes at the further places of a press cycle from those that are left."""
    batch = folder.manifest.get("batch")
    if batch is None:
        return
    if (
        len(batch["places"]) != batch["at_once"]
        or sum(batch["cycles"]) != folder.manifest["copies"]
    ):
        yield f"places and cycles do not make all copies: {batch}"
    for spot in batch["places"][1:]:
        for pin in pins:
            at = pin.hole.x + spot["x"], pin.hole.y + spot["y"]
            found = next((hole for hole in left if math.dist(at, hole[:2]) < FITS), None)
            if found is None or abs(found.radius - pin.hole.radius) > FITS:
                yield f"place {spot} has no hole for pin {pin.name}"
            else:
                left.remove(found)


def _meets(folder: Folder, pin: Pin, layer: Layer) -> str:
    """How a pin meets a layer: "held" by its hole, "film" where it runs into it, or "free"."""
    x, y, radius = pin.hole
    slack = max(FITS, folder.chord_error + FITS)
    if Point(x, y).buffer(radius - slack).intersects(layer.profile):
        return "film"
    for part in pieces(layer.profile):
        for ring in part.interiors:
            hole = Polygon(ring)
            centre = hole.centroid
            if math.hypot(centre.x - x, centre.y - y) > slack:
                continue
            wider = math.sqrt(hole.area / math.pi) - radius
            if -slack <= wider <= slack + play(folder):
                return "held"
    return "free"


def play(folder: Folder) -> float:
    """By how much a bore's radius may exceed its pin's, as asked for."""
    return float(folder.wish("bore", "clearance", 0.04)) / 2


def _unheld(folder: Folder, holding: dict[int, list[Pin]]) -> Iterator[str]:
    """Pieces of layers that lie on fewer pins than their registration method promises."""
    known = set()
    for layer in folder.layers:
        wanted = promised(folder, layer)
        if not wanted or (layer.shape, len(holding[layer.index])) in known:
            continue
        known.add((layer.shape, len(holding[layer.index])))
        for part in pieces(layer.profile):
            filled = Polygon(part.exterior)
            on = sum(filled.contains(Point(*pin.hole[:2])) for pin in holding[layer.index])
            if on < wanted:
                yield (
                    f"{on} pins hold a piece of layer {layer.index} ({layer.role}), at "
                    f"{place(part)}, where {wanted} should"
                )


def promised(folder: Folder, layer: Layer) -> int:
    """How many pins hold each piece of a layer in the step that adds it (docs/registration.md)."""
    balloons = max((other.balloon or 1) for other in folder.layers)
    if folder.method == "ears":
        if layer.role != "chamber-mask":
            return 2
        return 2 if layer.balloon == 1 else 1
    if balloons == 1 or layer.role in ("base", "cap", "sheet"):
        return 0
    if layer.role == "separator-mask":
        return 1 if folder.asked["family"] == "lobed" else 0
    return 1
