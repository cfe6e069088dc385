"""Stroke and volume of a stack of balloons, by each model that knows its pockets.

Balloons of unlike size (a tapered stack) are taken at equal height over radius, so that one
formula holds for all: strokes add up with l, volumes with l^3. Volumes are the mean of a chamber's
balloons. Held at a height they all carry one force, and are then at unlike heights over radius.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sbafab.models import lens, parabola, printed
from sbafab.models.figures import Model
from sbafab.models.numeric import within
from sbafab.models.paper import FULL_SHARE, VALID, VALID_RADIUS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Law = Callable[[NDArray[np.float64]], NDArray[np.float64]]


SAMPLES = 401


@dataclass(frozen=True)
class Kinematics:
    """One stack by one model: limits, and ``_stroke``, ``_volume`` and ``_rate`` within them.

    ``_push`` is given for balloons of unlike size.
    """

    model: Model
    largest_volume: float
    largest_stroke: float
    _stroke: Law
    _volume: Law
    _rate: Law
    _push: Law | None = None

    def stroke(self, volume: ArrayLike) -> NDArray[np.float64]:
        """Stroke of the stack in mm at ul a balloon. Raises DesignError out of range."""
        wanted = within(volume, self.largest_volume, "volume", "ul a balloon", self.model.name)
        return self._stroke(wanted)

    def volume(self, stroke: ArrayLike) -> NDArray[np.float64]:
        """Volume in ul a balloon at a stroke of the stack. Raises DesignError out of range."""
        return self._volume(self._within(stroke))

    def rate(self, stroke: ArrayLike) -> NDArray[np.float64]:
        """dv/dh of the stack in mm2: the chamber's whole volume by the stack's stroke."""
        return self._rate(self._within(stroke))

    def push(self, stroke: ArrayLike) -> NDArray[np.float64]:
        """Force over pressure in mm2 of the stack held at a stroke: that of every balloon in it.

        Of a tapered stack at most what its weakest balloon has when flat; what solid films of shut
        balloons may carry beyond is not counted.
        """
        return (self._push or self._rate)(self._within(stroke))

    def _within(self, stroke: ArrayLike) -> NDArray[np.float64]:
        return within(stroke, self.largest_stroke, "stroke of the stack", "mm", self.model.name)


def round_stack(radii: Sequence[float]) -> tuple[Kinematics, Kinematics]:
    """Eq. 4 and Eqs. 1 to 3 for balloons with these pocket radii (mm)."""
    first, third = sum(radii), sum(radius**3 for radius in radii)
    scale = third / len(radii)

    def scaled(model: Model, stroke: Law, volume: Law, rate: Law, most: float) -> Kinematics:
        return Kinematics(
            model,
            float(volume(np.asarray(most))) * scale,
            most * first,
            lambda v: stroke(v / scale) * first,
            lambda h: volume(h / first) * scale,
            lambda h: rate(h / first) * third / first,
            _in_series(radii, rate, most) if len(set(radii)) > 1 else None,
        )

    by_eq_4 = scaled(
        Model(printed.MODEL, "Sec. 3.1, h the stroke of one balloon", _eq_4_trust(max(radii))),
        lambda v: printed.stroke(v, 1.0),
        lambda h: printed.volume(h, 1.0),
        lambda h: printed.rate(h, 1.0),
        printed.largest_stroke(1.0),
    )
    by_eqs_1_to_3 = scaled(
        Model(
            parabola.MODEL,
            "Sec. 3.1, solved for two halves",
            "geometric regime only: films that do not stretch, wrinkle or have a neck ring; "
            "3/4 of Eq. 4's volume and force at small strokes",
        ),
        lambda v: parabola.balloon_stroke(v, 1.0),
        lambda h: parabola.balloon_volume(h, 1.0),
        lambda h: parabola.balloon_rate(h, 1.0),
        2 * parabola.fullest(1.0).height,
    )
    return by_eq_4, by_eqs_1_to_3


def _in_series(radii: Sequence[float], rate: Law, most: float) -> Law:
    """Force over pressure by stroke of unlike balloons that carry the same force.

    ``rate`` is dv/dh of a balloon of radius 1 up to the stroke ``most``.
    """
    share = np.linspace(0.0, most, SAMPLES)
    # Past its full state a formula may rise again; a balloon does not.
    falling = np.minimum.accumulate(rate(share))
    force = np.linspace(0.0, min(radii) ** 2 * falling[0], SAMPLES)
    stroke = sum(r * np.interp(force / r**2, falling[::-1], share[::-1]) for r in radii)
    by_stroke = np.asarray(stroke)[::-1]
    return lambda h: np.asarray(np.interp(h, by_stroke, force[::-1]))


def slot_stack(width: float, run: float, balloons: int) -> tuple[Kinematics]:
    """The lens of two arcs for oblong pockets of a width and straight run (mm)."""
    most = lens.fullest(width, run)
    model = Model(
        lens.MODEL,
        "films of constant length, ends as spherical caps",
        "geometric regime only; the paper measured no oblong balloon but the inflated diameter",
    )
    return (
        Kinematics(
            model,
            most.volume,
            most.stroke * balloons,
            lambda v: lens.stroke(v, width, run) * balloons,
            lambda h: lens.volume(h / balloons, width, run),
            lambda h: lens.rate(h / balloons, width, run),
        ),
    )


def full_stroke(radii: Sequence[float]) -> float:
    """What the paper's balloons reach, mm of a stack: 17.5 mm for 15 of radius 2.5 (Sec. 4.6)."""
    return FULL_SHARE * sum(radii)


def _eq_4_trust(radius: float) -> str:
    scale = (radius / VALID_RADIUS) ** 3
    limits = [
        f"within {error.value * radius / VALID_RADIUS:.2g} mm a balloon to "
        f"{volume * scale:.3g} ul in {fluid}"
        for fluid, volume, error in VALID
    ]
    said = "" if radius == VALID_RADIUS else f", scaled from d = {2 * VALID_RADIUS:g}"
    if radius == 2.5:
        said += "; the regime ends near 0.95 kPa"
    return f"geometric regime only: {', '.join(limits)} (measured{said})"
