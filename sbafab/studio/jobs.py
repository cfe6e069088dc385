"""What the page asks for, worked out in a process of its own: each job yields its answers.

A job is a table with ``do`` and the text of a design; ``beat`` raises where the answer is no longer
wanted. Files are looked for in ``folder`` alone.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sbafab import api
from sbafab.errors import DesignError, SbafabError
from sbafab.studio import places
from sbafab.studio.editing import MOST_EDITS, edited
from sbafab.studio.forms import keys
from sbafab.studio.model import Beat, finding_model, laminate_model, parts_model
from sbafab.studio.moving import (
    Filling,
    moving_parts,
    part_poses,
    poses,
    stack_model,
    stack_of,
    whole_prediction,
)

if TYPE_CHECKING:
    from sbafab.assemblies.build import Assembled
    from sbafab.assemblies.records import Assembly
    from sbafab.design.records import Design
    from sbafab.laminate.laminate import Laminate
    from sbafab.runs.run import Run

StudioJob = dict[str, Any]
Answer = dict[str, Any]
_FILLINGS: dict[str, Filling] = {}
MOST_FILLINGS = 8
"""Tabs whose actuators fill at the same time."""


def live(job: StudioJob, beat: Beat) -> Iterator[Answer]:
    """Text after the edits and design, then what is seen, in the order in which it is known.

    Laminate and prediction come before the rules; the yield is the last of those.
    """
    text = _text(job)
    yield {"kind": "text", "text": text}
    known = _known(text, job)
    found = _read(known)
    if found.family == "assembly":
        yield from _assembly(known, job, beat)
        return
    yield {"kind": "design", "name": found.name, "family": found.family, **_values(found)}
    beat()
    laminate = _laminate(known)
    yield laminate_model(laminate, frozenset(job.get("has", ())))
    beat()
    yield _prediction(found, laminate)
    beat()
    try:
        for number, (rule, findings) in enumerate(api.checking(found, laminate, beat), 1):
            yield {
                "kind": "rule",
                "rule": rule,
                "number": number,
                "findings": [finding_model(finding) for finding in findings],
            }
            beat()
    except ModuleNotFoundError as error:
        # Without a server numpy may be missing; only the registration rules, the last ones, ask it.
        yield {
            "kind": "unmeasured",
            "message": f"The rules that need {error.name} were not measured: it is not in this "
            "page. sbafab check measures them.",
        }
    yield {"kind": "checked"}


def _values(design: Design | Assembly) -> Answer:
    return {"values": api.resolved(design)}


def _assembly(known: _Known, job: StudioJob, beat: Beat) -> Iterator[Answer]:
    """An assembly's keys, its parts in place, and what the rules find in and between them."""
    assembly = _read(known)
    yield {"kind": "assembly", "name": assembly.name, **_values(assembly)}
    beat()
    assembled = _assembled(known)
    yield parts_model(assembled, frozenset(job.get("has", ())))
    beat()
    # What the whole does takes seconds, and is asked for when the hand rests.
    yield {"kind": "prediction", "quick": True, "figures": [], "left_out": []}
    designs = {made.design.name for made in assembled.designs}
    checked = api.check(assembly, progress=lambda *_: beat())
    findings = [finding_model(finding) for finding in checked]
    for finding in findings:
        of, _, rest = finding["message"].partition(": ")
        if of in designs:
            finding |= {"design": of, "message": rest}
    yield {"kind": "rule", "rule": "assembly", "number": 1, "findings": findings}
    yield {"kind": "checked"}


def _prediction(design: Design, laminate: Laminate) -> Answer:
    """Figures by closed formulas; why there are none, where that is so."""
    try:
        found = api.predict(design, quick=True, laminate=laminate)
    except SbafabError as error:
        return {"kind": "unpredicted", "message": str(error)}
    except ModuleNotFoundError as error:
        return {"kind": "unpredicted", "message": f"This needs {error.name}, which is not here."}
    return {"kind": "prediction", "quick": True, **found.as_dict()}


def elastic(job: StudioJob, beat: Beat) -> Iterator[Answer]:
    """All figures, with those of the elastic stack, which take seconds."""
    known = _known(_text(job), job)
    found = _read(known)
    beat()
    if found.family == "assembly":
        yield whole_prediction(_assembled(known), job.get("pose") or {}, beat)
    else:
        yield {"kind": "prediction", **api.predict(found).as_dict()}


def generate(job: StudioJob, beat: Beat) -> Iterator[Answer]:
    """Writes the folder of a design into ``out``; every step is told, the last answer names it."""
    yield _made(
        api.generate(_read(_known(_text(job), job)), out=job["out"], progress=_told(job, beat))
    )


def cut(job: StudioJob, beat: Beat) -> Iterator[Answer]:
    """The same with cut files and film sheets alone, which a page can write without a server."""
    design = _read(_known(_text(job), job))
    if design.family == "assembly":
        raise DesignError(f"{design.name} is an assembly; cut it with sbafab generate")
    yield _made(api.cut(design, out=job["out"], progress=_told(job, beat)))


