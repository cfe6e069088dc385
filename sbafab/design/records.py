"""Records of a design file: the sections that all families share, and the form of an actuator.

Every field has the paper's value as default (paper Sec. 2) or, if the paper gives none, ours,
marked as such. Lengths are mm.
"""

from __future__ import annotations

import functools
import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from sbafab.design.files import (
    ASSEMBLY,
    FITS,
    KIT,
    OUTLINE,
    Change,
    changed_keys,
    checked,
    listed,
    override,
    shown,
    suggestion,
    with_changes,
)
from sbafab.design.films import (
    FaceBondings,
    Films,
    LayerFilms,
    material,
    without_other_products,
)
from sbafab.design.kits import inlet_of_kit, load_kit, under_kit
from sbafab.design.sections import (
    Acceptance,
    Bond,
    Bore,
    Chamber,
    Fillet,
    Inlet,
    Laser,
    Mask,
    Models,
    OrderSection,
    Press,
    Registration,
    Rules,
    SeamTools,
    Sheets,
    Stack,
)
from sbafab.design.toml_table import NAME_PATTERN, Section
from sbafab.design.units import Length, LengthOrZero
from sbafab.errors import DesignError
from sbafab.geometry.offset import Kerf
from sbafab.geometry.region import Region
from sbafab.laminate.base_plate import PlateMachine, lone_pin_error, pin_error
from sbafab.laminate.films import Material
from sbafab.laminate.joints import FaceBond
from sbafab.markup import table_html

if TYPE_CHECKING:
    from pydantic import GetJsonSchemaHandler
    from pydantic.json_schema import JsonSchemaValue


def card(title: str, symbol: str) -> ConfigDict:
    """Return the form's entries for a family: a few words, and a drawing."""
    return ConfigDict(title=title, json_schema_extra={"symbol": symbol})


REGISTRATIONS = {
    "method": ("channel-pin", "ears"),
    "sequence": ("bottom-first", "middle-first"),
}
"""Ways of registration that a search may choose between, by key."""


