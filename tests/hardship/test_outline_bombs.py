"""Drawings made to be slow or large to read are refused before they are: time and memory hold."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from tests.hardship.starting import assert_refused

pytestmark = pytest.mark.long

if TYPE_CHECKING:
    from conftest import Output, Runs

BOUNDED = """
import resource
resource.setrlimit(resource.RLIMIT_CPU, (6, 6))
resource.setrlimit(resource.RLIMIT_AS, ({most}, {most}))
"""
SIZE = 1_900_000
MOST_MEMORY = 2 << 30


def dxf(entities: str, tables: str = "") -> str:
    sections = [
        f"  2\n{name}\n{body}" for name, body in (("BLOCKS", tables), ("ENTITIES", entities))
    ]
    return "".join(f"  0\nSECTION\n{section}  0\nENDSEC\n" for section in sections) + "  0\nEOF\n"


def nested_blocks() -> str:
    """Thirty blocks of ten references to the next: 10^30 entities, once exploded."""
    insert = "  0\nINSERT\n  8\n0\n  2\nB{}\n 10\n0\n 20\n0\n"
    blocks = "".join(
        f"  0\nBLOCK\n  8\n0\n  2\nB{n}\n 10\n0\n 20\n0\n{insert.format(n + 1) * 10}  0\nENDBLK\n"
        for n in range(30)
    )
    return dxf(insert.format(0), blocks)


def svg(body: str, head: str = "") -> str:
    return f'{head}<svg xmlns="http://www.w3.org/2000/svg">{body}</svg>'


def laughs() -> str:
    entities = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10 if n else "ha"}">' for n in range(10))
    return svg("<title>&l9;</title>", f"<!DOCTYPE svg [{entities}]>")


def star(points: int) -> str:
    """Every edge crosses nearly every other."""
    steps = (2 * math.pi * n * (points // 2 - 1) / points for n in range(points))
    return " ".join(f"{40 * math.cos(a):.4f},{40 * math.sin(a):.4f}" for a in steps)


BOMBS: dict[str, tuple[Callable[[], str], str]] = {
    "lines.dxf": (lambda: dxf("0\nLINE\n" * (SIZE // 7)), "entities and settings"),
    "inserts.dxf": (lambda: dxf("0\nINSERT\n" * (SIZE // 9)), "entities and settings"),
    "unknown.dxf": (lambda: dxf("0\nX\n" * (SIZE // 4)), "entities and settings"),
    "nested.dxf": (nested_blocks, "explode blocks"),
    "large.dxf": (lambda: " " * 2_000_001, "where at most 2,000,000"),
    "far.dxf": (
        lambda: dxf("  0\nLINE\n  8\n0\n 10\n1e300\n 20\n0\n 11\n1e301\n 21\n0\n"),
        "has a coordinate of x 1e+300",
    ),
    "vertices.dxf": (
        lambda: dxf("  0\nLWPOLYLINE\n  8\n0\n 70\n1\n" + "10\n1\n20\n2\n" * (SIZE // 10)),
        "outline",
    ),
    "knots.dxf": (
        lambda: dxf("  0\nSPLINE\n 70\n8\n 71\n3\n" + "40\n1\n" * (SIZE // 5)),
        "outline",
    ),
    "zeros.dxf": (lambda: "0\n" * (SIZE // 2), "entities and settings"),
    "entities.svg": (laughs, "has a DOCTYPE or entities"),
    "paths.svg": (lambda: svg('<path d="M0 0L1 1"/>' * (SIZE // 20)), "more than 2000 elements"),
    "groups.svg": (lambda: svg("<g>" * 100_000 + "</g>" * 100_000), "more than 2000 elements"),
    "deep.svg": (lambda: svg("<g>" * 1900 + "</g>" * 1900), "no closed path"),
    "closings.svg": (lambda: svg(f'<path d="M0 0{"z" * SIZE}"/>'), "more than 5000 edges"),
    "path.svg": (lambda: svg(f'<path d="M0 0{"L1 1" * (SIZE // 4)}"/>'), "more than 5000 edges"),
    "style.svg": (lambda: svg(f"<style>{'a{b:c}' * (SIZE // 6)}</style>"), "in a style sheet"),
    "turns.svg": (
        lambda: svg(f'<path transform="{"rotate(1)" * (SIZE // 9)}" d="M0 0L1 1"/>'),
        "very long transform",
    ),
    "far.svg": (lambda: svg('<circle r="1e308"/>'), "has a coordinate of x 1e+308"),
    "star.svg": (lambda: svg(f'<polygon points="{star(499)}"/>'), "crosses or touches itself"),
    "clones.svg": (lambda: svg('<use href="#a"/>' * 9), "clones unlinked"),
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused(name: str, runs: Runs, output: Output) -> None:
    make, says = BOMBS[name]
    path = output.folder.parent / name
    path.write_text(make(), encoding="utf-8")
    ended = runs.run(
        [*output.arguments("0.75"), "--set", f"chamber.outline={path}"],
        output.folder,
        BOUNDED.format(most=MOST_MEMORY),
    )
    assert_refused(ended, "sbafab: outline ", says)
    assert output.held() == "0.8"
