"""What several rules ask of one laminate under one set of limits, each worked out once."""

from __future__ import annotations

from functools import cached_property

from sbafab.laminate.laminate import Laminate
from sbafab.rules.facing import Facing, facing_films
from sbafab.rules.forms import Form, linear_forms
from sbafab.rules.freedoms import Freedoms, freedoms
from sbafab.rules.limits import Limits
from sbafab.rules.margins import InterfaceMargins, interface_margins


class Measures:
    """Measured when first asked for; the deck passes one to all rules that share them."""

    def __init__(self, laminate: Laminate, limits: Limits) -> None:
        self.laminate = laminate
        self.limits = limits

    @cached_property
    def facing(self) -> tuple[Facing, ...]:
        """The films that face each other past others."""
        return facing_films(self.laminate)

    @cached_property
    def moves(self) -> Freedoms:
        """What every piece of every layer can do."""
        return freedoms(self.laminate, self.limits.tolerances)

    @cached_property
    def margins(self) -> list[InterfaceMargins]:
        """The narrow places of every interface."""
        return interface_margins(self.laminate, self.facing, self.limits, self.moves)

    @cached_property
    def forms(self) -> list[tuple[Form, ...]]:
        """The same as linear forms."""
        return [linear_forms(own.margins, own.first, self.moves) for own in self.margins]