def _told(job: StudioJob, beat: Beat) -> Callable[[str, int, int], None]:
    steps: list[Answer] = []
    tell: Callable[[Answer], None] = job.get("tell", steps.append)

    def progress(what: str, done: int, total: int) -> None:
        beat()
        tell({"kind": "progress", "what": what, "done": done, "total": total})

    return progress


def _made(run: Run) -> Answer:
    return {
        "kind": "made",
        "name": run.folder.name,
        "failed": run.failed,
        "kept": run.kept,
        "files": sorted(
            [*run.manifest.get("files", ()), *(["manifest.json"] * bool(run.manifest))]
        ),
        "findings": [finding_model(finding) for finding in run.findings],
    }


def motion(job: StudioJob, beat: Beat) -> Iterator[Answer]:
    """The actuator as the fast stack has it, and how it moves as its pressures grow together.

    The pose asks for ``pressures``, or gives none for what the page has to know beforehand; of an
    assembly for ``parts``, the pressures of each.
    """
    known, asked = _known(_text(job), job), job.get("pose") or {}
    design = _read(known)
    if design.family == "assembly":
        assembled = _assembled(known)
        beat()
        yield part_poses(assembled, asked) if "parts" in asked else moving_parts(assembled)
        return
    stack = stack_of(design)
    beat()
    if "pressures" not in asked:
        yield stack_model(design.name, stack)
        return
    if asked.get("tube"):
        filling = _FILLINGS.setdefault(job["tab"], Filling())
        while len(_FILLINGS) > MOST_FILLINGS:
            del _FILLINGS[next(iter(_FILLINGS))]
        yield filling.step(stack, asked)
        return
    for pose in poses(stack, asked):
        yield pose
        beat()


def _text(job: StudioJob) -> str:
    """The design's text with the edits made. Raises DesignError."""
    edits = job.get("edits", ())
    if len(edits) > MOST_EDITS:
        raise DesignError(f"{len(edits)} keys are changed at once; change at most {MOST_EDITS}")
    return edited(job["text"], edits) if edits else str(job["text"])


class _Known(NamedTuple):
    """A design's text, where its file would lie, and the states of the files that it names."""

    text: str
    path: Path
    files: tuple[str, ...]


def _known(text: str, job: StudioJob) -> _Known:
    """Raises DesignError for a file outside the folder."""
    folder = Path(job["folder"])
    return _Known(text, folder / job["path"], places.named_files(text, folder))


@lru_cache(maxsize=4)
def _read(known: _Known) -> Any:
    return api.loads(known.text, known.path)


@lru_cache(maxsize=2)
def _laminate(known: _Known) -> Laminate:
    return api.build(_read(known))


@lru_cache(maxsize=2)
def _assembled(known: _Known) -> Assembled:
    return api.assemble(_read(known))


JOBS: dict[str, Callable[[StudioJob, Beat], Iterator[Answer]]] = {
    "live": live,
    "elastic": elastic,
    "generate": generate,
    "cut": cut,
    "motion": motion,
}


# What a job answers, whoever runs it: a worker process or Python in the page itself.
#
# What goes wrong is an answer too: bad input in the command line's words, anything else as a
# defect.


class SupersededError(Exception):
    """Nobody waits for this answer any more."""


def answers(job: StudioJob, beat: Beat) -> Iterator[Answer]:
    """The job's answers; where it fails, the last one says why."""
    try:
        for answer in JOBS[job["do"]](job, beat):
            yield answer
            beat()
    except SupersededError:
        yield {"kind": "superseded"}
    except SbafabError as error:
        yield refusal(str(error))
    except ModuleNotFoundError as error:
        yield {"kind": "error", "message": f"this needs {error.name}, which is not installed here"}
    except MemoryError:
        yield {"kind": "error", "message": "the design takes more memory than there is"}
    except Exception:
        traceback.print_exc(file=sys.stderr)
        yield {"kind": "defect", "message": _defect()}


def refusal(sentence: str) -> Answer:
    """The answer that refuses, with the key of a design file that the sentence names first."""
    words = (word.strip(",;:()[]'\"") for word in sentence.split())
    field = next((word for word in words if _is_key(word)), None)
    return {"kind": "error", "message": sentence, **({"field": field} if field else {})}


def _is_key(word: str) -> bool:
    return word.startswith("parts.") or word in design_keys()


@lru_cache(maxsize=1)
def design_keys() -> frozenset[str]:
    """Every dotted key that a design file may have."""
    return frozenset(keys(api.schema()))


def _defect() -> str:
    kind, what = sys.exc_info()[:2]
    name = kind.__name__ if kind else "error"
    return (
        f"this is a defect of sbafab ({name}: {' '.join(str(what).split())[:200]}); go back with "
        "Undo, and report the design file"
    )
