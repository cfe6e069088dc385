"""Designs that cannot be, each refused in one sentence: the table is ``refused.txt``."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from sbafab.errors import DesignError
from tests.designs import drawn, put, tables

TABLE = Path(__file__).with_name("refused.txt").read_text(encoding="utf-8")
CASES = [
    tuple(part.strip() for part in line.split(" | "))
    for line in TABLE.splitlines()
    if line and not line.startswith("#")
]


@pytest.mark.parametrize(("design", "changes", "words"), CASES)
def test_it_is_refused_in_one_sentence(
    design: str, changes: str, words: str, tmp_path: Path
) -> None:
    data = tables(design)
    for change in changes.split(" & "):
        key, _, value = change.partition(" = ")
        put(data, key, tomllib.loads(f"value = {value}")["value"])
    with pytest.raises(DesignError) as refused:
        drawn(tmp_path, data)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
