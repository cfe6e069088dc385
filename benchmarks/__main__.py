"""Benchmarks: ``python -m benchmarks [--rounds N] [--rivals FOLDER]``.

The plates of other programs need a virtual environment with them: ``--install`` makes it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks import checking, copies, outlines, scaling
from benchmarks import stacks as equilibria
from benchmarks.timing import HEAD, ROOT, by_turns, keep_to_one_core, row

RIVALS = {"foldable": "foldable-robotics==0.0.37", "build123d": "build123d"}
MODULES = {"foldable": "foldable_robotics", "build123d": "build123d"}
HEAVY = ("ezdxf", "manifold3d", "numpy", "pydantic", "rich", "shapely", "trimesh")


def main() -> None:
    arguments = parsed()
    if arguments.install:
        install(arguments.rivals)
    keep_to_one_core()
    plates(arguments.rivals, arguments.rounds)
    stacks(arguments.rounds)
    drawn_outlines(arguments.rounds)
    many_copies(arguments.rounds)
    poses(arguments.rounds)
    commands(arguments.rounds)


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="counted rounds (default: 5)")
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
            print(row(name, times[name], arcs))


def importable(python: Path, module: str) -> bool:
    if not python.exists():
        return False
    find = f"import importlib.util as u, sys; sys.exit(u.find_spec({module!r}) is None)"
    return subprocess.run([python, "-c", find], check=False).returncode == 0


def stacks(rounds: int) -> None:
    """Equal profiles are computed, checked and written once."""
    print("\nRules and cut files, copying files aside")
    times: dict[int, list[float]] = {15: [], 150: []}
    for turn in range(rounds + 1):
        for balloons, taken in times.items():
            measured = scaling.rules_and_cut_files(balloons)
            if turn:
                taken.append(measured)
    print(HEAD)
    for balloons, taken in times.items():
        print(row(f"{balloons} balloons", taken))
    print(f"  ratio of the least: {min(times[150]) / min(times[15]):.2f}")


def drawn_outlines(rounds: int) -> None:
    """Rules on outlines of many edges grow with these, not their pairs."""
    print("\nA drawn outline: built, and all rules")
    times: dict[int, list[float]] = {60: [], 120: [], 240: [], 480: []}
    for turn in range(rounds + 1):
        for edges, taken in times.items():
            measured = sum(outlines.built_and_checked(edges))
            if turn:
                taken.append(measured)
    print(HEAD)
    for edges, taken in times.items():
        print(row(f"{edges} edges", taken))
    grown = copies.exponent({edges: min(taken) for edges, taken in times.items()})
    print(f"  time grows with the edges to the power of {grown:.2f}")


def many_copies(rounds: int) -> None:
    """Nesting, cutting order, writing and reading back grow with the parts, not their pairs."""
    print(f"\nCut files and {copies.SHEET} mm film sheets of many {copies.DESIGN}")
    times: dict[int, list[float]] = {1: [], 10: [], 50: [], 100: []}
    for turn in range(rounds + 1):
        for number, taken in times.items():
            measured = copies.nested_and_cut(number)
            if turn:
                taken.append(measured)
    print(HEAD)
    for number, taken in times.items():
        print(row(f"{number} copies", taken))
    many = {number: min(taken) for number, taken in times.items() if number >= 10}
    print(f"  time grows with the copies to the power of {copies.exponent(many):.2f}")


def poses(rounds: int) -> None:
    """Equilibria of a whole actuator, one after the other along a motion."""
    print("\n3dof-15mm in balance, 15 balloons in each of three chambers")
    rates = {loaded: [equilibria.pose_seconds(loaded) for _ in range(rounds)] for loaded in (0, 1)}
    print(HEAD)
    print(row("map of its balloon", [equilibria.map_seconds() for _ in range(rounds)]))
    for loaded, taken in rates.items():
        name = "pose with a load on the tip" if loaded else "pose"
        print(row(name, taken, f"{1 / min(taken):.0f} a second"))


def commands(rounds: int) -> None:
    """The command line, imports included."""
    print("\nCommands")
    sbafab = [sys.executable, "-c", "from sbafab.cli import main; main()"]
    with folders() as root:
        runs = {
            "python -c pass": [sys.executable, "-c", "pass"],
            "sbafab --help": [*sbafab, "--help"],
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
