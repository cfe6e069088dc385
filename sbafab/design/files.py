"""Design files: TOML in and out, changes to keys, error messages, hashes, and templates."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from sbafab import catalogue, plugins
from sbafab.design.toml_table import PATTERNS
from sbafab.errors import DesignError, OutputError

REMOVED = (
    *("panel", "registration.experimental", 'registration.method = "sheet"'),
    *("order.shift_hours", "order.technicians", "order.presses", "order.base_plates"),
    *("sheets.stock", "sheets.*.piece", "films.*.sheet.piece", "sheets.engine", "sheets.seconds"),
)
"""Tables, keys ("*": any name) and values of earlier design files."""


KEY_UNITS = {"_kpa": "kPa", "minutes": "minutes", "seconds": "s", "hours": "h", "_speed": "mm/s"}
"""Units of numbers by their keys' suffixes."""


def listed(values: Iterable[object]) -> str:
    """Return values in quotes, separated by commas."""
    return ", ".join(f'"{value}"' for value in values)


def suggestion(name: object, names: Iterable[str]) -> str:
    """Return the known name most similar to another as a question; empty if there is none."""
    near = difflib.get_close_matches(shown(name).strip("'"), names, 1)
    return f"; did you mean {near[0]}?" if near else ""


def hint(name: object, names: Iterable[str], others: str = "") -> str:
    """Return the most similar known name as a question, else ``others``, by default all names."""
    names = list(names)
    return suggestion(name, names)[2:] or others or f"there are {listed(names)}"


def is_file(path: Path) -> bool:
    """Return True for a file; False for an impossible path, such as one with a NUL."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def refuse_file_as_folder(out: Path) -> None:
    """Raise OutputError if a folder for output, or one above it, is a file."""
    for place in (out, *out.parents):
        if is_file(place):
            raise OutputError(f"{place} is a file, not a folder; choose a folder with -o")


def shown(value: object) -> str:
    """Return a value for messages: short, on one line."""
    try:
        text = repr(str(value)) if isinstance(value, str | Path) else str(value)
        if isinstance(value, bool):
            text = text.lower()
    except ValueError:
        # Python does not write out integers of thousands of digits.
        text = "a number of thousands of digits"
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."


def sentence(
    error: ValidationError,
    record: type[BaseModel],
    families: Mapping[str, type[BaseModel]],
    prefix: str,
    file: str = "design file",
) -> str:
    problems = error.errors(include_url=False)
    unknown = [problem for problem in problems if problem["type"] == "extra_forbidden"]
    wrong = [problem for problem in problems if problem["type"] == "literal_error"]
    first = (unknown or wrong or problems)[0]
    # Alternatives of a union put their own name in the location; the file has only keys.
    where = [_plain(part) for part in first["loc"] if not _is_alternative(part)]
    field = (prefix + ".".join(where)).rstrip(".")
    value = first["input"] if isinstance(first["input"], str) else ""
    for name in (field, where[0] if where else "", f'{field} = "{value}"'):
        if any(fnmatchcase(name, key) for key in REMOVED):
            return f"{name} was removed; delete it"
    count = len({tuple(problem["loc"][:2]) for problem in problems}) - 1
    more = f" (and {count} more problem{'s' if count > 1 else ''} like it)" if count > 0 else ""
    if first["type"] == "extra_forbidden":
        return prefix + _unknown_key(where, record, families, file) + more
    if first["type"] == "missing" and isinstance(first["loc"][-1], int):
        short = ".".join(where[:-1])
        return f"{short} is a list without value {first['loc'][-1] + 1}; add it{more}"
    if first["type"] == "missing":
        table = next(_tables_at(record, where[:-1]), None)
        kind = _keys(table)[where[-1]].annotation if table else None
        which = f", as one of {listed(get_args(kind))}" if get_origin(kind) is Literal else ""
        return f"{field} is missing; add it to the {file}{which}{more}"
    is_of_table = first["type"] == "value_error" and isinstance(first["input"], Mapping)
    if not where or is_of_table:
        return f"{field} {_allowed(first)}{more}"
    return f"{field} = {shown(first['input'])} {_allowed(first)}{more}"


def _plain(part: int | str) -> str:
    """Return a key for messages."""
    text = str(part)
    return text if text.isprintable() and len(text) <= 60 else shown(text)


def _is_alternative(part: int | str) -> bool:
    text = str(part)
    return text in {"float", "int", "str"} or "[" in text or "(" in text


ALLOWED = {
    "greater_than": "must be greater than {gt}",
    "greater_than_equal": "must be at least {ge}",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be at most {le}",
    "string_too_long": "must have at most {max_length} letters",
    "too_long": "must have at most {max_length} entries",
    "too_short": "must have at least {min_length} entries",
    "finite_number": "must be a finite number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_parsing_size": "is out of range",
    "float_parsing": "must be a number",
    "float_type": "must be a number",
    "string_type": "must be a text in quotes",
    "string_unicode": "must be plain text; remove characters that are not text",
    "bool_type": "must be true or false",
    "model_type": "must be a table of keys, such as {{key = value}}",
    "model_attributes_type": "must be a table of keys, such as {{key = value}}",
    "tuple_type": "must be a list in brackets",
    "list_type": "must be a list in brackets",
}
"""The allowed values, by pydantic's type of problem."""


