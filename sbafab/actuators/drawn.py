"""Laminates of drawn layers: the design file gives each layer's role and names its shape."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from sbafab.actuators import Family
from sbafab.actuators.shapes import (
    Angle,
    Coordinates,
    NamedShapes,
    Names,
    ShapeRegions,
    Vertex,
    marks_of,
)
from sbafab.actuators.stacking import CutFilm, channel_pin, layers, of_every_family
from sbafab.design.files import hint, shown
from sbafab.design.polylines import polyline
from sbafab.design.records import Design, Drawn, Form, Free, Mechanism, Wrap, card
from sbafab.design.toml_table import NAME_PATTERN, NamedTables, Section, writable
from sbafab.design.units import Length, LengthOrZero
from sbafab.errors import DesignError, SbafabError
from sbafab.geometry.edges import Edge, unit
from sbafab.geometry.region import Region
from sbafab.laminate.folding import lies_on, toward, unfolded
from sbafab.laminate.joining import joinings
from sbafab.laminate.joints import (
    Fold,
    Net,
    Port,
    PortKind,
    Seam,
    SeamKind,
    SeamTool,
    balloon_numbers,
    chamber_gaps,
)
from sbafab.laminate.laminate import Bore, Chamber, Inlet, Laminate, Layer, Pin, Role

NoteText = Annotated[str, Field(min_length=1, max_length=400), AfterValidator(writable)]
LayerPair = Annotated[tuple[int, int], Field(strict=False)]
MOST_LAYERS = 500


class DrawnLayer(Section):
    """A layer: its role, the name of its shape, and its intended number of parts."""

    role: Role
    """Role of the layer: base, wall, cap or sheet of a structural film, or a mask."""
    shape: str
    """The name of its shape."""
    film: str | None = None
    """The film that it is cut from, as in ``layup``; by default the film of its role there."""
    pieces: int = Field(default=1, ge=1, le=1000)
    """Separate parts that it is meant to have (rule piece-count)."""
    turned: bool | None = None
    """True if it lies with its upper face down; the upper half of a fold does so by itself."""


class DrawnChamber(Section):
    """A chamber, and the inlet strip that fills it."""

    name: str = Field(pattern=NAME_PATTERN)
    """Its name in findings and on pages."""
    centres: Annotated[tuple[Coordinates, ...], Field(strict=False, min_length=1, max_length=100)]
    """A point inside each of its pockets; with several balloons, the point of its bore."""
    mouth: Coordinates
    """The middle of the end of its inlet tab."""
    angle: Angle
    """Direction of the mouth: degrees from x, counter-clockwise."""
    width: Length | None = None
    """Width of its inlet strip as drawn; by default what the tube needs."""
    length: Length | None = None
    """Straight run of its inlet strip inward from the mouth; by default ``inlet.tab_length``."""
    balloons: Annotated[tuple[int, ...], Field(strict=False, min_length=1)] | None = None
    """The chamber gaps that it has pockets in, from 1 at the bottom; all by default."""


class DrawnPin(Section):
    """A dowel pin of the press fixture; it holds every layer with a fitting hole."""

    name: str = Field(pattern=NAME_PATTERN)
    """Its name in the fixture and on pages."""
    at: Coordinates
    """Its place."""
    diameter: Length
    """Diameter of the pin."""
    clearance: LengthOrZero = 0.0
    """Excess of the layers' holes for it over its diameter."""


