"""What the modules of a folder import and define, read from their source once for all tests."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple


class Source(NamedTuple):
    """One module: the top-level names it imports, at any place, its dataclasses that may be
    changed, and the public classes and types at its top level.
    """

    path: Path
    imported: frozenset[str]
    unfrozen: frozenset[str]
    public_types: tuple[str, ...]


@cache
def sources(folder: Path) -> tuple[Source, ...]:
    """Return every module below the folder."""
    return tuple(_source(path) for path in sorted(folder.rglob("*.py")))


def _source(path: Path) -> Source:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported: set[str] = set()
    unfrozen: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            imported.add(node.module.partition(".")[0])
        elif isinstance(node, ast.ClassDef) and _is_changeable(node):
            unfrozen.add(node.name)
    types = tuple(_public_types(tree))
    return Source(path, frozenset(imported), frozenset(unfrozen), types)


def _is_changeable(node: ast.ClassDef) -> bool:
    """Return True for a dataclass that is not frozen."""
    for mark in node.decorator_list:
        call = mark.func if isinstance(mark, ast.Call) else mark
        if isinstance(call, ast.Name) and call.id == "dataclass":
            options = mark.keywords if isinstance(mark, ast.Call) else []
            values = {option.arg: ast.literal_eval(option.value) for option in options}
            return values.get("frozen") is not True
    return False


def _public_types(tree: ast.Module) -> Iterator[str]:
    """Classes, and names such as ``Kerf = float | tuple[float, float]``."""
    for node in tree.body:
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
