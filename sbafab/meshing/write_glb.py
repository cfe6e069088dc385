"""Binary glTF 2.0 (GLB), for viewers: metres, y up."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sbafab.meshing.surface import Surface

COLOUR = [0.78, 0.74, 0.65, 1.0]
"""Linear red, green, blue and opacity: the off-white of TPE film."""

FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, INDICES = 34962, 34963
UPRIGHT = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""Quaternion of the quarter turn about x that brings our z to the format's y."""


def write_glb(surface: Surface, path: Path) -> None:
    """Write the surface at true size.

    The stored coordinates are mm; the node scales them to the metres the format asks for.
    """
    import json

    points = surface.points.astype("<f4")
    faces = surface.faces.astype("<u4")
    buffers = [points.tobytes(), faces.tobytes()]
    document = _document(len(buffers[0]), len(buffers[1]))
    document["accessors"] = [
        {
            "bufferView": 0,
            "componentType": FLOAT,
            "count": len(points),
            "type": "VEC3",
            "min": points.min(axis=0).tolist(),
            "max": points.max(axis=0).tolist(),
        },
        {"bufferView": 1, "componentType": UNSIGNED_INT, "count": faces.size, "type": "SCALAR"},
    ]
    text = json.dumps(document, separators=(",", ":")).encode()
    chunks = _chunk(b"JSON", text, b" ") + _chunk(b"BIN\0", b"".join(buffers), b"\0")
    path.write_bytes(b"glTF" + _number(2) + _number(12 + len(chunks)) + chunks)


def _document(points_size: int, faces_size: int) -> dict[str, Any]:
    """The scene of one node; sizes in bytes."""
    return {
        "asset": {"version": "2.0", "generator": "sbafab"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "solid", "mesh": 0, "scale": [1e-3] * 3, "rotation": UPRIGHT}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [
            {
                "name": "TPE",
                "pbrMetallicRoughness": {
                    "baseColorFactor": COLOUR,
                    "metallicFactor": 0.0,
                    "roughnessFactor": 0.55,
                },
            }
        ],
        "buffers": [{"byteLength": points_size + faces_size}],
        "bufferViews": [
            {"buffer": 0, "byteLength": points_size, "target": VERTICES},
            {
                "buffer": 0,
                "byteOffset": points_size,
                "byteLength": faces_size,
                "target": INDICES,
            },
        ],
    }


def _chunk(kind: bytes, data: bytes, filler: bytes) -> bytes:
    data += filler * (-len(data) % 4)
    return _number(len(data)) + kind + data


def _number(value: int) -> bytes:
    return value.to_bytes(4, "little")
