"""Whether a change of a file changes nothing that is cut, pressed or read, by other readers.

Drawings are told by all that ezdxf finds in entities, layers and custom properties, texts by their
parsed trees, pictures by their pixels, meshes by trimesh. Nothing here is the program's own.
"""

from __future__ import annotations

import csv
import io
import json
import tomllib
from collections.abc import Callable
from html.parser import HTMLParser
from typing import Any
from xml.etree import ElementTree

import ezdxf
import numpy as np
import trimesh
from ezdxf.math import Vec3
from PIL import Image

UNSEEN = ("handle", "owner", "lineweight", "plotstyle_handle", "material_handle", "plotstyle_name")
"""Attributes of entities and layers that say nothing of where or whether anything is cut."""
NEAR = {".dxf": 1e-3, ".svg": 1e-3, ".json": 2e-6, ".glb": 3e-5, ".stl": 3e-5, ".3mf": 3e-5}
"""mm within which a number says the same."""


def changes_nothing(name: str, before: bytes, after: bytes) -> bool:
    """Whether both contents of a file of this name say the same."""
    kind = "." + name.rsplit(".", 1)[-1]
    try:
        told = _told(kind, after)
    except Exception:
        # Whatever a reader raises: a file it cannot read says something else.
        return False
    return _same(_told(kind, before), told, NEAR.get(kind, 0.0))


def _told(kind: str, data: bytes) -> Any:
    readers: dict[str, Callable[[bytes], Any]] = {
        ".dxf": lambda data: _drawing(data.decode()),
        ".json": json.loads,
        ".toml": lambda data: tomllib.loads(data.decode()),
        ".csv": lambda data: list(csv.reader(io.StringIO(data.decode()))),
        **dict.fromkeys((".svg", ".lbrn2"), lambda data: _tree(ElementTree.fromstring(data))),
        ".html": _page,
        ".png": _picture,
    }
    return readers[kind](data) if kind in readers else _mesh(kind, data)


def _page(data: bytes) -> list[Any]:
    page = _Page()
    page.feed(data.decode())
    return page.told


def _picture(data: bytes) -> list[Any]:
    image = Image.open(io.BytesIO(data))
    return [image.size, image.convert("RGBA").tobytes()]


def _mesh(kind: str, data: bytes) -> list[Any]:
    mesh = trimesh.load_scene(io.BytesIO(data), file_type=kind[1:]).to_mesh()
    triangles = np.round(mesh.triangles.reshape(-1, 9), 4).tolist()
    return [sorted(map(tuple, triangles)), [float(mesh.volume)]]


def _drawing(text: str) -> Any:
    document = ezdxf.read(io.StringIO(text))
    entities = [[entity.dxftype(), *_attributes(entity)] for entity in document.modelspace()]
    for _, own, _ in entities:
        # A colour of an entity's own that is its layer's draws it as without.
        if own.get("color") == document.layers.get(own["layer"]).dxf.color:
            del own["color"]
    # Which of one layer's entities is cut first changes no part.
    entities.sort(key=lambda entity: (entity[1]["layer"], repr(entity)))
    used = {entity.dxf.layer for entity in document.modelspace()}
    layers = {
        layer.dxf.name: _attributes(layer) for layer in document.layers if layer.dxf.name in used
    }
    header = [document.header.get(key) for key in ("$INSUNITS", "$MEASUREMENT")]
    return [entities, layers, header, [*document.header.custom_vars.properties]]


def _attributes(entity: Any) -> list[Any]:
    own = {key: value for key, value in entity.dxfattribs().items() if key not in UNSEEN}
    rows = [list(row) for row in getattr(entity, "lwpoints", ())]
    plain = {k: list(v.xyz) if isinstance(v, Vec3) else v for k, v in own.items()}
    return [plain, rows]


def _tree(node: ElementTree.Element) -> Any:
    words = [(node.text or "").split(), (node.tail or "").split()]
    return [node.tag, {k: _words(v) for k, v in node.attrib.items()}, words, [*map(_tree, node)]]


def _words(text: str) -> list[Any]:
    for mark in "MLAZCHV,()":
        text = text.replace(mark, f" {mark} ")
    return [_number(word) for word in text.split()]


def _number(word: str) -> Any:
    try:
        return float(word)
    except ValueError:
        return word


class _Page(HTMLParser):
    """Tags with their attributes, and words, in order."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[Any] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.told.append([tag, [[name, value] for name, value in attrs]])

    def handle_endtag(self, tag: str) -> None:
        self.told.append(tag)

    def handle_data(self, data: str) -> None:
        self.told += data.split()

    def handle_decl(self, decl: str) -> None:
        self.told.append(decl)


def _same(one: Any, other: Any, near: float) -> bool:
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_same(one[k], other[k], near) for k in one)
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        pairs = zip(one, other, strict=False)
        return len(one) == len(other) and all(_same(a, b, near) for a, b in pairs)
    if isinstance(one, int | float) and isinstance(other, int | float):
        return abs(one - other) <= near
    return type(one) is type(other) and bool(one == other)
