"""What the package imports is what ``pyproject.toml`` says it needs."""

from __future__ import annotations

import re
import sys
import tomllib
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
