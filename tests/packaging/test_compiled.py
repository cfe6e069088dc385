"""The wheel that has modules compiled gives what the source gives; others hold nothing compiled."""

from __future__ import annotations

import importlib.util
import os
import runpy
import shutil
import site
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXTENSION = sysconfig.get_config_var("EXT_SUFFIX")
COMPILED: tuple[str, ...] = runpy.run_path(str(ROOT / ".ci" / "compile_modules.py"))["COMPILED"]
CAN_COMPILE = all(importlib.util.find_spec(name) for name in ("mypyc", "setuptools")) and (
    os.name == "nt" or shutil.which((sysconfig.get_config_var("CC") or "cc").split()[0])
)

COMPILED_ONLY = f"""
def pytest_runtest_setup() -> None:
    from sbafab.geometry import edges
    assert edges.__file__.endswith({EXTENSION!r})
"""
"""A plugin of pytest."""


def wheel(folder: Path, asked: str) -> Path:
    """A wheel as hatchling builds it of the source."""
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder],
        cwd=ROOT,
        env={**os.environ, "SBAFAB_COMPILE": asked},
        check=True,
        capture_output=True,
    )
    (found,) = folder.glob("*.whl")
    return found


def extensions(built: Path) -> set[str]:
    """Modules that are compiled in a wheel, by their source."""
    names = zipfile.ZipFile(built).namelist()
    return {f"{name.removesuffix(EXTENSION)}.py" for name in names if name.endswith(EXTENSION)}


def test_without_a_wish_nothing_is_compiled(tmp_path: Path) -> None:
    for asked in ("", "0"):
        built = wheel(tmp_path / f"asked{asked}", asked)
        assert built.name.endswith("-py3-none-any.whl")
        assert extensions(built) == set()


def test_what_is_to_be_compiled_is_there() -> None:
    assert [name for name in COMPILED if not (ROOT / name).is_file()] == []


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python with the compiled wheel, and all else of the environment that runs the tests."""
    place = tmp_path_factory.mktemp("compiled")
    built = wheel(place / "wheel", "1")
    assert not built.name.endswith("-any.whl")
    # The wheel's own library of all that is compiled, and each module.
    assert extensions(built) == {"sbafab__mypyc.py", *COMPILED}
    folder = place / "venv"
    venv.create(folder)
    own = sysconfig.get_path("purelib", "venv", {"base": str(folder), "platbase": str(folder)})
    with zipfile.ZipFile(built) as held:
        held.extractall(own)
    others = [*site.getsitepackages(), str(ROOT)]
    (Path(own) / "others.pth").write_text("\n".join(others), encoding="utf-8")
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def run(python: Path | str, *arguments: str, folder: Path, source: str = "") -> str:
    """What a program prints that takes sbafab from ``source``, or from where that Python has it."""
    kept = {name: v for name, v in os.environ.items() if name not in ("PYTHONPATH", "SBAFAB_LONG")}
    done = subprocess.run(
        [python, "-P", *arguments],
        cwd=folder,
        env={**kept, "PYTHONPATH": source},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr
    return done.stdout


@pytest.mark.long
@pytest.mark.skipif(not CAN_COMPILE, reason="there is no compiler, or no mypyc")
class TestCompiledWheel:
    def test_its_modules_are_compiled(self, python: Path, tmp_path: Path) -> None:
        names = [name.removesuffix(".py").replace("/", ".") for name in COMPILED]
        said = f"for name in {names}: print(__import__(name, fromlist=['x']).__file__)"
        files = run(python, "-c", said, folder=tmp_path).split()
        assert len(files) == len(COMPILED)
        assert [name for name in files if not name.endswith(EXTENSION)] == []

    @pytest.mark.parametrize("template", ["1dof-5mm", "3dof-15mm", "radial-15mm", "brace"])
    def test_it_writes_the_same_bytes(self, template: str, python: Path, tmp_path: Path) -> None:
        written = {}
        for name, program, source in (
            ("plain", sys.executable, str(ROOT)),
            ("compiled", python, ""),
        ):
            generate = ("-m", "sbafab", "generate", template, "-o", name)
            run(program, *generate, folder=tmp_path, source=source)
            root = tmp_path / name
            written[name] = {
                path.relative_to(root): path.read_bytes()
                for path in root.rglob("*")
                if path.is_file()
            }
        assert len(written["plain"]) > 20
        assert written["plain"].keys() == written["compiled"].keys()
        differ = [p for p, content in written["plain"].items() if written["compiled"][p] != content]
        assert differ == []

    def test_the_tests_of_geometry_hold(self, python: Path, tmp_path: Path) -> None:
        (tmp_path / "compiled_only.py").write_text(COMPILED_ONLY, encoding="utf-8")
        options = ("-q", "-p", "no:cacheprovider", "-p", "compiled_only", "-o", "pythonpath=")
        asked = ("-m", "pytest", *options, "-n", "2", "tests/geometry", "tests/rules")
        run(python, *asked, folder=ROOT, source=str(tmp_path))
