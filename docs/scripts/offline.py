"""Whether the built site stands by itself: nothing loaded from elsewhere, every link answered."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADS = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}
STYLE = re.compile(r"@import|url\(\s*['\"]?(?:https?:)?//")


class Page(HTMLParser):
    """What a page loads, where it leads, and the names in it that others may lead to."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.names: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        own = {key: value or "" for key, value in attrs}
        if "id" in own:
            self.names.add(own["id"])
        if tag == "link" and own.get("rel") in ("canonical", "search", "next", "prev"):
            return
        if tag in LOADS and own.get(LOADS[tag]):
            self.loads.append(own[LOADS[tag]])
        if tag == "a" and own.get("href"):
            self.links.append(own["href"])


@cache
def page(path: Path) -> Page:
    """A page of the site, read."""
    read = Page()
    read.feed(path.read_text(encoding="utf-8"))
    return read


def complaints(site: Path) -> Iterator[str]:
    """A sentence for everything that another host would have to give, or that is not there."""
    for path in sorted(site.rglob("*.html")):
        where = path.relative_to(site)
        for address in page(path).loads:
            if urlsplit(address).scheme in ("http", "https") or address.startswith("//"):
                yield f"{where} loads {address} from another host"
            elif why := _missing(path, address):
                yield f"{where} loads {address}: {why}"
        for address in page(path).links:
            if why := _missing(path, address):
                yield f"{where} leads to {address}: {why}"
    for path in sorted(site.rglob("*.css")):
        if STYLE.search(path.read_text(encoding="utf-8")):
            yield f"{path.relative_to(site)} loads from another host"


def _missing(path: Path, address: str) -> str:
    """Why a link of a page leads nowhere; empty where it does, or leaves the site."""
    parts = urlsplit(address)
    if parts.scheme or parts.netloc:
        return ""
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if not target.is_file():
        return "no such file"
    named = unquote(parts.fragment)
    if named and target.suffix == ".html" and named not in page(target).names:
        return f"no {named!r} in it"
    return ""
