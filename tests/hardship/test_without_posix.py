"""Where there is no POSIX: what such a system lacks is taken away, and what is read is the source.

Neither Windows nor macOS is at hand; this is what can be known without them.
"""

from __future__ import annotations

import ast
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from sbafab.cli import main
from sbafab.folders import swap
from sbafab.folders.swap import SCHEMA, replaced_folder
from sbafab.simulators import simulator

PACKAGE = Path(__file__).parents[2] / "sbafab"
POSIX_ONLY = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}


def nodes(words: set[str]) -> Iterator[tuple[str, ast.AST]]:
    """Every node, with its place, of the modules in which one of these words occurs."""
    written = re.compile(rf"\b({'|'.join(words)})\b")
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if written.search(text):
            for node in ast.walk(ast.parse(text)):
                line = getattr(node, "lineno", 0)
                yield f"{path.relative_to(PACKAGE)}:{line}", node


def imported(words: set[str]) -> set[str]:
    """Those of the words that are imported somewhere."""
    return words & {
        alias.name
        for _, node in nodes(words)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }


def test_no_module_is_imported_that_only_posix_has() -> None:
    assert imported({"tomllib"}) == {"tomllib"}
    assert imported(POSIX_ONLY) == set()


def test_text_files_have_one_encoding_and_line_feeds_everywhere() -> None:
    wanted = {"read_text": {"encoding"}, "write_text": {"encoding", "newline"}}
    found = [
        (where, wanted[node.func.attr] - {keyword.arg for keyword in node.keywords})
        for where, node in nodes(set(wanted))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        # An encoding may be given by its place.
        and node.func.attr in wanted
        and not (node.func.attr == "read_text" and node.args)
    ]
    assert len(found) > 20
    assert [one for one in found if one[1]] == []


def test_a_folder_is_replaced_without_an_exchange_of_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(swap.sys, "platform", "win32")
    target = tmp_path / "run"
    for text in ("one", "two"):
        with replaced_folder(target) as folder:
            (folder / "manifest.json").write_text(json.dumps({"schema": SCHEMA, "text": text}))
        assert json.loads((target / "manifest.json").read_text())["text"] == text
    assert [name for name in os.listdir(tmp_path) if name.endswith(".part")] == []


def test_a_simulator_is_stopped_without_groups_of_processes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delattr(os, "killpg")
    monkeypatch.delattr(signal, "SIGKILL")
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    simulator._end(process)
    assert process.poll() is not None


def test_commands_run_without_signals_of_posix(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("SIGHUP", "SIGPIPE", "SIGKILL"):
        monkeypatch.delattr(signal, name)
    with pytest.raises(SystemExit) as ended:
        main(["check", "nosuch"])
    assert ended.value.code == 2
    assert "neither a template" in capsys.readouterr().err
