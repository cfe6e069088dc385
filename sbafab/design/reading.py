"""Design files and templates in: TOML to validated records, and one clear sentence if not."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from sbafab.design.films import without_other_products
from sbafab.design.messages import listed, sentence, shown
from sbafab.design.records import Design, RuleName
from sbafab.design.templates import kit_names, template_names, templates_folder
from sbafab.design.writing import FITS, plain_tables
from sbafab.errors import DesignError

Change = str | Mapping[str, Any]
"""A key to set: "key.path=value", or a table of keys, which may be dotted, with their values."""
OUTLINE = "chamber.outline"
DIAMETER = "chamber.diameter"
KIT = "kit"
AnyRecord = TypeVar("AnyRecord", bound=BaseModel)
AnyDesign = TypeVar("AnyDesign", bound=Design)
MOST_BYTES = 1_000_000
ASSEMBLY = "assembly"
"""The family of files that name several designs; :mod:`sbafab.assemblies` reads them."""
DEEPEST = 8
"""Most parts of a dotted key; a design file needs three."""
_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*"""
_TOO_DEEP = re.compile(rf"(?<![A-Za-z0-9_-])(?:{_PART}){{{DEEPEST}}}")
_AT_LINE = re.compile(r"\(at line (\d+), column \d+\)")
_UNQUOTED = re.compile(r"[^=#]*=\s*([-+.\d]+\s*[A-Za-z\u00b5\u03bc]+)\s*(?:#.*)?")
"""A line whose value is a number and a unit without quotes."""


def design_path(source: str | Path) -> Path:
    """The file behind a template's name or a path. Raises DesignError if there is none."""
    names = template_names()
    if str(source) in names:
        return templates_folder() / f"{source}.toml"
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
    """What may have been meant by a design that is not there."""
    names = template_names()
    with suppress(OSError, ValueError):
        beside = [path.name for path in missing.parent.iterdir() if _may_be_a_design(path)]
        exact = f"{missing.name}.toml"
        near = [exact] if exact in beside else difflib.get_close_matches(missing.name, beside, 1)
        if near:
            return f"did you mean {missing.with_name(near[0])}?"
    near = difflib.get_close_matches(str(missing), names, 1)
    return f"did you mean {near[0]}?" if near else f"the templates are {', '.join(names)}"


def _may_be_a_design(path: Path) -> bool:
    return path.suffix == ".toml" or (path / "design.toml").is_file()


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a design file. Raises DesignError where it cannot be read."""
    try:
        with path.open("rb") as opened:
            content = opened.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            size = path.stat().st_size
            raise DesignError(
                f"{path} has {size:,} bytes; a design file has at most {MOST_BYTES:,}"
            )
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise DesignError(f"{path} is not a text file in UTF-8; save it as UTF-8") from None
    except OSError as error:
        raise DesignError(f"{path} cannot be read: {error.strerror or error}") from None
    return toml_tables(text, path)


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
        return deepcopy(_parsed(text))
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        reason = str(error) or "nested too deeply"
        # The parser names no key, but its line shows it.
        number = _AT_LINE.search(reason)
        line = text.split("\n")[int(number[1]) - 1] if number else text.rstrip().split("\n")[-1]
        quotes = _UNQUOTED.fullmatch(line)
        hint = f'; a value with a unit stands in quotes: "{quotes[1]}"' if quotes else ""
        raise DesignError(
            f"{path} is not valid TOML: {reason[:1].lower()}{reason[1:]}, "
            f"{shown(line.strip())}{hint}"
        ) from None


@lru_cache(maxsize=8)
def _parsed(text: str) -> dict[str, Any]:
    """The tables of a text; a file that is varied is read again and again."""
    return tomllib.loads(text)


def override(data: Mapping[str, Any], changes: Iterable[Change]) -> dict[str, Any]:
    """``data`` with every change made: keys set by ``key.path=value`` texts or by tables.

    The value in a text is TOML, or else plain text. Raises DesignError for what is no change.
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
    """Every dotted key that the changes set."""
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
    """Sets a dotted key; a table as value changes only the keys that it holds."""
    parts = _key_parts(key)
    if len(parts) > DEEPEST:
        raise DesignError(f"--set {shown(key)} has {len(parts)} parts; a design's keys have three")
    for part in parts[:-1]:
        inner = table.setdefault(part, {})
        if not isinstance(inner, dict):
            raise DesignError(f"--set {key}: {part} is a value, not a table")
        table = inner
    own = table.get(parts[-1])
    if isinstance(value, Mapping):
        table[parts[-1]] = override(own if isinstance(own, dict) else {}, [value])
    else:
        table[parts[-1]] = list(value) if isinstance(value, tuple) else value


