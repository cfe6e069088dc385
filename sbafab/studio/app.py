"""The studio's web server: guard, routes, links with designs, and its start.

It listens only on this machine; at another of its addresses, if requested, it serves only the
record page to a phone. A page of another site cannot read its answers: Host must be this machine by
number or name (so a rebound name is refused), Origin must be its own, and every route for designs
requires the link's token in a header, which no form or image can send.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import contextlib
import hmac
import json
import os
import secrets
import shutil
import socket
import tempfile
import zlib
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from sbafab import api
from sbafab.errors import DesignError, OutputError, SbafabError, Stopped
from sbafab.studio import design_files, forms
from sbafab.studio.workers import BusyError, WaitingJob, WorkerPool

ADDRESS = "127.0.0.1"
HERE = (ADDRESS, "localhost", "[::1]")
TOKEN_HEADER = b"x-sbafab-token"
PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
MADE_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src 'self' "
    "data:; sandbox allow-scripts allow-modals; frame-ancestors 'self'; base-uri 'none'; "
    "form-action 'none'"
)
"""For pages written by a run: sandboxed, without access to the studio or any host."""


class Guard:
    """Refuses requests from other sites, and restricts what a page may load."""

    def __init__(self, app: ASGIApp, token: str, address: str = ADDRESS) -> None:
        self.app, self.token = app, token.encode()
        self.hosts = HERE if address == ADDRESS else (*HERE, address)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        refused = self.refusal(scope) if scope["type"] == "http" else None
        if refused is not None:
            status, why = refused
            await JSONResponse({"kind": "refused", "message": why}, status)(scope, receive, send)
        elif scope["type"] == "http":
            policy = MADE_POLICY if scope["path"].startswith("/made/") else PAGE_POLICY
            await self.app(scope, receive, _with_headers(send, policy))
        else:
            await self.app(scope, receive, send)

    def refusal(self, scope: Scope) -> tuple[int, str] | None:
        """Return status and reason if a request is not answered."""
        headers: dict[bytes, bytes] = dict(scope["headers"])
        host = headers.get(b"host", b"").decode("latin-1")
        if host.rpartition(":")[0] not in self.hosts and host not in self.hosts:
            return 403, f"the studio answers to {ADDRESS} only; open the link that it printed"
        origin = headers.get(b"origin")
        if origin is not None and origin.decode("latin-1").partition("://")[2] != host:
            return 403, "this request comes from another site"
        is_call = str(scope["path"]).startswith("/api/")
        if is_call and not hmac.compare_digest(headers.get(TOKEN_HEADER, b""), self.token):
            return 401, "the link is not this studio's; open the one that sbafab studio printed"
        return None


def _with_headers(send: Send, policy: str) -> Send:
    security = (
        (b"content-security-policy", policy.encode()),
        (b"x-content-type-options", b"nosniff"),
        (b"referrer-policy", b"no-referrer"),
        (b"cross-origin-opener-policy", b"same-origin"),
        (b"cross-origin-resource-policy", b"same-origin"),
        (b"cache-control", b"no-store"),
    )

    async def with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message["headers"], *security]}
        await send(message)

    return with_headers


# Links with a design: its text, packed into the fragment.


MOST = 1_000_000


def design_in(link: str) -> str:
    """Return the design text in a link. Raises DesignError if there is none."""
    packed = parse_qs(link.partition("#")[2]).get("design", [""])[0]
    try:
        raw = base64.b64decode(packed + "=" * (-len(packed) % 4), b"-_", validate=True)
        reader = zlib.decompressobj(-zlib.MAX_WBITS)
        text = reader.decompress(raw, MOST)
        if not packed or reader.unconsumed_tail or reader.unused_data or not reader.eof:
            raise ValueError("cut off")
        return text.decode("utf-8")
    except (ValueError, binascii.Error, zlib.error):
        raise DesignError("the link holds no design; copy the complete link") from None


# The studio's routes.


STATIC = Path(__file__).parent / "static"
JOBS = ("live", "elastic", "motion")
LIVE_SECONDS, MAKE_SECONDS = 60.0, 900.0
LOOK_EVERY = 0.4  # polling interval for the file on disk, s
MOST_MADE = 6  # number of run folders kept; the oldest is deleted first


@dataclass
class Studio:
    """State shared by the routes: folder, initial design, workers and folders of runs."""

    folder: Path
    token: str
    opened: Mapping[str, str] = field(default_factory=dict)
    """The design that the page opens: a file ``opened``, the ``text`` in a link, a ``template``."""
    address: str = ADDRESS
    """Address to listen on; at another than this a phone gets only the record page."""
    live: WorkerPool = field(default_factory=lambda: WorkerPool(LIVE_SECONDS))
    mover: WorkerPool = field(default_factory=lambda: WorkerPool(LIVE_SECONDS, warm=False))
    # A cancelled run ends at its next step, where it cleans up.
    maker: WorkerPool = field(
        default_factory=lambda: WorkerPool(MAKE_SECONDS, warm=False, patience=MAKE_SECONDS)
    )
    made: dict[str, Path] = field(default_factory=dict)
    scratch: Path = field(default_factory=lambda: Path(tempfile.mkdtemp(prefix="sbafab-studio-")))

    @contextlib.asynccontextmanager
    async def lifespan(self, _: Starlette) -> AsyncIterator[None]:
        if self.address == ADDRESS:
            self.live.start()
        try:
            yield
        finally:
            for pool in (self.live, self.mover, self.maker):
                pool.stop()
            shutil.rmtree(self.scratch, ignore_errors=True)


def app(studio: Studio) -> Starlette:
    """Return the application; every request passes the guard first."""
    editing = [
        Route("/api/start", start),
        Route("/api/template/{name}", template),
        Route("/api/file/{name}", opened_file),
        Route("/api/save", save, methods=["POST"]),
        Route("/api/watch/{name}", watch),
        Route("/api/generate", generate, methods=["POST"]),
        *(Route(f"/api/{do}", partial(answered, do), methods=["POST"]) for do in JOBS),
        Route("/made/{key}.zip", made_zip),
        Route("/made/{key}/{path:path}", made_file),
    ]
    application = Starlette(
        routes=[
            *(editing if studio.address == ADDRESS else ()),
            # The record page, the only routes for a phone.
            Route("/record", partial(static_file, "record.html")),
            Route("/api/record", record_choices),
            Route("/api/record", partial(recorded, _stored), methods=["POST"]),
            Route("/api/record/sheet", partial(recorded, _sheet), methods=["POST"]),
            Mount("/", StaticFiles(directory=STATIC, html=True)),
        ],
        middleware=[Middleware(Guard, token=studio.token, address=studio.address)],
        exception_handlers={SbafabError: _refused, BusyError: _busy},
        lifespan=studio.lifespan,
    )
    application.state.studio = studio
    return application


async def static_file(name: str, _: Request) -> Response:
    return FileResponse(STATIC / name)


def _studio(request: Request) -> Studio:
    studio: Studio = request.app.state.studio
    return studio


async def _refused(_: Request, error: Exception) -> Response:
    status = 409 if isinstance(error, design_files.ChangedError) else 422
    return JSONResponse({"kind": "error", "message": str(error)}, status)


async def _busy(_: Request, __: Exception) -> Response:
    message = "too many requests at once; wait a moment, or close some tabs of the studio"
    return JSONResponse({"kind": "error", "message": message}, 503, {"retry-after": "1"})


async def start(request: Request) -> Response:
    studio = _studio(request)
    design = {**dict.fromkeys(("opened", "text", "template")), **studio.opened}
    return JSONResponse(forms.started(studio.folder) | design)


async def template(request: Request) -> Response:
    return JSONResponse({"text": api.template(request.path_params["name"])})


async def opened_file(request: Request) -> Response:
    path = design_files.design_file(_studio(request).folder, request.path_params["name"])
    text, sha = design_files.read(path)
    return JSONResponse({"text": text, "sha": sha})


async def save(request: Request) -> Response:
    table = await _request_table(request)
    path = design_files.design_file(_studio(request).folder, str(table.get("name", "")))
    seen = table.get("seen")
    expected = None if seen is None else str(seen)
    return JSONResponse({"sha": design_files.save(path, str(table.get("text", "")), expected)})


async def watch(request: Request) -> Response:
    """Sends a line whenever the file's content changes, until the page disconnects."""
    path = design_files.design_file(_studio(request).folder, request.path_params["name"])

    async def changes() -> AsyncIterator[bytes]:
        last: str | None = None
        while not await request.is_disconnected():
            now = design_files.state(path)
            yield b"\n" if now == last else json.dumps({"sha": now}).encode() + b"\n"
            last = now
            await asyncio.sleep(LOOK_EVERY)

    return _Lines(changes())


