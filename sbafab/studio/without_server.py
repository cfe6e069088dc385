"""The studio as a folder of files: Python runs in the page, any web server can hand it out.

Pyodide, which is Python compiled for the browser, is brought by the user and copied, with what its
Python needs; the page asks no other host. Equal input gives equal bytes.
"""

from __future__ import annotations

import json
import re
import shutil
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import sbafab
from sbafab.design.files import templates_folder
from sbafab.errors import DesignError, OutputError
from sbafab.output.swap import BEGUN, put_in_place
from sbafab.studio.places import packed

STATIC = Path(__file__).parent / "static"
PURE = ("annotated-types", "filelock", "tomli-w", "tomlkit", "typing-extensions")
PURE_OF_PYDANTIC = ("pydantic", "typing-inspection")
"""Python alone: taken from where sbafab runs; the latter two match the core of pydantic there."""
CORE, NUMPY = "pydantic-core", "numpy"
NEEDED = ("pyodide.mjs", "pyodide.asm.wasm", "python_stdlib.zip", "pyodide-lock.json")
EITHER = ("pyodide.asm.mjs", "pyodide.asm.js")
"""Newer and older name of one file."""
COMPILED = {".pyc", ".so", ".pyd"}
INDEX, LISTING = "index.html", "python/python.json"
POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; "
    "style-src 'self'; img-src 'self' blob: data:; connect-src 'self' blob:; frame-src blob:; "
    "base-uri 'none'; form-action 'none'"
)
HOW = "npm pack pyodide && tar xzf pyodide-*.tgz, then --pyodide package"


@dataclass(frozen=True)
class Wheel:
    """A wheel for the page's Python."""

    path: Path
    project: str
    version: str


@dataclass(frozen=True)
class Pyodide:
    """Python for the browser as it lies in a folder, with the wheels beside it that fit."""

    folder: Path
    python: str
    abi: str
    wheels: tuple[Wheel, ...]

    def wheel(self, project: str, version: str | None = None) -> Wheel | None:
        """The wheel of a project, of this version if one is asked for."""
        wheels = (wheel for wheel in self.wheels if wheel.project == project)
        return next((wheel for wheel in wheels if version in {None, wheel.version}), None)


@dataclass(frozen=True)
class WrittenPage:
    """The folder that was written, and what it goes without."""

    folder: Path
    bytes: int
    lacks: tuple[str, ...]


def write(folder: Path, pyodide: Path | None) -> WrittenPage:
    """Writes the page into the folder, which is new, empty or such a page already.

    Raises DesignError for what is missing, with what adds it, and OutputError, also where files
    that the page did not write would go.
    """
    python = _pyodide(pyodide or Path("node_modules/pyodide"))
    wheels, pure = _chosen(python)
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise OutputError(f"{folder} is a file or a link; choose a new or empty folder")
    foreign = sorted(set(_files(folder)) - set(_listed(folder)))
    if foreign:
        raise OutputError(
            f"{folder} holds {foreign[0]}, which the page did not write; move it away, or choose a "
            "new folder"
        )
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=BEGUN, dir=folder.parent))
        try:
            fresh.chmod(0o755)
            _write_page(fresh, python, wheels, pure)
            put_in_place(fresh, folder)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror or error}") from None
    size = sum((folder / path).stat().st_size for path in _files(folder))
    lacks = () if any(wheel.project == NUMPY for wheel in wheels) else (NUMPY,)
    return WrittenPage(folder, size, lacks)


def _files(folder: Path) -> list[str]:
    """All that lies in a folder, by its place there."""
    return [
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_symlink() or not path.is_dir()
    ]


def _listed(folder: Path) -> list[str]:
    """Return the files of a page that was written here; none where there is none."""
    try:
        listing = json.loads((folder / LISTING).read_text(encoding="utf-8"))
        return [str(name) for name in listing["files"]]
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _pyodide(folder: Path) -> Pyodide:
    missing = [name for name in NEEDED if not (folder / name).is_file()]
    if not missing and not any((folder / name).is_file() for name in EITHER):
        missing = [EITHER[0]]
    if missing:
        raise DesignError(
            f"{folder} holds no Pyodide ({missing[0]} is missing), which sbafab does not bring "
            f"along; fetch it with {HOW}"
        )
    try:
        info = json.loads((folder / "pyodide-lock.json").read_text("utf-8"))["info"]
        python, abi = ".".join(info["python"].split(".")[:2]), str(info["abi_version"])
    except (ValueError, KeyError, TypeError, AttributeError, OSError):
        raise DesignError(
            f"{folder / 'pyodide-lock.json'} does not say for which Python it is; fetch Pyodide "
            f"again with {HOW}"
        ) from None
    wheels = (_wheel(path, python, abi) for path in sorted(folder.glob("*.whl"), reverse=True))
    return Pyodide(folder, python, abi, tuple(wheel for wheel in wheels if wheel is not None))


