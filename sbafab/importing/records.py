"""The result of an import: the tables of a design and its drawings, and their files."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from sbafab.actuators import build, load_design
from sbafab.design.files import shown
from sbafab.design.records import Design
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.region import Region, polygon, union
from sbafab.laminate.laminate import Laminate

if TYPE_CHECKING:
    import shapely

LAYERS = "layers.csv"
"""The table of layers in a folder of drawings."""
UNNAMED = "import"
"""Name of a design whose source names none."""
MOST_NAMED = 20
"""At most this many places of one kind are named one by one."""


@dataclass(frozen=True)
class Imported:
    """A design of drawn layers as ``tables`` of its file, and the content of its ``drawings``.

    Shapes, kit and calibration name a drawing by its key. ``remarks`` list, by place, items that
    were not imported and the interpretation of ambiguous input.
    """

    tables: Mapping[str, Any]
    drawings: Mapping[str, bytes] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def toml_text(tables: Mapping[str, Any], head: Iterable[str] = ()) -> str:
    """Return a design file: single keys, lists with one row per line, then tables."""
    import tomli_w

    lines = [f"# {line}" for line in head]
    singles = {key: value for key, value in tables.items() if not isinstance(value, dict)}
    for key, value in singles.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            rows = "".join(f"  {_inline(row)},\n" for row in value)
            lines.append(f"{key} = [\n{rows}]")
        else:
            lines.append(f"{key} = {_inline(value)}")
    shapes = tables.get("shapes", {})
    if shapes:
        lines += ["", "[shapes]", *(f"{name} = {_inline(row)}" for name, row in shapes.items())]
    rest = {
        key: value
        for key, value in tables.items()
        if isinstance(value, dict) and value and key != "shapes"
    }
    return "\n".join(lines) + "\n" + ("\n" + tomli_w.dumps(rest) if rest else "")


def _inline(value: Any) -> str:
    """Return a TOML value on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_inline(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_inline, value)) + "]"
    # A JSON string with only JSON's own escapes is a TOML string; so are numbers and booleans.
    return json.dumps(value, ensure_ascii=False)


def key_name(text: str, taken: Iterable[str], fallback: str = "x") -> str:
    """Return a text as a name of lower case letters, digits and - that is not ``taken``."""
    stem = re.sub(r"[^a-z0-9-]+", "-", text.lower()).strip("-")[:24]
    if not stem or not stem[0].isalpha():
        stem = f"{fallback}{stem}"
    taken = set(taken)
    number, name = 1, stem
    while name in taken:
        number += 1
        name = f"{stem}-{number}"
    return name


def named(remark: str, places: list[str]) -> list[str]:
    """Return a remark for each of the places, or one for all if there are many."""
    remarks = [f"{place}: {remark}" for place in places[:MOST_NAMED]]
    if len(places) > MOST_NAMED:
        remarks.append(f"and {len(places) - MOST_NAMED} more places: {remark}")
    return remarks


def json_of(path: Path, text: str) -> Any:
    """Return the content of a JSON file's text. Raises DesignError with the place at fault."""
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno} column {error.colno}: {error.msg.lower()}"
    except RecursionError:
        where = "its lists and objects are nested too deep"
    except ValueError:
        where = "a number in it is too long"
    raise DesignError(f"{path} is not valid JSON: {where}; correct it, or save it again")


def read_yaml(path: Path, text: str, what: str, loader_of: Callable[[Any], Any]) -> Any:
    """Return the content of YAML, read by the loader that is made of the module.

    Raises DesignError if it is not ``what``, or the extra is not installed.
    """
    try:
        import yaml
    except ImportError:
        raise DesignError(
            f'{path} is YAML, which needs PyYAML; pip install "sbafab[yaml]"'
        ) from None
    try:
        return yaml.load(text, loader_of(yaml))
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        line = " ".join(str(error).split())
        raise DesignError(f"{path} is not valid YAML for {what}: {line}; save it again") from None


def layer_index(path: Path | str, number: str, count: int) -> int:
    """Return the index of a layer that a table names by its number. Raises DesignError."""
    if not number.isdecimal() or not 1 <= int(number) <= count:
        raise DesignError(
            f"{path} has no layer {shown(number)}; its layers are 1 to {count}, bottom to top"
        )
    return int(number) - 1


def refuse_without_table(path: Path, layers: str, layer: str, more: str = "") -> NoReturn:
    """Refuse layers that are imported without a table of them."""
    raise DesignError(
        f"{path} has {layers} but not their roles; write {LAYERS} beside it, with a row "
        f'"{path.name},ROLE,{layer}" a layer under "file,role,layer", and import the folder{more}'
    )


def region_of(drawn: shapely.Polygon) -> Region:
    """Return a polygon of shapely as a region."""
    outer, *holes = (
        polygon([(float(x), float(y)) for x, y, *_ in ring.coords[:-1]])
        for ring in (drawn.exterior, *drawn.interiors)
    )
    return outer - union(holes)


# Out: all or nothing, never over an existing file.


FOLDER = "-drawings"
"""Suffix of the folder for drawings beside a design."""


class Written(NamedTuple):
    """An imported design on disk: its file, record and laminate."""

    file: Path
    design: Design
    laminate: Laminate


def write_imported(imported: Imported, file: Path, source: str) -> Written:
    """Write a design file and the folder of its drawings beside it.

    The design is read and its laminate built before anything is written. Raises DesignError if the
    design cannot be built, OutputError if a file already exists.
    """
    folder = file.with_name(f"{file.stem}{FOLDER}")
    for path in (file, folder) if imported.drawings else (file,):
        if path.exists():
            raise OutputError(
                f"{path} already exists; move it, or choose another place with -o or --to"
            )
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent, prefix=f".{file.stem}.") as name:
            fresh = Path(name)
            drawings = fresh / folder.name
            if imported.drawings:
                drawings.mkdir()
            for drawing, content in imported.drawings.items():
                (drawings / drawing).write_bytes(content)
            tables = _in_folder(imported.tables, imported.drawings, folder.name)
            text = toml_text(tables, [f"Imported from {source}. Layers go bottom to top."])
            (fresh / file.name).write_text(text, encoding="utf-8", newline="\n")
            _built(fresh / file.name)
            if imported.drawings:
                drawings.rename(folder)
            try:
                (fresh / file.name).rename(file)
            except OSError:
                with contextlib.suppress(OSError):
                    shutil.rmtree(folder)
                raise
    except OSError as error:
        raise OutputError(
            f"{file} cannot be written: {error.strerror or error}; choose another folder with -o"
        ) from None
    return Written(file, *_built(file))


def _built(file: Path) -> tuple[Design, Laminate]:
    try:
        design = load_design(file)
        return design, build(design)
    except DesignError as error:
        # The folder in the message is gone by the time it is read.
        raise DesignError(str(error).replace(f"{file.parent}/", "")) from None


def _in_folder(
    tables: Mapping[str, Any], drawings: Mapping[str, bytes], folder: str
) -> dict[str, Any]:
    """Return the tables with the drawings' paths relative to the design file."""

    def place(value: Any) -> Any:
        return f"{folder}/{value}" if value in drawings else value

    placed = dict(tables)
    placed["shapes"] = {
        name: {**row, "file": place(row["file"])} if "file" in row else row
        for name, row in tables.get("shapes", {}).items()
    }
    if "kit" in tables:
        placed["kit"] = place(tables["kit"])
    if "calibration" in tables.get("models", {}):
        models = tables["models"]
        placed["models"] = {**models, "calibration": place(models["calibration"])}
    return placed