async def answered(do: str, request: Request) -> Response:
    """Runs a job of the page."""
    studio = _studio(request)
    pool = studio.live if do == "live" else studio.mover
    job = {**forms.job(studio.folder, await _request_table(request)), "do": do}
    waiting = pool.ask((job["tab"], do), job)
    return _Lines(waiting.lines(), waiting)


async def generate(request: Request) -> Response:
    """Runs generate, into the chosen folder's ``out`` or into a folder of the studio's own."""
    studio, table = _studio(request), await _request_table(request)
    key = secrets.token_urlsafe(16)
    out = studio.folder / "out" if table.get("keep") else studio.scratch / key
    job = {**forms.job(studio.folder, table), "do": "generate", "out": str(out)}
    waiting = studio.maker.ask((job["tab"], "generate"), job)

    async def lines() -> AsyncIterator[bytes]:
        async for line in waiting.lines():
            answer = json.loads(line)
            if answer["kind"] == "made":
                _remember(studio, key, out / answer["name"])
                answer["key"] = key
            yield json.dumps(answer).encode() + b"\n"

    return _Lines(lines(), waiting)


def _remember(studio: Studio, key: str, folder: Path) -> None:
    studio.made[key] = folder
    while len(studio.made) > MOST_MADE:
        oldest = next(iter(studio.made))
        old = studio.made.pop(oldest)
        if old.is_relative_to(studio.scratch):
            shutil.rmtree(old.parent, ignore_errors=True)


