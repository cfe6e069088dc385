"""Requests to the studio's application, without a socket or a process."""

from __future__ import annotations

import asyncio
import base64
import zlib
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import httpx
from starlette.types import ASGIApp

from sbafab.studio.jobs import JOBS


class Client:
    """Asks an application; what it raises comes back as it is."""

    def __init__(self, application: ASGIApp, base_url: str) -> None:
        self.application, self.base_url = application, base_url

    def get(self, path: str, **options: Any) -> httpx.Response:
        return self.ask("GET", path, **options)

    def post(self, path: str, **options: Any) -> httpx.Response:
        return self.ask("POST", path, **options)

    def ask(self, method: str, path: str, **options: Any) -> httpx.Response:
        async def asked() -> httpx.Response:
            transport = httpx.ASGITransport(app=self.application)
            async with httpx.AsyncClient(transport=transport, base_url=self.base_url) as client:
                return await client.request(method, path, **options)

        return asyncio.run(asked())


def packed(text: str) -> str:
    """The text as it follows ``design=`` in a link, as the page packs it."""
    squeezer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    raw = squeezer.compress(text.encode("utf-8")) + squeezer.flush()
    return base64.urlsafe_b64encode(raw).decode("ascii").rstrip("=")


# Jobs of the studio run here and now, without a process of their own.


def job(folder: Path, text: str) -> dict[str, Any]:
    """The job of showing a design whose file would lie in the folder."""
    return {
        "do": "live",
        "text": text,
        "edits": [],
        "has": [],
        "folder": str(folder),
        "path": "design.toml",
    }


def answers(asked: dict[str, Any], beat: Callable[[], None] = lambda: None) -> list[dict[str, Any]]:
    """Everything that the job answers."""
    return list(JOBS[asked["do"]](asked, beat))


class EnoughError(Exception):
    """Nobody waits for the work any more."""


def given_up_at(beat: int) -> Callable[[], None]:
    """What a job calls as it goes on; that beat, counted from 1, raises EnoughError."""
    beats = count(1)

    def called() -> None:
        if next(beats) == beat:
            raise EnoughError

    return called