def _allowed(problem: Any) -> str:
    kind, context = problem["type"], problem.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    if kind == "literal_error":
        known = re.findall("'([^']*)'", context["expected"])
        return f"must be {context['expected']}{suggestion(problem['input'], known)}"
    if kind == "string_pattern_mismatch":
        return PATTERNS.get(context["pattern"], "must match {pattern}".format(**context))
    if kind == "float_type" and isinstance(problem["input"], str):
        key = str(problem["loc"][-1])
        unit = next((unit for end, unit in KEY_UNITS.items() if key.endswith(end)), "")
        return ALLOWED[kind] + (f" without its unit, in {unit}" if unit else "")
    if kind in ALLOWED:
        return ALLOWED[kind].format(**context)
    return f"is not allowed: {problem['msg'].lower()}"


def _unknown_key(
    where: Sequence[str],
    record: type[BaseModel],
    families: Mapping[str, type[BaseModel]],
    file: str,
) -> str:
    field = ".".join(where)
    families_with_key = [name for name, model in families.items() if field in key_paths(model)]
    if families_with_key:
        return f"{field} is not a key of this family; it belongs to {listed(families_with_key)}"
    if where[-2:-1] == ["faces"]:
        return f"{field} is not a key of a film's faces; they are upper and lower"
    is_used = getattr(record, "uses", bool)
    paths = [path for path in key_paths(record) if is_used(path)]
    table = ".".join(where[:-1])
    record_at = next(_tables_at(record, where[:-1]), None)
    siblings = [f"{table}.{key}".lstrip(".") for key in _keys(record_at)] if record_at else []
    # A key without its table; otherwise a misspelt key.
    near = _nearest(field, paths, 1.0) or _nearest(where[-1], siblings, 0.6)
    # A truncated key belongs to its own table, not to a similar key of another.
    if near is None and not any(path.startswith(field) for path in siblings):
        near = _nearest(where[-1], paths, 0.75)
    if near:
        return f"{field} is not a key of a {file}; did you mean {near}?"
    known = f"; known here: {', '.join(siblings)}" if siblings else ""
    return f"{field} is not a key of a {file}{known}"


def _nearest(key: str, paths: Iterable[str], cutoff: float) -> str | None:
    """Return up to three paths whose last part is most similar to ``key``, the pockets' first."""
    leaves: dict[str, list[str]] = {}
    for path in sorted(paths, key=lambda path: not path.startswith("chamber.")):
        leaves.setdefault(path.split(".")[-1], []).append(path)
    near = difflib.get_close_matches(key, leaves, 1, cutoff)
    *others, last = leaves[near[0]][:3] if near else [""]
    return f"{', '.join(others)} or {last}" if others else last or None


def _keys(record: type[BaseModel]) -> dict[str, FieldInfo]:
    """Return the keys of a table, as spelled in a file."""
    return {info.alias or name: info for name, info in record.model_fields.items()}


