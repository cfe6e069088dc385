"""A tutorial's page as steps that can be run: files to write, commands, what they must print."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

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
    """Makes the change that a ``diff`` block shows: its file, the old line, the new line."""
    head, old, new = text.splitlines()
    path = folder / head.removeprefix("--- ")
    before = path.read_text(encoding="utf-8")
    assert before.count(old[1:]) == 1, f"{old[1:]!r} in {path}"
    path.write_text(before.replace(old[1:], new[1:]), encoding="utf-8")


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
