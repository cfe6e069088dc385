"""All checks and tests: ``python -m tests [arguments for pytest]``."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LINT_IMPORTS = "from importlinter.cli import lint_imports_command as run; run()"
CHECKS = {
    "ruff check": ["-m", "ruff", "check", "."],
    "ruff format": ["-m", "ruff", "format", "--check", "."],
    "mypy": ["-m", "mypy"],
    "import contracts": ["-c", LINT_IMPORTS],
}
# Neighbours share what their module made once.
PYTEST = ["-m", "pytest", "-q", "-n", str(os.cpu_count() or 1), "--dist", "worksteal"]


def passes(name: str, arguments: list[str]) -> bool:
    """Runs one check and prints its row; what it said is shown only where it failed."""
    began = time.perf_counter()
    run = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    ok = run.returncode == 0
    seconds = time.perf_counter() - began
    print(f"{name:<18}{'passed' if ok else 'FAILED':<8}{seconds:6.1f} s", flush=True)
    if not ok:
        print(run.stdout + run.stderr, flush=True)
    return ok


def terminal() -> tuple[list[str], dict[str, str]]:
    """Arguments and settings that let pytest write through a pipe as it would write here."""
    if not sys.stdout.isatty():
        return [], {}
    return ["--color=yes"], {"COLUMNS": str(shutil.get_terminal_size().columns)}


def main() -> int:
    """Every check runs beside pytest; its output comes last, so that its counts close all."""
    # Workers and the processes that tests start would each compile all modules again.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    colour, width = terminal()
    with subprocess.Popen(
        [sys.executable, *PYTEST, *colour, *sys.argv[1:]],
        cwd=ROOT,
        env={**os.environ, **width},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    ) as tests:
        # Until every check has its row, what pytest writes waits in the pipe.
        failed = [name for name, arguments in CHECKS.items() if not passes(name, arguments)]
        assert tests.stdout is not None
        while text := os.read(tests.stdout.fileno(), 65536):
            sys.stdout.buffer.write(text)
            sys.stdout.buffer.flush()
    if failed:
        print(f"failed: {', '.join(failed)}")
    return 1 if failed or tests.returncode else 0


if __name__ == "__main__":
    raise SystemExit(main())
