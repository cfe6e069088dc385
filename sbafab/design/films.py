"""The films of a design, their sheets, and the film of each layer.

Lengths are mm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from sbafab.design.toml_table import DATE_PATTERN, FACE_PATTERN, NamedTables, Section
from sbafab.design.units import (
    CELSIUS,
    DENSITIES,
    MEGAPASCALS,
    SHORTEST,
    Length,
    LengthOrZero,
    Millimetres,
    millimetres,
)
from sbafab.geometry.offset import Kerf
from sbafab.laminate.films import (
    PAPER_PRODUCT,
    PAPER_THICKNESS,
    PAPER_TPE,
    PTFE_WARNING,
    BondProcess,
    Film,
    FilmKind,
    Material,
)

UNCALIBRATED: Literal["uncalibrated"] = "uncalibrated"
FILM_NAME = r"[a-z][a-z0-9]{0,15}"
HOTTEST = 400.0
"""Highest temperature of any film, C."""
Density = Annotated[float, Field(gt=0, le=20000), DENSITIES]
FilmTemperature = Annotated[float, Field(gt=0, le=HOTTEST), CELSIUS]
Modulus = Annotated[float, Field(gt=0, le=1e6), MEGAPASCALS]


def _poisson(value: object) -> object:
    if isinstance(value, int | float) and value >= 0.5:
        raise ValueError("must be less than 0.5; for incompressible rubber, write 0.49")
    return value


PoissonRatio = Annotated[float, Field(ge=0, lt=0.5), BeforeValidator(_poisson)]


def is_kerf(x: float, y: float) -> bool:
    """Return True for a possible beam width: up to 1 mm, with an aspect ratio up to ten."""
    return min(x, y) >= 0 and max(x, y) <= min(1.0, 10 * min(x, y)) and math.isfinite(x + y)


def _kerf(value: object) -> Kerf | str:
    if value == UNCALIBRATED:
        return UNCALIBRATED
    pair = list(value) if isinstance(value, list | tuple) else [value, value]
    try:
        x, y = map(millimetres, pair)
    except ValueError:
        x = y = -1.0
    if not is_kerf(x, y):
        raise ValueError(
            "must be a length from 0 to 1 mm, or two, [along x, along y], with a ratio of at "
            'most ten, or "uncalibrated"'
        )
    return x if x == y else (x, y)


KerfWidth = Annotated[
    LengthOrZero | tuple[LengthOrZero, LengthOrZero] | Literal["uncalibrated"],
    BeforeValidator(_kerf),
]
"""Full width of the cut, or [along x, along y]."""

SheetPin = Annotated[tuple[LengthOrZero, LengthOrZero, Length], Field(strict=False)]


class Sheet(Section):
    """A film sheet to cut, as placed on the machine."""

    width: Annotated[float, Millimetres(SHORTEST, 10000)] = 152.4
    """Size along x; the heated area of the paper's press."""
    length: Annotated[float, Millimetres(SHORTEST, 10000)] = 152.4
    """Size along y; of a roll, the most that is unrolled for one sheet."""
    roll: bool = False
    """True if it comes off a roll: a sheet then ends where its parts do."""
    border: LengthOrZero = 10.0
    """Margin along every edge of the sheet."""
    spacing: Annotated[float, Millimetres(SHORTEST, 100)] = 1.0
    """Least distance between two parts' cuts, and to pins."""
    pins: tuple[SheetPin, ...] = Field(default=(), max_length=100, strict=False)
    """Pins that hold the sheet down: x, y from its lower left corner, and diameter."""
    most: int = Field(default=20, ge=1, le=1000)
    """Sheets that may be used."""
    lead_in: Annotated[float, Millimetres(0.01, 20)] | None = None
    """Length of the straight line in the waste by which the beam comes to each contour, in machine
    files; by default none."""
    overcut: Annotated[float, Millimetres(0.01, 20)] | None = None
    """Distance for which the beam follows a contour past its start, in machine files; by default
    0."""
    tab_width: Annotated[float, Millimetres(0.01, 20)] | None = None
    """Width of the tabs of film that hold an outline in the skeleton, in machine files; by default
    there are none. The remainder of a tab stays on the part."""
    tabs: int | None = Field(default=None, ge=1, le=50)
    """Tabs of each outline; 3 unless given."""

    @model_validator(mode="after")
    def _tabs_have_a_width(self) -> Self:
        if self.tabs is not None and self.tab_width is None:
            raise ValueError("has tabs without tab_width; add tab_width, or remove tabs")
        return self


