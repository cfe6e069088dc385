"""A studio that is asked too much: whole answers or a refusal, and no tab that waits for another.

A server is started as a person starts it, and asked over sockets.
"""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import pytest

from sbafab import api
from sbafab.studio.jobs import edited
from tests.quick import few
from tests.studio.browsing import served

PARALLEL = 48
"""Requests at once, more than a studio takes."""
SMALL = edited(api.template("1dof-5mm"), [("stack.balloons", "1"), ("rules.yield_builds", "100")])
SLOW = edited(
    api.template("3dof-15mm"),
    [
        ("chamber.count", "8"),
        ("chamber.axis_radius", "9"),
        ("stack.balloons", "60"),
        ("rules.yield_builds", "1000000"),
    ],
)
"""Half a minute of work."""
PATIENCE = 120.0
"""Seconds: other work may share the machine."""


class Answer(NamedTuple):
    """Status, headers and body of an answer that came whole."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def kinds(self) -> list[str]:
        """Kinds of its lines, each of which is JSON."""
        return [json.loads(line)["kind"] for line in self.body.splitlines()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("chosen")


@pytest.fixture(scope="module")
def link(folder: Path) -> Iterator[str]:
    (folder / "own.toml").write_text(SMALL, encoding="utf-8")
    with served(folder) as link:
        yield link


def opened(link: str, path: str, body: Any = None) -> http.client.HTTPConnection:
    """A request that is sent; nothing of its answer is read."""
    parts = urlsplit(link)
    connection = http.client.HTTPConnection(parts.netloc, timeout=PATIENCE)
    headers = {"X-Sbafab-Token": parts.fragment.removeprefix("token=")}
    content = None if body is None else json.dumps(body)
    connection.request("GET" if body is None else "POST", path, content, headers)
    return connection


def asked(link: str, path: str, body: Any = None) -> Answer:
    """The whole answer. Raises HTTPException where it is cut short."""
    connection = opened(link, path, body)
    try:
        answer = connection.getresponse()
        return Answer(answer.status, dict(answer.getheaders()), answer.read())
    finally:
        connection.close()


@pytest.mark.parametrize("path", ["/api/live", "/api/generate"])
def test_parallel_requests_are_answered_whole_or_refused(link: str, path: str) -> None:
    """Refused before the answer has begun: 200 and a body cut short would be neither."""
    answers: list[Answer] = []
    broken: list[Exception] = []

    def ask(tab: int) -> None:
        # What generate would write fails at once: the text is no design.
        text = SMALL if path == "/api/live" else 'family = "none"'
        try:
            answers.append(asked(link, path, {"tab": f"tab{tab}", "text": text}))
        except (http.client.HTTPException, OSError) as error:
            broken.append(error)

    threads = [threading.Thread(target=ask, args=(tab,)) for tab in range(PARALLEL)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert broken == []
    statuses = Counter(answer.status for answer in answers)
    assert sum(statuses.values()) == PARALLEL
    assert set(statuses) <= {200, 503}
    assert statuses[200] > 0
    last = "checked" if path == "/api/live" else "error"
    for answer in answers:
        if answer.status == 200:
            assert answer.kinds[-1] == last
        else:
            assert len(answer.body) == int(answer.headers["content-length"])
            assert "too many requests at once" in json.loads(answer.body)["message"]
            assert answer.headers["retry-after"] == "1"


def test_a_slow_design_in_a_tab_holds_no_other(link: str) -> None:
    slow = opened(link, "/api/live", {"tab": "slow", "text": SLOW})
    try:
        begun = slow.getresponse()
        assert json.loads(begun.readline())["kind"] == "text"
        # Answered while the other still works on a million builds.
        answer = asked(link, "/api/live", {"tab": "other", "text": SMALL})
        assert answer.kinds[-1] == "checked"
        # The slow one is given up for a newer one of its tab.
        newer = asked(link, "/api/live", {"tab": "slow", "text": SMALL})
        assert newer.kinds[-1] == "checked"
        assert json.loads(begun.read().splitlines()[-1])["kind"] == "superseded"
    finally:
        slow.close()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs here")
def test_a_fifo_in_the_folder_stops_nothing(link: str, folder: Path) -> None:
    os.mkfifo(folder / "f.toml")
    os.mkfifo(folder / "f.svg")
    try:
        refused = asked(link, "/api/file/f.toml")
        assert refused.status == 422
        assert "f.toml is not a regular file" in json.loads(refused.body)["message"]
        saved = asked(link, "/api/save", {"name": "f.toml", "text": SMALL})
        assert saved.status == 422
        assert "f.toml is not a regular file" in json.loads(saved.body)["message"]
        assert (folder / "f.toml").is_fifo()
        # Nor does a design that names one.
        text = edited(SMALL, [("chamber.outline", '"f.svg"'), ("chamber.diameter", None)])
        named = asked(link, "/api/live", {"tab": "fifo", "text": text})
        assert "is not a regular file" in json.loads(named.body.splitlines()[-1])["message"]
        watched = opened(link, "/api/watch/f.toml")
        assert json.loads(watched.getresponse().readline()) == {"sha": ""}
        watched.close()
        start = json.loads(asked(link, "/api/start").body)
        assert start["files"] == ["own.toml"]
    finally:
        (folder / "f.toml").unlink()
        (folder / "f.svg").unlink()


def test_a_file_too_long_for_a_design_is_not_read(link: str, folder: Path) -> None:
    (folder / "long.toml").write_bytes(b"#" * 2_000_001)
    try:
        answer = asked(link, "/api/file/long.toml")
        assert answer.status == 422
        assert "a design file holds at most 2,000,000" in json.loads(answer.body)["message"]
    finally:
        (folder / "long.toml").unlink()


@pytest.mark.skipif(sys.platform == "win32", reason="no such signals")
@pytest.mark.parametrize("number", few([signal.SIGINT, signal.SIGTERM], 1))
def test_the_end_of_the_studio_speaks_of_nothing_else(tmp_path: Path, number: int) -> None:
    # What starts the tests may ignore signals (nohup), and a child would inherit that.
    program = (
        f"import signal; signal.signal({int(number)}, signal.SIG_DFL); "
        "from sbafab.entry import main; main()"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    process = subprocess.Popen(
        [sys.executable, "-c", program, "studio", "--no-browser"],
        cwd=tmp_path,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    link = process.stdout.readline().split()[-1]
    assert asked(link, "/api/start").status == 200
    process.send_signal(number)
    _, complaint = process.communicate(timeout=PATIENCE)
    assert (process.returncode, complaint) == (128 + number, "sbafab: the studio has stopped\n")
    assert list(tmp_path.iterdir()) == []