def start_where_the_user_stands(data: dict[str, Any], changes: Iterable[Change]) -> None:
    """The path of a drawing or a kit that a change names starts there, not at the design file."""
    keys = set(changed_keys(changes))
    if OUTLINE in keys:
        chamber = data["chamber"]
        chamber["outline"] = str(Path(str(chamber["outline"])).absolute())
    if KIT in keys and isinstance(data[KIT], str) and data[KIT] not in kit_names():
        data[KIT] = str(Path(data[KIT]).absolute())


def open_what_fits(data: dict[str, Any], changes: Iterable[Change]) -> None:
    """A change to what the design must fit opens its chamber, unless a change names that too."""
    keys = set(changed_keys(changes))
    chamber = data.get("chamber")
    fits = DIAMETER not in keys and any(key.startswith(f"{FITS}.") for key in keys)
    if fits and isinstance(chamber, dict):
        chamber.pop("diameter", None)


def changed(design: AnyDesign, changes: Iterable[Change]) -> AnyDesign:
    """The same design with changes made to its keys. Raises DesignError with one sentence."""
    from sbafab.design.kits import under_kit, without_kit

    changes = list(changes)
    data = plain_tables(design)
    if KIT in changed_keys(changes):
        data = without_kit(data, design)
    films = override({"films": {}}, changes).get("films")
    if isinstance(films, dict):
        data["films"] = without_other_products(data.get("films", {}), films)
    data = override(data, changes)
    start_where_the_user_stands(data, changes)
    open_what_fits(data, changes)
    data = under_kit(data, design.folder)
    family = type(design)
    return checked(family, data, {design.family: family}).placed(design.folder).fitted()


def add_waivers(
    data: dict[str, Any], waivers: Sequence[str], known: Sequence[str] = get_args(RuleName)
) -> dict[str, Any]:
    """``data`` with rule names added to ``rules.waive``.

    Raises DesignError for a name that is not among the ``known``, in the command line's words.
    """
    for name in waivers:
        if name not in known:
            near = difflib.get_close_matches(name, known, 3) or [
                rule for rule in known if rule.startswith(name)
            ]
            hint = f"did you mean {' or '.join(near)}" if near else f"it may be {', '.join(known)}"
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


def validated(
    data: Mapping[str, Any], families: Mapping[str, type[Design]], folder: Path
) -> Design:
    """The design record of the family that ``data`` names.

    Raises DesignError with one sentence: field, value, what is allowed, what would fix it.
    """
    family = data.get("family")
    if family is None:
        raise DesignError(f"family is missing; add family = one of {listed(families)}")
    if family == ASSEMBLY:
        raise DesignError(
            f"{shown(data.get('name', folder.name))} is an assembly of several designs; it goes "
            "with generate, check, predict and studio, and other commands take one of its designs"
        )
    if not isinstance(family, str) or family not in families:
        near = difflib.get_close_matches(shown(family).strip("'"), families, 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise DesignError(f"family = {shown(family)} must be one of {listed(families)}{hint}")
    from sbafab.design.kits import under_kit

    return checked(families[family], under_kit(data, folder), families).placed(folder).fitted()


def checked(
    record: type[AnyRecord],
    data: Mapping[str, Any],
    families: Mapping[str, type[Design]],
    prefix: str = "",
) -> AnyRecord:
    """The record of a table; ``prefix`` leads to it. Raises DesignError with one sentence."""
    try:
        return record.model_validate(data)
    except ValidationError as error:
        raise DesignError(sentence(error, record, families, prefix)) from None