def _wheel(path: Path, python: str, abi: str) -> Wheel | None:
    """The wheel, None where it is for another Python or machine."""
    parts = path.stem.split("-")
    if len(parts) not in {5, 6}:
        return None
    tag, _, machine = parts[-3:]
    python_tag = f"cp{python.replace('.', '')}"
    fits = machine == "any" or (tag == python_tag and machine.endswith(f"_{abi}_wasm32"))
    return Wheel(path, _project(parts[0]), parts[1]) if fits else None


def _project(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _chosen(python: Pyodide) -> tuple[list[Wheel], list[str]]:
    """Wheels out of Pyodide's folder, and projects taken from where sbafab runs.

    pydantic and its core fit each other in one version only: those installed here if the core lies
    in the folder, else those of the folder.
    """
    needed = _core_version(metadata.requires("pydantic") or ())
    core, pydantic = python.wheel(CORE, needed), None
    if core is None:
        pydantic = python.wheel("pydantic")
        core = python.wheel(CORE, _core_version(_requirements(pydantic))) if pydantic else None
    if core is None:
        digits = python.python.replace(".", "")
        raise DesignError(
            f"pydantic-core {needed} for Pyodide's Python {python.python} is not in "
            f"{python.folder}; add it with pip download --no-deps --only-binary :all: "
            f"--python-version {python.python} --implementation cp --abi cp{digits} --platform "
            f"pyemscripten_{python.abi}_wasm32 --dest {python.folder} pydantic-core=={needed}"
        )
    numpy = python.wheel(NUMPY)
    wheels = [core, *([numpy] if numpy else [])]
    if pydantic is None:
        return wheels, [*PURE, *PURE_OF_PYDANTIC]
    return [*wheels, pydantic], [*PURE, *PURE_OF_PYDANTIC[1:]]


def _core_version(requirements: Sequence[str]) -> str | None:
    """The version of its core that pydantic asks for."""
    matches = (
        re.match(r"pydantic[-_]core\s*\(?==\s*([\w.]+)", requirement)
        for requirement in requirements
    )
    return next((match[1] for match in matches if match), None)


def _requirements(wheel: Wheel) -> list[str]:
    with (
        suppress(OSError, KeyError, StopIteration, zipfile.BadZipFile),
        zipfile.ZipFile(wheel.path) as archive,
    ):
        name = next(n for n in archive.namelist() if n.endswith(".dist-info/METADATA"))
        lines = archive.read(name).decode("utf-8").splitlines()
        head = "Requires-Dist: "
        return [line.removeprefix(head) for line in lines if line.startswith(head)]
    return []


def _write_page(
    folder: Path, python: Pyodide, wheels: Sequence[Wheel], pure: Sequence[str]
) -> None:
    shutil.copytree(STATIC, folder, dirs_exist_ok=True)
    index = (STATIC / INDEX).read_text(encoding="utf-8")
    head = (
        '<meta name="sbafab-without-server">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
    )
    index = index.replace('<meta charset="utf-8">\n', f'<meta charset="utf-8">\n{head}')
    (folder / INDEX).write_text(index, encoding="utf-8", newline="\n")
    python_folder = folder / "python"
    python_folder.mkdir()
    for name in (*NEEDED, *EITHER):
        if (python.folder / name).is_file():
            shutil.copyfile(python.folder / name, python_folder / name)
    for wheel in wheels:
        shutil.copyfile(wheel.path, python_folder / wheel.path.name)
    (python_folder / "sbafab.zip").write_bytes(packed(_program()))
    (python_folder / "packages.zip").write_bytes(
        packed(file for name in pure for file in _installed(name))
    )
    listing = {
        "archives": ["sbafab.zip", "packages.zip"],
        "wheels": [wheel.path.name for wheel in wheels],
        "files": sorted([*_files(folder), LISTING]),
    }
    (folder / LISTING).write_text(
        json.dumps(listing, indent=1) + "\n", encoding="utf-8", newline="\n"
    )


def _program() -> Iterator[tuple[str, bytes]]:
    """The program's own code and templates, without what is compiled or lies beside it."""
    root = Path(sbafab.__file__).parent
    templates = templates_folder()
    for path in sorted(root.rglob("*")):
        inner = path.relative_to(root)
        beside = inner.parts[0] == "templates" or inner.parts[:2] == ("studio", "static")
        if path.is_file() and path.suffix not in COMPILED and not beside:
            yield f"sbafab/{inner.as_posix()}", path.read_bytes()
    for path in sorted(templates.rglob("*.toml")):
        yield f"sbafab/templates/{path.relative_to(templates).as_posix()}", path.read_bytes()


def _installed(project: str) -> Iterator[tuple[str, bytes]]:
    """The files of an installed project that is Python alone. Raises DesignError without it."""
    try:
        files = metadata.files(project)
    except metadata.PackageNotFoundError:
        files = None
    if not files:
        raise DesignError(f"{project} is not installed here; pip install {project}")
    for file in sorted(files, key=str):
        if file.suffix in {".py", ".typed"} or file.name == "METADATA":
            yield file.as_posix(), file.read_binary()