class DrawnSeam(Section):
    """A seam: two films bonded by a moving tool along a path."""

    name: str = Field(pattern=NAME_PATTERN)
    """Its name in findings, pages and files."""
    layers: LayerPair
    """The two films, by their numbers in ``layers``; only masks may lie between them."""
    shape: str | None = None
    """The shape whose boundary is the path of the tool's middle."""
    path: Annotated[tuple[Vertex, ...], Field(strict=False, min_length=2)] | None = None
    """Or the corners of the path, in order; a third number bulges the edge to the next into an
    arc."""
    closed: bool = False
    """True if the path goes back to its first corner."""
    width: Length
    """Width of the bond, half of it on either side of the path."""
    tool: SeamTool
    """Tool that makes it: laser, hot-tip, ultrasonic or roller; a roller's ends are square."""
    kind: SeamKind = "lap"
    """Position of the films: lap, flat on each other; fin, with their edges standing out together.
    It changes only the instruction to the bench: shapes and rules treat both as a lap."""

    @model_validator(mode="after")
    def _has_one_path(self) -> Self:
        if (self.shape is None) == (self.path is None):
            raise ValueError("has either a shape or a path; give one of the two")
        if self.shape is not None and self.closed:
            raise ValueError("has a shape, whose boundary is closed; remove closed")
        if self.path is not None and any(a[:2] == b[:2] for a, b in pairwise(self.path)):
            raise ValueError("repeats a corner of its path; remove one")
        return self


class DrawnFold(Section):
    """A film folded along a straight line into two layers."""

    layers: LayerPair
    """The halves, by their numbers in ``layers``, the lower one first."""
    line: Annotated[tuple[Coordinates, Coordinates], Field(strict=False)]
    """Two points of the line, which both halves end at."""

    @model_validator(mode="after")
    def _has_a_line(self) -> Self:
        if self.line[0] == self.line[1]:
            raise ValueError("has a line with coincident ends; move one of them")
        return self


class DrawnPort(Section):
    """A place in a gap that nets name: a pocket, the end of a channel, or a hole for a tube."""

    name: str = Field(pattern=NAME_PATTERN)
    """Its name in nets and findings."""
    layers: LayerPair
    """The two films that it lies between, by their numbers in ``layers``."""
    at: Coordinates
    """Its place, in a void."""
    kind: PortKind = "place"
    """A place of that gap, or a hole of the top or bottom film beside it, with a tube glued on."""


class NamedNets(NamedTables):
    """Nets by name: ports and chambers that voids connect, and that connect to nothing else."""

    what, names = "net", NAME_PATTERN
    names_are = "of letters, digits, dots, - and _, 64 at most"
    most = 500
    __pydantic_extra__: dict[str, Names] = Field(init=False)


DRAWN = "drawn"
"""The family's name, for writers of its design files."""


