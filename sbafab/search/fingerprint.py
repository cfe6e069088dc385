"""Which program this is, to the last line: rows of another one are not mixed with its own."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import sbafab


@cache
def fingerprint() -> str:
    """The version, and a hash of the package's source."""
    root = Path(sbafab.__file__).parent
    total = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        total.update(path.relative_to(root).as_posix().encode())
        total.update(path.read_bytes())
    return f"{sbafab.__version__}+{total.hexdigest()[:12]}"
