"""Templates compiled once, not in every run: kept beside them, as Python keeps its modules."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import BytecodeCache


def compiled_beside(folder: Path) -> BytecodeCache:
    """What reads them in ``__pycache__``, and writes them there where Python may write.

    Each is kept with its source's checksum and is made anew when that changed. Where the folder
    cannot be read or written, nothing is kept.
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