class DrawnDesign(Design):
    """Layers whose shapes are drawn, bottom to top.

    Families do not build them; rules read them like any laminate, and predictions omit parts
    without a model. ``bore.diameter`` changes no shape: only rules and pins read it.
    """

    unused: ClassVar[Mapping[str, str]] = {
        "bond": "remove it, and draw bonds as wide as they shall be",
        "mask": "remove it, and draw masks as large as they shall be",
        "fillet": "remove it, and round a shape by {fillet = SHAPE, radius = 1}",
        "chamber": "remove it, and name a drawn outline in a shape: shapes.pocket.file",
        "registration.pin_clearance": "remove it, and give pins their clearance, in pins",
    }

    model_config = card(
        "Drawn layers",
        "M5 26 27 18l22 8-22 8ZM5 19 27 11l22 8-22 8ZM5 12 27 4l22 8-22 8Z",
    )

    family: Literal["drawn"]
    """Kind of actuator."""
    layers: Annotated[tuple[DrawnLayer, ...], Field(strict=False, max_length=MOST_LAYERS)] = ()
    """The layers, bottom to top."""
    shapes: NamedShapes = NamedShapes.model_construct()
    chambers: Annotated[tuple[DrawnChamber, ...], Field(strict=False, max_length=100)] = ()
    """The chambers, each with its inlet."""
    seams: Annotated[tuple[DrawnSeam, ...], Field(strict=False, max_length=200)] | None = None
    """The seams, in order of making; none by default."""
    folds: Annotated[tuple[DrawnFold, ...], Field(strict=False, max_length=100)] | None = None
    """The folds; none by default."""
    ports: Annotated[tuple[DrawnPort, ...], Field(strict=False, max_length=500)] | None = None
    """Places that nets name, beside the chambers; none by default."""
    nets: NamedNets | None = None
    """Ports and chambers that are meant to be joined, across holes of films too (rule nets)."""
    body: str | None = None
    """The shape of the films without tabs, for the outline's diameter; none by default."""
    lumen: Length | None = None
    """Diameter of the channel through all layers round (0, 0), and of its dowel pin."""
    pins: Annotated[tuple[DrawnPin, ...], Field(strict=False, max_length=200)] | None = None
    """The dowel pins, by default one in every bore, unless there are nets, and in the lumen."""
    tube: Wrap | None = None
    """The tube that the laminate is wrapped round; none by default."""
    notes: Annotated[tuple[NoteText, ...], Field(strict=False, max_length=20)] | None = None
    """Sentences that pictures and pages print; none by default."""
    mechanism: Mechanism | None = None
    """Action of its pockets, such as {kind = "pouch-motor", direction = 90}."""

    @model_validator(mode="before")
    @classmethod
    def _balloons_are_counted(cls, data: Any) -> Any:
        """One balloon for each gap with a chamber, unless the file gives their number."""
        rows, stack = data.get("layers"), data.get("stack", {})
        if (
            not isinstance(rows, list | tuple)
            or not isinstance(stack, Mapping)
            or "balloons" in stack
        ):
            return data
        roles = [str(row.get("role")) if isinstance(row, Mapping) else "" for row in rows]
        seams = data.get("seams")
        pairs = {
            tuple(row["layers"])
            for row in (seams if isinstance(seams, list | tuple) else ())
            if isinstance(row, Mapping) and isinstance(row.get("layers"), list | tuple)
        }
        count = sum(chamber_gaps(roles, pairs).values())
        return {**data, "stack": {**stack, "balloons": count}} if count else data

    @property
    def form(self) -> Form:
        stacks = max(1, sum(len(chamber.centres) for chamber in self.chambers))
        words, places = "laminate of drawn layers", (self.lumen, self.lumen_pin)
        return Form(words, stacks, Drawn(), *places, self.tube, self.mechanism, True)

    @property
    def lumen_pin(self) -> float | None:
        """The diameter of the lumen's pin, if there is one."""
        middle = (pin.diameter for pin in self.pins or () if pin.at == (0.0, 0.0))
        return next(middle, self.lumen) if self.lumen is not None else None

    @property
    def layer_films(self) -> dict[int, str]:
        rows = enumerate(self.layers, start=1)
        return {number: row.film for number, row in rows if row.film is not None}

    @property
    def layer_roles(self) -> tuple[str, ...]:
        return tuple(row.role for row in self.layers)

    @property
    def has_nets(self) -> bool:
        return bool(_nets(self))

    @property
    def chamber_gaps(self) -> dict[tuple[int, int], bool]:
        """The gaps between films, by their layers: True for those with a chamber."""
        return chamber_gaps(self.layer_roles, {seam.layers for seam in self.seams or ()})

    @property
    def stated_folds(self) -> tuple[Fold, ...]:
        """The folds, with their lines as drawn."""
        return tuple(Fold(*fold.layers, fold.line) for fold in self.folds or ())

    @property
    def free(self) -> tuple[Free, ...]:
        return ()

    @property
    def thickest_pin(self) -> float:
        pins = [pin.diameter for pin in self.pins or ()]
        return max([super().thickest_pin, self.lumen_pin or 0.0, *pins])

    @property
    def drawings(self) -> dict[str, Path]:
        named = {name: shape.file for name, shape in self.shapes.by_name.items()}
        files = {name: self.folder / file for name, file in named.items() if file is not None}
        return {f"shapes.{name}.file": file for name, file in files.items()}

    def drawn_shapes(self) -> Mapping[str, Region | None]:
        shapes = ShapeRegions(self.shapes.by_name, self.drawings)
        regions: dict[str, Region | None] = {}
        for name in self.shapes.by_name:
            try:
                regions[name] = shapes.of(name, f"shapes.{name}")
            except SbafabError:
                regions[name] = None
        return regions

    def drawn_from(self, key: str, file: str) -> Self:
        _, name, _ = key.split(".")
        shape = self.shapes.by_name[name].model_copy(update={"file": file})
        return self.model_copy(update={"shapes": self.shapes.model_copy(update={name: shape})})


