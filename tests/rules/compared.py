"""Findings held against each other."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sbafab.rules.finding import Finding


def same(found: Finding, expected: Finding) -> bool:
    """Equal but for rounding of value, limit, x and y."""
    numbers = [
        (found.limit, expected.limit),
        (found.measured, expected.measured),
        (found.where.x, expected.where.x),
        (found.where.y, expected.where.y),
    ]
    where = replace(found.where, x=expected.where.x, y=expected.where.y)
    rest = replace(found, limit=expected.limit, measured=expected.measured, where=where)
    return rest == expected and all(
        a == b or (a is not None and a == pytest.approx(b, abs=1e-4)) for a, b in numbers
    )


def only(findings: list[Finding]) -> Finding:
    (finding,) = findings
    return finding
