"""Many random designs: made by the program, judged from their files, counted."""

from __future__ import annotations

import json
import re
import shutil
import signal
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

from shapely import Polygon

from tests.judge.bonds import judge_bonds, judge_facing
from tests.judge.claims import judge_claims, judge_pockets
from tests.judge.drafts import Draft, beside, draft
from tests.judge.folder import Disagreement, Folder, open_folder
from tests.judge.overhangs import judge_overhangs
from tests.judge.pins import judge_pins
from tests.judge.pressing import judge_press
from tests.judge.reading import UnreadableError
from tests.judge.sheets import judge_sheets
from tests.judge.using import Ended, sbafab
from tests.judge.voids import judge_voids

MOST_SECONDS = {False: 90, True: 400}
"""Processor time of one case, and of one drawn in chords: the whole deck measures those again."""
STOPPED = (130, 143)
"""Exit codes of a command that someone stopped, and with it the judging."""
TOGETHER = 15
ANOTHER = 1_000_000
"""Added to a design's number for the one that is cut with it."""


@dataclass
class Case:
    """What became of one design."""

    name: str
    family: str
    typed: str = ""
    refused: str = ""
    disagreements: list[Disagreement] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def is_judged(self) -> bool:
        return not self.refused


@dataclass(frozen=True)
class Ways:
    """How designs are made: everything by ``generate``, or ``lean``: cut files and schedule."""

    lean: bool = False
    check: bool = True
    most_balloons: int = 4
    keep: Path | None = None


def run_case(seed: int, number: int, ways: Ways = Ways()) -> Case:
    """One design made and judged, or every ``TOGETHER``-th time two that are cut together."""
    made = [draft(seed, number, ways.most_balloons)]
    if number % TOGETHER == TOGETHER - 1:
        made.append(beside(made[0], draft(seed, ANOTHER + number, ways.most_balloons)))
    families = " and ".join(str(one.tables["family"]) for one in made)
    case = Case(made[0].name, families)
    began = time.process_time()
    most = MOST_SECONDS[made[0].dxf_profile == "chords"]
    with tempfile.TemporaryDirectory() as scratch:
        home = Path(scratch)
        try:
            with _no_longer_than(most):
                _make_and_judge(case, made, home, ways)
        except TooSlowError as error:
            case.disagreements.append(Disagreement("time", f"over {most} s in {error}"))
        except Exception as error:  # a crash of the program, or of a judge, is a finding too
            lines = traceback.format_exception_only(error)[-1].strip()
            at = traceback.extract_tb(error.__traceback__)[-1]
            said = f"{lines} ({Path(at.filename).name}:{at.lineno})"
            case.disagreements.append(Disagreement("crash", said))
        if case.disagreements and ways.keep is not None:
            kept = ways.keep / case.name
            shutil.rmtree(kept, ignore_errors=True)
            shutil.copytree(home, kept)
    case.seconds = time.process_time() - began
    return case


class TooSlowError(BaseException):
    """A case that takes no end; no ``except Exception`` on the way is meant to catch it."""


@contextmanager
def _no_longer_than(seconds: int) -> Iterator[None]:
    """Raises TooSlowError, with the innermost place, after so much processor time."""

    def stop(_: int, frame: FrameType | None) -> None:
        code = frame.f_code if frame is not None else None
        raise TooSlowError(f"{Path(code.co_filename).name}, {code.co_name}" if code else "it")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _make_and_judge(case: Case, made: list[Draft], home: Path, ways: Ways) -> None:
    """Each design judged by itself, and common sheets against all of them."""
    designs = [one.write(home) for one in made]
    is_alone = len(made) == 1
    commands = ["nest"] if not is_alone else ["cut", "press"] if ways.lean else ["generate"]
    words = [*(design.name for design in designs), *made[0].options]
    case.typed = " ".join(["sbafab", commands[0], *words])
    top = home / "out" / (made[0].name if is_alone else "job")
    for command in commands:
        options = made[0].options if command != "press" else []
        ended = sbafab(command, *designs, "-o", home / "out", *options)
        if _refused(case, ended, top if is_alone else home / "out"):
            return
    folders = [top] if is_alone else [top / one.name for one in made]
    try:
        opened = []
        for folder, design, one in zip(folders, designs, made, strict=True):
            opened.append(open_folder(folder, design, one.chord_error))
            case.disagreements += judged(opened[-1], one.pockets)
        if not is_alone:
            sheets = json.loads((top / "manifest.json").read_text(encoding="utf-8"))["sheets"]
            case.disagreements += _heard("sheets", judge_sheets, opened, top, sheets)
    except UnreadableError as error:
        case.disagreements.append(Disagreement("reading", str(error)))
    if ways.check:
        _check(case, top)