def build(design: DrawnDesign) -> Laminate:
    """Return the laminate of drawn layers.

    Raises DesignError with the key at fault, or with the reason why its films cannot be joined.
    """
    for fault in _faults(design):
        raise DesignError(fault)
    shapes = ShapeRegions(design.shapes.by_name, design.drawings)
    balloons = design.stack.balloons
    numbers = balloon_numbers(design.layer_roles, design.chamber_gaps)
    cuts = [
        CutFilm(row.role, shapes.of(row.shape, f"layer {number}"), balloon, row.pieces)
        for number, (row, balloon) in enumerate(zip(design.layers, numbers, strict=True), start=1)
    ]
    chambers = tuple(Chamber(c.name, c.centres, c.balloons or ()) for c in design.chambers)
    bores = tuple(
        Bore(chamber.name, centre, design.bore.diameter)
        for chamber in chambers
        for centre in chamber.centres
        if len(chamber.balloons or range(balloons)) > 1
    )
    stack = _turned(layers(cuts, design), design)
    tube = design.inlet.tube_outer_diameter
    laminate = Laminate(
        **of_every_family(design),
        layers=stack,
        chambers=chambers,
        bores=bores,
        inlets=tuple(
            Inlet(
                chamber.name,
                chamber.mouth,
                unit(chamber.angle),
                design.strip_width if chamber.width is None else chamber.width,
                design.inlet.tab_length if chamber.length is None else chamber.length,
                tube,
            )
            for chamber in design.chambers
        ),
        # With nets a bore is an ordinary hole: masks continue over it, and no pin is in it.
        pins=_pins(design, () if _nets(design) else bores),
        lumen=design.lumen,
        balloons=balloons,
        notes=design.notes or (),
        tube=None if design.tube is None else design.tube.outer_diameter,
        outline=Region() if design.body is None else shapes.of(design.body, "body"),
        seams=tuple(
            Seam(row.name, *row.layers, _seam_path(row, shapes), row.width, row.tool, row.kind, n)
            for n, row in enumerate(design.seams or (), start=1)
        ),
        folds=tuple(
            replace(fold, line=toward(fold.line, stack[fold.lower - 1].profile))
            for fold in design.stated_folds
        ),
        ports=tuple(
            Port(row.name, *row.layers, row.at, row.kind, tube if row.kind == "hole" else None)
            for row in design.ports or ()
        ),
        nets=tuple(Net(name, members) for name, members in _nets(design).items()),
    )
    for fault in _faults_of_folds(laminate, design):
        raise DesignError(fault)
    joinings(laminate)
    return laminate


def _nets(design: DrawnDesign) -> Mapping[str, tuple[str, ...]]:
    return {} if design.nets is None else design.nets.by_name


def _faults(design: DrawnDesign) -> Iterator[str]:
    """Yield what makes parts no laminate; each fault rests on those before it."""
    yield from _faults_of_names(design)
    if design.registration.method == "ears" and design.pins is None:
        yield (
            "registration.method = 'ears' adds parts to layers, and drawn ones stay as they are; "
            'set it to "channel-pin", or draw the ears and list their pins'
        )
    yield from _faults_of_order(design.layer_roles)
    yield from _faults_of_joints(design)
    yield from _faults_of_nets(design)
    count = sum(design.chamber_gaps.values())
    if not count:
        yield (
            "layers has no gap with a chamber; lay a chamber-mask between two films, or bond them "
            "by seams"
        )
    if count != design.stack.balloons:
        yield (
            f"stack.balloons = {design.stack.balloons}, and layers has {count} gaps with a "
            "chamber; each balloon has one: leave stack.balloons out, or correct the roles"
        )
    for number, chamber in enumerate(design.chambers):
        for balloon in chamber.balloons or ():
            if not 1 <= balloon <= count:
                yield (
                    f"chambers.{number}.balloons = {balloon} is none of the {count} gaps with a "
                    "chamber; they count from 1 at the bottom"
                )


