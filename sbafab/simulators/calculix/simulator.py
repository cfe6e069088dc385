"""CalculiX as one of the simulators."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.conforming.layup import MeshSettings, Symmetry, images
from sbafab.process import Progress
from sbafab.simulators.calculix.deck import DeckSettings, Procedure, deck_settings, write_deck
from sbafab.simulators.calculix.run import deck_mesh, simulate
from sbafab.simulators.simulator import Result, Wish

USES = ("h", "symmetry", "procedure")


def why_not(laminate: Laminate) -> str | None:
    """Every laminate can be meshed."""
    return None


def export(laminate: Laminate, wish: Wish, folder: Path) -> None:
    """The deck, and the mesh that it includes."""
    mesh, settings = _settings(laminate, wish)
    write_deck(deck_mesh(laminate, mesh), settings, folder)


def run(laminate: Laminate, wish: Wish, folder: Path, tell: Progress) -> Result:
    """Deck, results, table and pictures."""
    mesh, settings = _settings(laminate, wish)
    found = simulate(laminate, mesh, settings, folder, 60 * wish.minutes, tell)
    last = found.states[-1]
    rows = [(name, value, "kPa") for name, value in last.pressures.items()]
    rows += [("stroke", last.stroke, "mm")]
    rows += [("tilt", last.tilt, "degrees")] if last.tilt is not None else []
    rows += [(f"air in {name}", value, "ul") for name, value in last.volumes.items()]
    rows += [("von Mises stress, at most", last.stress, "MPa")]
    figures = {"states": [state.as_dict() for state in found.states]}
    return Result(tuple(rows), figures, found.stopped)


def _settings(laminate: Laminate, wish: Wish) -> tuple[MeshSettings, DeckSettings]:
    usual = MeshSettings()
    mesh = MeshSettings(
        h=usual.h if wish.h is None else wish.h,
        symmetry=cast(Symmetry, wish.symmetry or usual.symmetry),
        wrapped=False,
    )
    settings = deck_settings(laminate, wish, cast(Procedure, wish.procedure or "dynamic"))
    for name, meshed in images(laminate, mesh.symmetry).items():
        if settings.pressures[name] != settings.pressures[meshed]:
            raise DesignError(
                f"symmetry {mesh.symmetry} computes {meshed} in place of {name}: give both one "
                "pressure, or take symmetry full"
            )
    return mesh, settings
