"""Benchmarks: ``python -m benchmarks [--rounds N] [--rivals FOLDER]``.

The plates of other programs need a virtual environment with them: ``--install`` makes it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from benchmarks import checking, copies, decks, many, outlines, scaling, simulators
from benchmarks import stacks as equilibria
from benchmarks.timing import (
    HEAD,
    ROOT,
    by_turns,
    exponent,
    keep_to_one_core,
    row,
    sizes_by_turns,
)

RIVALS = {"foldable": "foldable-robotics==0.0.37", "build123d": "build123d"}
MODULES = {"foldable": "foldable_robotics", "build123d": "build123d"}
HEAVY = ("ezdxf", "manifold3d", "numpy", "pydantic", "rich", "shapely", "trimesh")


def main() -> None:
    arguments = parsed()
    if arguments.install:
        install(arguments.rivals)
    keep_to_one_core()
    plates(arguments.rivals, arguments.rounds)
    rule_decks(arguments.rounds)
    many_designs(arguments.designs)
    stacks(arguments.rounds)
    lobes(arguments.rounds)
    drawn_outlines(arguments.rounds)
    many_copies(arguments.rounds)
    poses(arguments.rounds)
    commands(arguments.rounds)


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="counted rounds (default: 5)")
    parser.add_argument(
        "--designs", type=int, default=400, help="in one process, one by one (default: 400)"
    )
    parser.add_argument(
        "--rivals", type=Path, default=ROOT / ".benchmarks" / "venv", help="virtual environment"
    )
    parser.add_argument("--install", action="store_true", help="make that environment first")
    return parser.parse_args()


def install(folder: Path) -> None:
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    subprocess.run([python_of(folder), "-m", "pip", "install", *RIVALS.values()], check=True)


def python_of(folder: Path) -> Path:
    return folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


def plates(rivals: Path, rounds: int) -> None:
    """The 40-plate task, whole processes, programs by turns."""
    print("40 lobed plates, a DXF each")
    with folders() as root:
        pythons: dict[str, Path | str] = {"sbafab": sys.executable}
        for name in RIVALS:
            if importable(python_of(rivals), MODULES[name]):
                pythons[name] = python_of(rivals)
            else:
                print(f"  {name}: skipped, not installed in {rivals} (--install puts it there)")
        for name in pythons:
            (root / name).mkdir()
        runs = {
            name: [python, "-m", f"benchmarks.plates_{name}", root / name]
            for name, python in pythons.items()
        }
        times = by_turns(runs, rounds)
        print(HEAD)
        for name in pythons:
            wrong = checking.complaint(root / name)
            if wrong is not None:
                print(f"  {name}: does not count, {wrong}")
                continue
            arcs = "true arcs" if checking.has_true_arcs(root / name) else "chords"
            ratio = min(times[name]) / min(times["sbafab"])
            print(row(name, times[name], f"{arcs}, {ratio:.1f} times sbafab's"))


def importable(python: Path, module: str) -> bool:
    if not python.exists():
        return False
    find = f"import importlib.util as u, sys; sys.exit(u.find_spec({module!r}) is None)"
    return subprocess.run([python, "-c", find], check=False).returncode == 0


def rule_decks(rounds: int) -> None:
    """One design after the other, all different, on one core."""
    print("\nA design built, and all rules")
    print(HEAD)
    for template in decks.VARIED:
        decks.checked(template, -1)
        taken = [decks.checked(template, turn) for turn in range(3 * rounds)]
        print(row(template, taken, f"{len(taken) / sum(taken):.1f} designs a second"))


def many_designs(designs: int) -> None:
    """What is remembered is bounded, and so is the memory of a process however long it runs."""
    print(f"\n{many.DESIGN} in other sizes and heights, in one process")
    # In a process of its own, which has not done anything else.
    program = f"from benchmarks.many import measured\nfor one in measured({designs}): print(*one)"
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, check=True, capture_output=True, text=True
    )
    for line in run.stdout.splitlines():
        number, taken, memory = map(float, line.split())
        print(row(f"{number:.0f} designs", [taken], f"{memory:.0f} MB"))


def stacks(rounds: int) -> None:
    """Equal profiles are computed, checked and written once."""
    print("\nRules and cut files of stacks, copying files aside")
    sizes = (1, 5, 15, 50, 150, 400)
    _told("balloons", sizes_by_turns(sizes, rounds, scaling.rules_and_cut_files))


def lobes(rounds: int) -> None:
    """Bores, tabs and widths grow with the chambers round the lumen."""
    print("\nRules for chambers round a lumen")

    def checked(count: int, turn: int) -> float:
        return decks.checked("3dof-15mm", turn, f"chamber.count={count}", "chamber.axis_radius=9")

    _told("chambers", sizes_by_turns((2, 3, 4, 6, 8), rounds, checked))


def drawn_outlines(rounds: int) -> None:
    """Rules on outlines of many edges grow with these, not their pairs."""
    print("\nA drawn outline: built, and all rules")
    _told("edges", sizes_by_turns((60, 120, 300, 480), rounds, outlines.built_and_checked))


def many_copies(rounds: int) -> None:
    """Nesting, cutting order, writing and reading back grow with the parts, not their pairs."""
    print(f"\nCut files and {copies.SHEET} mm film sheets of many {copies.DESIGN}")
    _told("copies", sizes_by_turns((1, 10, 50, 100, 200), rounds, copies.nested_and_cut), 10)


def _told(what: str, times: Mapping[int, Sequence[float]], least: int = 1) -> None:
    """Rows of a work of several sizes, and the power of the size with which its time grows."""
    print(HEAD)
    for size, taken in times.items():
        print(row(f"{size} {what}", taken))
    since = f" from {least} on" if least > min(times) else ""
    print(f"  time grows with the {what}{since} to the power of {exponent(times, least):.2f}")


def poses(rounds: int) -> None:
    """Equilibria of a whole actuator, beside steps of it in two simulators."""
    print("\n3dof-15mm in balance, 15 balloons in each of three chambers")
    print(HEAD.replace("seconds", "milliseconds", 1))
    told = [1000 * equilibria.map_seconds() for _ in range(rounds)]
    print(row("map of its balloon", told))
    for load in equilibria.LOADS:
        for kind, is_dragged in (("along a path", True), ("at random", False)):
            taken = [1000 * equilibria.pose_seconds(load, is_dragged) for _ in range(rounds)]
            print(row(f"{load}, {kind}", taken, f"{1000 / min(taken):.0f} equilibria a second"))
    rivals = {
        "SOFA, shells": simulators.sofa,
        "MuJoCo, flexes in rings of 8": lambda: simulators.mujoco(8),
        "MuJoCo, flexes in rings of 16": lambda: simulators.mujoco(16),
    }
    for name, run in rivals.items():
        # The slowest of all: once is enough.
        found = run()
        if found is None:
            print(f"  {name}: skipped, not installed")
            continue
        rest = found.seconds * found.steps
        said = f"{1 / found.seconds:.0f} steps a second, {rest:.1f} s to come to rest"
        print(row(name, [1000 * found.seconds], said))


def commands(rounds: int) -> None:
    """The command line, imports included."""
    print("\nCommands")
    sbafab = [sys.executable, "-c", "from sbafab.entry import main; main()"]
    with folders() as root:
        runs = {
            "python -c pass": [sys.executable, "-c", "pass"],
            "sbafab --help": [*sbafab, "--help"],
            "sbafab check 1dof-5mm": [*sbafab, "check", "1dof-5mm"],
            "sbafab generate 3dof-15mm": [*sbafab, "generate", "3dof-15mm", "-o", root],
        }
        times = by_turns(runs, rounds)
    print(HEAD)
    for name, taken in times.items():
        print(row(name, taken))
    print(f"  sbafab --help loads of {', '.join(HEAVY)}: {loaded_by_help() or 'none'}")


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


@contextmanager
def folders() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


if __name__ == "__main__":
    main()
