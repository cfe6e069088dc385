"""Every tutorial works as it is written."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

BLOCK = re.compile(r"^```(\S*)[ ]?(\S*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
OPTION = re.compile(r"^:(\w+): (.*)\n", re.MULTILINE)
DOWNLOAD = re.compile(r"\{download\}`(\S+) <(\S+)>`")


class Step(NamedTuple):
    """A block of the page: its language, its options and its text."""

    kind: str
    options: dict[str, str]
    text: str


def steps(page: Path) -> Iterator[Step]:
    """The fenced blocks of a page in order; ``{code-block} toml`` is of the kind ``toml``."""
    for language, argument, body in BLOCK.findall(page.read_text(encoding="utf-8")):
        kind = argument if language == "{code-block}" else language
        options, text = {}, body
        if language.startswith("{"):
            options = dict(OPTION.findall(body))
            text = OPTION.sub("", body).lstrip("\n")
        yield Step(kind, options, text)


def follow(page: Path, folder: Path, environment: dict[str, str]) -> int:
    """Does what the page says in a folder; how many commands' outputs were compared.

    Raises AssertionError where a command fails or prints something else.
    """
    for name, source in DOWNLOAD.findall(page.read_text(encoding="utf-8")):
        shutil.copyfile(page.parent / source, folder / name)
    said, compared = "", 0
    for step in steps(page):
        if "caption" in step.options:
            (folder / step.options["caption"]).write_text(step.text, encoding="utf-8")
        elif step.kind == "diff":
            _change(step.text, folder)
        elif step.kind == "sh" and _can_run(step):
            said = _run(step.text, folder, environment)
        elif step.kind == "output" and _can_run(step):
            _compare(step.text, said)
            compared += 1
    return compared


def _can_run(step: Step) -> bool:
    program = step.options.get("class", "").removeprefix("needs-")
    return not program or shutil.which(program) is not None


def _run(commands: str, folder: Path, environment: dict[str, str]) -> str:
    done = subprocess.run(
        ["bash", "-e", "-o", "pipefail", "-c", commands],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{commands}{done.stdout}"
    return done.stdout


def _change(text: str, folder: Path) -> None:
    """Make the changes that a ``diff`` block shows: its file, then old lines, each run followed by
    the lines that take its place.
    """
    head, _, body = text.partition("\n")
    path = folder / head.removeprefix("--- ")
    content = path.read_text(encoding="utf-8")
    for old, new in re.findall(r"((?:^-.*\n)+)((?:^\+.*\n)+)", body, re.MULTILINE):
        before, after = (re.sub(r"^[-+]", "", run, flags=re.MULTILINE) for run in (old, new))
        assert content.count(before.rstrip("\n")) == 1, before
        content = content.replace(before.rstrip("\n"), after.rstrip("\n"))
    path.write_text(content, encoding="utf-8")


def _compare(expected: str, said: str) -> None:
    """Every line that the page shows is printed, in this order; breaks and spaces do not count.

    A line of three dots stands for what the page leaves out. The number of rules that pass may
    differ: it grows with the deck.
    """
    rest = _normalised(said)
    for line in expected.splitlines():
        words = _normalised(line)
        if words == "...":
            continue
        _, found, rest = rest.partition(words)
        assert found, f"{words!r} is not printed after what stands above it:\n{said}"


def _normalised(text: str) -> str:
    return re.sub(r"passed: \d+ rules", "passed: rules", " ".join(text.split()))


# The tutorials.


ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "learn").glob("*.md"))
NOTEBOOKS = {"python"}
"""Run by the build of the site."""


def environment(folder: Path) -> dict[str, str]:
    """With an ``sbafab`` that runs this source with this Python."""
    bin_ = folder / "bin"
    bin_.mkdir()
    command = bin_ / "sbafab"
    command.write_text(
        f'#!/bin/sh\nexec "{sys.executable}" -c "from sbafab.entry import main; main()" "$@"\n'
    )
    command.chmod(0o755)
    path = os.pathsep.join((str(bin_), os.environ["PATH"]))
    return {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "COLUMNS": "80"}


@pytest.mark.long
@pytest.mark.parametrize(
    "page", [p for p in PAGES if p.stem not in NOTEBOOKS], ids=lambda p: p.stem
)
def test_a_tutorial_works_as_written(page: Path, tmp_path: Path) -> None:
    desk = tmp_path / "desk"
    desk.mkdir()
    assert follow(page, desk, environment(tmp_path)) > 0


def test_a_tutorial_that_says_something_else_fails(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```sh\necho one two\n```\n\n```output\none\ntwo\n```\n")
    assert follow(page, tmp_path, dict(os.environ)) == 1
    page.write_text("```sh\necho one two\n```\n\n```output\ntwo\none\n```\n")
    with pytest.raises(AssertionError, match="'one' is not printed"):
        follow(page, tmp_path, dict(os.environ))
    page.write_text("```sh\nfalse\n```\n")
    with pytest.raises(AssertionError):
        follow(page, tmp_path, dict(os.environ))
