"""The deformed mesh for ParaView, with what the run found at its nodes."""

from __future__ import annotations

from pathlib import Path

from sbafab.meshing.conforming.model import Mesh
from sbafab.meshing.conforming.write_vtu import write_fields
from sbafab.simulators.calculix.frd import Frame


def write_deformed(mesh: Mesh, frame: Frame, path: Path) -> None:
    """Write the deformed shape: ``displacement`` in mm, ``stress`` and ``von_mises`` in MPa.

    To see the undeformed one, warp by the displacement with a factor of -1.
    """
    # VTK's order of a symmetric tensor is that of CalculiX.
    found = {
        "displacement": frame.displacement,
        "von_mises": frame.von_mises,
        "stress": frame.stress,
    }
    write_fields(path, mesh.kind, mesh.points + frame.displacement, mesh.cells, found, {})
