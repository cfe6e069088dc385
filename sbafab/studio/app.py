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

from sbafab import api
from sbafab.errors import SbafabError
from sbafab.studio import places, requested
from sbafab.studio.guard import Guard, TooLongError
from sbafab.studio.made import Made, zipped
from sbafab.studio.workers import BusyError, Worker

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
    live: Worker = field(default_factory=lambda: Worker(LIVE_SECONDS))
    mover: Worker = field(default_factory=lambda: Worker(LIVE_SECONDS, warm=False))
    maker: Worker = field(default_factory=lambda: Worker(MAKE_SECONDS, warm=False))
    made: dict[str, Made] = field(default_factory=dict)
    scratch: Path = field(default_factory=lambda: Path(tempfile.mkdtemp(prefix="sbafab-studio-")))

    @contextlib.asynccontextmanager
    async def lifespan(self, _: Starlette) -> AsyncIterator[None]:
        self.live.start()
        try:
            yield
        finally:
            for worker in (self.live, self.mover, self.maker):
                worker.stop()
            shutil.rmtree(self.scratch, ignore_errors=True)


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
    return JSONResponse({"kind": "error", "message": "too many tabs ask at once; close some"}, 429)


async def _too_long(_: Request, __: Exception) -> Response:
    return JSONResponse({"kind": "error", "message": "the request is too long"}, 413)


async def start(request: Request) -> Response:
    studio = _studio(request)
    return JSONResponse(requested.started(studio.folder, studio.opened, studio.text))


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

    return _lines(changes())


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

    async def told() -> AsyncIterator[bytes]:
        async for line in studio.maker.answers((job["tab"], "generate"), job):
            answer = json.loads(line)
            if answer["kind"] == "made":
                _keep(studio, key, Made(out / answer["name"], answer["name"]))
                yield json.dumps({**answer, "key": key}).encode() + b"\n"
            else:
                yield line + b"\n"

    return _lines(told())


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


async def _worked(request: Request, worker: Worker, do: str) -> Response:
    studio, asked = _studio(request), await _asked(request)
    job = {**requested.job(studio.folder, asked), "do": do}

    async def lines() -> AsyncIterator[bytes]:
        async for answer in worker.answers((job["tab"], do), job):
            yield answer + b"\n"

    return _lines(lines())


def _lines(content: AsyncIterator[bytes]) -> Response:
    return StreamingResponse(content, media_type="application/x-ndjson")


async def _asked(request: Request) -> dict[str, Any]:
    return requested.table(await request.body())
