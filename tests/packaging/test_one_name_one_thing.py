"""A public class or type has its name to itself, wherever in the package it stands."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from tests.packaging.sources import sources

PACKAGE = Path(__file__).parents[2] / "sbafab"
WORDS_OF_FILES = {"Bore", "Chamber", "Inlet", "Line", "Stack", "Tube"}
"""Tables of a design or assembly file, which are called as the things that they ask for."""


def test_no_two_modules_use_one_name_for_two_things() -> None:
    places: dict[str, list[str]] = defaultdict(list)
    for source in sources(PACKAGE):
        for name in source.public_types:
            places[name].append(source.path.relative_to(PACKAGE).as_posix())
    twice = {name: where for name, where in places.items() if len(where) > 1}
    assert {name: twice[name] for name in twice.keys() - WORDS_OF_FILES} == {}
    assert twice.keys() >= WORDS_OF_FILES