class Design(Section):
    """The sections that all families share; a family adds its own, sets ``family`` and ``form``."""

    unused: ClassVar[Mapping[str, str]] = {}
    """Sections and keys below that a family does not use, each with its replacement. They cannot be
    set, and no file and no form has them."""

    name: str = Field(pattern=NAME_PATTERN)
    """Names the output folder: letters, digits, dot, dash, underscore."""
    family: str
    """Kind of actuator."""
    kit: str = Field(default="paper", min_length=1, max_length=1000)
    """The lab's films, tubes, press, laser and limits: "paper", or a file beside the design. It
    gives every key of its sections that the design leaves out."""
    stack: Stack = Stack.model_construct()
    bond: Bond = Bond.model_construct()
    mask: Mask = Mask.model_construct()
    bore: Bore = Bore.model_construct()
    fillet: Fillet = Fillet.model_construct()
    inlet: Inlet = Inlet.model_construct()
    films: Films = Films.model_construct()
    layup: LayerFilms = LayerFilms.model_construct()
    face_bonds: FaceBondings | None = None
    """Faces of films that bond, and the process; by default all structural films in the press."""
    registration: Registration = Registration.model_construct()
    seam_tools: SeamTools | None = None
    """Tools that make seams beside their machine's head; by default each is at the head."""
    press: Press = Press.model_construct()
    acceptance: Acceptance = Acceptance.model_construct()
    laser: Laser = Laser.model_construct()
    sheets: Sheets = Sheets.model_construct()
    order: OrderSection = OrderSection.model_construct()
    rules: Rules = Rules.model_construct()
    models: Models = Models.model_construct()
    chamber: Chamber = Chamber.model_construct()

    _folder: Path = PrivateAttr(default=Path())
    _is_solved: bool = PrivateAttr(default=False)

    @property
    def folder(self) -> Path:
        """The folder of the design's file, for relative paths."""
        return self._folder

    @property
    def is_solved(self) -> bool:
        """True if ``chamber.diameter`` was solved from ``fits``."""
        return self._is_solved

    @property
    def drawing(self) -> Path | None:
        """The file of the pockets' drawn outline, if there is one."""
        return None if self.chamber.outline is None else self.folder / self.chamber.outline

    @property
    def drawings(self) -> dict[str, Path]:
        """The files of all drawn outlines, by the keys that name them."""
        return {} if self.drawing is None else {OUTLINE: self.drawing}

    @property
    def layer_films(self) -> dict[int, str]:
        """The films of single layers, by layer index; others take the role's film in ``layup``."""
        return {}

    @property
    def layer_roles(self) -> tuple[str, ...]:
        """The roles of all layers, bottom to top, if the design lists them; else empty."""
        return ()

    @property
    def has_nets(self) -> bool:
        """True if the design states which ports its voids join."""
        return False

    @property
    def stated_bonds(self) -> tuple[FaceBond, ...]:
        """Faces that bond, and the process; empty if not stated.

        Raises DesignError for a face that does not belong to a film.
        """
        bonds = {} if self.face_bonds is None else self.face_bonds.by_name
        faces = self.films.face_names if bonds else frozenset()
        for name, bond in bonds.items():
            strange = next((face for face in bond.faces if face not in faces), None)
            if strange is not None:
                raise DesignError(
                    f"face_bonds.{name}.faces names {shown(strange)}, which is not the face of a "
                    f"film; use {listed(sorted(faces))}"
                )
        return tuple(
            FaceBond(name, bond.faces, bond.by, bond.temperature_c, bond.after)
            for name, bond in bonds.items()
        )

    @property
    def seam_offsets(self) -> dict[str, tuple[float, float]]:
        """Offsets, mm, of tools mounted beside their machine's head, by the tools' names."""
        return {} if self.seam_tools is None else self.seam_tools.offsets

    @property
    def thickest_pin(self) -> float:
        """The diameter of the thickest dowel pin that the design may need, mm."""
        return max(self.bore.pin, self.registration.pin_diameter)

    @property
    def pin_error(self) -> float:
        """The largest displacement of a layer on several pins, mm."""
        return self._error_on(pin_error)

    @property
    def lone_pin_error(self) -> float:
        """The largest displacement of a layer on a single pin, without its position error, mm."""
        return self._error_on(lone_pin_error)

    def _error_on(self, pins: Callable[[float, PlateMachine], float]) -> float:
        registration = self.registration
        if registration.pin_error is not None:
            return registration.pin_error
        return pins(self.thickest_pin, registration.plate_made_by)

    @property
    def plate_machine(self) -> PlateMachine | None:
        """Machine for the base plate's holes; None if the pins' error is stated, or bonds drawn."""
        is_stated = self.registration.pin_error is not None or self.form.is_drawn
        return None if is_stated else self.registration.plate_made_by

    @property
    def kerf_widths(self) -> dict[Material, Kerf | None]:
        """The full kerf width (or widths along x and y) by material, None if not measured."""
        kerfs = {"TPE": self.laser.kerf_tpe, "PTFE": self.laser.kerf_ptfe}
        kerfs |= {material(name): film.kerf for name, film in self.films.by_name.items()}
        return {name: None if isinstance(kerf, str) else kerf for name, kerf in kerfs.items()}

    @property
    def strip_width(self) -> float:
        """The width of the inlet strips, mm: as given, or the least that opens to the tube.

        A flat channel opens to half the perimeter of its content: the tube, and the PTFE strip
        along one side of it (rule tube-fit). Rounded up to 0.05 mm.
        """
        if self.inlet.width is not None:
            return self.inlet.width
        opened = math.pi / 2 * (self.inlet.tube_outer_diameter + self.films.ptfe.thickness)
        return round(math.ceil((opened + self.strip_loss) / 0.05 - 1e-9) * 0.05, 4)

    @property
    def strip_loss(self) -> float:
        """The width by which a cut strip may be narrower than drawn, mm, for any kerf.

        A later kerf measurement changes no strip.
        """
        return 2 * self.registration.cutting_error + self.laser.unknown_kerf

    @property
    @abstractmethod
    def form(self) -> Form:
        """The form of the actuator, for models, checks and pages. Raises DesignError."""

    @classmethod
    def uses(cls, key: str) -> bool:
        """Return True if the family uses a key and its section."""
        return not {key, key.partition(".")[0]} & cls.unused.keys()

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: Any, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        schema: JsonSchemaValue = super().__get_pydantic_json_schema__(core_schema, handler)
        for key in cls.unused:
            handler.resolve_ref_schema(schema)["properties"].pop(key, None)
        return schema

    @property
    def free(self) -> tuple[Free, ...]:
        """The keys that a search may change by default; a family adds its own."""
        most, bond, reach = self.rules.validated_balloons, self.rules.bond_width, self.mask.overhang
        return (
            Free("stack.balloons", 2, most, 1),
            Free("bond.width", bond, bond + 0.5, 0.05, asked="yield"),
            Free("mask.overhang", reach, reach + 0.5, 0.05, asked="yield"),
            *(
                Free.of_choices(f"registration.{key}", words, asked="yield")
                for key, words in REGISTRATIONS.items()
            ),
        )

    def drawn_shapes(self) -> Mapping[str, Region | None]:
        """Return the shapes that the design file names; None for an invalid one."""
        return {}

    def drawn_from(self, key: str, file: str) -> Self:
        """Return the design with another file for one of the keys of ``drawings``."""
        assert key == OUTLINE, key
        chamber = self.chamber.model_copy(update={"outline": file})
        return self.model_copy(update={"chamber": chamber})

    def with_(self, *changes: str | Mapping[str, Any], **tables: Any) -> Self:
        """Return the design with keys changed, checked like a design file.

        ``design.with_("stack.balloons=6")``, ``design.with_({"stack.balloons": 6})`` and
        ``design.with_(stack={"balloons": 6})`` are equal. Raises DesignError with one sentence.
        """
        return changed(self, [*changes, tables])

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {self.stack.balloons} balloons)"

    def _repr_html_(self) -> str:
        return table_html(("key", "value", "default"), keys_of(self), self.name)

    def completed(self) -> Self:
        """Return the design with every default that depends on another value filled in."""
        inlet = self.inlet.model_copy(update={"width": self.strip_width})
        return self.model_copy(update={"inlet": inlet})

    def fitted(self) -> Self:
        """Return the design with its chamber solved from ``fits``, in families that have it.

        Raises DesignError if no chamber fits.
        """
        return self

    def solved(self) -> Self:
        """Return the design with ``chamber.diameter`` marked as solved, not given."""
        copy = self.model_copy()
        copy._is_solved = True
        return copy

    def placed(self, folder: Path) -> Self:
        """Return the design with relative paths based on ``folder``."""
        copy = self.model_copy()
        copy._folder = folder
        return copy


