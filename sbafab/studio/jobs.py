"""The jobs of the page: each yields its answers.

A job is a table with ``do`` and the text of a design; ``pause`` raises once the answer is not
needed. Files are only searched in ``folder``.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from sbafab import api
from sbafab.api.records import Assembled, Assembly, Design, Laminate
from sbafab.errors import DesignError, SbafabError
from sbafab.studio import design_files
from sbafab.studio.editing import MOST_EDITS, edited
from sbafab.studio.forms import keys
from sbafab.studio.model import (
    CancelCheck,
    finding_model,
    laminate_model,
    nets_model,
    parts_model,
    remembered,
    shapes_model,
)
from sbafab.studio.moving import (
    Filling,
    moving_parts,
    part_poses,
    poses,
    stack_model,
    stack_of,
    whole_prediction,
)

StudioJob = dict[str, Any]
Answer = dict[str, Any]
_FILLINGS: dict[str, Filling] = {}
MOST_FILLINGS = 8  # number of tabs whose actuators can inflate at the same time


def live(job: StudioJob, pause: CancelCheck) -> Iterator[Answer]:
    """The edited text and design, then the displayed results, in the order in which they are known.

    Laminate and prediction come before the rules; the yield is the last of those.
    """
    text = _text(job)
    yield {"kind": "text", "text": text}
    source = _source(text, job)
    design = _read(source)
    if design.family == "assembly":
        yield from _assembly(source, job, pause)
        return
    yield {"kind": "design", "name": design.name, "family": design.family, **_values(design)}
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


def _values(design: Design | Assembly) -> Answer:
    return {"values": api.resolved(design)}


def _assembly(source: _Source, job: StudioJob, pause: CancelCheck) -> Iterator[Answer]:
    """An assembly's keys, its parts in place, and what the rules find in and between them."""
    assembly = _read(source)
    yield {"kind": "assembly", "name": assembly.name, **_values(assembly)}
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
    """Figures by closed formulas; the reason if there are none."""
    try:
        prediction = api.predict(design, quick=True, laminate=laminate)
    except SbafabError as error:
        return {"kind": "unpredicted", "message": str(error)}
    return {"kind": "prediction", "quick": True, **prediction.as_dict()}


def elastic(job: StudioJob, pause: CancelCheck) -> Iterator[Answer]:
    """All figures, including the elastic stack's, which take seconds."""
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
    yield {
        "kind": "made",
        "name": run.folder.name,
        "failed": run.failed,
        "kept": run.kept,
        "files": sorted(
            [*run.manifest.get("files", ()), *(["manifest.json"] * bool(run.manifest))]
        ),
        "findings": [finding_model(finding) for finding in run.findings],
    }


def motion(job: StudioJob, pause: CancelCheck) -> Iterator[Answer]:
    """The actuator as a fast stack, and its poses as its pressures rise together.

    The pose is at ``pressures``, absent for the data that the page needs beforehand; for an
    assembly at the pressures of each of its ``parts``.
    """
    source, pose = _source(_text(job), job), job.get("pose", {})
    design = _read(source)
    if design.family == "assembly":
        assembled = _assembled(source)
        pause()
        yield part_poses(assembled, pose) if "parts" in pose else moving_parts(assembled)
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
    """The edited text of the design. Raises DesignError."""
    edits = job.get("edits", ())
    if len(edits) > MOST_EDITS:
        raise DesignError(f"{len(edits)} keys are changed at once; change at most {MOST_EDITS}")
    return edited(job["text"], edits) if edits else str(job["text"])


class _Source(NamedTuple):
    """A design's text, its path, and the states of the files that it names."""

    text: str
    path: Path
    files: tuple[str, ...]


def _source(text: str, job: StudioJob) -> _Source:
    """Raises DesignError for a file outside the folder."""
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
    """Nothing waits for this answer any more."""


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
    except Exception:
        traceback.print_exc(file=sys.stderr)
        yield {"kind": "defect", "message": _defect()}


def refusal(sentence: str) -> Answer:
    """The refusing answer, with the first key of a design file named in its sentence."""
    words = (word.strip(",;:()[]'\"") for word in sentence.split())
    field = next((word for word in words if _is_key(word)), None)
    return {"kind": "error", "message": sentence, **({"field": field} if field else {})}


def _is_key(word: str) -> bool:
    return word.startswith(("parts.", "shapes.")) or word in design_keys()


@lru_cache(maxsize=1)
def design_keys() -> frozenset[str]:
    """Every dotted key that a design file may have."""
    return frozenset(keys(api.schema()))


def _defect() -> str:
    kind, error = sys.exc_info()[:2]
    name = kind.__name__ if kind else "error"
    return (
        f"this is a defect of sbafab ({name}: {' '.join(str(error).split())[:200]}); go back with "
        "Undo, and report the design file"
    )
