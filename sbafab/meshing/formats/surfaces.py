"""Surfaces as STL, OBJ and PLY in millimetres, and as GLB for viewers; trimesh writes them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sbafab.meshing.surface import Surface

LinearRGB = tuple[float, float, float]
FILM: LinearRGB = (0.78, 0.74, 0.65)
"""Linear red, green and blue: the off-white of TPE film."""
UPRIGHT_METRES = ((1e-3, 0, 0, 0), (0, 0, 1e-3, 0), (0, -1e-3, 0, 0), (0, 0, 0, 1))
"""From mm with z up to metres with y up, as GLB requires."""


class Node(NamedTuple):
    """One body of a scene; ``colour`` is linear, not sRGB."""

    name: str
    surface: Surface
    material: str
    colour: LinearRGB


def write_stl(surface: Surface, path: Path, _material: str = "") -> None:
    """Write binary STL in mm; the format cannot store a unit or a material."""
    path.write_bytes(surface.trimesh().export(file_type="stl"))


def write_obj(surface: Surface, path: Path) -> None:
    """Write OBJ in mm."""
    text = surface.trimesh().export(file_type="obj", header="mm", digits=9)
    path.write_text(text, encoding="ascii", newline="\n")


def write_ply(surface: Surface, path: Path) -> None:
    """Write binary PLY in mm, in single precision."""
    path.write_bytes(surface.trimesh().export(file_type="ply"))


def write_glb(surface: Surface, path: Path, material: str = "TPE") -> None:
    """Write GLB at true size, as a scene of one node."""
    write_scene([Node("solid", surface, material, FILM)], path)


def write_scene(nodes: Sequence[Node], path: Path) -> None:
    """Write GLB at true size, one node per body: coordinates in mm, scaled by the node."""
    from trimesh import Scene
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    scene = Scene()
    for node in nodes:
        body = node.surface.trimesh()
        material = PBRMaterial(
            name=node.material,
            baseColorFactor=[round(255 * part) for part in (*node.colour, 1.0)],
            metallicFactor=0.0,
            roughnessFactor=0.55,
        )
        body.visual = TextureVisuals(material=material)
        scene.add_geometry(body, node.name, node.name, transform=np.array(UPRIGHT_METRES))
    path.write_bytes(scene.export(file_type="glb", include_normals=False))
