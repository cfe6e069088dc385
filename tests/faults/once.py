"""Checks of many folders of one design, in which each thing is worked out once."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any
from unittest.mock import patch

from sbafab.folders import build as builds
from sbafab.folders import check as as_built
from sbafab.folders.order import Order


def remembering(root: Path) -> Callable[[], AbstractContextManager[None]]:
    """A context in which checks remember, under ``root``, what does not hang on a changed file.

    That is what a design makes, what the rules find in it, and what it writes beside cut files.
    """
    remake = as_built._remake
    check = _remembered(
        as_built.make_build,
        lambda design, curves: f"{design.model_dump_json()} {curves} {id(builds.run_deck)}",
    )
    expected = _remembered(
        as_built.expected_laminate, lambda build: f"{build.laminate.name} {build.settings}"
    )
    made: dict[str, Any] = {}

    def remake_once(folder: Path, index: Any, order: Order, fresh: Path) -> Any:
        asked = [folder / name for name in ("design.toml", "sheets/nest.json")]
        files = [path.read_bytes() if path.exists() else b"" for path in asked]
        curves = [build.curves for build in order.builds]
        said = repr((sorted(index.files), curves, order.findings)).encode()
        key = sha256(b"".join(files) + said).hexdigest()
        if key not in made:
            (root / key).mkdir(parents=True)
            made[key] = remake(folder, index, order, root / key)
        shutil.copytree(root / key, fresh, dirs_exist_ok=True)
        return made[key]

    @contextmanager
    def context() -> Iterator[None]:
        with (
            patch.object(as_built, "make_build", check),
            patch.object(as_built, "expected_laminate", expected),
            patch.object(as_built, "_remake", remake_once),
        ):
            yield

    return context


def _remembered(work: Callable[..., Any], key: Callable[..., str]) -> Callable[..., Any]:
    known: dict[str, Any] = {}

    def asked(*args: Any, **more: Any) -> Any:
        own = key(*args, **more)
        if own not in known:
            known[own] = work(*args, **more)
        return known[own]

    return asked