# The form of an actuator: a family's description of a design for family-independent code.


@dataclass(frozen=True)
class Discs:
    """Round pockets on one axis per stack: a diameter in mm for each balloon, from the bottom."""

    diameters: tuple[float, ...]


@dataclass(frozen=True)
class Slots:
    """Oblong pockets of every balloon: half discs of ``width`` and a straight ``run``, mm."""

    width: float
    run: float


@dataclass(frozen=True)
class Drawn:
    """Pockets of an outline that the user drew."""


Pockets = Discs | Slots | Drawn


class Wrap(Section):
    """The tube around which the finished laminate is wrapped."""

    outer_diameter: Length
    """Diameter of the tube."""
    pitch: Length
    """Distance between neighbouring stacks of balloons round it."""
    overlap: LengthOrZero = 0.0
    """Width by which the ends of the wrapped sheet overlap."""
    glue: str = Field(min_length=1, max_length=120)
    """Adhesive or tape that holds the sheet round the tube."""


MechanismKind = Literal["pouch-motor", "hinge", "beam", "jamming", "push"]


class Mechanism(Section):
    """The action of the pockets when filled, for the closed forms of ``predict``, if any."""

    kind: MechanismKind
    """"pouch-motor" pulls, "hinge" bends two plates, "beam" bears a load at its end, "jamming"
    stiffens under a vacuum, "push" presses against a plate."""
    direction: Annotated[float, Field(ge=-360, le=360)] = 0.0
    """Degrees from x, counter-clockwise: motors shorten along it; plates and beams lie along it."""
    friction: float | None = Field(default=None, gt=0, le=2)
    """Coefficient of friction between the sheets; jamming needs it."""

    @model_validator(mode="after")
    def _friction_is_of_sheets(self) -> Self:
        if self.kind == "jamming" and self.friction is None:
            raise ValueError("is jamming without friction; add it, such as 0.3")
        if self.kind != "jamming" and self.friction is not None:
            raise ValueError(f"is a {self.kind}, which has no friction; remove it")
        return self