def _faults_of_names(design: DrawnDesign) -> Iterator[str]:
    """Yield missing chambers, and duplicate names and centres."""
    chambers, ports = design.chambers, design.ports or ()
    if not chambers and not any(port.kind == "hole" for port in ports):
        yield (
            "chambers is missing; add a list of {name, centres, mouth, angle}, or a port of kind "
            '"hole" to a net'
        )
    for chamber in chambers:
        for centre in _twice(chamber.centres):
            yield f"chambers has the centre {list(centre)} of {chamber.name} twice; remove one"
    names = [chamber.name for chamber in chambers]
    for key, rows in (("chamber", names), ("seam", [seam.name for seam in design.seams or ()])):
        for name in _twice(rows):
            yield f"{key}s has {shown(name)} twice; give each {key} its name"
    for name in _twice([*names, *(port.name for port in ports)]):
        yield (
            f"ports has {shown(name)}, which is the name of another port or chamber; give each its "
            "own"
        )


def _faults_of_joints(design: DrawnDesign) -> Iterator[str]:
    """Yield folds, seams and ports that do not lie between neighbouring films."""
    ports = design.ports or ()
    pairs = design.chamber_gaps
    joints = [
        (f"fold of layers {f.lower} and {f.upper}", (f.lower, f.upper)) for f in design.stated_folds
    ]
    joints += [(f"seam {seam.name}", seam.layers) for seam in design.seams or ()]
    joints += [(f"port {port.name}", port.layers) for port in ports]
    for joint, pair in joints:
        if pair not in pairs:
            yield (
                f"{joint}: layers {list(pair)} are not two films that lie next to each other, "
                f"which are {', '.join(str(list(pair)) for pair in pairs)}"
            )
    first, *_, last = [*pairs, *pairs]
    for port in ports:
        if port.kind == "hole" and port.layers not in (first, last):
            yield (
                f"port {port.name} is a hole between layers {list(port.layers)}, and a tube goes "
                f"through the bottom or the top film; give {list(first)} or {list(last)}, or join "
                "them by a hole in each film between"
            )


def _twice(values: Sequence[Any]) -> list[Any]:
    return [value for number, value in enumerate(values) if value in values[:number]]


def _faults_of_order(roles: Sequence[str]) -> Iterator[str]:
    """Yield the reasons why layers form no stack."""
    masks = [role.endswith("-mask") for role in roles]
    if masks.count(False) < 2:
        yield f"layers has {masks.count(False)} structural films; a laminate has two at least"
    for number in (1, len(roles)):
        if masks[number - 1]:
            yield (
                f"layer {number} is a {roles[number - 1]} with no film on its other side; masks "
                "lie between films: add one, or remove the mask"
            )
    for number, (role, mask) in enumerate(zip(roles[1:], roles, strict=False), start=2):
        if role.endswith("-mask") and mask.endswith("-mask") and role != mask:
            yield (
                f"layer {number} is a {role} on a {mask}: masks between two films have one role, "
                "that of the gap"
            )


def _faults_of_nets(design: DrawnDesign) -> Iterator[str]:
    """Yield members of nets that do not exist, or that are in two nets."""
    names = [chamber.name for chamber in design.chambers]
    names += [port.name for port in design.ports or ()]
    home: dict[str, str] = {}
    for net, members in _nets(design).items():
        for member in members:
            if member not in names:
                remedy = hint(member, names)
                yield f"nets.{net} names {shown(member)}, which is not a port or chamber; {remedy}"
            if member in home:
                where = "twice" if home[member] == net else f"and so does nets.{home[member]}"
                yield f"nets.{net} names {shown(member)} {where}; a port belongs to one net, once"
            home[member] = net


LEAST_OVERLAP = 1e-4
"""Largest area that counts as rounding, mm2."""


