"""The studio's routes."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
import shutil
import tempfile
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import Receive, Scope, Send

from sbafab import api
from sbafab.errors import SbafabError
from sbafab.process import processors
from sbafab.studio import places, requested
from sbafab.studio.guard import Guard, TooLongError, no_room
from sbafab.studio.made import Made, zipped
from sbafab.studio.workers import BusyError, WaitingJob, WorkerPool

STATIC = Path(__file__).parent / "static"
LIVE_SECONDS, MAKE_SECONDS = 60.0, 900.0
LOOK_EVERY = 0.4
"""Seconds between two looks at the file on disk."""
MOST_MADE = 6
"""Folders of runs that are kept; the oldest goes first."""


@dataclass
class Studio:
    """What the routes share: the chosen folder, the workers and the folders that runs wrote."""

    folder: Path
    token: str
    opened: str | None = None
    text: str | None = None
    """A design from a link, in place of a file."""
    template: str | None = None
    live: WorkerPool = field(default_factory=lambda: WorkerPool(LIVE_SECONDS, _processes()))
    mover: WorkerPool = field(
        default_factory=lambda: WorkerPool(LIVE_SECONDS, _processes(), warm=False)
    )
    # A run that is given up ends at its next step, where it tidies up.
    maker: WorkerPool = field(
        default_factory=lambda: WorkerPool(MAKE_SECONDS, _processes(), False, MAKE_SECONDS)
    )
    made: dict[str, Made] = field(default_factory=dict)
    scratch: Path = field(default_factory=lambda: Path(tempfile.mkdtemp(prefix="sbafab-studio-")))

    @contextlib.asynccontextmanager
    async def lifespan(self, _: Starlette) -> AsyncIterator[None]:
        self.live.start()
        try:
            yield
        finally:
            for pool in (self.live, self.mover, self.maker):
                pool.stop()
            shutil.rmtree(self.scratch, ignore_errors=True)


def _processes() -> int:
    """Processes of a pool; two at least, so that a slow design of one tab never holds another."""
    return max(2, processors())


def app(studio: Studio) -> Starlette:
    """The application; every request passes the guard first."""
    routes = [
        Route("/api/start", start),
        Route("/api/template/{name}", template),
        Route("/api/file/{name}", opened_file),
        Route("/api/save", save, methods=["POST"]),
        Route("/api/watch/{name}", watch),
        Route("/api/live", live, methods=["POST"]),
        Route("/api/elastic", elastic, methods=["POST"]),
        Route("/api/motion", motion, methods=["POST"]),
        Route("/api/generate", generate, methods=["POST"]),
        Route("/made/{key}.zip", made_zip),
        Route("/made/{key}/{path:path}", made_file),
        Mount("/", StaticFiles(directory=STATIC, html=True)),
    ]
    made = Starlette(
        routes=routes,
        middleware=[Middleware(Guard, token=studio.token)],
        exception_handlers={SbafabError: _refused, BusyError: _busy, TooLongError: _too_long},
        lifespan=studio.lifespan,
    )
    made.state.studio = studio
    return made


def _studio(request: Request) -> Studio:
    studio: Studio = request.app.state.studio
    return studio


async def _refused(_: Request, error: Exception) -> Response:
    return JSONResponse({"kind": "error", "message": str(error)}, 422)


async def _busy(_: Request, __: Exception) -> Response:
    return no_room()


async def _too_long(_: Request, __: Exception) -> Response:
    return JSONResponse({"kind": "error", "message": "the request is too long"}, 413)


async def start(request: Request) -> Response:
    studio = _studio(request)
    return JSONResponse(
        requested.started(studio.folder, studio.opened, studio.text, studio.template)
    )


async def template(request: Request) -> Response:
    return JSONResponse({"text": api.template(request.path_params["name"])})


async def opened_file(request: Request) -> Response:
    path = places.design_file(_studio(request).folder, request.path_params["name"])
    text, sha = places.read(path)
    return JSONResponse({"text": text, "sha": sha})


async def save(request: Request) -> Response:
    asked = await _asked(request)
    path = places.design_file(_studio(request).folder, str(asked.get("name", "")))
    seen = asked.get("seen")
    sha = places.save(path, str(asked.get("text", "")), None if seen is None else str(seen))
    return JSONResponse({"sha": sha})


async def watch(request: Request) -> Response:
    """A line whenever the file's content changes, until the page goes away."""
    path = places.design_file(_studio(request).folder, request.path_params["name"])

    async def changes() -> AsyncIterator[bytes]:
        last: str | None = None
        while not await request.is_disconnected():
            now = places.state(path)
            yield b"\n" if now == last else json.dumps({"sha": now}).encode() + b"\n"
            last = now
            await asyncio.sleep(LOOK_EVERY)

    return _Lines(changes())


