"""The studio without a server, in Chromium: Python runs in the page, and nobody else is asked.

``SBAFAB_PYODIDE`` names a folder with Pyodide and the wheels for it (docs/studio.md); without it
these are skipped. With the wheel of numpy there, the page also cuts, predicts and moves.
"""

from __future__ import annotations

import functools
import http.server
import io
import os
import threading
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from sbafab import api
from sbafab.studio import without_server
from tests.studio.browsing import Watched, chromium, colours, picture, share_changed

PYODIDE = os.environ.get("SBAFAB_PYODIDE", "")
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not PYODIDE, reason="SBAFAB_PYODIDE names no folder"),
    pytest.mark.skipif(chromium() is None, reason="Chromium or Playwright is not installed"),
]
PATIENCE = 240.0
"""Seconds: Python in the page is slower than beside it, and starts in two workers."""


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, bool]]:
    """The link of a plain web server on the folder, and whether numpy is in it."""
    written = without_server.write(tmp_path_factory.mktemp("www") / "studio", Path(PYODIDE))
    handler = functools.partial(Quiet, directory=written.folder.parent)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/studio/", "numpy" not in written.lacks
        server.shutdown()


@pytest.fixture(scope="module")
def seen(chrome: Any, page: tuple[str, bool]) -> Iterator[Watched]:
    watched = Watched(chrome, page[0])
    watched.until("Boolean(window.studio?.laminate)", PATIENCE)
    watched.page.get_by_role("dialog", name="Open a design").wait_for()
    watched.page.keyboard.press("Escape")
    yield watched
    assert watched.complaints == []
    assert watched.hosts == {page[0].split("/")[2]}
    watched.close()


def current(seen: Watched) -> None:
    seen.until("!Object.values(studio.stale).some(Boolean)", PATIENCE)


def test_a_knob_turns_layers_and_rules_without_a_server(
    seen: Watched, page: tuple[str, bool]
) -> None:
    current(seen)
    before = picture(seen, "#view-solid .surface")
    assert colours(before) > 6
    field = seen.page.get_by_label("chamber.diameter, mm")
    field.fill("6.5")
    field.press("Enter")
    seen.until("studio.text.includes('diameter = 6.5')", PATIENCE)
    current(seen)
    assert share_changed(before, picture(seen, "#view-solid .surface")) > 0.02
    design = api.load("3dof-15mm", "chamber.diameter=6.5")
    assert seen.say("studio.laminate.bounds") == pytest.approx(list(api.build(design).bounds))
    rules = [(rule, [f.measured for f in found]) for rule, found in api.checking(design)]
    theirs = rules if page[1] else rules[:-2]
    own = seen.say("studio.running.map(a => [a.rule, a.findings.map(f => f.measured)])")
    assert [rule for rule, _ in own] == [rule for rule, _ in theirs]
    for (rule, measured), (_, expected) in zip(own, theirs, strict=True):
        assert measured == pytest.approx(expected), rule
    assert (seen.say("studio.unmeasured") is None) == page[1]


def test_an_error_stands_at_its_field_and_undo_mends_it(seen: Watched) -> None:
    field = seen.page.get_by_label("bond.width, mm")
    field.fill("-1")
    field.press("Enter")
    seen.page.locator(".row.bad .why").wait_for(timeout=1000 * PATIENCE)
    seen.page.keyboard.press("Control+z")
    seen.until("studio.error === null", PATIENCE)
    current(seen)


def test_cut_files_come_as_a_zip_if_every_rule_was_measured(
    seen: Watched, page: tuple[str, bool], tmp_path: Path
) -> None:
    seen.say("studio.edit([['stack.balloons', '4'], ['chamber.diameter', '5']])")
    seen.until("studio.laminate.balloons === 4", PATIENCE)
    current(seen)
    seen.page.get_by_role("button", name="Make", exact=True).click()
    seen.page.get_by_role("button", name="Cut", exact=True).click()
    if not page[1]:
        seen.until(
            "document.querySelector('.make [role=status]').textContent.includes('needs numpy')",
            PATIENCE,
        )
        assert seen.page.get_by_role("link", name="Download zip").count() == 0
        return
    seen.until("Boolean(document.querySelector('.make .list button'))", PATIENCE)
    with seen.page.expect_download() as coming:
        seen.page.get_by_role("link", name="Download zip").click()
    assert coming.value.suggested_filename == "3dof-15mm.zip"
    archive = zipfile.ZipFile(io.BytesIO(Path(coming.value.path()).read_bytes()))
    run = api.cut("3dof-15mm", "stack.balloons=4", out=tmp_path)
    paths = [path for path in run.folder.rglob("*") if path.suffix in {".dxf", ".svg", ".lbrn2"}]
    assert len(paths) > 15
    for path in paths:
        name = f"3dof-15mm/{path.relative_to(run.folder).as_posix()}"
        assert archive.read(name) == path.read_bytes()
    assert colours(picture(seen, ".make .show")) > 3


def test_a_link_holds_the_design_and_save_downloads_it(
    seen: Watched, chrome: Any, page: tuple[str, bool]
) -> None:
    seen.page.get_by_role("button", name="Share", exact=True).click()
    link = seen.page.get_by_label("Link that holds the design").input_value()
    assert link.startswith(f"{page[0]}#design=")
    seen.page.keyboard.press("Escape")
    with seen.page.expect_download() as coming:
        seen.page.keyboard.press("Control+s")
    assert Path(coming.value.path()).read_text(encoding="utf-8") == seen.say("studio.text")
    other = Watched(chrome, link)
    other.until("Boolean(window.studio?.laminate)", PATIENCE)
    assert other.say("studio.text") == seen.say("studio.text")
    assert other.complaints == []
    other.close()


def test_the_actuator_moves_where_numpy_is(seen: Watched, page: tuple[str, bool]) -> None:
    seen.page.get_by_role("tab", name="Motion").click()
    if page[1]:
        seen.until("Boolean(studio.motion.pose)", PATIENCE)
        assert seen.say("studio.motion.pose.height") > 2
    else:
        seen.until("studio.motion.trust.textContent.includes('needs numpy')", PATIENCE)
