"""A studio in a process of its own, and a browser that looks at it."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest
from PIL import Image, ImageChops

from sbafab import api

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CHROMIUM = ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
DESIGN = api.template("3dof-15mm")
FILE = "gripper.toml"
PATIENCE = 120.0
"""Seconds: other work may share the machine."""


def chromium() -> str | None:
    """The browser's program; None where it or what drives it is not installed."""
    if find_spec("playwright") is None:
        return None
    return next((path for path in CHROMIUM if Path(path).exists()), None)


BROWSED = [
    pytest.mark.long,
    pytest.mark.skipif(chromium() is None, reason="Chromium or Playwright is not installed"),
]
"""Marks of the tests that start a server, its workers and a browser."""


@contextlib.contextmanager
def served(folder: Path, *arguments: str) -> Iterator[str]:
    """The link of a studio that is started in the folder and ended afterwards."""
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    command = [sys.executable, "-c", "from sbafab.entry import main; main()", "studio"]
    process = subprocess.Popen(
        [*command, *arguments, "--no-browser"],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert "http://127.0.0.1:" in line, line
        yield line.split()[-1]
    finally:
        process.terminate()
        process.wait(20)
        if process.stdout is not None:
            process.stdout.close()


@contextlib.contextmanager
def browser() -> Iterator[Browser]:
    """Chromium, headless."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=chromium(), args=list(FLAGS))
        try:
            yield made
        finally:
            made.close()


class Watched:
    """A page, all that it complained of, and all hosts that it asked."""

    def __init__(self, browser: Browser, link: str, **context: Any) -> None:
        self.complaints: list[str] = []
        self.hosts: set[str] = set()
        options = {"viewport": {"width": 1440, "height": 900}, "color_scheme": "light", **context}
        self.context = browser.new_context(**options)
        self.page: Page = self.context.new_page()
        self.watch(self.page)
        self.page.goto(link)

    def load(self, link: str) -> None:
        """Open a link as a tab does that has stored nothing; what it complained of is forgotten.

        A tab that is used again costs half of what a new one does.
        """
        # What a page stores when it is left goes with the rest.
        self.page.goto("about:blank")
        place = urlsplit(link)
        stored = {"origin": f"{place.scheme}://{place.netloc}", "storageTypes": "local_storage"}
        session = self.context.new_cdp_session(self.page)
        session.send("Storage.clearDataForOrigin", stored)
        session.detach()
        self.complaints.clear()
        self.hosts.clear()
        self.page.goto(link)

    def watch(self, page: Page) -> None:
        page.on("console", self._console)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", lambda request: self.hosts.add(request.url.split("/")[2]))
        page.on("websocket", lambda socket: self.hosts.add(socket.url))

    def _console(self, message: Any) -> None:
        # Reading pixels back, as these tests do, makes the graphics driver grumble.
        if message.type == "error" or (
            message.type == "warning"
            and all(words not in message.text for words in ("GL Driver", "willReadFrequently"))
        ):
            self.complaints.append(message.text)

    def until(self, condition: str, seconds: float = PATIENCE) -> Any:
        """Waits until the expression is true and returns its value."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = self.page.evaluate(condition)
            if found:
                return found
            time.sleep(0.03)
        raise AssertionError(f"{condition} is not true after {seconds:g} s")

    def ready(self) -> None:
        """Waits until all is current: views, rules and prediction."""
        self.until("Boolean(window.studio?.laminate) && !Object.values(studio.stale).some(Boolean)")

    def say(self, words: str) -> Any:
        return self.page.evaluate(words)

    def close(self) -> None:
        self.context.close()


def picture(seen: Watched, selector: str) -> Image.Image:
    seen.page.wait_for_timeout(250)
    return Image.open(io.BytesIO(seen.page.locator(selector).screenshot())).convert("RGB")


def share_changed(a: Image.Image, b: Image.Image) -> float:
    """The share of pixels that differ."""
    grey = ImageChops.difference(a, b).convert("L").point(lambda value: 255 * (value > 8))
    return grey.histogram()[255] / (a.width * a.height)


def colours(image: Image.Image) -> int:
    return len(image.quantize(32).getcolors() or ())
