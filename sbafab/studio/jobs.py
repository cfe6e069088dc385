"""The jobs of the page: each yields its answers.

A job is a table with ``do`` and the text of a design; ``pause`` raises once the answer is no longer
needed. Files are sought only in ``folder``.
"""

from __future__ import annotations

import sys
import tomllib
import traceback
from collections.abc import Callable, Iterable, Iterator, MutableMapping, MutableSequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit
import tomlkit.items
from tomlkit.exceptions import TOMLKitError

from sbafab import api
from sbafab.api.designs import Assembled, Design, Laminate
from sbafab.errors import DesignError, SbafabError
from sbafab.studio import design_files
from sbafab.studio.answers import (
    CancelCheck,
    Filling,
    finding_model,
    laminate_model,
    movers,
    nets_model,
    part_poses,
    parts_model,
    poses,
    remembered,
    shapes_model,
    stack_model,
    stack_of,
    whole_prediction,
)
from sbafab.studio.forms import keys

StudioJob = dict[str, Any]
Answer = dict[str, Any]
_FILLINGS: dict[str, Filling] = {}
MOST_FILLINGS = 8  # number of tabs whose actuators can inflate at the same time


def live(job: StudioJob, pause: CancelCheck) -> Iterator[Answer]:
    """Yield the edited text and design, then the displayed results as they become known.

    Laminate and prediction precede the rules; the yield is the last rule.
    """
    text = _text(job)
    yield {"kind": "text", "text": text}
    source = _source(text, job)
    design = _read(source)
    if design.family == "assembly":
        yield from _assembly(source, job, pause)
        return
    facts = {"name": design.name, "family": design.family, "values": api.resolved(design)}
    yield {"kind": "design", **facts}
    pause()
    has = frozenset(job.get("has", ()))
    drawn = design.drawn_shapes()
    if drawn:
        yield shapes_model(drawn, has)
    laminate = _laminate(source)
    yield laminate_model(laminate, has)
    pause()
    yield _prediction(design, laminate)
    pause()
    for number, (rule, findings) in enumerate(api.checking(design, laminate, pause), 1):
        yield {
            "kind": "rule",
            "rule": rule,
            "number": number,
            "findings": [finding_model(finding) for finding in findings],
        }
        pause()
    # After the rules, which the user waits for.
    yield nets_model(laminate, api.nets_of(design), has)
    yield {"kind": "checked"}


def _assembly(source: _Source, job: StudioJob, pause: CancelCheck) -> Iterator[Answer]:
    """Return an assembly's keys, its parts in place, and the findings on and between them."""
    assembly = _read(source)
    yield {"kind": "assembly", "name": assembly.name, "values": api.resolved(assembly)}
    pause()
    assembled = _assembled(source)
    yield parts_model(assembled, frozenset(job.get("has", ())))
    pause()
    # The checks of the whole take seconds, and run when the user pauses.
    yield {"kind": "prediction", "quick": True, "figures": [], "left_out": []}
    checked = api.check(assembly, progress=lambda *_: pause())
    findings = [finding_model(finding) for finding in checked]
    yield {"kind": "rule", "rule": "assembly", "number": 1, "findings": findings}
    yield {"kind": "checked"}


def _prediction(design: Design, laminate: Laminate) -> Answer:
    """Return figures from closed formulas; the reason if there are none."""
    try:
        prediction = api.predict(design, quick=True, laminate=laminate)
    except SbafabError as error:
        return {"kind": "unpredicted", "message": str(error)}
    return {"kind": "prediction", "quick": True, **prediction.as_dict()}


def elastic(job: StudioJob, pause: CancelCheck) -> Iterator[Answer]:
    """Return all figures, including those of the elastic stack, which take seconds."""
    source = _source(_text(job), job)
    design = _read(source)
    pause()
    if design.family == "assembly":
        yield whole_prediction(_assembled(source), job.get("pose", {}), pause)
    else:
        yield {"kind": "prediction", **api.predict(design).as_dict()}