@dataclass(frozen=True)
class Form:
    """Form of an actuator of any family.

    ``words`` is a technician's name for it; ``stacks`` of balloons stand side by side, all with the
    same ``pockets``; ``lumen`` is the diameter in mm of the channel through all layers,
    ``lumen_pin`` that of its dowel pin; ``mechanism`` the action of drawn pockets, if stated.
    ``is_drawn``: every layer is drawn, so the paper's handling times do not apply.
    """

    words: str
    stacks: int
    pockets: Pockets
    lumen: float | None = None
    lumen_pin: float | None = None
    wrap: Wrap | None = None
    mechanism: Mechanism | None = None
    is_drawn: bool = False

    @property
    def is_parallel(self) -> bool:
        """True if stacks on common plates push one way: unequal strokes then bend the actuator."""
        return self.stacks > 1 and self.wrap is None

    @property
    def works_under_vacuum(self) -> bool:
        """True if its pressures are below atmospheric: negative gauge pressures."""
        return self.mechanism is not None and self.mechanism.kind == "jamming"

    @property
    def pushing(self) -> int:
        """Number of stacks that push one way: all on common plates, one of those round a tube."""
        return self.stacks if self.wrap is None else 1


@dataclass(frozen=True)
class Free:
    """A key that a search or sweep changes: from ``low`` to ``high`` in steps, or one of
    ``choices``. With a ``step`` of 0 it may be any number between.

    ``asked``: free only if a requirement names this quantity. ``widens``: the ends are where a
    search begins, and may move.
    """

    key: str
    low: float
    high: float
    step: float
    asked: str = ""
    widens: bool = False
    choices: tuple[Any, ...] = ()
    """Words or other values of the key; its steps then count them from 0."""

    @classmethod
    def of_choices(cls, key: str, choices: Iterable[Any], asked: str = "") -> Free:
        """Return a key that takes one of some values."""
        values = tuple(choices)
        return cls(key, 0, len(values) - 1, 1, asked, choices=values)

    def at(self, number: int) -> Any:
        """Return the value after a number of steps: whole if ``low`` and ``step`` are.

        Beyond its range a choice stays the last one.
        """
        if self.choices:
            return self.choices[min(max(number, 0), len(self.choices) - 1)]
        value = round(self.low + number * self.step, 9)
        return int(value) if self.low == int(self.low) and self.step == int(self.step) else value

    @functools.cached_property
    def values(self) -> tuple[Any, ...]:
        """Every value, in order; without a step both ends."""
        if not self.step:
            return self.low, self.high
        return tuple(map(self.at, range(round((self.high - self.low) / self.step) + 1)))


def degrees_of_freedom(stacks: int) -> str:
    """Words for round stacks on common plates: one lengthens (1-DoF), three also bend (3-DoF)."""
    suffix = {1: " (1-DoF)", 3: " (3-DoF)"}.get(stacks, "")
    return f"stacked balloon actuator with {stacks} chamber{'s' if stacks > 1 else ''}{suffix}"


AnyDesign = TypeVar("AnyDesign", bound=Design)


def changed(design: AnyDesign, changes: Iterable[Change]) -> AnyDesign:
    """Return the design with changes made to its keys. Raises DesignError with one sentence."""
    changes = list(changes)
    data = plain_tables(design)
    if KIT in changed_keys(changes):
        data = without_kit(data, design)
    films = override({"films": {}}, changes).get("films")
    if isinstance(films, dict):
        data["films"] = without_other_products(data.get("films", {}), films)
    return validated(with_changes(data, changes), {design.family: type(design)}, design.folder)


