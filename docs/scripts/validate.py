"""Writes docs/validation.md, the paper's figures beside ours: python -m docs.scripts.validate"""

from __future__ import annotations

from pathlib import Path

from docs.scripts import sensitivity
from sbafab.reproduction.page import page

PATH = Path(__file__).parent.parent / "validation.md"


def validation() -> str:
    """The text of docs/validation.md."""
    return page() + sensitivity.section()


if __name__ == "__main__":
    PATH.write_text(validation(), encoding="utf-8", newline="\n")
