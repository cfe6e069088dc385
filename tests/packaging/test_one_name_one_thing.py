"""A public class or type has its name to itself, wherever in the package it stands."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "sbafab"
WORDS_OF_FILES = {"Bore", "Chamber", "Inlet", "Line", "Stack", "Tube"}
"""Tables of a design or assembly file, which are called as the things that they ask for."""


def public_types(module: Path) -> Iterator[str]:
    """Classes, and names such as ``Kerf = float | tuple[float, float]``."""
    for node in ast.parse(module.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef):
            name = node.name
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            if isinstance(node.value, ast.Call):  # a type variable
                continue
            name = node.targets[0].id
        else:
            continue
        if name[0].isupper() and not name.isupper():
            yield name


def test_no_two_modules_use_one_name_for_two_things() -> None:
    places: dict[str, list[str]] = defaultdict(list)
    for module in sorted(PACKAGE.rglob("*.py")):
        for name in public_types(module):
            places[name].append(module.relative_to(PACKAGE).as_posix())
    twice = {name: where for name, where in places.items() if len(where) > 1}
    assert {name: twice[name] for name in twice.keys() - WORDS_OF_FILES} == {}
    assert twice.keys() >= WORDS_OF_FILES
