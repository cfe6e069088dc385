"""Records do not change after they are made, but for a few that hold a state."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import sbafab

ROOT = Path(sbafab.__file__).parent
STATES = {
    "as_built/expected.py": {"_ContourGroup"},
    "models/stack.py": {"Motion"},
    "models/stack_batch.py": {"BatchMotion"},
    "output/artefacts.py": {"DesignFolder"},
    "pressing/work_plan.py": {"_Bookings"},
    "rules/voids.py": {"VoidGraph"},
    "studio/app.py": {"Studio"},
    "studio/model.py": {"AnswerShapes"},
    "studio/workers.py": {"WaitingJob"},
}
"""Dataclasses that gather or step: by module."""


def unfrozen(tree: ast.Module) -> Iterator[str]:
    """Yield the names of dataclasses that may be changed."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.ClassDef):
            continue
        for mark in node.decorator_list:
            call = mark.func if isinstance(mark, ast.Call) else mark
            if not isinstance(call, ast.Name) or call.id != "dataclass":
                continue
            options = mark.keywords if isinstance(mark, ast.Call) else []
            values = {option.arg: ast.literal_eval(option.value) for option in options}
            if values.get("frozen") is not True:
                yield node.name


def test_records_are_frozen() -> None:
    changeable = {
        path.relative_to(ROOT).as_posix(): names
        for path in sorted(ROOT.rglob("*.py"))
        if (names := set(unfrozen(ast.parse(path.read_text(encoding="utf-8")))))
    }
    assert changeable == STATES
