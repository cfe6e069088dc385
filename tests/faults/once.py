"""Checks of many folders of one design, in which each thing is worked out once."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any
from unittest.mock import patch

from sbafab.as_built import check as as_built
from sbafab.design.identity import design_sha256
from sbafab.output.checked import Checked
from sbafab.output.manifest import Manifest
from sbafab.runs import check_folder as derived


def remembering(root: Path) -> Callable[[], AbstractContextManager[None]]:
    """A context in which checks remember, under ``root``, what does not hang on a changed file.

    That is what a design makes, what the rules find in it, and what it writes beside cut files.
    """
    deck, write = as_built._run_deck, derived._regenerate
    measured = _remembered(deck, _asked_of_deck)
    expected = _remembered(
        as_built.expected_laminate, lambda d, curves: f"{design_sha256(d)} {curves}"
    )
    run_deck = _remembered(as_built.run_deck, lambda made, limits: made.name + repr(limits))
    made: dict[str, Any] = {}

    def write_once(
        folder: Path, fresh: Path, claims: Manifest, checked: Checked, *made_of: object
    ) -> Any:
        asked = [folder / name for name in ("design.toml", "sheets/nest.json")]
        files = [path.read_bytes() if path.exists() else b"" for path in asked]
        said = repr((sorted(claims.files), claims.curves, checked.findings)).encode()
        key = sha256(b"".join(files) + said).hexdigest()
        if key not in made:
            (root / key).mkdir(parents=True)
            made[key] = write(folder, root / key, claims, checked, *made_of)
        shutil.copytree(root / key, fresh, dirs_exist_ok=True)
        return made[key]

    @contextmanager
    def context() -> Iterator[None]:
        with (
            patch.object(as_built, "_run_deck", lambda b: (measured if b.is_expected else deck)(b)),
            patch.object(as_built, "expected_laminate", expected),
            patch.object(as_built, "run_deck", run_deck),
            patch.object(derived, "_regenerate", write_once),
        ):
            yield

    return context


def _asked_of_deck(built: as_built.AsBuiltFolder) -> str:
    """Design, and the rules that are run: some checks leave out all or some."""
    names = [rule.name for rule in as_built.RULES]
    return built.design.model_dump_json() + repr((built.design_findings, names))


def _remembered(work: Callable[..., Any], key: Callable[..., str]) -> Callable[..., Any]:
    known: dict[str, Any] = {}

    def asked(*args: Any) -> Any:
        own = key(*args)
        if own not in known:
            known[own] = work(*args)
        return known[own]

    return asked
