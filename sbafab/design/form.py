"""The form of an actuator: what a family says of a design to all who do not know the family."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Discs:
    """Round pockets on one axis a stack: their diameters in mm, one a balloon, bottom to top."""

    diameters: tuple[float, ...]


@dataclass(frozen=True)
class Slots:
    """Oblong pockets, alike in every balloon: half discs of ``width`` joined by a straight ``run``,
    both in mm.
    """

    width: float
    run: float


@dataclass(frozen=True)
class Drawn:
    """Pockets of an outline that the user drew."""


Pockets = Discs | Slots | Drawn


@dataclass(frozen=True)
class Wrap:
    """A laminate that is wrapped round a tube: its outer diameter, and the pitch of the stacks
    round it, both in mm; ``glue`` is the adhesive that holds it there, and ``overlap`` by how much
    (mm) one end of the sheet lies over the other.
    """

    tube_diameter: float
    pitch: float
    glue: str
    overlap: float = 0.0


@dataclass(frozen=True)
class Form:
    """What an actuator is like, whichever family made it.

    ``words`` is what a technician calls it; ``stacks`` of balloons stand side by side, all with the
    same ``pockets``; ``lumen`` is the diameter in mm of the channel through all layers,
    ``lumen_pin`` its dowel pin's.
    """

    words: str
    stacks: int
    pockets: Pockets
    lumen: float | None = None
    lumen_pin: float | None = None
    wrap: Wrap | None = None

    @property
    def is_parallel(self) -> bool:
        """Whether stacks on common plates push one way: unlike strokes then bend the actuator."""
        return self.stacks > 1 and self.wrap is None

    @property
    def pushing(self) -> int:
        """Stacks that push one way: all on common plates, one alone of those round a tube."""
        return self.stacks if self.wrap is None else 1


@dataclass(frozen=True)
class Free:
    """A key that a search may change: from ``low`` to ``high`` in steps.

    ``asked``: only where a requirement names this quantity; else it stays as it is. ``widens``: the
    ends are where a search begins to look, and may move.
    """

    key: str
    low: float
    high: float
    step: float
    asked: str = ""
    widens: bool = False


def degrees_of_freedom(stacks: int) -> str:
    """Words for round stacks on common plates: one lengthens (1-DoF), three also bend (3-DoF)."""
    said = {1: " (1-DoF)", 3: " (3-DoF)"}.get(stacks, "")
    return f"stacked balloon actuator with {stacks} chamber{'s' if stacks > 1 else ''}{said}"
