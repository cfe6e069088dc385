"""The API's reference: complete, and every number says its unit."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any

import pytest

import sbafab
from sbafab import api

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
FUNCTIONS = re.findall(r"^\.\. autofunction:: (\w+)$", PAGE, re.MULTILINE)
ENTRY = re.compile(r"^\.\. autoclass:: ([\w.]+)\(\)\n(?:   :members:([ \w,]*)\n)?", re.MULTILINE)
RECORDS: dict[str, str] = dict(ENTRY.findall(PAGE))
UNIT = re.compile(
    r"(?<![\w])(mm[23]?|kPa|MPa|ul(/s)?|ml/min|N|mN|g|kg/m3|C|s|min|uJ|degrees|Degrees|rad|"
    r"(?i:ul|kpa)|share|ratio|over|``unit``|unit)(?!\w)"
)
IN_NAME = re.compile(r"_(mm|kpa|mpa|ul|ml_min|n|g|c|deg|s|minutes)$|^(minutes|seconds)$")
"""What says the unit in the name itself."""
NUMBER = re.compile(r"\b(float|Array|NDArray\[np\.float64\]|Point|Bounds|Vector)\b")
RAISES_NOTHING = {"templates", "schema", "resolved", "drawing", "dimensions"}


def described(owner: Any) -> str:
    return " ".join((inspect.getdoc(owner) or "").split())


def says_unit(name: str, text: str) -> bool:
    """Whether a name carries its unit, or a sentence that has the name in it says one."""
    if IN_NAME.search(name):
        return True
    sentences = re.split(r"(?<=[.;:])\s", text)
    return any(re.search(rf"\b{name}\b", one) and UNIT.search(one) for one in sentences)


def record(path: str) -> type:
    module, _, name = path.rpartition(".")
    found = getattr(import_module(module), name)
    assert isinstance(found, type)
    return found


def attribute_texts(owner: type) -> dict[str, str]:
    """What stands as a text below a field in the source of a class."""
    body = ast.parse(textwrap.dedent(inspect.getsource(owner))).body[0]
    assert isinstance(body, ast.ClassDef)
    found = {}
    for field, text in zip(body.body, body.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
            found[ast.unparse(field.target)] = ast.literal_eval(text.value)
    return found


def shown_members(owner: type, members: str) -> Iterator[tuple[str, Any]]:
    """Methods and properties that the page shows of a record."""
    names = {name.strip() for name in members.split(",") if name.strip()}
    for name, member in vars(owner).items():
        is_function = isinstance(member, FunctionType | property | cached_property | classmethod)
        if is_function and not name.startswith("_") and (name in names or not names):
            yield name, member


def test_the_page_has_every_function_and_every_record_that_they_return() -> None:
    names = {path.rpartition(".")[2] for path in RECORDS}
    assert sbafab.__all__ == api.__all__
    assert set(FUNCTIONS) | {"Source", "DesignError"} | names >= set(sbafab.__all__)
    assert sorted(FUNCTIONS) == sorted(name for name in sbafab.__all__ if name.islower())
    others = {"Iterator", "Assembly", "Drawing", "Dimension", "Any", "None"}
    for name in FUNCTIONS:
        returned = inspect.signature(getattr(sbafab, name)).return_annotation
        assert set(re.findall(r"[A-Z]\w+", returned)) <= names | others, name


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_a_function_says_units_and_errors(name: str) -> None:
    function = getattr(sbafab, name)
    text = described(function)
    assert text.partition(".")[0]
    assert "Raises" in text or name in RAISES_NOTHING
    for parameter in inspect.signature(function).parameters.values():
        if NUMBER.search(str(parameter.annotation)):
            assert says_unit(parameter.name, text), parameter.name


@pytest.mark.parametrize("path", RECORDS)
def test_a_record_says_the_unit_of_every_number(path: str) -> None:
    owner = record(path)
    text = described(owner)
    assert text
    assert not text.startswith(f"{owner.__name__}("), "dataclass itself wrote this"
    assert [*fields_without_unit(owner), *members_without_words(path)] == []


def fields_without_unit(owner: type) -> Iterator[str]:
    text, below = described(owner), attribute_texts(owner)
    for name, kind in vars(owner).get("__annotations__", {}).items():
        is_number = NUMBER.search(str(kind)) and not name.startswith("_")
        if is_number and not (says_unit(name, text) or UNIT.search(below.get(name, ""))):
            yield name


def members_without_words(path: str) -> Iterator[str]:
    """Methods and properties on the page without a docstring, or without the number's unit."""
    if f":: {path}()\n   :members:" not in PAGE:
        return
    for name, member in shown_members(record(path), RECORDS[path]):
        plain = member.fget if isinstance(member, property) else member
        plain = getattr(plain, "func", getattr(plain, "__func__", plain))
        said, returned = described(plain), str(plain.__annotations__.get("return", ""))
        if not said or (NUMBER.search(returned) and not UNIT.search(said)):
            yield f"{name} -> {returned}: {said}"


def test_a_number_without_its_unit_is_told() -> None:
    assert says_unit("h", "The side ``h`` in mm.")
    assert says_unit("pressures_kpa", "")
    assert not says_unit("h", "The side ``h`` of triangles. Lengths are mm.")
