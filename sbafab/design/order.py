"""How many are made: of actuators, for so many good ones, and of parts, with spares."""

from __future__ import annotations

import math

from pydantic import Field, ValidationInfo, field_validator

from sbafab.design.section import Section

MOST = 1000
"""Actuators of one order."""
ROUNDING = 1e-9


class Order(Section):
    """How many, for whom, and how long a working day is."""

    copies: int = Field(default=1, ge=1, le=MOST)
    """How many of the actuator are made; more where order.good takes more."""
    success_rate: float = Field(default=0.9, gt=0, le=1)
    """Share of builds that come out good (paper Sec. 4: under 10 % failed). Take your lab's own
    from "sbafab record --report" once it has one."""
    certainty: float = Field(default=0.8, gt=0, lt=1)
    """With what probability at least order.good come out good (ours): 20 good ones at 0.9 take 23
    with 0.81, 24 with 0.91, 25 with 0.97."""
    good: int | None = Field(default=None, ge=1, le=MOST)
    """How many must come out good. As many more are made as order.success_rate and order.certainty
    ask for; none asked for by default."""
    spare_share: float = Field(default=0.05, ge=0, le=2)
    """Spare parts as a share of the number that the actuators take of each pattern, rounded up
    (ours). A part that is lost or torn at the press else costs a trip to the laser."""
    spares: int = Field(default=1, ge=0, le=100)
    """The fewest spares of a pattern, films and masks alike; 0, with spare_share = 0, cuts none."""
    shift_hours: float = Field(default=8.0, ge=1, le=24)
    """A working day of one person at one press: no press cycle takes more copies than fit in it."""
    made_for: str = Field(default="", max_length=120)
    """Printed on the traveller."""
    note: str = Field(default="", max_length=400)
    """Printed on the traveller."""

    @field_validator("good")
    @classmethod
    def _copies_suffice(cls, good: int | None, info: ValidationInfo) -> int | None:
        rate, certainty = info.data.get("success_rate"), info.data.get("certainty")
        if good is None or rate is None or certainty is None:
            return good
        needed = builds_for(good, rate, certainty)
        odds = f"at success_rate = {rate:g} and certainty = {certainty:g}"
        if needed is None:
            raise ValueError(
                f"{odds} takes more than {MOST} builds; lower good or certainty, or split the order"
            )
        if 1 < info.data.get("copies", 1) < needed:
            raise ValueError(
                f"{odds} takes {needed}, and order.copies = {info.data['copies']}; leave copies or "
                "good out, or lower certainty"
            )
        return good

    @property
    def quantity(self) -> int:
        """Number of actuators that are made."""
        if self.good is None:
            return self.copies
        needed = builds_for(self.good, self.success_rate, self.certainty)
        return max(self.copies, needed or MOST)

    @property
    def why(self) -> str:
        """Sentence on what the number that is made is good for; empty where none was asked for."""
        if self.good is None:
            return ""
        likely = probability_of(self.good, self.quantity, self.success_rate)
        return (
            f"{self.quantity} are made for {self.good} good ones: if {self.success_rate:.0%} of "
            "builds come out good, each whatever the others do, at least "
            f"{self.good} of {self.quantity} do with a probability of {likely:.0%} (binomial)."
        )

    def spare_parts(self, needed: int) -> int:
        """Number of spares of a pattern of which the actuators take ``needed`` parts."""
        return max(self.spares, math.ceil(self.spare_share * needed - ROUNDING)) if needed else 0


def probability_of(good: int, builds: int, rate: float) -> float:
    """Probability that at least ``good`` of ``builds`` succeed, each with probability ``rate``.

    The upper tail of the binomial distribution, summed over the number of failures. Builds are
    taken as independent of each other, which those of one press cycle are not wholly.
    """
    return math.fsum(
        math.comb(builds, failed) * rate ** (builds - failed) * (1 - rate) ** failed
        for failed in range(builds - good + 1)
    )


def builds_for(good: int, rate: float, certainty: float) -> int | None:
    """Least number of builds of which ``good`` succeed with this certainty; None beyond MOST."""
    low, high = good, MOST
    if probability_of(good, high, rate) < certainty:
        return None
    # The probability grows with the number of builds.
    while low < high:
        middle = (low + high) // 2
        if probability_of(good, middle, rate) >= certainty:
            high = middle
        else:
            low = middle + 1
    return low
