"""What is measured, section by section."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple

from benchmarks import (
    batches,
    checking,
    copies,
    decks,
    many,
    outlines,
    processes,
    scaling,
    simulators,
)
from benchmarks import stacks as equilibria
from benchmarks.timing import (
    ROOT,
    Row,
    Section,
    by_turns,
    exponent,
    sizes_by_turns,
)

RIVALS = {"foldable": "foldable-robotics==0.0.37", "build123d": "build123d"}
MODULES = {"foldable": "foldable_robotics", "build123d": "build123d"}
BATCH = 12
"""Designs a round."""
FIRST_CALL = (
    "import numpy, threadpoolctl; threadpoolctl.threadpool_limits(8)\n"
    "import sbafab; sbafab.predict('3dof-15mm')"
)
"""As in a notebook on a machine of eight processors."""
HEAVY = ("ezdxf", "manifold3d", "numpy", "pydantic", "rich", "shapely", "trimesh")


class Asked(NamedTuple):
    """Counted rounds, designs in one process, and the Python that has the other programs."""

    rounds: int
    designs: int
    rivals: Path


def sections(asked: Asked, only: Container[str] = ()) -> Iterator[Section]:
    """Each when it has been measured; ``only``: those with these keys, all if empty."""
    rounds = asked.rounds
    every: dict[str, Callable[[], Section]] = {
        "plates": lambda: plates(asked.rivals, rounds),
        "decks": lambda: rule_decks(rounds),
        "processes": lambda: side_by_side(rounds),
        "memory": lambda: many_designs(asked.designs),
        "balloons": lambda: stacks(rounds),
        "chambers": lambda: lobes(rounds),
        "edges": lambda: drawn_outlines(rounds),
        "copies": lambda: many_copies(rounds),
        "poses": lambda: poses(rounds),
        "commands": lambda: commands(rounds),
    }
    for key, measure in every.items():
        if not only or key in only:
            yield measure()


def plates(rivals: Path, rounds: int) -> Section:
    """The 40-plate task, whole processes, programs by turns."""
    notes = []
    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        pythons: dict[str, Path | str] = {"sbafab": sys.executable}
        for name in RIVALS:
            if importable(rivals, MODULES[name]):
                pythons[name] = rivals
            else:
                notes.append(f"{name}: skipped, {rivals} has none (--install puts it there)")
        for name in pythons:
            (root / name).mkdir()
        runs: dict[str, Sequence[str | Path]] = {
            name: [python, "-m", f"benchmarks.plates_{name}", root / name]
            for name, python in pythons.items()
        }
        times = by_turns(runs, rounds)
        rows = []
        for name in pythons:
            wrong = checking.complaint(root / name)
            if wrong is not None:
                notes.append(f"{name}: does not count, {wrong}")
                continue
            arcs = "true arcs" if checking.has_true_arcs(root / name) else "chords"
            ratio = median(times[name]) / median(times["sbafab"])
            rows.append(Row(name, times[name], f"{arcs}, {ratio:.1f} times sbafab's"))
    return Section("plates", "40 lobed plates, a DXF each", rows, notes)


def rate(times: Sequence[float], what: str) -> str:
    """Return how many a second the median of the times is, in words."""
    each = 1 / median(times)
    return f"{each:.1f} {what} a second" if each < 100 else f"{each:,.0f} {what} a second"


def importable(python: Path, module: str) -> bool:
    if not python.exists():
        return False
    find = f"import importlib.util as u, sys; sys.exit(u.find_spec({module!r}) is None)"
    return subprocess.run([python, "-c", find], check=False).returncode == 0


def rule_decks(rounds: int) -> Section:
    """One design after the other, all different, on one core."""
    rows = []
    for template in decks.VARIED:
        decks.checked(template, -1)
        taken = [decks.checked(template, turn) for turn in range(BATCH * rounds)]
        rows.append(Row(template, taken, rate(taken, "designs")))
    for template in ("1dof-5mm", "3dof-15mm"):
        taken = [decks.other_height(template, turn) for turn in range(BATCH * rounds)]
        rows.append(Row(f"{template}, other heights", taken, rate(taken, "designs")))
    return Section("decks", "A design built, and all rules", rows)


def side_by_side(rounds: int) -> Section:
    """By the clock: what a second process gains."""
    rows = []
    for template in ("1dof-5mm", "3dof-15mm"):
        for count in (1, 2):
            rates = [processes.rate(template, count, 40) for _ in range(rounds)]
            name = f"{template}, {count} process{'es' if count > 1 else ''}"
            each = [1 / rate for rate in rates]
            rows.append(Row(name, each, rate(each, "designs")))
    return Section("processes", "Designs built and checked, all different", rows, timed="clock")


def many_designs(designs: int) -> Section:
    """What is remembered is bounded, and so is the memory of a process however long it runs."""
    # In a process of its own, which has not done anything else.
    program = f"from benchmarks.many import measured\nfor one in measured({designs}): print(*one)"
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, check=True, capture_output=True, text=True
    )
    rows = []
    for line in run.stdout.splitlines():
        number, taken, memory = map(float, line.split())
        rows.append(Row(f"{number:.0f} designs", [taken], f"{memory:.0f} MB"))
    return Section(
        "memory", f"{many.DESIGN} in other sizes and heights, in one process, each of them", rows
    )


def stacks(rounds: int) -> Section:
    """Equal profiles are computed, checked and written once."""
    times = sizes_by_turns((1, 5, 15, 50, 150, 400), rounds, scaling.rules_and_cut_files)
    return _grown("balloons", "Rules and cut files of stacks, copying files aside", times)


def lobes(rounds: int) -> Section:
    """Bores, tabs and widths grow with the chambers round the lumen."""

    def checked(count: int, turn: int) -> float:
        return decks.checked("3dof-15mm", turn, f"chamber.count={count}", "chamber.axis_radius=9")

    times = sizes_by_turns((2, 3, 4, 6, 8), rounds, checked)
    return _grown("chambers", "Rules for chambers round a lumen", times)


def drawn_outlines(rounds: int) -> Section:
    """Rules on outlines of many edges grow with these, not their pairs."""
    times = sizes_by_turns((60, 120, 300, 480), rounds, outlines.built_and_checked)
    return _grown("edges", "A drawn outline: built, and all rules", times)


def many_copies(rounds: int) -> Section:
    """Nesting, cutting order, writing and reading back grow with the parts, not their pairs."""
    title = f"Cut files and {copies.SHEET} mm film sheets of many {copies.DESIGN}"
    times = sizes_by_turns((1, 10, 50, 100, 200), rounds, copies.nested_and_cut)
    return _grown("copies", title, times, 10)


def _grown(what: str, title: str, times: Mapping[int, Sequence[float]], least: int = 1) -> Section:
    """Rows of a work of several sizes, and the power of the size with which its time grows."""
    rows = [Row(f"{size} {what}", taken) for size, taken in times.items()]
    since = f" from {least} on" if least > min(times) else ""
    power = exponent(times, least)
    note = f"time grows with the {what}{since} to the power of {power:.2f}"
    return Section(what, title, rows, [note], power)


def poses(rounds: int) -> Section:
    """Equilibria of a whole actuator, beside steps of it in two simulators."""
    taken = [equilibria.map_seconds() for _ in range(rounds)]
    rows = [Row("map of its balloon", taken)]
    notes = []
    for load in equilibria.LOADS:
        for kind, is_dragged in (("along a path", True), ("at random", False)):
            taken = [equilibria.pose_seconds(load, is_dragged) for _ in range(rounds)]
            rows.append(Row(f"{load}, {kind}", taken, rate(taken, "equilibria")))
        taken = [equilibria.derivative_seconds(load) for _ in range(rounds)]
        rows.append(Row(f"{load}, at random, with derivatives", taken, rate(taken, "equilibria")))
        if "plate" in load:
            continue
        for kind, is_dragged in (("along a path", True), ("at random", False)):
            taken = [equilibria.reach_seconds(load, is_dragged) for _ in range(rounds)]
            rows.append(Row(f"{load}, tip to a place, {kind}", taken, rate(taken, "places")))
    for kind, is_dragged in (("near the ones before", True), ("at random", False)):
        taken = [batches.pose_seconds(is_dragged) for _ in range(rounds)]
        name = f"no load, {batches.STATES:,} at once, {kind}"
        rows.append(Row(name, taken, rate(taken, "equilibria")))
    for load in ("no load", "7 mN on the tip", *batches.PLATES):
        taken = [batches.reach_seconds(load) for _ in range(rounds)]
        name = f"{load}, tip to {batches.PLACES:,} places at once"
        rows.append(Row(name, taken, rate(taken, "places")))
    taken = [batches.step_seconds() for _ in range(rounds)]
    rows.append(Row(f"a step of {batches.STATES:,} environments", taken, rate(taken, "steps")))
    clock = batches.clock_rate(2)
    notes.append(f"{batches.STATES:,} environments in two processes: {clock:,.0f} steps a second")
    rivals = {
        "SOFA, shells": simulators.sofa,
        "MuJoCo, flexes in rings of 8": lambda: simulators.mujoco(8),
        "MuJoCo, flexes in rings of 16": lambda: simulators.mujoco(16),
    }
    for name, run in rivals.items():
        # The slowest of all: once is enough.
        found = run()
        if found is None:
            notes.append(f"{name}: skipped, not installed")
            continue
        rest = found.seconds * found.steps
        told = f"{1 / found.seconds:.0f} steps a second, {rest:.1f} s to come to rest"
        rows.append(Row(name, [found.seconds], told))
    title = "3dof-15mm in balance, 15 balloons in each of three chambers"
    return Section("poses", title, rows, notes, unit="ms")


def commands(rounds: int) -> Section:
    """The command line, imports included."""
    sbafab = [sys.executable, "-m", "sbafab"]
    with tempfile.TemporaryDirectory() as root:
        runs: dict[str, Sequence[str | Path]] = {
            "python -c pass": [sys.executable, "-c", "pass"],
            "sbafab --help": [*sbafab, "--help"],
            "sbafab check 1dof-5mm": [*sbafab, "check", "1dof-5mm"],
            "sbafab predict 1dof-5mm": [*sbafab, "predict", "1dof-5mm", "-o", root],
            "sbafab predict 3dof-15mm": [*sbafab, "predict", "3dof-15mm", "-o", root],
            "its first call in Python, 8 BLAS threads": [sys.executable, "-c", FIRST_CALL],
            "sbafab generate 3dof-15mm": [*sbafab, "generate", "3dof-15mm", "-o", root],
        }
        times = by_turns(runs, rounds)
    rows = [Row(name, taken) for name, taken in times.items()]
    note = f"sbafab --help loads of {', '.join(HEAVY)}: {loaded_by_help() or 'none'}"
    return Section("commands", "Commands", rows, [note])


def loaded_by_help() -> str:
    program = (
        "import sys, contextlib, io\n"
        "from sbafab.cli import main\n"
        "with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):\n"
        "    main(['--help'])\n"
        f"print(*[name for name in {HEAVY!r} if name in sys.modules])"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return run.stdout.strip()
