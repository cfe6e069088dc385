"""What a command loads: help and listings must not wait for geometry or meshing libraries."""

from __future__ import annotations

import subprocess
import sys

import pytest

from sbafab.cli import HOMES, SUMMARIES

HEAVY = {
    "PIL",
    "ezdxf",
    "manifold3d",
    "matplotlib",
    "numpy",
    "rich",
    "shapely",
    "svgelements",
    "trimesh",
}

PROGRAM = """
import contextlib, io, sys
from sbafab.cli import main
with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
    main({arguments!r})
print(*sorted(sys.modules))
"""


def modules_after(*arguments: str) -> set[str]:
    """Modules that a fresh interpreter holds after the command."""
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(arguments=list(arguments))],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(run.stdout.split())


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["generat"]])
def test_help_loads_neither_geometry_nor_pydantic(arguments: list[str]) -> None:
    loaded = modules_after(*arguments)
    assert not loaded & (HEAVY | {"pydantic"})
    assert not {name for name in loaded if name.startswith("sbafab.geometry")}


def test_a_command_loads_no_other_command() -> None:
    loaded = modules_after("new")
    others = {f"sbafab.cli.{HOMES.get(name, name)}" for name in SUMMARIES} - {"sbafab.cli.start"}
    assert "sbafab.cli.start" in loaded
    assert not loaded & others


def test_listing_the_templates_loads_no_heavy_library() -> None:
    assert not modules_after("new") & (HEAVY - {"rich"})


def test_geometry_laminate_and_rules_run_on_numpy_alone() -> None:
    program = (
        "import sys, pkgutil, importlib\n"
        "for room in ('geometry', 'laminate', 'rules'):\n"
        "    package = importlib.import_module(f'sbafab.{room}')\n"
        "    for module in pkgutil.iter_modules(package.__path__, f'sbafab.{room}.'):\n"
        "        importlib.import_module(module.name)\n"
        "print(*sorted(sys.modules))"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    loaded = set(run.stdout.split())
    assert "sbafab.rules.finding" in loaded
    assert not loaded & (HEAVY - {"numpy"} | {"click"})
