"""Films: their properties, order in lists, and colours in pictures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple

from sbafab.errors import DesignError

Material = str
"""Name of a film in files, sheets and lists: "TPE", "PTFE", or another in capitals."""
FilmKind = Literal["structural", "mask"]
"""A structural film bonds where it touches another; nothing bonds to a mask."""
BondProcess = Literal["press", "laser", "hot-tip", "ultrasonic", "roller"]
"""The process that bonds two faces: the heat press, or the tool of a seam."""
FIRST: tuple[Material, ...] = ("TPE", "PTFE")
"""The films of every design; they come first in lists."""
PTFE_WARNING = (
    "Extract the fumes: hot PTFE gives off toxic COF2 and HF. Cut it with a laser only on a "
    "machine whose owner permits PTFE, or use a drag knife."
)


PAPER_TPE = (10.0, 0.2)
"""Young's modulus in MPa and Poisson's ratio of the paper's model (Sec. 3.2.1)."""
PAPER_PRODUCT, PAPER_THICKNESS = "Stretchlon 200", 0.038
"""The film that the paper bonded, and its thickness in mm (Sec. 2)."""
PAPER_BURST = (367.0, 18.0)
"""Burst pressure of pockets of 5 mm in that film, kPa, and its error (Sec. 4)."""
GAUGE = 0.1
"""Tolerance of a film's thickness, as a share: our estimate for commercial film."""


@dataclass(frozen=True)
class Film:
    """A film as it comes off the roll.

    ``thickness`` is in mm, ``density`` kg/m3 (None if unknown). ``softens_above`` is the bonding
    temperature in C: the melting point of a TPE, None if unknown or if the film ``stays_solid`` in
    the press and bonds to one that melts. ``limit`` is the highest temperature allowed, C.
    ``shade`` counts the films of a kind, for colours; ``warning`` is written into its cut files;
    ``elastic`` are Young's modulus in MPa and Poisson's ratio, None if either is unknown. ``faces``
    are the materials of the upper and the lower face; None if both have the film's name.
    """

    material: Material
    product: str
    thickness: float
    density: float | None
    softens_above: float | None
    limit: float
    kind: FilmKind = "structural"
    shade: int = 0
    warning: str = ""
    elastic: tuple[float, float] | None = None
    stays_solid: bool = False
    faces: tuple[str, str] | None = None

    @property
    def table(self) -> str:
        """The table of a design or kit that defines it: "films.tpe"."""
        return f"films.{self.material.lower()}"

    @property
    def said(self) -> str:
        """The product and thickness as text: "Stretchlon 200, 0.038 mm"."""
        return film_name(self.product, self.thickness)

    @property
    def written(self) -> str:
        """The material for the traveller; a TPE other than the paper's with its product."""
        is_another = self.material == FIRST[0] and self.product != PAPER_PRODUCT
        return f"{self.material} ({self.product})" if is_another else self.material

    def is_a(self, product: str, thickness: float) -> bool:
        """Return True for this product of this thickness in mm, within the films' tolerance."""
        return self.product == product and abs(self.thickness - thickness) <= GAUGE * thickness

    @property
    def is_the_papers(self) -> bool:
        """True for the film of the paper's measured actuators, with its thickness and stiffness."""
        return self.is_a(PAPER_PRODUCT, PAPER_THICKNESS) and self.elastic == PAPER_TPE

    @property
    def melts(self) -> bool:
        """True if it melts completely when a press bonds it; False for masks, films that stay
        solid, and coated films, whose faces are of two materials.
        """
        is_coated = self.faces is not None and self.faces[0] != self.faces[1]
        return not (self.is_mask or self.stays_solid or is_coated)

    @property
    def is_mask(self) -> bool:
        """True if nothing bonds to it."""
        return self.kind == "mask"


def density_of(film: Film, purpose: str = "the mass") -> float:
    """Return a film's density in kg/m3. Raises DesignError with the purpose if it is unknown."""
    if film.density is None:
        raise DesignError(
            f"{purpose} needs the density of {film.material}, {film.product}; add "
            f"{film.table}.density, in kg/m3"
        )
    return film.density


def film_name(product: str, thickness: float) -> str:
    """Return a product and thickness (mm) as text: "Stretchlon 200, 0.038 mm"."""
    return f"{product}, {thickness:g} mm"


def in_order(materials: Iterable[Material]) -> list[Material]:
    """Return every material once: TPE, PTFE, then the others by name."""
    rank = {material: place for place, material in enumerate(FIRST)}
    return sorted(set(materials), key=lambda name: (rank.get(name, len(FIRST)), name))


# Colours of films, the same in every picture and on every page.


class Ink(NamedTuple):
    """Fill and line colour of a film."""

    fill: str
    line: str


# Blue against orange: distinct in every common colour blindness, and in grey by lightness.
# Further films have other hues; masks stay light, and pictures hatch them.
STRUCTURAL = (
    Ink("#a9cfea", "#0b4f86"),
    Ink("#8fd0b5", "#0b6b4b"),
    Ink("#c9b8e6", "#54308f"),
    Ink("#b9c2cc", "#3c4650"),
)
MASKS = (
    Ink("#fbe3bd", "#b35a00"),
    Ink("#f8cfd4", "#a3213a"),
    Ink("#ecebae", "#6f6a00"),
)


def ink(film: Film) -> Ink:
    """Return the colours of a film; the fifth of a kind repeats those of the first."""
    inks = MASKS if film.is_mask else STRUCTURAL
    return inks[film.shade % len(inks)]
