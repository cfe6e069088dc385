"""Jinja templates of HTML pages, cached compiled as Python caches its modules."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import BytecodeCache, Environment


def environment(folder: Path) -> Environment:
    """Return the environment of a folder's templates; an undefined name is an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(folder),
        bytecode_cache=compiled_beside(folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def compiled_beside(folder: Path) -> BytecodeCache:
    """Return the cache of compiled templates in ``__pycache__``, filled where Python may write.

    Each template is kept with its source's checksum and compiled again when that changes. Where the
    folder cannot be read or written, nothing is kept.
    """
    from jinja2 import FileSystemBytecodeCache
    from jinja2.bccache import Bucket

    class Compiled(FileSystemBytecodeCache):
        def load_bytecode(self, bucket: Bucket) -> None:
            with suppress(OSError):
                super().load_bytecode(bucket)

        def dump_bytecode(self, bucket: Bucket) -> None:
            if sys.dont_write_bytecode:
                return
            with suppress(OSError):
                place.mkdir(exist_ok=True)
                super().dump_bytecode(bucket)

    place = folder / "__pycache__"
    return Compiled(str(place), f"%s.{sys.implementation.cache_tag}.jinja")