def _tables_at(kind: Any, where: Sequence[str]) -> Iterator[type[BaseModel]]:
    """Yield the records of the table at a location, skipping list rows and users' names."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        keys = _keys(kind)
        if not where:
            yield kind
        elif where[0] in keys:
            yield from _tables_at(keys[where[0]].annotation, where[1:])
        elif kind.model_config.get("extra") == "allow":
            # Tables named by the user, such as further films.
            yield from _tables_at(get_type_hints(kind)["__pydantic_extra__"], where)
        return
    # A list and a table of tables take a part of the location; alternatives take none.
    takes = isinstance(get_origin(kind), type) and issubclass(get_origin(kind), Collection)
    for inner in get_args(kind):
        yield from _tables_at(inner, where[1:] if takes else where)


def key_paths(record: type[BaseModel], prefix: str = "") -> dict[str, object]:
    """Return every dotted key of a record, as spelled in a file, with its annotation."""
    paths: dict[str, object] = {}
    for key, info in _keys(record).items():
        paths[prefix + key] = info.annotation
        if isinstance(info.annotation, type) and issubclass(info.annotation, BaseModel):
            paths.update(key_paths(info.annotation, f"{prefix}{key}."))
    return paths


# Design files and templates in: TOML to validated records, and one clear sentence if not.


Change = str | Mapping[str, Any]
"""A key to set: "key.path=value", or a table of keys, which may be dotted, with their values."""
OUTLINE = "chamber.outline"
DIAMETER = "chamber.diameter"
_SHAPE_FILE = re.compile(r"shapes\.[^.]+\.file")
KIT = "kit"
FITS = "fits"
AnyRecord = TypeVar("AnyRecord", bound=BaseModel)
MOST_BYTES = 1_000_000
ASSEMBLY = "assembly"
"""The family of files with several designs; :mod:`sbafab.assemblies` reads them."""
DEEPEST = 8
"""Most parts of a dotted key; a design file needs three."""
_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*"""
_TOO_DEEP = re.compile(rf"(?<![A-Za-z0-9_-])(?:{_PART}){{{DEEPEST}}}")
_AT_LINE = re.compile(r"\(at line (\d+), column \d+\)")
_UNQUOTED = re.compile(r"[^=#]*=\s*([-+.\d]+\s*[A-Za-z\u00b5\u03bc]+)\s*(?:#.*)?")
"""A line whose value is a number and a unit without quotes."""


def design_path(source: str | Path) -> Path:
    """Return the file behind a template's name or a path. Raises DesignError if there is none."""
    if str(source) in template_names():
        return _template(str(source))
    path = Path(source)
    try:
        if path.is_file():
            return path
        is_folder = path.is_dir()
    except (OSError, ValueError):
        is_folder = False
    if is_folder:
        raise DesignError(f"{shown(source)} is a folder; give a design file (.toml) or a template")
    raise DesignError(f"{shown(source)} is neither a template nor a design file; {_hint(path)}")


def _hint(missing: Path) -> str:
    """Return a suggestion for a design that does not exist."""
    names = template_names()
    with suppress(OSError, ValueError):
        beside = [
            path.name
            for path in missing.parent.iterdir()
            if path.suffix == ".toml" or (path / "design.toml").is_file()
        ]
        exact = f"{missing.name}.toml"
        near = [exact] if exact in beside else difflib.get_close_matches(missing.name, beside, 1)
        if near:
            return f"did you mean {missing.with_name(near[0])}?"
    return hint(missing, names, f"the templates are {', '.join(names)}")


def read_bytes(path: Path, most: int) -> bytes:
    """Return the content of a file. Raises DesignError if it cannot be read, or is too large."""
    try:
        with path.open("rb") as opened:
            content = opened.read(most + 1)
        size = len(content) if len(content) <= most else path.stat().st_size
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DesignError(f"{path} cannot be read: {reason}; check its path") from None
    if size > most:
        raise DesignError(f"{path} has {size:,} bytes, where at most {most:,} are allowed")
    return content


def read_text(path: Path, most: int = MOST_BYTES) -> str:
    """Return the text of a file in UTF-8. Raises DesignError."""
    try:
        return read_bytes(path, most).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise DesignError(f"{path} is not a text file in UTF-8; save it as UTF-8") from None


