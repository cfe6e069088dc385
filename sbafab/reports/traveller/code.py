"""The code that a phone reads: which design this sheet of paper belongs to."""

from __future__ import annotations

QUIET = 4
"""Modules left white round the code, as its standard asks."""


def code_text(name: str, design_sha256: str, generator: str) -> str:
    """What the code says, a line each; plain text, for there is nothing to look up anywhere."""
    return f"{name}\nsha256 {design_sha256}\n{generator}"


def record_text(name: str, design_sha256: str, generator: str) -> str:
    """The same for a design that is built, and the command that shows what came out of it."""
    told = code_text(name, design_sha256, generator)
    return f"{told}\nsbafab record --find {design_sha256[:12]}"


def code_svg(text: str) -> str:
    """The text as a QR code, inline SVG without a size of its own."""
    import segno

    code = segno.make(text, error="m", micro=False)
    return code.svg_inline(border=QUIET, omitsize=True, light="white", svgclass="code")
