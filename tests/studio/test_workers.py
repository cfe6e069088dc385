"""Worker processes: the newest wish of a tab is worked on, what it replaces ends."""

from __future__ import annotations

import asyncio
import json
import math
import os
import signal
from pathlib import Path

import pytest

from sbafab import api
from sbafab.studio.jobs import edited
from sbafab.studio.workers import MOST_WAITING, BusyError, WaitingJob, WorkerPool
from tests.studio.asking import job

LONG = [("stack.balloons", "2"), ("rules.yield_builds", "1000000")]
SHORT = [("stack.balloons", "3"), ("rules.yield_builds", "100")]
TEXT = api.template("1dof-5mm")


async def heard(
    wish: WaitingJob, come: asyncio.Event, awaited: str = "registration-worst-case"
) -> list[str]:
    """Rules or kinds of the answers; ``come`` is set when the awaited one, before the yield, is."""
    found = []
    async for line in wish.lines():
        answer = json.loads(line)
        found.append(answer.get("rule", answer["kind"]))
        if found[-1] == awaited:
            come.set()
    return found


@pytest.mark.long
def test_a_change_that_comes_during_the_yield_is_worked_on_at_once(tmp_path: Path) -> None:
    async def both() -> tuple[list[str], list[str]]:
        pool, changed = WorkerPool(60, 2, warm=False), asyncio.Event()
        try:
            older = pool.ask(("tab", "live"), job(tmp_path, edited(TEXT, LONG)))
            first = asyncio.create_task(heard(older, changed))
            await changed.wait()
            await asyncio.sleep(0.2)
            newer = pool.ask(("tab", "live"), job(tmp_path, edited(TEXT, SHORT)))
            second = await heard(newer, asyncio.Event())
            # The tab's own process went on; no other was started for it.
            assert len(pool.workers) == 1
            return await first, second
        finally:
            pool.stop()

    first, second = asyncio.run(both())
    assert first[-2:] == ["registration-worst-case", "superseded"]
    assert second[-3:] == ["registration-yield", "nets", "checked"]


def test_work_without_a_step_is_stopped_when_a_newer_wish_comes(tmp_path: Path) -> None:
    """A laminate of many edges is one step of seconds; its process is replaced."""
    turns = [math.tau * number / 480 for number in range(480)]
    corners = [
        f"{(5 + 0.2 * (number % 2)) * math.cos(turn):.3f},"
        f"{(5 + 0.2 * (number % 2)) * math.sin(turn):.3f}"
        for number, turn in enumerate(turns)
    ]
    (tmp_path / "star.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="20mm" height="20mm" '
        f'viewBox="-10 -10 20 20"><path d="M{" L".join(corners)} Z"/></svg>',
        encoding="utf-8",
    )
    star = [("stack.balloons", "60"), ("chamber.outline", '"star.svg"'), ("chamber.diameter", None)]

    async def both() -> tuple[list[str], list[str], bool]:
        pool, begun = WorkerPool(60, 1, warm=False, patience=0.01), asyncio.Event()
        try:
            older = pool.ask(("tab", "live"), job(tmp_path, edited(TEXT, star)))
            first = asyncio.create_task(heard(older, begun, "design"))
            await begun.wait()
            await asyncio.sleep(0.2)  # past the step between design and laminate
            process = pool.workers[0].process
            newer = pool.ask(("tab", "live"), job(tmp_path, edited(TEXT, SHORT)))
            second = await heard(newer, asyncio.Event())
            return await first, second, pool.workers[0].process is process
        finally:
            pool.stop()

    first, second, same = asyncio.run(both())
    assert first == ["text", "design", "superseded"]
    assert second[-1] == "checked"
    assert not same


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="no process is held here")
def test_a_process_that_hangs_holds_its_own_tab_alone(tmp_path: Path) -> None:
    async def both() -> tuple[list[str], list[str], list[str]]:
        pool, begun = WorkerPool(60, 2, warm=False, patience=0.01), asyncio.Event()
        try:
            hung = pool.ask(("hung", "live"), job(tmp_path, edited(TEXT, LONG)))
            first = asyncio.create_task(heard(hung, begun))
            await begun.wait()
            assert pool.workers[0].process.pid is not None
            os.kill(pool.workers[0].process.pid, signal.SIGSTOP)
            other = pool.ask(("other", "live"), job(tmp_path, edited(TEXT, SHORT)))
            second = await heard(other, asyncio.Event())
            assert not first.done()
            newer = pool.ask(("hung", "live"), job(tmp_path, edited(TEXT, SHORT)))
            return await first, second, await heard(newer, asyncio.Event())
        finally:
            pool.stop()

    first, second, third = asyncio.run(both())
    assert first[-1] == "superseded"
    assert second[-1] == third[-1] == "checked"


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no process is killed here")
def test_a_killed_process_is_a_message_and_work_goes_on(tmp_path: Path) -> None:
    async def both() -> tuple[list[str], list[str]]:
        pool, begun = WorkerPool(60, 1, warm=False), asyncio.Event()
        try:
            killed = pool.ask(("tab", "live"), job(tmp_path, edited(TEXT, LONG)))
            first = asyncio.create_task(heard(killed, begun))
            await begun.wait()
            assert pool.workers[0].process.pid is not None
            os.kill(pool.workers[0].process.pid, signal.SIGKILL)
            told = await first
            newer = pool.ask(("tab", "live"), job(tmp_path, edited(TEXT, SHORT)))
            return told, await heard(newer, asyncio.Event())
        finally:
            pool.stop()

    first, second = asyncio.run(both())
    assert (first[-1], second[-1]) == ("crashed", "checked")


def test_a_pool_refuses_before_it_answers(tmp_path: Path) -> None:
    async def filled() -> None:
        pool = WorkerPool(60, 1, warm=False)
        try:
            wishes = [
                pool.ask((f"tab{number}", "live"), job(tmp_path, TEXT))
                for number in range(MOST_WAITING)
            ]
            with pytest.raises(BusyError):
                pool.ask(("one more", "live"), job(tmp_path, TEXT))
            # A newer wish of a tab takes the place of its older one.
            pool.ask(("tab3", "live"), job(tmp_path, TEXT))
            assert await heard(wishes[3], asyncio.Event()) == ["superseded"]
            # Whoever goes away leaves room.
            pool.forget(wishes[7])
            pool.ask(("one more", "live"), job(tmp_path, TEXT))
        finally:
            pool.stop()

    asyncio.run(filled())
