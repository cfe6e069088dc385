"""The gallery: every template and further designs, each checked, drawn and predicted anew."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import sbafab
from sbafab.assemblies.build import Assembled
from sbafab.assemblies.files import load
from sbafab.assemblies.records import Assembly
from sbafab.design.files import template_names, templates_folder
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.models.figures import LEFT_OUT, Figure, Prediction
from sbafab.models.mechanisms import NOT_CALIBRATED
from sbafab.reports.solid_pictures import assembly_pngs, solid_png
from sbafab.rules.finding import counted

DESIGNS = Path(__file__).parents[1] / "gallery"
PIXELS = (720, 540)
FIGURES = (
    ("outline diameter", "across", 1),
    ("folded height", "flat", 2),
    ("free stroke at 10 kPa", "stroke at 10 kPa", 1),
    ("reference stroke", "reference stroke", 1),
    ("blocked force at 10 kPa, flat", "blocked force at 10 kPa", 2),
    ("blocked force at 10 kPa, flat, at most", "blocked force at 10 kPa at most", 2),
    ("bend at 10 kPa in one chamber, the others empty", "bend at 10 kPa in one chamber", 0),
    ("inflated diameter", "inflated", 1),
    ("deflated diameter", "deflated", 1),
)
"""Figures of the prediction, what they are called here, and their decimals."""

NUMBERS = (
    ("outline diameter", "inflated diameter"),
    ("free stroke at 10 kPa", "reference stroke", "folded height"),
    (
        "bend at 10 kPa in one chamber, the others empty",
        "blocked force at 10 kPa, flat",
        "blocked force at 10 kPa, flat, at most",
        "deflated diameter",
    ),
)
"""Figures of a card: of each row the first that the prediction has."""

HEAD = """# Gallery

Designs that pass every rule, drawn and predicted by the build of this site. Pictures show the flat actuator, heights
enlarged as stated. How far each number is trusted: [prediction](../prediction.md). *Model / paper 1.33*: on the paper's own actuator the
model gives 1.33 times the measured value. A range is the 90 % interval of what would be measured, or that of a drawn
pocket.

## Templates

`sbafab new NAME` writes the commented file.
"""
BEYOND = """
## Other designs

Nobody has built these. Save a file and run `sbafab generate FILE`.
"""


def write_gallery(folder: Path) -> None:
    """Write the page, its pictures and copies of its design files.

    Raises DesignError where a design fails a rule.
    """
    target = folder / "gallery"
    target.mkdir()
    for drawing in DESIGNS.glob("*.svg"):
        (target / drawing.name).write_bytes(drawing.read_bytes())
    templates = [_card(name, target) for name in template_names()]
    others = [_card(str(path), target) for path in sorted(DESIGNS.glob("*.toml"))]
    parts = [HEAD, _grid(templates), BEYOND, _grid(others)]
    (folder / "gallery.md").write_text("\n".join(parts), encoding="utf-8")


def _grid(cards: Sequence[str]) -> str:
    return "\n".join(["::::{container} cards", *cards, "::::", ""])


def _card(source: str, target: Path) -> str:
    """Return the card of a design: picture, name, one sentence, three numbers, file."""
    found = load(source)
    path = Path(source) if source.endswith(".toml") else templates_folder() / f"{source}.toml"
    findings = sbafab.check(source)
    if findings.failed:
        raise DesignError(f"{found.name} of the gallery fails: {findings.failed[0].message}")
    picture = f"{found.name}.png"
    (target / picture).write_bytes(_picture(found, source))
    (target / path.name).write_bytes(path.read_bytes())
    text = path.read_text(encoding="utf-8")
    if isinstance(found, Design):
        prediction = sbafab.predict(found)
        numbers = list(numbers_of(prediction))
        every = "; ".join(figures_of(prediction, found))
    else:
        assembled = sbafab.assemble(source)
        numbers = list(_counts(found, assembled))
        every = ", ".join(found.parts)
    rows = "\n".join(f"* **{value}** {name}{aside}" for name, value, aside in numbers)
    return f""":::{{container}} card
![{found.name}, flat](gallery/{picture})

**{found.name}**. {_first_sentence(text)}

{rows}

{{download}}`{path.name} <gallery/{path.name}>`

<details><summary>All figures</summary>

{every}. {counted(findings)}.

</details>
:::
"""


def numbers_of(prediction: Prediction) -> Iterator[tuple[str, str, str]]:
    """Yield the three numbers of an actuator, each with its interval or the model's known error."""
    known = _to_design_with(prediction)
    called = {name: (words, digits) for name, words, digits in FIGURES}
    for line in prediction.verdict:
        value, _, words = line.figure.partition(", ")
        if line.quantity != LEFT_OUT and NOT_CALIBRATED in line.note:
            yield words, value, ""
    for choices in NUMBERS:
        figure = next((known[name] for name in choices if name in known), None)
        if figure is None:
            continue
        words, digits = called[figure.name]
        value = f"{figure.value:.{digits}f} {figure.unit}"
        if figure.interval is not None:
            low, high = figure.interval
            value += f" ({low:.{digits}f} to {high:.{digits}f})"
        if figure.between is not None:
            low, high = figure.between
            value += f" ({low:.{digits}f} to {high:.{digits}f})"
        aside = "" if figure.measured is None else f" (model / paper {figure.measured.ratio:.2f})"
        yield words, value, aside


def _to_design_with(prediction: Prediction) -> dict[str, Figure]:
    """Return the figures by name, each by the model to design with."""
    return {figure.name: figure for figure in prediction.figures if not figure.other}


def _counts(found: Assembly, assembled: Assembled) -> Iterator[tuple[str, str, str]]:
    actuators = sum(part.kind == "sba" for part in found.parts.values())
    counts = {"part": len(found.parts), "actuator": actuators, "design": len(assembled.designs)}
    for name, count in counts.items():
        yield (name if count == 1 else f"{name}s"), str(count), ""


def _first_sentence(text: str) -> str:
    """The comment that a design file begins with, its first line."""
    return text.partition("\n")[0].lstrip("# ")


def _picture(found: Design | Assembly, source: str) -> bytes:
    if isinstance(found, Assembly):
        return assembly_pngs(sbafab.assemble(source))[0]
    return solid_png(sbafab.build(found), *PIXELS)


def figures_of(found: Prediction, design: Design) -> Iterator[str]:
    """Key figures of a card, each with what the paper measured where the model is far off."""
    yield f"{len(sbafab.build(design).layers)} layers"
    known = _to_design_with(found)
    for name, called, digits in FIGURES:
        figure = known.get(name)
        if figure is not None:
            unit = "degrees" if figure.unit == "deg" else figure.unit
            yield f"{called} {figure.value:.{digits}f} {unit} {figure.aside}".strip()
