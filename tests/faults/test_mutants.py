"""Faults at random, with the hashes put right: each is caught.

``SBAFAB_FAULTS=500`` draws as many, ``SBAFAB_FAULTS_SEED`` others.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from sbafab.actuators import load_design
from sbafab.errors import OutputError
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from tests.faults.mutants import mutated
from tests.faults.once import remembering
from tests.folders.doctoring import Doctor
from tests.quick import few

COUNT = int(os.environ.get("SBAFAB_FAULTS", "16"))
SEED = int(os.environ.get("SBAFAB_FAULTS_SEED", "12"))
PARTS = 8
"""Tests that the draws are shared out over."""
DESIGNS = (
    ("1dof-5mm", ("registration.method=ears",)),
    ("3dof-15mm", ("laser.kerf_tpe=0.12", "laser.kerf_ptfe=[0.1, 0.08]")),
    ("radial-15mm", ("inlet.manifold=true",)),
)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    few = ("stack.balloons=2", "rules.yield_builds=100")
    root = tmp_path_factory.mktemp("sound")
    return [
        generate(RunRequest(load_design(template, [*few, *settings]), root)).folder
        for template, settings in DESIGNS
    ]


@pytest.fixture(scope="module", autouse=True)
def _once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with remembering(tmp_path_factory.mktemp("anew"))():
        yield


def missed(folders: list[Path], number: int, folder: Path) -> str:
    """What is wrong with the verdict on draw ``number``; empty where it is right."""
    good = folders[number % len(folders)]
    name, data = mutated(good, number)
    target = folder / f"{number}" / good.name
    shutil.copytree(good, target)
    (target / name).write_bytes(data)
    if name != "manifest.json":
        Doctor(target).rehash()
    try:
        findings = check_folder(target)
    except OutputError:
        return ""
    except Exception as error:
        return f"draw {number}: {name}: {type(error).__name__}: {error}"
    is_caught = any(finding.verdict == "fail" for finding in findings)
    return "" if is_caught else f"draw {number}: {name} was changed, and nothing said so"


@pytest.mark.parametrize("part", few(range(PARTS), 3, setting="SBAFAB_FAULTS"))
def test_random_faults_are_caught(part: int, folders: list[Path], tmp_path: Path) -> None:
    numbers = [SEED * 1_000_000 + n for n in range(part, COUNT, PARTS)]
    said = [missed(folders, number, tmp_path) for number in numbers]
    assert not [*filter(None, said)]


def test_a_sound_folder_passes(folders: list[Path]) -> None:
    for folder in folders:
        assert not [f.message for f in check_folder(folder) if f.verdict == "fail"]