async def made_file(request: Request) -> Response:
    folder = _studio(request).made.get(request.path_params["key"])
    path = design_files.file_in(folder, request.path_params["path"]) if folder else None
    return FileResponse(path) if path else Response(status_code=404)


async def made_zip(request: Request) -> Response:
    folder = _studio(request).made.get(request.path_params["key"])
    if folder is None:
        return Response(status_code=404)
    content = await asyncio.to_thread(design_files.zipped, folder)
    headers = {"content-disposition": f'attachment; filename="{folder.name}.zip"'}
    return Response(content, media_type="application/zip", headers=headers)


class _Lines(StreamingResponse):
    """A job's answers, each as a line of JSON; the job is cancelled if the reader disconnects."""

    media_type = "application/x-ndjson"

    def __init__(self, content: AsyncIterator[bytes], job: WaitingJob | None = None) -> None:
        super().__init__(content)
        self.job = job

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            # Also if the reader left before the first line was requested.
            if self.job is not None:
                self.job.pool.forget(self.job)


async def _request_table(request: Request) -> dict[str, Any]:
    return forms.table(await request.body())


# The record page: entries of a device's history from a form on a phone.


async def record_choices(request: Request) -> Response:
    """The designs that may be recorded, and the lab's file."""
    folder = _studio(request).folder
    designs = {"files": design_files.listed(folder), "templates": api.templates()}
    return JSONResponse({**designs, "lab": str(_lab_file(folder))})


async def recorded(
    answer: Callable[[Path, Mapping[str, Any]], dict[str, Any]], request: Request
) -> Response:
    table = await _request_table(request)
    return JSONResponse(await asyncio.to_thread(answer, _studio(request).folder, table))


def _lab_file(folder: Path) -> Path:
    """Return the lab's file: SBAFAB_LAB, or lab.sqlite in the chosen folder."""
    return folder / os.environ.get("SBAFAB_LAB", "lab.sqlite")