def validated(
    data: Mapping[str, Any], families: Mapping[str, type[AnyDesign]], folder: Path
) -> AnyDesign:
    """Return the design record of the family in ``data``.

    Raises DesignError with one sentence: field, value, allowed values, remedy.
    """
    family = data.get("family")
    if family is None:
        raise DesignError(f"family is missing; add family = one of {listed(families)}")
    if family == ASSEMBLY:
        raise DesignError(
            f"{shown(data.get('name', folder.name))} is an assembly of several designs; use it "
            "with generate, check, predict or studio, or use one of its designs"
        )
    if not isinstance(family, str) or family not in families:
        allowed = f"{'one of ' if len(families) > 1 else ''}{listed(families)}"
        near = suggestion(family, families)
        raise DesignError(f"family = {shown(family)} must be {allowed}{near}")
    record = families[family]
    for key, _ in dotted(data):
        if not record.uses(key):
            instead = record.unused.get(key) or record.unused[key.partition(".")[0]]
            raise DesignError(f"{key} is a key that family {family} does not use; {instead}")
    return checked(record, under_kit(data, folder), families).placed(folder).fitted()


def resolved(design: Design) -> dict[str, Any]:
    """Return the design with every default written out, as plain TOML values."""
    return _used(with_unused(design), design)


def with_unused(design: Design) -> dict[str, Any]:
    """Return the design with the keys that its family does not use, at their defaults."""
    return _tables(design.completed())


def plain_tables(design: Design) -> dict[str, Any]:
    """Return the design as tables of a TOML file, without defaults that depend on other values."""
    tables = _used(_tables(design), design)
    if design.is_solved:
        del tables["chamber"]["diameter"]
    return tables


def _tables(design: Design) -> dict[str, Any]:
    tables = without_none(design.model_dump(mode="json"))
    if not tables.get(FITS):
        # No requirement: an empty table would be meaningless.
        tables.pop(FITS, None)
    return tables


def _used(tables: dict[str, Any], design: Design) -> dict[str, Any]:
    for key in design.unused:
        section, _, name = key.partition(".")
        (tables[section] if name else tables).pop(name or section, None)
    return tables


def without_none(table: dict[str, Any]) -> dict[str, Any]:
    """Return nested tables without keys that have no value."""

    def plain(value: Any) -> Any:
        if isinstance(value, list):
            return [plain(item) for item in value]
        return without_none(value) if isinstance(value, dict) else value

    return {key: plain(value) for key, value in table.items() if value is not None}


def keys_of(design: Design) -> list[tuple[str, object, object]]:
    """Return dotted key, value and default of every key, the default only if the value differs."""
    plain = type(design).model_validate({"name": design.name, "family": design.family})
    usual = dict(dotted(resolved(plain)))
    return [
        (key, value, usual.get(key) if usual.get(key) != value else None)
        for key, value in dotted(resolved(design))
    ]


def dotted(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Yield dotted key and value of every key of nested tables."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from dotted(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def design_toml(design: Design) -> str:
    """Return the text of ``design.toml`` of an output folder."""
    import tomli_w

    return tomli_w.dumps(resolved(design))


def without_kit(data: Mapping[str, Any], design: Design) -> dict[str, Any]:
    """Return a design's tables without the values of its kit or the defaults, for another kit."""
    kit = load_kit(design.kit, design.folder)
    kit_values = {**kit.tables, "inlet": inlet_of_kit(kit, {}, False)}
    usual = type(design).model_validate({"name": "x", "family": design.family, **kit_values})
    tables = {key: table for key, table in data.items() if isinstance(table, dict)}
    return {**data, **{key: {} for key in tables}, **_less(tables, plain_tables(usual))}


def _less(data: Mapping[str, Any], usual: Mapping[str, Any]) -> dict[str, Any]:
    """Return values that differ from the defaults; tables that become empty are removed."""
    rest: dict[str, Any] = {}
    for key, value in data.items():
        inner = usual.get(key)
        difference = (
            _less(value, inner) if isinstance(value, dict) and isinstance(inner, dict) else value
        )
        if difference not in (inner, {}):
            rest[key] = difference
    return rest