def generate(job: StudioJob, pause: CancelCheck) -> Iterator[Answer]:
    """Write the folder of a design into ``out`` with progress; the last answer names it."""
    tell: Callable[[Answer], None] = job["tell"]

    def progress(stage: str, done: int, total: int) -> None:
        pause()
        tell({"kind": "progress", "what": stage, "done": done, "total": total})

    run = api.generate(_read(_source(_text(job), job)), out=job["out"], progress=progress)
    files = sorted([*run.manifest.get("files", ()), "manifest.json"]) if run.manifest else []
    findings = [finding_model(finding) for finding in run.findings]
    facts = {"failed": run.failed, "kept": run.kept, "files": files, "findings": findings}
    yield {"kind": "made", "name": run.folder.name, **facts}


def motion(job: StudioJob, pause: CancelCheck) -> Iterator[Answer]:
    """Return the actuator as a fast stack, and its poses as its pressures rise together.

    The pose is at ``pressures``, or absent for the preliminary data of the page; for an assembly,
    at the pressures of each of its ``parts``.
    """
    source, pose = _source(_text(job), job), job.get("pose", {})
    design = _read(source)
    if design.family == "assembly":
        assembled = _assembled(source)
        pause()
        if "parts" in pose:
            yield part_poses(assembled, pose)
        else:
            yield {"kind": "movers", "movers": list(movers(assembled))}
        return
    stack = stack_of(design)
    pause()
    if "pressures" not in pose:
        yield stack_model(design.name, stack)
        return
    if pose.get("tube"):
        filling = remembered(_FILLINGS, job["tab"], Filling, MOST_FILLINGS)
        yield filling.step(stack, pose)
        return
    for answer in poses(stack, pose):
        yield answer
        pause()


def _text(job: StudioJob) -> str:
    """Return the edited text of the design. Raises DesignError."""
    edits = job.get("edits", ())
    if len(edits) > MOST_EDITS:
        raise DesignError(f"{len(edits)} keys are changed at once; change at most {MOST_EDITS}")
    return edited(job["text"], edits) if edits else str(job["text"])


class _Source(NamedTuple):
    """A design's text, its path, and the states of its files."""

    text: str
    path: Path
    files: tuple[str, ...]


def _source(text: str, job: StudioJob) -> _Source:
    """Return the source. Raises DesignError for a file outside the folder."""
    folder = Path(job["folder"])
    return _Source(text, folder / job["path"], design_files.named_files(text, folder))


@lru_cache(maxsize=4)
def _read(source: _Source) -> Any:
    return api.loads(source.text, source.path)


@lru_cache(maxsize=2)
def _laminate(source: _Source) -> Laminate:
    return api.build(_read(source))


@lru_cache(maxsize=2)
def _assembled(source: _Source) -> Assembled:
    return api.assemble(_read(source))


JOBS: dict[str, Callable[[StudioJob, CancelCheck], Iterator[Answer]]] = {
    "live": live,
    "elastic": elastic,
    "generate": generate,
    "motion": motion,
}


# The answers of a job, run by a worker process.
#
# Errors are answers too: bad input with the command line's message, anything else as a defect.


class SupersededError(Exception):
    """Nothing waits for this answer any longer."""


def answers(job: StudioJob, pause: CancelCheck) -> Iterator[Answer]:
    """Yield the job's answers; if it fails, the last one gives the reason."""
    try:
        for answer in JOBS[job["do"]](job, pause):
            yield answer
            pause()
    except SupersededError:
        yield {"kind": "superseded"}
    except SbafabError as error:
        yield refusal(str(error))
    except MemoryError:
        yield {"kind": "error", "message": "the design takes more memory than there is"}
    except Exception as error:
        traceback.print_exc(file=sys.stderr)
        what = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
        message = (
            f"this is a defect of sbafab ({what}); go back with Undo, and report the design file"
        )
        yield {"kind": "defect", "message": message}


def refusal(sentence: str) -> Answer:
    """Return the refusal, with the first design key named in its sentence."""
    words = (word.strip(",;:()[]'\"") for word in sentence.split())
    named = [w for w in words if w.startswith(("parts.", "shapes.")) or w in design_keys()]
    return {"kind": "error", "message": sentence, **({"field": named[0]} if named else {})}


@lru_cache(maxsize=1)
def design_keys() -> frozenset[str]:
    """Return every dotted key that a design file may have."""
    return frozenset(keys(api.schema()))


# Change keys of a design's text one by one; comments and order are kept.