def _turned(stack: tuple[Layer, ...], design: DrawnDesign) -> tuple[Layer, ...]:
    """Return the layers, with face-down ones turned over, and folded ones as separate patterns."""
    turned = {number: bool(row.turned) for number, row in enumerate(design.layers, start=1)}
    for fold in design.stated_folds:
        # A film that is folded over lies with its other face up.
        turned[fold.upper] = not turned[fold.lower]
    if not any(turned.values()):
        return stack
    folded = {index for fold in design.stated_folds for index in (fold.lower, fold.upper)}
    patterns: dict[tuple[str, Region, int, bool], str] = {}
    placed = []
    for layer in stack:
        own = layer.index if layer.index in folded else 0
        shape = layer.film.material, layer.profile, own, turned[layer.index]
        pattern = patterns.setdefault(shape, f"P{len(patterns) + 1:02d}")
        placed.append(replace(layer, turned=turned[layer.index], pattern=pattern))
    return tuple(placed)


def _faults_of_folds(laminate: Laminate, design: DrawnDesign) -> Iterator[str]:
    """Yield folds about which a film cannot be folded."""
    uppers = [fold.upper for fold in laminate.folds]
    for fold, stated in zip(laminate.folds, design.stated_folds, strict=True):
        lower, upper = laminate.layer(fold.lower), laminate.layer(fold.upper)
        name = f"fold of layers {fold.lower} and {fold.upper}"
        if lower.film != upper.film:
            yield (
                f"{name}: they are of {lower.film.material} and {upper.film.material}, and halves "
                "of one film are of one; give both the same film"
            )
        if uppers.count(fold.upper) > 1:
            yield f"{name}: layer {fold.upper} is folded over twice; remove one fold"
        way = design.layers[fold.upper - 1].turned
        if way is not None and way != upper.turned:
            yield (
                f"{name}: layer {fold.upper} has turned = {str(way).lower()}, and folding turns it "
                "the other way up; leave it out"
            )
        for layer in (lower, upper):
            if not any(lies_on(edge, [fold.line]) for edge in layer.profile.edges):
                (x, y), (u, v) = stated.line
                yield (
                    f"{name}: layer {layer.index} has no edge on the line from x {x:g}, y {y:g} to "
                    f"x {u:g}, y {v:g}; both halves end at the line with a straight edge"
                )
        over = lower.profile & unfolded(upper.profile, [fold.line])
        if over.area > LEAST_OVERLAP:
            x, y = over.edges[0].at(0.5)
            yield (
                f"{name}: laid flat the halves lie over each other on {over.area:.3f} mm2, at "
                f"x {x:.3f}, y {y:.3f}; both must lie on one side of the line"
            )
    for root in {fold.lower for fold in laminate.folds}.difference(uppers):
        flat = laminate.as_cut(laminate.layer(root))
        if len(flat.pieces) > len(laminate.layer(root).profile.pieces):
            yield (
                f"fold of layer {root}: laid flat its halves fall into {len(flat.pieces)} parts, "
                "for they do not meet on the line; let their edges there overlap"
            )


def _seam_path(seam: DrawnSeam, shapes: ShapeRegions) -> tuple[tuple[Edge, ...], ...]:
    if seam.shape is not None:
        region = shapes.of(seam.shape, f"seam {seam.name}")
        return tuple(contour.edges for contour in region.contours)
    marks = marks_of(seam.path or ())
    return (polyline(marks, closed=seam.closed and marks[0][:2] != marks[-1][:2]),)


def _pins(design: DrawnDesign, bores: Sequence[Bore]) -> tuple[Pin, ...]:
    if design.pins is not None:
        return tuple(Pin(pin.name, pin.at, pin.diameter, pin.clearance) for pin in design.pins)
    pins = [channel_pin(f"chamber{n}", b.centre, design.bore) for n, b in enumerate(bores, 1)]
    if design.lumen is not None:
        pins.append(Pin("lumen", (0.0, 0.0), design.lumen))
    return tuple(pins)


FAMILY = Family(DrawnDesign, build)
