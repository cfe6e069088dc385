"""Worker processes: the newest wish of a tab is worked on, what it replaces ends."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from sbafab import api
from sbafab.studio.editing import edited
from sbafab.studio.workers import Worker
from tests.studio.worked import job

LONG = [("stack.balloons", "2"), ("rules.yield_builds", "1000000")]
SHORT = [("stack.balloons", "3"), ("rules.yield_builds", "100")]


@pytest.mark.long
def test_a_change_that_comes_during_the_yield_is_worked_on_at_once(tmp_path: Path) -> None:
    text = api.template("1dof-5mm")

    async def heard(worker: Worker, asked: dict[str, Any], changed: asyncio.Event) -> list[str]:
        found = []
        async for line in worker.answers(("tab", "live"), asked):
            answer = json.loads(line)
            found.append(answer.get("rule", answer["kind"]))
            if found[-1] == "registration-worst-case":
                changed.set()
        return found

    async def both() -> tuple[list[str], list[str]]:
        worker, changed = Worker(60, warm=False), asyncio.Event()
        try:
            first = asyncio.create_task(heard(worker, job(tmp_path, edited(text, LONG)), changed))
            await changed.wait()
            await asyncio.sleep(0.2)
            newer = job(tmp_path, edited(text, SHORT))
            second = await heard(worker, newer, asyncio.Event())
            return await first, second
        finally:
            worker.stop()

    first, second = asyncio.run(both())
    assert first[-2:] == ["registration-worst-case", "superseded"]
    assert second[-2:] == ["registration-yield", "checked"]
