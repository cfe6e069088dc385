"""Files of models from templates, as several simulators take them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from sbafab.markup import environment

if TYPE_CHECKING:
    from jinja2 import Environment


def model_file(
    template: Path,
    name: str,
    finish: Callable[[ET.Element], None] = lambda root: None,
    **values: object,
) -> str:
    """Return a file of XML that begins with a comment, from a template and its values.

    ``name`` is the actuator's, in the comment as ``title``; ``finish`` may change the elements.
    """
    # Two hyphens in a row would end the comment.
    title = name.replace("--", "- -")
    text = rendered(template, name=name, title=title, **values)
    head, end, body = text.partition("-->\n")
    root = ET.fromstring(body)
    finish(root)
    ET.indent(root, " ")
    return f"{head}{end}{ET.tostring(root, encoding='unicode')}\n"


def rendered(template: Path, **values: object) -> str:
    """Return a template with its values; the filter ``numbers`` is the function of that name."""
    return _environment(template.parent).get_template(template.name).render(values)


@cache
def _environment(folder: Path) -> Environment:
    templates = environment(folder)
    templates.filters |= {"numbers": numbers, "shown": lambda value, digits: f"{value:.{digits}g}"}
    return templates


def numbers(values: ArrayLike) -> str:
    """Format numbers with nine digits, spaces between them, and no minus before a zero."""
    return " ".join([f"{value + 0.0:.9g}" for value in np.ravel(values).tolist()])


def write_files(texts: Mapping[str, str], folder: Path) -> list[Path]:
    """Write files by name into a folder; return them in that order."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in texts]
