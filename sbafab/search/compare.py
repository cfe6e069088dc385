"""Compare two designs: differences in keys, rules and predicted figures, and a page with
pictures.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AliasPath, Field
from pydantic.json_schema import SkipJsonSchema

from sbafab.actuators import load_design
from sbafab.design.files import Change
from sbafab.design.identity import design_sha256
from sbafab.design.records import Design
from sbafab.documents import Document, PlainNumber, Short, attribute
from sbafab.errors import DesignError
from sbafab.folders.build import Build, make_build
from sbafab.folders.swap import replace_text, writing
from sbafab.laminate.burst import refuse_beyond_burst
from sbafab.models.actuator import model_form
from sbafab.models.balloons import has_balloons
from sbafab.models.calibration import factors_of
from sbafab.models.figures import PredictionRequest
from sbafab.models.pneumatics import usual_pressures
from sbafab.models.prediction import predict
from sbafab.models.quantity import ANYWHERE, Conditions, Quantity
from sbafab.models.stack import MOST_PRESSURE, stack
from sbafab.reports.solid_pictures import WHY, PictureRequest, pictures_at_one_scale, solid_png
from sbafab.runtime import Progress, ignore_progress
from sbafab.search.sweep_report import FIRST, PageSection, page_html
from sbafab.search.trials import margin, worst_findings
from sbafab.search.vary import NOTHING, KeyDifference, format_value, key_values
from sbafab.version import GENERATOR

FOLDER, PAGE = "compare", "compare.html"
MAIN = {
    **dict.fromkeys(FIRST, ANYWHERE),
    Quantity.FREE_STROKE: ANYWHERE,
    Quantity.BEND: Conditions(chambers=1),
    Quantity.BLOCKED_FORCE: Conditions(share=0.0),
    Quantity.WATER_TIME: ANYWHERE,
    Quantity.SHUT_STIFFNESS: ANYWHERE,
}
"""The most important figures, at these conditions."""
DIGITS = 4
"""Figures that agree to this many significant digits count as equal."""
SIZE = 640, 512
"""Width of a picture, pixels."""
Pair = tuple[Any, Any]
"""Findings or figures of both designs, None of one that has none."""
ShortOrNone = Short | None
MeasuredEnds = tuple[Short, Short]
Key = TypeVar("Key")
Value = TypeVar("Value")


@dataclass(frozen=True)
class ComparedDesign:
    """One of the two designs: ``source`` is the argument, ``failed`` are the rules that fail."""

    source: str
    checked: Build
    failed: list[str]

    @property
    def design(self) -> Design:
        """The design that was checked."""
        return self.checked.design

    @property
    def design_sha256(self) -> str:
        """Hash of the design."""
        return design_sha256(self.design)


NumberOrNone = float | None
TextOrNone = str | None


class RuleDifference(Document):
    """A rule whose verdict or margin differs, or its measured value without a limit; None if a
    design has no such finding.
    """

    rule: str
    unit: str
    verdicts: tuple[TextOrNone, TextOrNone]
    margins: tuple[NumberOrNone, NumberOrNone]
    """distance to the limit"""
    measured: tuple[NumberOrNone, NumberOrNone]


class FigurePair(Document):
    """A figure of both designs; None if a design lacks it."""

    quantity: Annotated[Quantity, SkipJsonSchema(), Field(exclude=True)]
    name: str
    unit: str
    main: bool
    """true if the command prints it"""
    differs: bool
    """true if the values differ in the first four digits, or one is missing"""
    values: tuple[ShortOrNone, ShortOrNone]
    intervals: tuple[MeasuredEnds | None, MeasuredEnds | None]
    """90 % intervals, if a calibration says so"""
    models: tuple[TextOrNone, TextOrNone]


@dataclass(frozen=True)
class DesignComparison:
    """Two designs and their differences. Values are in the order of ``designs``."""

    designs: tuple[ComparedDesign, ComparedDesign]
    keys: tuple[KeyDifference, ...]
    rules: tuple[RuleDifference, ...]
    figures: tuple[FigurePair, ...]
    pressures_kpa: tuple[float, ...]

    @property
    def names(self) -> tuple[str, str]:
        """Names of the designs; if these are equal, their sources."""
        a, b = self.designs
        pairs = (a.design.name, b.design.name), (Path(a.source).name, Path(b.source).name)
        return next((pair for pair in pairs if pair[0] != pair[1]), (a.source, b.source))

    def as_dict(self) -> dict[str, Any]:
        """Return the content of ``compare --json``."""
        return CompareDocument.of(self)


class DesignEntry(Document):
    """One of the two designs."""

    name: str = attribute("design.name")
    source: str
    family: str = attribute("design.family")
    design_sha256: str
    failed: list[str]


class CompareDocument(Document, schema="sbafab/compare@1"):
    """The content of ``compare --json``."""

    designs: tuple[DesignEntry, DesignEntry]
    keys: list[KeyDifference]
    rules: list[RuleDifference]
    figures: list[FigurePair]
    folder: str = ""


def load_compared(source: str | Path, changes: Iterable[Change] = ()) -> Design:
    """Return the design of a template, a design file or an output folder. Raises DesignError if
    there is none.
    """
    file = Path(source) / "design.toml"
    with suppress(OSError):  # a text too long for a path
        source = file if file.is_file() else source
    return load_design(source, changes)


def compare(
    first: Design,
    second: Design,
    sources: tuple[str, str] = ("A", "B"),
    pressures_kpa: Sequence[float] | None = None,
    flow_ml_min: float = PredictionRequest.flow_ml_min,
    progress: Progress = ignore_progress,
) -> DesignComparison:
    """Return the differences between two designs, at pressures in kPa, by default the first of
    ``usual_pressures``. Raises DesignError if one cannot be built, and for pressures or a flow out
    of range.
    """
    if pressures_kpa is not None and not pressures_kpa:
        raise DesignError("pressures_kpa is empty; a comparison needs at least one pressure")
    each = []
    for number, (design, source) in enumerate(zip((first, second), sources, strict=True)):
        progress(f"predicting {design.name}", number, 2)
        made = make_build(design)
        pressures = tuple(pressures_kpa or usual_pressures(design.form)[:1])
        request = PredictionRequest(pressures, flow_ml_min)
        figures = {
            (figure.quantity, figure.at): figure
            for figure in predict(design, request, made.laminate).figures
            if not figure.other or (figure.interval and _is_main(figure.quantity, figure.at))
        }
        rules = worst_findings(made.findings)
        failed = [name for name, rule in rules.items() if rule.verdict == "fail"]
        each.append((ComparedDesign(source, made, failed), key_values(design), rules, figures))
    designs, keys, both_rules, both_figures = zip(*each, strict=True)
    differences = [_rule(name, pair) for name, pair in _paired(*both_rules)]
    return DesignComparison(
        designs,
        tuple(KeyDifference(k, two) for k, two in _paired(*keys) if k != "name" and _differ(two)),
        tuple(rule for rule in differences if _differ(rule.verdicts) or _differ(_judged(rule))),
        tuple(_figure(of, at, pair) for (of, at), pair in _paired(*both_figures)),
        tuple(pressures_kpa or usual_pressures(first.form)[:1]),
    )


def _paired(
    a: Mapping[Key, Value], b: Mapping[Key, Value]
) -> list[tuple[Key, tuple[Value | None, Value | None]]]:
    """Return both values of each key, None if a design lacks it."""
    return [(key, (a.get(key), b.get(key))) for key in dict.fromkeys([*a, *b])]


def _differ(pair: Sequence[object]) -> bool:
    return pair[0] != pair[1]


def _rule(name: str, pair: Pair) -> RuleDifference:
    return RuleDifference.read(
        None,
        rule=name,
        unit=next(finding.unit for finding in pair if finding),
        verdicts=[finding and finding.verdict for finding in pair],
        margins=[finding and margin(finding) for finding in pair],
        measured=[finding and finding.measured for finding in pair],
    )


def _judged(rule: RuleDifference) -> list[float | None]:
    """Return both margins; a yield without a limit still differs by its value."""
    pairs = zip(rule.margins, rule.measured, strict=True)
    return [value if left is None else left for left, value in pairs]


def _figure(quantity: Quantity, at: Conditions, pair: Pair) -> FigurePair:
    digits = [figure and f"{figure.value:.{DIGITS}g}" for figure in pair]
    return FigurePair.read(
        None,
        quantity=quantity,
        name=quantity.named(at),
        unit=quantity.unit,
        main=_is_main(quantity, at),
        differs=_differ(digits),
        values=[figure and figure.value for figure in pair],
        intervals=[figure and figure.interval for figure in pair],
        models=[figure and figure.model.title for figure in pair],
    )


def _is_main(quantity: Quantity, at: Conditions) -> bool:
    return quantity in MAIN and at.meet(MAIN[quantity])


# Words of the table and the page.


ComparedRows = list[tuple[str, ...]]


def key_rows(keys: Iterable[KeyDifference]) -> ComparedRows:
    """Return the keys that differ, with the value in each design."""
    return [(row.key, *map(format_value, row.values)) for row in keys]


def rule_rows(rules: Iterable[RuleDifference]) -> ComparedRows:
    """The rules that differ, with both verdicts and margins, or measured values without a limit."""
    rows: ComparedRows = []
    for rule in rules:
        cells = []
        for verdict, left, value in zip(rule.verdicts, rule.margins, _judged(rule), strict=True):
            word = "" if left is None else "margin "
            text = "" if value is None else f", {word}{value:.3g} {rule.unit}"
            cells.append(NOTHING if verdict is None else f"{verdict}{text}".rstrip())
        rows.append((rule.rule, *cells))
    return rows


def figure_rows(pairs: Iterable[FigurePair]) -> ComparedRows:
    """Return the figures that differ, with both values and 90 % intervals."""
    rows: ComparedRows = []
    for pair in pairs:
        cells = []
        for value, interval in zip(pair.values, pair.intervals, strict=True):
            ends = f" ({interval[0]:.3g} to {interval[1]:.3g})" if interval else ""
            cells.append(NOTHING if value is None else f"{value:.4g}{ends}")
        rows.append((f"{pair.name}, {pair.unit}", *cells))
    return rows


# The page.


def write_page(comparison: DesignComparison, out: Path) -> Path:
    """Write ``out``/compare/compare.html beside an old one, swap it in, and return its folder.

    Raises OutputError if it cannot be written.
    """
    page = out / FOLDER / PAGE
    with writing(page):
        page.parent.mkdir(parents=True, exist_ok=True)
        replace_text(page, compare_html(comparison))
    return page.parent


def compare_html(comparison: DesignComparison) -> str:
    """Return the whole page of a comparison."""
    names, designs = comparison.names, comparison.designs
    head = ("", *names)
    keys, rules = key_rows(comparison.keys), rule_rows(comparison.rules)
    pairs = sorted(comparison.figures, key=lambda pair: not pair.main)
    grey = [number for number, pair in enumerate(pairs) if not pair.differs]
    intervals = "In parentheses the 90 % interval of what would be measured; grey figures agree."
    verdicts = [
        f"{name}: " + (f"fails {', '.join(each.failed)}" if each.failed else "passes every rule")
        for name, each in zip(names, designs, strict=True)
    ]
    same = "" if rules else "No verdict or margin differs."
    sections = [
        _flat(comparison),
        _inflated(comparison),
        PageSection("Keys", head=head, rows=keys, note="" if keys else "No key differs."),
        PageSection("Rules", head=head, rows=rules, note=same),
        PageSection("Figures", head=head, rows=figure_rows(pairs), grey=grey, note=intervals),
    ]
    first, second = (each.design_sha256[:12] for each in designs)
    footer = (
        f"Designs {first} and {second}, {GENERATOR}. Models and validity of each figure: sbafab "
        "predict -v."
    )
    return page_html(" and ".join(names), verdicts, sections, footer)


def _flat(comparison: DesignComparison) -> PageSection:
    uris = (_uri(solid_png(each.checked.laminate, *SIZE)) for each in comparison.designs)
    return PageSection("Flat", pictures=[*zip(comparison.names, uris, ("", ""), strict=True)])


def _inflated(comparison: DesignComparison) -> PageSection:
    """Return pictures at one scale: one chamber is filled if there are several."""
    pressure = comparison.pressures_kpa[0]
    bodies, notes = [], ["", ""]
    for number, each in enumerate(comparison.designs):
        design, laminate = each.design, each.checked.laminate
        form = model_form(design)
        if not has_balloons(form):
            notes[number] = WHY
            continue
        try:
            refuse_beyond_burst(laminate, pressure)
            most = max(MOST_PRESSURE, pressure)
            together = stack(design, laminate, most, factors_of(design), form)
            pose = together.pose((pressure, *(0.0,) * (together.chambers - 1)))
            bodies.append((laminate, together, pose))
        except DesignError as error:
            notes[number] = str(error)
    wish = PictureRequest({}, width=SIZE[0], height=SIZE[1])
    drawn = map(_uri, pictures_at_one_scale(bodies, wish))
    uris = ["" if note else next(drawn) for note in notes]
    title = f"Inflated at {pressure:g} kPa; of parallel chambers only the first"
    return PageSection(title, pictures=[*zip(comparison.names, uris, notes, strict=True)])


def _uri(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"


# A design changed as little as a target yield needs, compared with the original.


DESIGNS = "as given", "changed"


class ChangeEntry(Document):
    """A key, and its original and changed values."""

    key: str
    given: Any = Field(validation_alias=AliasPath("values", 0), serialization_alias="from")
    changed: Any = Field(validation_alias=AliasPath("values", 1), serialization_alias="to")


class YieldEntry(Document):
    """The result of --target-yield; figures before and after the changes."""

    target_yield: PlainNumber = attribute("target")
    changes: list[ChangeEntry]
    measured: float | None = attribute("share.value")
    interval: tuple[float, float] | None = attribute("share.interval")
    message: str = attribute("sentence")
    figures: list[FigurePair]