def read_toml(path: Path) -> dict[str, Any]:
    """Return the tables of a design file. Raises DesignError if it cannot be read."""
    return toml_tables(read_text(path), path)


def toml_tables(text: str, path: str | Path) -> dict[str, Any]:
    """The tables of a design file's text; ``path`` names it in messages. Raises DesignError."""
    # The parser's time grows with the square of the parts of a key.
    deep = _TOO_DEEP.search(text)
    if deep is not None:
        raise DesignError(
            f"{path} has a key of {DEEPEST} or more parts in line "
            f"{text.count(chr(10), 0, deep.start()) + 1}; write [table] and key = value"
        )
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        reason = str(error) or "nested too deeply"
        # The parser names no key, but its line shows it.
        number = _AT_LINE.search(reason)
        line = text.split("\n")[int(number[1]) - 1] if number else text.rstrip().split("\n")[-1]
        quotes = _UNQUOTED.fullmatch(line) if len(line) < LONGEST_LINE else None
        hint = f'; a value with a unit stands in quotes: "{quotes[1]}"' if quotes else ""
        raise DesignError(
            f"{path} is not valid TOML: {reason[:1].lower()}{reason[1:]}, "
            f"{shown(line.strip())}{hint}"
        ) from None


LONGEST_LINE = 120
"""Letters of a line that a message repeats."""


def override(data: Mapping[str, Any], changes: Iterable[Change]) -> dict[str, Any]:
    """Return ``data`` with every change made: keys set by ``key.path=value`` texts or by tables.

    The value in a text is TOML or plain text. Raises DesignError for an invalid change.
    """
    changed = _copied(data)
    for change in changes:
        if isinstance(change, str):
            key, equals, text = change.partition("=")
            if not equals or not all(_key_parts(key)):
                raise DesignError(
                    f"--set {shown(change)} is not KEY=VALUE; write for example "
                    "--set chamber.diameter=6"
                )
            _set(changed, key, _value(text.strip()))
        else:
            for key, value in change.items():
                _set(changed, key, value)
    return changed


def changed_keys(changes: Iterable[Change]) -> Iterator[str]:
    """Return every dotted key that the changes set."""
    for change in changes:
        if isinstance(change, str):
            yield ".".join(_key_parts(change.partition("=")[0]))
            continue
        for key, value in change.items():
            inner = changed_keys([value]) if isinstance(value, Mapping) else ()
            yield from (f"{key}.{name}" for name in inner)
            yield key


def _key_parts(key: str) -> list[str]:
    return [part.strip() for part in key.split(".")]