async def live(request: Request) -> Response:
    return await _worked(request, _studio(request).live, "live")


async def elastic(request: Request) -> Response:
    return await _worked(request, _studio(request).mover, "elastic")


async def motion(request: Request) -> Response:
    return await _worked(request, _studio(request).mover, "motion")


async def generate(request: Request) -> Response:
    """Runs generate, into the chosen folder's ``out`` or into a folder of the studio's own."""
    studio, asked = _studio(request), await _asked(request)
    key = secrets.token_urlsafe(16)
    out = studio.folder / "out" if asked.get("keep") else studio.scratch / key
    job = {**requested.job(studio.folder, asked), "do": "generate", "out": str(out)}
    wish = studio.maker.ask((job["tab"], "generate"), job)

    async def told() -> AsyncIterator[bytes]:
        async for line in wish.lines():
            answer = json.loads(line)
            if answer["kind"] == "made":
                _keep(studio, key, Made(out / answer["name"], answer["name"]))
                yield json.dumps({**answer, "key": key}).encode() + b"\n"
            else:
                yield line + b"\n"

    return _Lines(told(), studio.maker, wish)


def _keep(studio: Studio, key: str, made: Made) -> None:
    studio.made[key] = made
    while len(studio.made) > MOST_MADE:
        oldest = next(iter(studio.made))
        folder = studio.made.pop(oldest).folder
        if folder.is_relative_to(studio.scratch):
            shutil.rmtree(folder.parent, ignore_errors=True)


async def made_file(request: Request) -> Response:
    made = _studio(request).made.get(request.path_params["key"])
    path = made.file(request.path_params["path"]) if made else None
    return FileResponse(path) if path else Response(status_code=404)


async def made_zip(request: Request) -> Response:
    made = _studio(request).made.get(request.path_params["key"])
    if made is None:
        return Response(status_code=404)
    content = await asyncio.to_thread(zipped, made)
    headers = {"content-disposition": f'attachment; filename="{made.name}.zip"'}
    return Response(content, media_type="application/zip", headers=headers)


async def _worked(request: Request, pool: WorkerPool, do: str) -> Response:
    studio, asked = _studio(request), await _asked(request)
    job = {**requested.job(studio.folder, asked), "do": do}
    wish = pool.ask((job["tab"], do), job)

    async def lines() -> AsyncIterator[bytes]:
        async for answer in wish.lines():
            yield answer + b"\n"

    return _Lines(lines(), pool, wish)


class _Lines(StreamingResponse):
    """A job's answers, each as a line of JSON; the job is given up where the reader goes away."""

    media_type = "application/x-ndjson"

    def __init__(
        self,
        content: AsyncIterator[bytes],
        pool: WorkerPool | None = None,
        wish: WaitingJob | None = None,
    ) -> None:
        super().__init__(content)
        self.pool, self.wish = pool, wish

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            # Also where the reader was gone before the first line was asked for.
            if self.pool is not None and self.wish is not None:
                self.pool.forget(self.wish)


async def _asked(request: Request) -> dict[str, Any]:
    return requested.table(await request.body())
