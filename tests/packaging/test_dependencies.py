"""What the package imports is what ``pyproject.toml`` says it needs."""

from __future__ import annotations

import re
import sys
import tomllib
from collections import defaultdict
from pathlib import Path

from sbafab.cli import EXTRAS
from tests.packaging.sources import sources

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRA = PROJECT["optional-dependencies"]
INSTALLED_AS = {
    "PIL": "pillow",
    "netgen": "netgen-mesher",
    "resvg_py": "resvg-py",
    "skimage": "scikit-image",
    "tomli_w": "tomli-w",
    "yaml": "pyyaml",
    "zxingcpp": "zxing-cpp",
}


OUR_OWN = {
    "sbafab",
    "benchmarks",
    "docs",
    "tests",
    *(path.stem for path in (ROOT / "tests").rglob("*.py")),
}


TESTING = ("dev", "interop")
APART = {"all", "docs", *TESTING}
"""All extras together, the site's, and those of the tests."""


BY_SCRIPTS = {"mujoco"}
"""Imported by scripts that are written for users and run."""


def names(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>=~!\[; ]", requirement)[0].lower() for requirement in requirements}


def third_party(folder: Path) -> set[str]:
    imported = {name for source in sources(folder) for name in source.imported}
    modules = imported - sys.stdlib_module_names
    return {INSTALLED_AS.get(name, name) for name in modules} - OUR_OWN


def _testing() -> set[str]:
    return {name for extra in TESTING for name in names(EXTRA[extra])}


def test_the_package_needs_what_it_imports_and_no_more() -> None:
    extras = {
        name for extra, needed in EXTRA.items() if extra not in APART for name in names(needed)
    }
    assert third_party(ROOT / "sbafab") | BY_SCRIPTS == names(PROJECT["dependencies"]) | extras
    assert extras <= _testing()


def test_the_tests_need_nothing_undeclared() -> None:
    declared = names(PROJECT["dependencies"]) | _testing()
    assert third_party(ROOT / "tests") <= declared


def test_the_extra_all_and_help_have_every_extra() -> None:
    (said,) = EXTRA["all"]
    assert said == f"sbafab[{','.join(sorted(EXTRA.keys() - APART))}]"
    assert set(EXTRAS) == EXTRA.keys() - APART


# A public class or type has its name to itself, wherever in the package it stands.


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


# Records do not change after they are made, but for a few that hold a state.


STATES = {
    "geometry/edges.py": {"Arc", "Line"},
    "models/motion.py": {"Motion", "BatchMotion"},
    "folders/artefacts.py": {"DesignFolder"},
    "rules/voids.py": {"VoidGraph"},
    "studio/answers.py": {"AnswerShapes"},
    "studio/app.py": {"Studio"},
    "studio/workers.py": {"WaitingJob"},
}
"""Dataclasses that gather or step, by module. Edges keep their lengths and boxes; as frozen records
they would take a fifteenth more of the time of a check.
"""


def test_records_are_frozen() -> None:
    changeable = {
        source.path.relative_to(PACKAGE).as_posix(): source.unfrozen
        for source in sources(PACKAGE)
        if source.unfrozen
    }
    assert changeable == STATES