def _set(table: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key; a table as value changes only its own keys."""
    parts = _key_parts(key)
    if len(parts) > DEEPEST:
        raise DesignError(f"--set {shown(key)} has {len(parts)} parts; a design's keys have three")
    for part in parts[:-1]:
        inner = table.setdefault(part, {})
        if not isinstance(inner, dict):
            raise DesignError(f"--set {key}: {part} is a value, not a table")
        table = inner
    current = table.get(parts[-1])
    if isinstance(value, Mapping):
        table[parts[-1]] = override(current if isinstance(current, dict) else {}, [value])
    else:
        table[parts[-1]] = as_in_a_file(value)


def as_in_a_file(value: Any) -> Any:
    """Return a value in TOML types: tuples and arrays as lists, NumPy numbers as Python's."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: as_in_a_file(inner) for key, inner in value.items()}
    return [as_in_a_file(inner) for inner in value] if type(value) in (list, tuple) else value


def with_changes(data: Mapping[str, Any], changes: Iterable[Change]) -> dict[str, Any]:
    """Return a design's tables with changes to its keys.

    Paths of drawings and kits in the changes are relative to the working directory. Changes to
    ``fits`` clear ``chamber.diameter`` unless they set it. Raises DesignError for invalid changes.
    """
    changes = list(changes)
    changed, keys = override(data, changes), set(changed_keys(changes))
    chamber: Any = changed.get("chamber")
    if OUTLINE in keys:
        chamber["outline"] = _from_user(chamber["outline"])
    for key in filter(_SHAPE_FILE.fullmatch, keys):
        shape = changed["shapes"][key.split(".")[1]]
        shape["file"] = _from_user(shape["file"])
    if KIT in keys and isinstance(changed[KIT], str) and changed[KIT] not in kit_names():
        changed[KIT] = _from_user(changed[KIT])
    fits = DIAMETER not in keys and any(key.startswith(f"{FITS}.") for key in keys)
    if fits and isinstance(chamber, dict):
        chamber.pop("diameter", None)
    return changed


def _from_user(path: object) -> str:
    return str(Path(str(path)).absolute())


def rule_names() -> tuple[str, ...]:
    """Return the names of all rules, those of installed packages last."""
    return (*catalogue.names("rules"), *(entry.name for entry in plugins.installed(plugins.RULES)))


def add_waivers(
    data: dict[str, Any], waivers: Sequence[str], checks: Sequence[str] = ()
) -> dict[str, Any]:
    """Return ``data`` with names of rules, or of ``checks``, added to ``rules.waive``.

    Raises DesignError for other names, with the message of the command line.
    """
    names = (*rule_names(), *checks) if waivers else ()
    for name in waivers:
        if name not in names:
            near = difflib.get_close_matches(name, names, 3) or [
                rule for rule in names if rule.startswith(name)
            ]
            hint = f"did you mean {' or '.join(near)}" if near else f"it may be {', '.join(names)}"
            raise DesignError(f"--waive {shown(name)}: no rule has that name; {hint}")
    rules = data.get("rules", {})
    if not waivers or not isinstance(rules, dict) or not isinstance(rules.get("waive", []), list):
        return data
    return {**data, "rules": {**rules, "waive": [*rules.get("waive", []), *waivers]}}


def _copied(data: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _copied(value) if isinstance(value, dict) else value for key, value in data.items()
    }


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (tomllib.TOMLDecodeError, RecursionError, ValueError):
        return text


def checked(
    record: type[AnyRecord],
    data: Mapping[str, Any],
    families: Mapping[str, type[BaseModel]],
    prefix: str = "",
    file: str = "design file",
) -> AnyRecord:
    """Return the record of a table; ``prefix`` leads to it, in a ``file`` of this kind."""
    try:
        return record.model_validate(data)
    except ValidationError as error:
        raise DesignError(sentence(error, record, families, prefix, file)) from None


# The bundled designs and kits, and files that start from them.


KITS = "kits"
"""The folder of the bundled kits, among the templates."""


@cache
def templates_folder() -> Path:
    """Return the folder of the templates: in the installed package, or in a source checkout."""
    packaged = Path(__file__).parents[1] / "templates"
    return packaged if packaged.is_dir() else packaged.parents[1] / "templates"


def template_names() -> list[str]:
    return list(_designs_in(templates_folder()))


def kit_names() -> list[str]:
    """Return the names of the bundled kits."""
    return list(_designs_in(templates_folder() / KITS))


@cache
def _designs_in(folder: Path) -> tuple[str, ...]:
    """Return the names of the bundled files in a folder, which does not change during a process."""
    return tuple(sorted(path.stem for path in folder.glob("*.toml")))


def _template(name: str) -> Path:
    """Return the file of a template. Raises DesignError if there is none."""
    names = template_names()
    if name not in names:
        raise DesignError(f"{shown(name)} is not a template; {hint(name, names)}")
    return templates_folder() / f"{name}.toml"


def template_text(name: str) -> str:
    """Return the commented text of a template. Raises DesignError if there is none."""
    return _template(name).read_text(encoding="utf-8")


def template_summaries() -> dict[str, str]:
    """Return template names with the first comment line of each."""
    return {name: template_text(name).partition("\n")[0].lstrip("# ") for name in template_names()}


def write_new(template: str, file: Path | None) -> Path:
    """Copy a template's commented file, named after the new file, without overwriting."""
    return write_copy(_template(template), file or Path(f"{template}.toml"))


def name_of(text: str) -> str:
    """Return a design's name from a text or a file's stem; empty if no character is allowed."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", text).strip("-._")[:64]


def write_copy(source: Path, target: Path) -> Path:
    """Copy a commented file, named after the new one, without overwriting."""
    text = source.read_text(encoding="utf-8")
    name = name_of(target.stem) or source.stem
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
