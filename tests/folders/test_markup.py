"""Escaped text is what the standard library makes of it."""

from __future__ import annotations

from xml.sax import saxutils

import pytest

from sbafab.markup import escape, quoteattr


@pytest.mark.parametrize(
    "text", ["", "plain", "a & b < c > d", "it's", 'say "x"', "both ' and \"", "a\n\tb\r", "&amp;"]
)
def test_it_is_as_the_standard_library_has_it(text: str) -> None:
    assert escape(text) == saxutils.escape(text)
    assert quoteattr(text) == saxutils.quoteattr(text)
