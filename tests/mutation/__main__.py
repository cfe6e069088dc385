"""``python -m tests.mutation rules=25 cutting=25``: small faults, and whether tests see them.

A sample of changes, one at a time, in a copy of the tree: another operator or number, a condition
turned round. Constants of modules and decorated functions are among them, which mutmut leaves out;
texts are not. Each change is shown to its room's own tests, and what survives those to neighbours'.
``rules/nets,voids=12`` draws from these modules alone.
"""

from __future__ import annotations

import argparse
import ast
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent.parent
NEIGHBOURS = {
    "rules": ("tests/regressions", "tests/faults", "tests/folders"),
    "cutting": ("tests/folders", "tests/faults", "tests/regressions"),
    "pressing": ("tests/reports",),
    "folders": ("tests/faults",),
    "models": ("tests/validation",),
}
SWAPPED: dict[type[ast.AST], str] = {
    ast.Lt: "<=",
    ast.LtE: "<",
    ast.Gt: ">=",
    ast.GtE: ">",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.Is: "is not",
    ast.IsNot: "is",
    ast.In: "not in",
    ast.NotIn: "in",
    ast.Add: "-",
    ast.Sub: "+",
    ast.Mult: "/",
    ast.Div: "*",
    ast.And: "or",
    ast.Or: "and",
}
MOST_SECONDS = 600


class Mutant(NamedTuple):
    """One change: the file, the span of its text (in characters), and what is put there."""

    file: Path
    start: int
    end: int
    new: str
    line: int

    def said(self, source: str) -> str:
        old = " ".join(source[self.start : self.end].split())
        return f"{self.file.relative_to('sbafab')}:{self.line}: {old!r} -> {self.new!r}"


def mutants_of(file: Path, source: str) -> Iterator[Mutant]:
    """Every change of one file, in the order of the text."""
    tree = ast.parse(source)
    starts = [0]
    for text in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(text))
    data = source.encode()

    def place(line: int, column: int) -> int:
        return len(data[: starts[line - 1] + column].decode())

    def between(left: ast.expr, right: ast.expr, new: str) -> Mutant:
        """The operator between two operands, with whatever parentheses stand beside it."""
        first = place(left.end_lineno or 0, left.end_col_offset or 0)
        last = place(right.lineno, right.col_offset)
        head = source[first:last]
        tail = head.lstrip(") \n")
        core = tail.rstrip("( \n")
        start = first + len(head) - len(tail)
        return Mutant(file, start, start + len(core), new, left.end_lineno or 0)

    annotated = {
        id(inner)
        for node in ast.walk(tree)
        for name in ("annotation", "returns")
        if isinstance(hint := getattr(node, name, None), ast.expr)
        for inner in ast.walk(hint)
    }
    for node in ast.walk(tree):
        if id(node) in annotated:
            continue
        if isinstance(node, ast.BinOp) and type(node.op) in SWAPPED:
            yield between(node.left, node.right, SWAPPED[type(node.op)])
        elif isinstance(node, ast.BoolOp):
            yield between(node.values[0], node.values[1], SWAPPED[type(node.op)])
        elif isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPPED:
            yield between(node.left, node.comparators[0], SWAPPED[type(node.ops[0])])
        elif isinstance(node, ast.If | ast.IfExp | ast.While):
            test = node.test
            start = place(test.lineno, test.col_offset)
            end = place(test.end_lineno or 0, test.end_col_offset or 0)
            yield Mutant(file, start, end, f"not ({source[start:end]})", test.lineno)
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
            value = node.value
            new = str(not value) if isinstance(value, bool) else repr(value * 2 if value else 1)
            start = place(node.lineno, node.col_offset)
            end = place(node.end_lineno or 0, node.end_col_offset or 0)
            yield Mutant(file, start, end, new, node.lineno)


def sampled(home: Path, room: str, modules: list[str], count: int, seed: int) -> list[Mutant]:
    """So many changes of a room, or of some modules, that still are Python, drawn with a seed."""
    every: list[Mutant] = []
    for path in sorted((home / "sbafab" / room).glob("*.py")):
        if modules and path.stem not in modules:
            continue
        source = path.read_text(encoding="utf-8")
        found = mutants_of(path.relative_to(home), source)
        every += sorted({*found}, key=lambda m: (m.start, m.new))
    draw = Random(f"{seed}/{room}")
    draw.shuffle(every)
    chosen = []
    for mutant in every:
        source = (home / mutant.file).read_text(encoding="utf-8")
        try:
            before = ast.dump(ast.parse(source))
            if ast.dump(ast.parse(changed(source, mutant))) != before:
                chosen.append(mutant)
        except SyntaxError:
            continue
        if len(chosen) == count:
            break
    return chosen


def changed(source: str, mutant: Mutant) -> str:
    return source[: mutant.start] + mutant.new + source[mutant.end :]


def likely(home: Path, room: str, mutant: Mutant) -> tuple[str, ...]:
    """The room's tests that name the changed module: most changes are seen by these."""
    name = mutant.file.stem
    files = sorted((home / "tests" / room).glob("test_*.py"))
    found = [path for path in files if name in path.read_text(encoding="utf-8")]
    return tuple(str(path.relative_to(home)) for path in found or files)


def is_seen(home: Path, tests: tuple[str, ...]) -> bool:
    """Whether any of these tests fails in a copy of the tree; one that takes no end sees it."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider"]
    environment = {**os.environ, "PYTHONPATH": str(home), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        run = subprocess.run(
            [*command, *tests],
            cwd=home,
            env=environment,
            capture_output=True,
            check=False,
            timeout=MOST_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return True
    return run.returncode != 0


def main() -> int:
    """Print a line for each change and the counts of each room; exit code 1 if any survived."""
    asked = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    asked.add_argument("rooms", nargs="+", metavar="ROOM=COUNT", help="how many of each room")
    asked.add_argument("--seed", type=int, default=29, help="which are drawn [29]")
    asked.add_argument("--start", type=int, default=0, help="number of the first one [0]")
    reach = asked.add_mutually_exclusive_group()
    reach.add_argument("--own", action="store_true", help="only the tests that name the module")
    reach.add_argument("--room", action="store_true", help="only the tests of the module's room")
    given = asked.parse_args()
    left = 0
    with tempfile.TemporaryDirectory() as place:
        home = Path(place) / "tree"
        shutil.copytree(ROOT, home, ignore=shutil.ignore_patterns(".git", "__pycache__", "out"))
        for said in given.rooms:
            where, _, count = said.partition("=")
            room, _, names = where.partition("/")
            modules = [name for name in names.split(",") if name]
            survived = []
            chosen = sampled(home, room, modules, int(count), given.seed)[given.start :]
            for mutant in chosen:
                target = home / mutant.file
                source = target.read_text(encoding="utf-8")
                target.write_text(changed(source, mutant), encoding="utf-8")
                own = likely(home, room, mutant)
                shown = [own, (f"tests/{room}",), *((one,) for one in NEIGHBOURS.get(room, ()))]
                most = 1 if given.own else 2 if given.room else None
                seen = any(is_seen(home, tests) for tests in shown[:most])
                target.write_text(source, encoding="utf-8")
                if not seen:
                    survived.append(mutant)
                print("killed  " if seen else "SURVIVED", mutant.said(source), flush=True)
            print(f"{room}: {len(chosen)} run, {len(survived)} survived", flush=True)
            left += len(survived)
    return 1 if left else 0


if __name__ == "__main__":
    raise SystemExit(main())
