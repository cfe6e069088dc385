"""Starting the studio: what is opened, the port, the link."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from sbafab import api
from sbafab.errors import DesignError, OutputError, Stopped
from sbafab.studio import places
from sbafab.studio.links import design_in

ADDRESS = "127.0.0.1"
PORT = 8417
"""Tried first, so that a link that was kept finds the studio again."""


class StudioStart(NamedTuple):
    """The folder that the studio is for, and the design that it opens with, if one was named."""

    folder: Path
    file: str | None = None
    """A design file of the folder."""
    text: str | None = None
    """A design from a link."""
    template: str | None = None


def opened(source: str | None) -> StudioStart:
    """Return what the studio shall open.

    ``source`` is a file, a folder, a template's name, a link that holds a design, or None for the
    folder one stands in. Raises DesignError.
    """
    if source is None:
        return StudioStart(Path.cwd())
    if source.startswith(("http://", "https://")):
        return StudioStart(Path.cwd(), text=design_in(source))
    if source in api.templates():
        return StudioStart(Path.cwd(), template=source)
    path = Path(source)
    if path.is_dir():
        return StudioStart(path.resolve())
    if not path.is_file():
        raise DesignError(
            f"{source} is no design file, folder, template or link; the templates are "
            f"{', '.join(api.templates())}"
        )
    folder = path.resolve().parent
    return StudioStart(folder, places.design_file(folder, path.name).name)


def listening(port: int | None) -> socket.socket:
    """A socket on this machine alone, at the port or, if none is asked for, at a free one."""
    for number in (PORT, 0) if port is None else (port,):
        # Only of a socket whose protocol is named does asyncio send small answers at once; others
        # wait 40 ms for the browser to acknowledge what came before.
        sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            sock.bind((ADDRESS, number))
            # From now on a browser waits for the server, which is not up yet.
            sock.listen(64)
            return sock
        except OSError as error:
            sock.close()
            reason = error.strerror
    raise OutputError(f"port {port} cannot be used ({reason}); leave out --port to take a free one")


def serve(source: str | None, port: int | None, announce: Callable[[str], None]) -> None:
    """Serves the studio until Ctrl-C; ``announce`` gets the link.

    Raises DesignError, OutputError, and Stopped at the end.
    """
    try:
        import uvicorn

        from sbafab.studio.app import Studio, app
    except ImportError as error:
        raise DesignError(
            f'{error.name} is not installed; add it with pip install "sbafab[studio]"'
        ) from None
    folder, name, text, template = opened(source)
    studio = Studio(folder, secrets.token_urlsafe(24), name, text, template)
    sock = listening(port)
    announce(f"http://{ADDRESS}:{sock.getsockname()[1]}/#token={studio.token}")
    config = uvicorn.Config(
        app(studio),
        log_level="warning",
        ws="none",
        server_header=False,
        lifespan="on",
        timeout_graceful_shutdown=1,
    )
    try:
        # It ends in order at a signal and then raises it once more.
        uvicorn.Server(config).run(sockets=[sock])
    except KeyboardInterrupt as stop:
        raise Stopped("the studio has stopped", *stop.args) from None