def _refused(case: Case, ended: Ended, folder: Path) -> bool:
    if ended.code in STOPPED:
        raise KeyboardInterrupt
    if ended.code:
        case.refused = _reason(ended, folder)
    if ended.code not in (0, 1, 2):
        case.disagreements.append(Disagreement("exit", f"code {ended.code}: {ended.said}"))
    return bool(ended.code)


def _check(case: Case, folder: Path) -> None:
    """What the program itself says of the folder that it has just written without complaint."""
    checked = sbafab("check", folder, "--json")
    if checked.code:
        why = _reason(checked)
        case.disagreements.append(Disagreement("check", f"exit {checked.code}: {why}"))


def _reason(ended: Ended, folder: Path | None = None) -> str:
    """Rules that fail, or the sentence without its numbers."""
    text = ended.out
    if folder is not None and (folder / "checks.json").is_file():
        text = (folder / "checks.json").read_text(encoding="utf-8")
    try:
        findings = json.loads(text)["findings"] if ended.code == 1 else []
    except (ValueError, KeyError, TypeError):
        findings = []
    failed = sorted({f["rule"] for f in findings if f["verdict"] == "fail"})
    if failed:
        return "rule " + ", ".join(failed)
    sentence = " ".join(ended.said.split())
    sentence = re.sub(r"s\d+n\d+", "NAME", sentence)
    sentence = re.sub(r"\S*pocket\.(svg|dxf)", r"pocket.\1", sentence)
    return re.sub(r"-?\d+(\.\d+)?(e-?\d+)?", "#", sentence)[:110] or f"exit {ended.code}"


def run_cases(seed: int, count: int, ways: Ways, jobs: int, start: int = 0) -> Iterator[Case]:
    """Cases in their order, on one process or several."""
    numbers = range(start, start + count)
    if jobs == 1:
        for number in numbers:
            yield run_case(seed, number, ways)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(run_case, [seed] * count, numbers, [ways] * count, chunksize=4)


def table(cases: list[Case]) -> str:
    """Designs by what became of them, and every disagreement with its design."""
    judged_cases = [case for case in cases if case.is_judged]
    wrong = [case for case in cases if case.disagreements]
    judges = (judge for c in wrong for judge in {d.judge for d in c.disagreements})
    lines = [
        f"designs        {len(cases)}",
        f"refused        {len(cases) - len(judged_cases)}",
        *_counted(case.refused for case in cases if case.refused),
        f"judged         {len(judged_cases)}",
        *_counted(case.family for case in judged_cases),
        f"disagreements  {len(wrong)}",
        *_counted(judges),
    ]
    for case in wrong:
        lines.append(f"{case.name} ({case.family}): {case.typed}")
        by_judge: dict[str, list[str]] = {}
        for found in case.disagreements:
            by_judge.setdefault(found.judge, []).append(found.said)
        for judge, said in by_judge.items():
            more = f" (and {len(said) - 2} more)" if len(said) > 2 else ""
            lines += [f"    {judge}: {sentence}" for sentence in said[:2]]
            lines[-1] += more
    lines.append(f"processor time {sum(case.seconds for case in cases):.0f} s")
    return "\n".join(lines)


def _counted(names: Iterable[str]) -> list[str]:
    return [f"  {count:4d}  {name}" for name, count in Counter(names).most_common()]


# All judges in turn.


JUDGES: dict[str, Callable[[Folder], Iterator[str]]] = {
    "facing": judge_facing,
    "bonds": judge_bonds,
    "overhangs": judge_overhangs,
    "voids": judge_voids,
    "pins": judge_pins,
    "press": judge_press,
    "claims": judge_claims,
}


def judged(folder: Folder, drawn: Sequence[Polygon] | None = None) -> list[Disagreement]:
    """What all judges say of one design's folder, its sheets included if it has its own."""
    found = [said for name, judge in JUDGES.items() for said in _heard(name, judge, folder)]
    if sheets := folder.manifest.get("sheets"):
        found += _heard("sheets", judge_sheets, [folder], folder.path, sheets)
    if drawn is not None:
        found += _heard("pockets", judge_pockets, folder, drawn)
    return found


def _heard(name: str, judge: Callable[..., Iterator[str]], *asked: object) -> list[Disagreement]:
    """What a judge says; a file that no cutter could follow does not silence the others."""
    try:
        return [Disagreement(name, said) for said in judge(*asked)]
    except UnreadableError as error:
        return [Disagreement("reading", str(error))]
