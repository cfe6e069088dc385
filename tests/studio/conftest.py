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
def link(folder: Path, request: pytest.FixtureRequest) -> Iterator[str]:
    """Of a studio that shows the DESIGN of a module in its FILE, or those of browsing."""
    file, design = (getattr(request.module, k, v) for k, v in (("FILE", FILE), ("DESIGN", DESIGN)))
    (folder / file).write_text(design, encoding="utf-8")
    with served(folder, file) as found:
        yield found


@pytest.fixture(scope="module")
def chrome() -> Iterator[Any]:
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def tab(chrome: Any, request: pytest.FixtureRequest) -> Iterator[Watched]:
    watched = Watched(chrome, "about:blank", **getattr(request.module, "VIEW", {}))
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
