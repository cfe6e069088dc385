"""Templates compiled once, not in every run: kept beside them, as Python keeps its modules."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import BytecodeCache


def compiled_beside(folder: Path) -> BytecodeCache | None:
    """What reads and writes them in ``__pycache__``; None where Python must not write there.

    Each is kept with its source's checksum and is made anew when that changed. Where the folder
    cannot be read or written, nothing is kept.
    """
    from jinja2 import FileSystemBytecodeCache
    from jinja2.bccache import Bucket

    if sys.dont_write_bytecode:
        return None

    class Compiled(FileSystemBytecodeCache):
        def load_bytecode(self, bucket: Bucket) -> None:
            with suppress(OSError):
                super().load_bytecode(bucket)

        def dump_bytecode(self, bucket: Bucket) -> None:
            with suppress(OSError):
                super().dump_bytecode(bucket)

    place = folder / "__pycache__"
    with suppress(OSError):
        place.mkdir(exist_ok=True)
    return Compiled(str(place), f"%s.{sys.implementation.cache_tag}.jinja")
