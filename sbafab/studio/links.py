"""Links that hold a design: its text, packed into what follows the #."""

from __future__ import annotations

import base64
import binascii
import zlib
from urllib.parse import parse_qs, urlsplit

from sbafab.errors import DesignError

MOST = 1_000_000


def design_in(link: str) -> str:
    """The design's text in a link. Raises DesignError where there is none."""
    packed = parse_qs(urlsplit(link).fragment).get("design", [""])[0]
    try:
        raw = base64.b64decode(packed + "=" * (-len(packed) % 4), b"-_", validate=True)
        reader = zlib.decompressobj(-zlib.MAX_WBITS)
        text = reader.decompress(raw, MOST)
        if not packed or reader.unconsumed_tail or reader.unused_data or not reader.eof:
            raise ValueError("cut off")
        return text.decode("utf-8")
    except (ValueError, binascii.Error, zlib.error):
        raise DesignError(
            "the link holds no design; copy it whole, up to its last letter"
        ) from None


def packed(text: str) -> str:
    """What stands after ``design=`` in a link."""
    squeezer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    raw = squeezer.compress(text.encode("utf-8")) + squeezer.flush()
    return base64.urlsafe_b64encode(raw).decode("ascii").rstrip("=")