Edit = tuple[str, str | None]
"""A dotted key and its value as TOML writes it; None removes the key.

An integer in a key is the index of a list's row, from 0: ``layers.2.shape``.
"""
MOST_EDITS = 200


def edited(text: str, edits: Iterable[Edit]) -> str:
    """Return the text with every key changed. Raises DesignError if text or value is not TOML."""
    try:
        document = tomlkit.parse(text)
    except (TOMLKitError, ValueError, RecursionError) as error:
        raise DesignError(f"the text is not valid TOML ({error}); correct it first") from None
    for key, value in edits:
        parts = key.split(".")
        if value is None:
            _take_out(document, parts)
            continue
        if _has_table(document, parts):
            _put(document, parts, _value(key, value))
            continue
        before = tomlkit.dumps(document)
        _put(document, parts, _value(key, value))
        if not _holds(document, parts):
            # A table of dotted keys cannot contain a header; it gets another dotted key.
            document = tomlkit.parse(before)
            _put(document, parts, _value(key, value), dotted=True)
            if not _holds(document, parts):
                raise DesignError(f"{key} cannot be inserted here; change it in the text")
    return tomlkit.dumps(document)


def _has_table(table: Any, parts: list[str]) -> bool:
    """Return True if the table of the key exists."""
    for part in parts[:-1]:
        table = _inner(table, part)
    return isinstance(table, MutableMapping)


def _inner(table: Any, part: str) -> Any:
    """Return a table's value by name, or a list's by index; None if there is none."""
    if isinstance(table, MutableMapping):
        return table.get(part)
    is_row = isinstance(table, MutableSequence) and part.isdecimal() and int(part) < len(table)
    return table[int(part)] if is_row else None


def _holds(document: tomlkit.TOMLDocument, parts: list[str]) -> bool:
    """Return True if the written text has the document's value at the key."""
    try:
        written: Any = tomllib.loads(tomlkit.dumps(document))
        intended: Any = document.unwrap()
        for part in parts:
            written, intended = _inner(written, part), _inner(intended, part)
    except tomllib.TOMLDecodeError:
        return False
    return intended is not None and bool(written == intended)


def _value(key: str, text: str) -> Any:
    try:
        return tomlkit.value(text)
    except (TOMLKitError, ValueError, RecursionError, IndexError):
        raise DesignError(f"{key} = {text[:60]} is not a value; write a number or a text") from None


def _put(
    document: tomlkit.TOMLDocument, parts: list[str], value: Any, dotted: bool = False
) -> None:
    *above, last = parts
    table: Any = document
    for depth, part in enumerate(above):
        inner = _inner(table, part)
        if inner is None and dotted and isinstance(table, tomlkit.items.Table):
            table.append(tomlkit.key(parts[depth:]), value)
            return
        if inner is None and isinstance(table, MutableMapping):
            within = isinstance(table, tomlkit.items.InlineTable)
            table[part] = tomlkit.inline_table() if within else tomlkit.table()
            inner = table[part]
        if not isinstance(inner, MutableMapping | MutableSequence):
            missing = "is not there" if inner is None else "is a value, not a table"
            raise DesignError(f"{'.'.join(parts)}: {part} {missing}; change it in the text")
        table = inner
    if not isinstance(table, MutableMapping):
        raise DesignError(f"{'.'.join(parts)} is not a key of a table; change it in the text")
    old = table.get(last)
    if old is not None and hasattr(old, "trivia") and hasattr(value, "trivia"):
        _comment_like(old, value)
    if isinstance(table, tomlkit.items.InlineTable) and last not in table:
        table.append(last, value)
    else:
        table[last] = value


def _comment_like(old: Any, value: Any) -> None:
    """Give the value the old one's comment, in the same column."""
    trivia = value.trivia
    trivia.comment, trivia.trail = old.trivia.comment, old.trivia.trail
    column = len(old.as_string()) + len(old.trivia.comment_ws)
    trivia.comment_ws = " " * max(1, column - len(value.as_string())) if trivia.comment else ""


def _take_out(table: MutableMapping[str, Any], parts: list[str]) -> None:
    inner: Any = table
    for part in parts[:-1]:
        inner = _inner(inner, part)
    if isinstance(inner, MutableMapping):
        inner.pop(parts[-1], None)