FaceName = Annotated[str, Field(pattern=FACE_PATTERN)]
"""A face material: small letters, digits, - and _."""


class FilmFaces(Section):
    """Materials of the two faces of a film, if they are not the film's own."""

    upper: FaceName
    """The face that lies up, unless the layer is turned."""
    lower: FaceName
    """The other face."""


class FaceBonding(Section):
    """Two faces that bond to each other, and the process."""

    faces: Annotated[tuple[FaceName, FaceName], Field(strict=False)]
    """The two face materials, in either order; a film without faces has its own name for both."""
    by: BondProcess
    """press, or the tool of a seam: laser, hot-tip, ultrasonic, roller."""
    temperature_c: Annotated[float, Field(gt=0, le=1000), CELSIUS] | None = None
    """C at which they bond; in a press, at most its temperature."""
    after: str | None = Field(default=None, max_length=32)
    """The bond that must be made before this one."""


class FaceBondings(NamedTables):
    """Faces that bond, one table for each pair; if there are any, other faces do not bond."""

    what, names, names_are = "bond", FACE_PATTERN, "of small letters"
    __pydantic_extra__: dict[str, FaceBonding] = Field(init=False)

    @model_validator(mode="after")
    def _names_are_known(self) -> Self:
        for name, bond in self.by_name.items():
            if bond.after is not None and (bond.after == name or bond.after not in self.by_name):
                raise ValueError(
                    f"has bond {name} after {bond.after[:40]!r}, which is not another bond in "
                    f"this table; use {', '.join(self.by_name)}"
                )
        return self


OF_THE_PRODUCT = ("density", "melting_point", "modulus", "poisson")
"""Keys of a film that do not apply to another product."""


