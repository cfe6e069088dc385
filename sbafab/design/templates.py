"""The designs and kits that ship, and files that start from them."""

from __future__ import annotations

import difflib
import re
from functools import cache
from pathlib import Path

from sbafab.design.messages import shown
from sbafab.errors import DesignError

KITS = "kits"
"""The folder of the kits that ship, among the templates."""


@cache
def templates_folder() -> Path:
    """The designs that ship: in the installed package, or beside it in a source checkout."""
    packaged = Path(__file__).parents[1] / "templates"
    return packaged if packaged.is_dir() else packaged.parents[1] / "templates"


def template_names() -> list[str]:
    return list(_designs_in(templates_folder()))


def kit_names() -> list[str]:
    """The kits that ship."""
    return list(_designs_in(templates_folder() / KITS))


@cache
def _designs_in(folder: Path) -> tuple[str, ...]:
    """Names of what ships in a folder, which stays as it is while a process runs."""
    return tuple(sorted(path.stem for path in folder.glob("*.toml")))


def template_text(name: str) -> str:
    """The commented text of a design that ships. Raises DesignError if there is none."""
    if name not in template_names():
        raise DesignError(
            f"{shown(name)} is not a template; there are {', '.join(template_names())}"
        )
    return (templates_folder() / f"{name}.toml").read_text(encoding="utf-8")


def template_summaries() -> dict[str, str]:
    """Template names with the first comment line of each."""
    return {
        name: (templates_folder() / f"{name}.toml")
        .read_text(encoding="utf-8")
        .partition("\n")[0]
        .lstrip("# ")
        for name in template_names()
    }


def write_new(template: str, file: Path | None) -> Path:
    """Copies a template's commented file, named after the new file; never over an old one."""
    names = template_names()
    if template not in names:
        near = difflib.get_close_matches(template, names, 1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}"
        raise DesignError(f"{shown(template)} is not a template; {hint}")
    return write_copy(templates_folder() / f"{template}.toml", file or Path(f"{template}.toml"))


def name_of(file: Path) -> str:
    """A design's name from that of its file; empty where nothing of it may be in a name."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem).strip("-._")[:64]


def write_copy(source: Path, target: Path) -> Path:
    """Copies a commented file, named after the new one; never over an old one."""
    text = source.read_text(encoding="utf-8")
    name = name_of(target) or source.stem
    text = text.replace(f'name = "{source.stem}"', f'name = "{name}"', 1)
    try:
        with target.open("x", encoding="utf-8", newline="\n") as opened:
            opened.write(text)
    except FileExistsError:
        raise DesignError(f"{target} exists; choose another name or remove it first") from None
    except OSError as error:
        missing = f"; make the folder {target.parent} first"
        hint = missing if isinstance(error, FileNotFoundError) else "; name another place"
        raise DesignError(f"{target} cannot be written: {error.strerror or error}{hint}") from None
    return target
