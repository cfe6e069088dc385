"""Binary glTF 2.0 (GLB), for viewers: metres, y up."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from sbafab.meshing.surface import Surface

LinearRGB = tuple[float, float, float]
FILM: LinearRGB = (0.78, 0.74, 0.65)
"""Linear red, green and blue: the off-white of TPE film."""

FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, INDICES = 34962, 34963
UPRIGHT = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""Quaternion of the quarter turn about x that brings our z to the format's y."""


class Node(NamedTuple):
    """One body of a scene; ``colour`` is linear, not as screens have it."""

    name: str
    surface: Surface
    material: str
    colour: LinearRGB


def write_glb(surface: Surface, path: Path, material: str = "TPE") -> None:
    """Write the surface at true size, as a scene of one node."""
    write_scene([Node("solid", surface, material, FILM)], path)


def write_scene(nodes: Sequence[Node], path: Path) -> None:
    """Write a scene at true size, a node for each body.

    The stored coordinates are mm; the nodes scale them to the metres the format asks for.
    """
    import json

    buffers: list[bytes] = []
    accessors: list[dict[str, Any]] = []
    for node in nodes:
        points = node.surface.points.astype("<f4")
        faces = node.surface.faces.astype("<u4")
        accessors += [
            {
                "bufferView": len(buffers),
                "componentType": FLOAT,
                "count": len(points),
                "type": "VEC3",
                "min": points.min(axis=0).tolist(),
                "max": points.max(axis=0).tolist(),
            },
            {
                "bufferView": len(buffers) + 1,
                "componentType": UNSIGNED_INT,
                "count": faces.size,
                "type": "SCALAR",
            },
        ]
        buffers += [points.tobytes(), faces.tobytes()]
    document = {**_document(nodes, [len(data) for data in buffers]), "accessors": accessors}
    text = json.dumps(document, separators=(",", ":")).encode()
    chunks = _chunk(b"JSON", text, b" ") + _chunk(b"BIN\0", b"".join(buffers), b"\0")
    path.write_bytes(b"glTF" + _number(2) + _number(12 + len(chunks)) + chunks)


def _document(nodes: Sequence[Node], sizes: Sequence[int]) -> dict[str, Any]:
    """The scene of the nodes; for each of them the bytes of its points, then of its faces."""
    numbers = range(len(nodes))
    return {
        "asset": {"version": "2.0", "generator": "sbafab"},
        "scene": 0,
        "scenes": [{"nodes": [*numbers]}],
        "nodes": [
            {"name": node.name, "mesh": number, "scale": [1e-3] * 3, "rotation": UPRIGHT}
            for number, node in enumerate(nodes)
        ],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 2 * number},
                        "indices": 2 * number + 1,
                        "material": number,
                    }
                ]
            }
            for number in numbers
        ],
        "materials": [
            {
                "name": node.material,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*node.colour, 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": 0.55,
                },
            }
            for node in nodes
        ],
        "buffers": [{"byteLength": sum(sizes)}],
        "bufferViews": [_view(number, sizes) for number in range(len(sizes))],
    }


def _view(number: int, sizes: Sequence[int]) -> dict[str, int]:
    start = sum(sizes[:number])
    return {
        "buffer": 0,
        **({"byteOffset": start} if start else {}),
        "byteLength": sizes[number],
        "target": INDICES if number % 2 else VERTICES,
    }


def _chunk(kind: bytes, data: bytes, filler: bytes) -> bytes:
    data += filler * (-len(data) % 4)
    return _number(len(data)) + kind + data


def _number(value: int) -> bytes:
    return value.to_bytes(4, "little")
