"""The studio's tutorial, done in a browser as it is written."""

from __future__ import annotations

import re
from pathlib import Path

from sbafab import api
from tests.studio.browsing import BROWSED, Watched, browser, served

PAGE = Path(__file__).parents[2] / "docs" / "learn" / "studio.md"
pytestmark = BROWSED
STEP = re.compile(r"Set \*\*([\w.]+)\*\* to `(\S+)`|(?:[Cc]lick|tick) \*\*([^*]+)\*\*")


def click(seen: Watched, name: str) -> None:
    page = seen.page
    places = (
        page.get_by_role("tab", name=name, exact=True),
        page.get_by_role("button", name=name, exact=True),
        page.locator(f".finding[data-rule='{name}']"),
        page.get_by_label(name, exact=True),
    )
    found = next((place for place in places if place.count()), None)
    assert found is not None, f"nothing to click is called {name}"
    found.first.click()


def test_the_tutorial_works_as_written(tmp_path: Path) -> None:
    (tmp_path / "gripper.toml").write_text(api.template("3dof-15mm"), encoding="utf-8")
    steps = STEP.findall(PAGE.read_text(encoding="utf-8"))
    assert len(steps) == 8
    with browser() as made, served(tmp_path, "gripper.toml") as link:
        seen = Watched(made, link)
        seen.ready()
        for key, value, name in steps:
            if key:
                seen.page.get_by_label(f"{key}, mm").fill(value)
                seen.ready()
            else:
                click(seen, name)
        seen.until("Boolean(document.querySelector('.make .list button'))")
        seen.close()
    design = api.load(tmp_path / "gripper.toml")
    assert design.chamber.diameter == 6
    assert (tmp_path / "out" / design.name / "traveller.html").exists()