class TpeFilm(Section):
    """The structural film. The defaults describe the paper's film and do not apply to another
    product, for which missing values are unknown.
    """

    product: str = Field(default=PAPER_PRODUCT, max_length=80)
    """Product to order."""
    thickness: Annotated[float, Millimetres(SHORTEST, 1)] = PAPER_THICKNESS
    """Thickness of the structural film; another product than the paper's must give it."""
    density: Density | None = 1122.0
    """kg/m3, measured (paper Sec. 3.2.1); mass and weight need it."""
    melting_point: FilmTemperature | None = 120.0
    """C; the press must be hotter."""
    modulus: Modulus | None = PAPER_TPE[0]
    """MPa, Young's (paper Sec. 3.2.1); elastic models and simulators need it."""
    poisson: PoissonRatio | None = PAPER_TPE[1]
    """Poisson's ratio (paper Sec. 3.2.1); elastic models and simulators need it."""
    faces: FilmFaces | None = None
    """Materials of its faces; by default both are tpe."""

    @model_validator(mode="before")
    @classmethod
    def _another_product_is_another_film(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        product = data.get("product", PAPER_PRODUCT)
        if product == PAPER_PRODUCT or not isinstance(product, str):
            return data
        return {**dict.fromkeys(OF_THE_PRODUCT), **data}

    @model_validator(mode="after")
    def _another_product_has_its_thickness(self) -> Self:
        if self.product != PAPER_PRODUCT and "thickness" not in self.model_fields_set:
            raise ValueError(
                f"names another product than {PAPER_PRODUCT} but no thickness; add thickness, for "
                f'instance "50 um", and the known values of {", ".join(OF_THE_PRODUCT)}'
            )
        return self


class PtfeFilm(Section):
    """The mask film, which does not bond."""

    product: str = Field(default="PTFE film", max_length=80)
    """Product to order."""
    thickness: Annotated[float, Millimetres(SHORTEST, 1)] = 0.025
    """Thickness of the mask film."""
    density: Density = 2200.0
    """kg/m3, handbook value."""
    temperature_limit: FilmTemperature = 260.0
    """C; the usual limit for PTFE in lasting use."""


class OtherFilm(Section):
    """An additional film: another thickness or polymer, an inextensible film, or another mask."""

    kind: FilmKind
    """"structural": bonds where it touches another structural film. "mask": nothing bonds to it."""
    product: str = Field(max_length=80)
    """Product to order."""
    thickness: Annotated[float, Millimetres(SHORTEST, 1)]
    """Its thickness."""
    density: Density | None = None
    """kg/m3; mass and weight need it."""
    melting_point: FilmTemperature | None = None
    """C; the press must be hotter. A structural film without one stays solid in the press and
    bonds only to films that melt on it."""
    temperature_limit: FilmTemperature | None = None
    """C; the press must stay below. A mask has one."""
    modulus: Modulus | None = None
    """MPa, Young's; elastic models and simulators need it."""
    poisson: PoissonRatio | None = None
    """Poisson's ratio; elastic models and simulators need it."""
    faces: FilmFaces | None = None
    """Materials of its faces, for instance a coating and a textile; by default the film's name."""
    warning: str = Field(default="", max_length=200)
    """Warning in every cut file of it, for instance of its fumes."""
    kerf: KerfWidth = UNCALIBRATED
    """Full kerf width in this film, as laser.kerf_tpe."""
    sheet: Sheet = Sheet.model_construct()
    """Sheet that it is cut from, as sheets.tpe."""

    @model_validator(mode="after")
    def _mask_has_a_limit(self) -> Self:
        if self.kind == "mask" and self.temperature_limit is None:
            raise ValueError("is a mask without temperature_limit; add it, in C")
        if self.kind == "mask" and self.melting_point is not None:
            raise ValueError("is a mask, which does not bond; remove melting_point")
        return self


class Films(NamedTables):
    """The films from which layers are cut: TPE, PTFE, and additional films, one table each."""

    what, names, most = "film", FILM_NAME, 20
    names_are = 'a small letter and up to 15 small letters or digits, such as "tpu50"'
    __pydantic_extra__: dict[str, OtherFilm] = Field(init=False)

    tpe: TpeFilm = TpeFilm.model_construct()
    ptfe: PtfeFilm = PtfeFilm.model_construct()

    @property
    def face_names(self) -> frozenset[str]:
        """The materials of the faces of structural films; a film without faces has its own name."""
        bonding = {name: film for name, film in self.stock.items() if film.kind != "mask"}
        return frozenset(face for name, film in bonding.items() for face in film.faces or (name,))

    @property
    def stock(self) -> dict[str, Film]:
        """Every film by the name of its table: TPE, PTFE, then the others."""
        tpe, ptfe = self.tpe, self.ptfe
        limit = ptfe.temperature_limit
        films = {
            "tpe": _film("tpe", tpe, tpe.melting_point, limit),
            "ptfe": _film("ptfe", ptfe, limit, limit, "mask", warning=PTFE_WARNING),
        }
        for name, film in self.by_name.items():
            films[name] = _film(
                name,
                film,
                film.melting_point,
                HOTTEST if film.temperature_limit is None else film.temperature_limit,
                film.kind,
                warning=film.warning,
                shade=sum(limits.kind == film.kind for limits in films.values()),
                stays_solid=film.kind == "structural" and film.melting_point is None,
            )
        return films


def _film(
    name: str, table: TpeFilm | PtfeFilm | OtherFilm, softens: float | None, *more: Any, **keys: Any
) -> Film:
    """Return the film of a table, with the elasticity and the faces that it states in full."""
    if not isinstance(table, PtfeFilm):
        if table.modulus is not None and table.poisson is not None:
            keys["elastic"] = table.modulus, table.poisson
        if table.faces is not None:
            keys["faces"] = table.faces.upper, table.faces.lower
    product, thickness, density = table.product, table.thickness, table.density
    return Film(material(name), product, thickness, density, softens, *more, **keys)


def without_other_products(table: Mapping[str, Any], changed: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``table``, tables of films by name, without values that are invalid for ``changed``.

    A film with another product in ``changed`` loses all its values in ``table`` except kind, sheet
    and kerf: thickness, density and the rest describe the first product. PTFE is one polymer under
    any name, and keeps its values.
    """
    rest = dict(table)
    for name, film in table.items():
        changes = changed.get(name)
        if name == "ptfe" or not (isinstance(film, Mapping) and isinstance(changes, Mapping)):
            continue
        if changes.get("product", film.get("product")) != film.get("product"):
            rest[name] = {key: film[key] for key in ("kind", "sheet", "kerf") if key in film}
    return rest


def material(name: str) -> Material:
    """Return the name of this table's film in files and lists."""
    return name.upper()


class LayerFilms(Section):
    """The film of each layer, by the names of the tables in ``films``."""

    base: str = "tpe"
    """The lowest film of the bottom balloons."""
    wall: str = "tpe"
    """All films between base and cap."""
    cap: str = "tpe"
    """The topmost film."""
    sheet: str = "tpe"
    """The sheet of a radial design."""
    chamber_mask: str = "ptfe"
    """The masks in the pockets, inlet strips included."""
    separator_mask: str = "ptfe"
    """The masks between balloons."""


# Recipes: power, speed and passes for cutting or marking a film on a machine, with their source.


Operation = Literal["cut", "engrave"]
MachineName = Annotated[str, Field(min_length=1, max_length=80)]
SAME_THICKNESS = 1e-6
"""Thicknesses that differ by less are equal, mm."""


class Recipe(Section):
    """Settings of a machine for a film, and their source."""

    film: str = Field(min_length=1, max_length=80)
    """The film's product, as in films.tpe.product."""
    thickness_mm: Annotated[float, Millimetres(SHORTEST, 1)]
    """Its thickness."""
    machine: MachineName
    """The machine, as in laser.machine."""
    operation: Operation = "cut"
    """"cut" is for holes, outlines and the cut that frees a roll's sheet, "engrave" for labels."""
    power_percent: float = Field(gt=0, le=100)
    """%, both least and most power."""
    speed_mm_s: float = Field(gt=0, le=5000)
    """mm/s."""
    passes: int = Field(default=1, ge=1, le=50)
    """Number of times the beam follows a line."""
    kerf_mm: LengthOrZero | None = Field(default=None, le=1)
    """Full kerf width that was measured with these settings; for notes, it compensates nothing."""
    source: str = Field(min_length=1, max_length=200)
    """Source of the settings, for instance a material test of the laser program."""
    date: str | None = Field(default=None, pattern=DATE_PATTERN)
    """Date of their trial, as year-month-day."""

    @model_validator(mode="after")
    def _has_a_source(self) -> Self:
        if not self.source.strip():
            raise ValueError("has no source; state the source of power and speed")
        return self

    @property
    def settings(self) -> str:
        """Power, speed and passes as text."""
        passes = f"{self.passes} pass" + ("es" if self.passes > 1 else "")
        return f"{self.power_percent:g} % at {self.speed_mm_s:g} mm/s, {passes}"

    def is_for(self, film: Film, machine: str) -> bool:
        """Return True if it applies to a film on a machine."""
        same = abs(self.thickness_mm - film.thickness) < SAME_THICKNESS
        return same and (self.film, self.machine) == (film.product, machine)

    @property
    def purpose(self) -> tuple[str, float, str, str]:
        """Its use: film, thickness, machine and operation."""
        return self.film, round(self.thickness_mm, 6), self.machine, self.operation


def recipes_for(
    recipes: Iterable[Recipe], film: Film, machine: str | None
) -> Mapping[Operation, Recipe]:
    """Return the recipes of a film by operation; empty if no machine is named."""
    if machine is None:
        return {}
    return {recipe.operation: recipe for recipe in recipes if recipe.is_for(film, machine)}
