"""A page of the studio in Chromium, for the tests that look at it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.studio.browsing import DESIGN, FILE, Watched, browser, served


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("chosen")


@pytest.fixture(scope="module")
def link(folder: Path) -> Iterator[str]:
    (folder / FILE).write_text(DESIGN, encoding="utf-8")
    with served(folder, FILE) as found:
        yield found


@pytest.fixture(scope="module")
def chrome() -> Iterator[Any]:
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def tab(chrome: Any) -> Iterator[Watched]:
    watched = Watched(chrome, "about:blank")
    yield watched
    watched.close()


@pytest.fixture
def seen(tab: Watched, link: str, folder: Path) -> Iterator[Watched]:
    """The page with the design as the template has it; afterwards nothing may have complained."""
    (folder / FILE).write_text(DESIGN, encoding="utf-8")
    tab.load(link)
    tab.ready()
    yield tab
    assert tab.complaints == []
    assert len(tab.hosts) == 1
    assert next(iter(tab.hosts)).startswith("127.0.0.1:")
