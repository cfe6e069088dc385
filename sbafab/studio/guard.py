"""Who may ask the studio, and what its pages may load.

It listens on this machine only. A page of another site cannot read its answers: Host must be this
machine by number or name (so a name that is rebound to it is refused), Origin must be its own, and
all that knows of designs takes the token of the link in a header, which no form or image can send.
"""

from __future__ import annotations

import hmac
from urllib.parse import urlsplit

from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HERE = ("127.0.0.1", "localhost", "[::1]")
TOKEN_HEADER = b"x-sbafab-token"
MOST_BODY = 2_000_000
MOST_AT_ONCE = 64
"""Requests that are read and answered at a time: at most 128 MB of them."""
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
"""For pages that a run wrote: alone in a box, with no way to the studio or to any host."""


class Guard:
    """Refuses what does not come from the studio's own page, and bounds what it may send."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self.app, self.token = app, token.encode()
        self.at_once = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        refused = self.refusal(scope)
        if refused is not None:
            status, why = refused
            await JSONResponse({"kind": "refused", "message": why}, status)(scope, receive, send)
            return
        if self.at_once >= MOST_AT_ONCE:
            await no_room()(scope, receive, send)
            return
        policy = MADE_POLICY if scope["path"].startswith("/made/") else PAGE_POLICY
        self.at_once += 1
        try:
            await self.app(scope, _bounded(receive), _with_headers(send, policy))
        finally:
            self.at_once -= 1

    def refusal(self, scope: Scope) -> tuple[int, str] | None:
        """Status and reason why a request is not answered."""
        headers: dict[bytes, bytes] = dict(scope["headers"])
        host = headers.get(b"host", b"").decode("latin-1")
        if host.rpartition(":")[0] not in HERE and host not in HERE:
            return 403, f"the studio answers to {HERE[0]} only; open the link that it printed"
        origin = headers.get(b"origin")
        if origin is not None and urlsplit(origin.decode("latin-1")).netloc != host:
            return 403, "this request comes from another site"
        if headers.get(b"sec-fetch-site", b"same-origin") == b"cross-site" and _is_call(scope):
            return 403, "this request comes from another site"
        if _is_call(scope) and not hmac.compare_digest(headers.get(TOKEN_HEADER, b""), self.token):
            return 401, "the link is not this studio's; open the one that sbafab studio printed"
        length = headers.get(b"content-length", b"0")
        if not length.isdigit() or int(length) > MOST_BODY:
            return 413, f"a request holds at most {MOST_BODY:,} bytes"
        return None


def no_room() -> JSONResponse:
    """The answer where too much is asked at once; it is given before any other has begun."""
    message = "too many requests at once; wait a moment, or close some tabs of the studio"
    return JSONResponse({"kind": "error", "message": message}, 503, {"retry-after": "1"})


def _is_call(scope: Scope) -> bool:
    return str(scope["path"]).startswith("/api/")


class TooLongError(Exception):
    """A body without a length that grew past the limit."""


def _bounded(receive: Receive) -> Receive:
    total = 0

    async def bounded() -> Message:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > MOST_BODY:
            raise TooLongError
        return message

    return bounded


def _with_headers(send: Send, policy: str) -> Send:
    own = (
        (b"content-security-policy", policy.encode()),
        (b"x-content-type-options", b"nosniff"),
        (b"referrer-policy", b"no-referrer"),
        (b"cross-origin-opener-policy", b"same-origin"),
        (b"cross-origin-resource-policy", b"same-origin"),
        (b"cache-control", b"no-store"),
    )

    async def with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message["headers"], *own]}
        await send(message)

    return with_headers
