"""The gallery: every template and further designs, each checked, drawn and predicted anew."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import sbafab
from sbafab.assemblies.files import load
from sbafab.assemblies.records import Assembly
from sbafab.design.files import template_names, templates_folder
from sbafab.design.records import Design
from sbafab.errors import DesignError
from sbafab.models.figures import Prediction
from sbafab.reports.assembly_png import assembly_png
from sbafab.reports.solid_png import solid_png
from sbafab.rules.finding import counted

DESIGNS = Path(__file__).parents[1] / "gallery"
PIXELS = (720, 540)
FIGURES = (
    ("outline diameter", "across", 1),
    ("deflated height", "flat", 2),
    ("full stroke", "full stroke", 1),
    ("blocked force at 10 kPa, flat", "blocked force at 10 kPa", 2),
    ("blocked force at 10 kPa, flat, at most", "blocked force at 10 kPa at most", 2),
    ("bend at 10 kPa in one chamber, the others empty", "bend at 10 kPa in one chamber", 0),
)
"""Figures of the prediction, what they are called here, and their decimals."""

HEAD = """# Gallery

Designs that no rule fails, drawn and predicted by the build of this site. Each picture shows the flat actuator, heights
enlarged as it says; the file below it makes the actuator. Predictions have the trust that
[prediction](../prediction.md) states; what the paper measured stands beside what is off by more than a quarter. Nobody has
built the designs of the second part.

## Designs that ship

`sbafab new NAME` writes the commented file.
"""
BEYOND = """
## Beyond the paper

Files to start from: save one and run the command below it.
"""


def write_gallery(folder: Path) -> None:
    """The page, its pictures and copies of its design files. Raises where a design fails a rule."""
    target = folder / "gallery"
    target.mkdir()
    for drawing in DESIGNS.glob("*.svg"):
        (target / drawing.name).write_bytes(drawing.read_bytes())
    parts = [HEAD]
    parts += ["\n".join(_entry(name, target)) for name in template_names()]
    parts.append(BEYOND)
    parts += ["\n".join(_entry(str(path), target)) for path in sorted(DESIGNS.glob("*.toml"))]
    (folder / "gallery.md").write_text("\n".join(parts), encoding="utf-8")


def _entry(source: str, target: Path) -> Iterator[str]:
    """Heading, words, picture, figures, file and command of one design."""
    found = load(source)
    is_template = not source.endswith(".toml")
    path = templates_folder() / f"{source}.toml" if is_template else Path(source)
    findings = sbafab.check(source)
    if findings.failed:
        raise DesignError(f"{found.name} of the gallery fails: {findings.failed[0].message}")
    picture = f"{found.name}.png"
    (target / picture).write_bytes(_picture(found, source))
    (target / path.name).write_bytes(path.read_bytes())
    text = path.read_text(encoding="utf-8")
    yield f"\n### {found.name}\n"
    yield f"{_first_sentence(text)}\n"
    yield f"![{found.name}, flat](gallery/{picture}){{width=600px}}\n"
    held = counted(findings)
    if isinstance(found, Design):
        yield _told(f"{', '.join(figures_of(sbafab.predict(found), found))}; {held}.")
    else:
        yield _told(f"An assembly of {', '.join(found.parts)}; {held}.")
    argument = found.name if is_template else path.name
    yield f"    sbafab generate {argument}\n"
    yield _file(path.name, text)


def _told(words: str) -> str:
    """A paragraph in the style of key figures."""
    return f"{{.key-figures}}\n{words}\n"


def _file(name: str, text: str) -> str:
    return (
        f"<details><summary>{name}</summary>\n\n```toml\n{text.rstrip()}\n```\n\n</details>\n\n"
        f"{{download}}`{name} <gallery/{name}>`\n"
    )


def _first_sentence(text: str) -> str:
    """The comment that a design file begins with, its first line."""
    return text.partition("\n")[0].lstrip("# ")


def _picture(found: Design | Assembly, source: str) -> bytes:
    if isinstance(found, Assembly):
        return assembly_png(sbafab.assemble(source))
    return solid_png(sbafab.build(found), *PIXELS)


def figures_of(found: Prediction, design: Design) -> Iterator[str]:
    """Key figures of a card, each with what the paper measured where the model is far off."""
    yield f"{len(sbafab.build(design).layers)} layers"
    for name, called, digits in FIGURES:
        figure = next((one for one in found.figures if one.name == name), None)
        if figure is not None:
            unit = "degrees" if figure.unit == "deg" else figure.unit
            yield f"{called} {figure.value:.{digits}f} {unit} {figure.aside}".strip()
