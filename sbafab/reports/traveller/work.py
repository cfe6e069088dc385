"""A build with its sheets, as the pages for the bench show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from sbafab.cutting.fixture import PATH as FIXTURE
from sbafab.cutting.sheets import SheetFile
from sbafab.folders.build import Build
from sbafab.laminate.films import Film
from sbafab.reports.prints import NAME as UNDERLAY
from sbafab.reports.prints import guides


@dataclass(frozen=True, eq=False)
class Work(Build):
    """A build with the ``sheets`` for all copies.

    ``folder`` is the path from the page to the design's files, ``solid_png`` the bytes of the
    solid's picture.
    """

    sheets: Sequence[SheetFile] = ()
    folder: str = ""
    solid_png: bytes | None = None

    @property
    def copies(self) -> int:
        """Number of actuators to make."""
        return self.design.order.quantity

    @cached_property
    def films(self) -> list[Film]:
        """Every film once, in the order of the layers."""
        return list(dict.fromkeys(layer.film for layer in self.laminate.layers))

    @property
    def fixture(self) -> str | None:
        """The path of the base plate's cut file; None if no pins are used."""
        return f"{self.folder}{FIXTURE}" if self.laminate.pins else None

    @cached_property
    def underlay(self) -> str | None:
        """The path of the page to lay up on; None if pins hold every part in every step."""
        return f"{self.folder}{UNDERLAY}" if guides(self.laminate) else None