def _sheet(folder: Path, request: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of the record page of the named design."""
    tables = []
    for title, fields, rows in api.record_sheet(_recorded_design(folder, request)):
        first = fields[0].name
        lines = [{"values": {first: item}, "nominal": set_to} for item, set_to in rows.items()]
        tables.append({"title": title, "fields": [f._asdict() for f in fields], "rows": lines})
    return {"tables": tables}


def _stored(folder: Path, request: Mapping[str, Any]) -> dict[str, Any]:
    """Store the filled entries, all or none, and return their numbers and warnings."""
    lines = request.get("entries")
    if not isinstance(lines, list) or not lines or not all(isinstance(x, dict) for x in lines):
        raise DesignError("nothing is filled in; enter a reading, a lot, a decision or a note")
    entries = api.record_history(
        _recorded_design(folder, request),
        entries=[_entry(line) for line in lines],
        lab=_lab_file(folder),
        again=request.get("again") is True,
    )
    expired = [
        f"{entry.item} lot {entry.lot} expired on {entry.expires}"
        for entry in entries
        if entry.is_expired
    ]
    numbers = [entry.number for entry in entries]
    return {"entries": numbers, "warnings": list(dict.fromkeys(expired))}


def _recorded_design(folder: Path, request: Mapping[str, Any]) -> str | Path:
    """Return the template or the file of the folder named in a request. Raises DesignError."""
    name = str(request.get("design", ""))
    if name in api.templates():
        return name
    path = design_files.design_file(folder, name)
    design_files.named_files(design_files.read(path)[0], folder)
    return path


def _entry(line: Mapping[str, Any]) -> dict[str, Any]:
    """An entry with its photograph as bytes, since a page cannot name files of this machine."""
    values = {str(name): value for name, value in line.items() if name != "photograph"}
    packed = line.get("photograph")
    if packed:
        try:
            values["photograph"] = base64.b64decode(str(packed), validate=True)
        except (binascii.Error, ValueError):
            raise DesignError("the photograph arrived incomplete; send it again") from None
    return values


# Start of the studio: design, port and link.


PORT = 8417  # tried first, so that a saved link finds the studio again


def opened(source: str | None) -> tuple[Path, dict[str, str]]:
    """Return the folder and the design that the studio opens.

    ``source`` is a file, a folder, a template's name, a link that holds a design, or None for the
    current folder. Raises DesignError.
    """
    if source is None:
        return Path.cwd(), {}
    if source.startswith(("http://", "https://")):
        return Path.cwd(), {"text": design_in(source)}
    if source in api.templates():
        return Path.cwd(), {"template": source}
    path = Path(source)
    if path.is_dir():
        return path.resolve(), {}
    if not path.is_file():
        raise DesignError(
            f"{source} is not a design file, folder, template or link; the templates are "
            f"{', '.join(api.templates())}"
        )
    folder = path.resolve().parent
    return folder, {"opened": design_files.design_file(folder, path.name).name}


def listening(port: int | None, address: str = ADDRESS) -> socket.socket:
    """Return a listening socket at an address of this machine, on the given or a free port."""
    for number in (PORT, 0) if port is None else (port,):
        # asyncio sends small answers at once only for sockets with a named protocol; others wait 40
        # ms for the browser to acknowledge the previous data.
        sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            sock.bind((address, number))
            # From now on a browser waits for the server, which is not up yet.
            sock.listen(64)
            return sock
        except OSError as error:
            sock.close()
            reason = error.strerror
    if address != ADDRESS:
        raise OutputError(
            f"{address} cannot be used ({reason}); give this machine's address on the phone's "
            "network, such as 192.168.1.20"
        )
    raise OutputError(f"port {port} cannot be used ({reason}); omit --port to use a free one")


def serve(
    source: str | None, port: int | None, announce: Callable[[str], None], address: str = ADDRESS
) -> None:
    """Serve the studio until Ctrl-C; ``announce`` receives the link.

    At another ``address`` of this machine it serves only the record page. Raises DesignError,
    OutputError, and Stopped at the end.
    """
    try:
        import uvicorn

    except ImportError as error:
        raise DesignError(
            f'{error.name} is not installed; add it with pip install "sbafab[studio]"'
        ) from None
    folder, design = opened(source)
    studio = Studio(folder, secrets.token_urlsafe(24), design, address)
    sock = listening(port, address)
    page = "" if address == ADDRESS else "record"
    announce(f"http://{address}:{sock.getsockname()[1]}/{page}#token={studio.token}")
    config = uvicorn.Config(
        app(studio),
        log_level="warning",
        ws="none",
        server_header=False,
        lifespan="on",
        timeout_graceful_shutdown=1,
    )
    try:
        # It ends in order at a signal and then raises it again.
        uvicorn.Server(config).run(sockets=[sock])
    except KeyboardInterrupt as stop:
        raise Stopped("the studio has stopped", *stop.args) from None
