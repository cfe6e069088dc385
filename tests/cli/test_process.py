"""What a command sets for its whole process, and that a caller's process stays as it is."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from sbafab.runtime import YOUNG

KEYS = ("OPENBLAS_NUM_THREADS", "PYDANTIC_DISABLE_PLUGINS")
PROGRAM = """
import contextlib, gc, io, os, sys
from {door} import main
sys.argv = ["sbafab", "--version"]
with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
    main({arguments})
print(gc.get_threshold()[0], *(os.environ.get(key) for key in {keys}))
"""


def settings_after(door: str, arguments: str = "") -> list[str]:
    """The threshold of the collector and the variables, in a fresh interpreter."""
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(door=door, arguments=arguments, keys=KEYS)],
        capture_output=True,
        text=True,
        check=True,
        env={name: value for name, value in os.environ.items() if name not in KEYS},
    )
    return run.stdout.split()


@pytest.mark.parametrize("door", ["sbafab.entry", "sbafab.cli"])
def test_the_command_sets_its_process_up(door: str) -> None:
    assert settings_after(door) == [str(YOUNG), "1", "__all__"]


def test_a_caller_with_arguments_of_its_own_keeps_its_process() -> None:
    threshold, *variables = settings_after("sbafab.cli", '["--version"]')
    assert int(threshold) < YOUNG
    assert variables == ["None", "None"]


SOLVES = """
import numpy as np, threadpoolctl, sbafab
from sbafab.runtime import one_blas_thread

def threads():
    return [pool["num_threads"] for pool in threadpoolctl.threadpool_info()]

{code}
"""


def printed(code: str) -> list[str]:
    """What a fresh interpreter prints in whose environment nobody limits threads."""
    free = {name: value for name, value in os.environ.items() if "NUM_THREADS" not in name}
    command = [sys.executable, "-c", SOLVES.format(code=code)]
    run = subprocess.run(command, capture_output=True, text=True, check=True, env=free)
    return run.stdout.splitlines()


@pytest.mark.parametrize(
    ("solver", "call"),
    [
        # The fit of a map, two unlike films, and many stacks at once.
        ("sbafab.models.balloon_map.nearest_admissible", "sbafab.predict('3dof-15mm')"),
        ("np.linalg.pinv", "inflate(Balloon(mate=Balloon(thickness=0.1)), 8.0)"),
        (
            "sbafab.models.column.descent",
            "StackBatch(sbafab.stack('1dof-5mm')).poses([[8]])",
        ),
    ],
)
def test_models_are_solved_on_one_thread_and_the_caller_keeps_its_own(
    solver: str, call: str
) -> None:
    module, _, name = solver.rpartition(".")
    lines = printed(
        f"""
from sbafab.models import column
from sbafab.models.balloon import inflate
from sbafab.models.film_elements import Balloon
from sbafab.models.stack import StackBatch
solve, within = {solver}, set()

def watched(*arguments, **options):
    within.add(tuple(threads()))
    if len(within | {{(1,)}}) > 1:
        raise SystemExit(f"{{within}} threads")
    return solve(*arguments, **options)

{module}.{name} = watched
threadpoolctl.threadpool_limits(8)
{call}
print(*within)
print(*threads())
"""
    )
    assert lines == ["(1,)", "8"]


def test_threads_come_back_when_the_last_of_overlapping_solves_ends() -> None:
    code = """
threadpoolctl.threadpool_limits(8)
one_blas_thread.__enter__()
one_blas_thread.__enter__()
one_blas_thread.__exit__()
print(*threads())
one_blas_thread.__exit__()
print(*threads())
"""
    assert printed(code) == ["1", "8"]
