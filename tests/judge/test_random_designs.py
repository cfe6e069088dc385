"""Random designs of all families, judged from the files that were written for them.

``SBAFAB_JUDGED=300`` judges that many in place of the few, ``SBAFAB_SEED=7`` draws others;
``python -m tests.judge`` prints a table.
"""

from __future__ import annotations

import ast
import os
from dataclasses import replace
from pathlib import Path

import pytest

from tests.judge.campaign import Ways, run_case
from tests.quick import few

COUNT = int(os.environ.get("SBAFAB_JUDGED", "5"))
SEED = int(os.environ.get("SBAFAB_SEED", "1"))
FEW = Ways(lean=True, most_balloons=3)
MANY = Ways(most_balloons=5)
SHARES = 5


@pytest.mark.parametrize("share", few(range(SHARES), 2, setting="SBAFAB_JUDGED"))
def test_judges_find_nothing_in_what_is_written(share: int) -> None:
    ways = FEW if COUNT <= 5 else MANY
    cases = [
        # Of the few every fourth is also shown to ``sbafab check``.
        run_case(SEED, number, replace(ways, check=COUNT > 5 or number % 4 == 0))
        for number in range(share, COUNT, SHARES)
    ]
    wrong = [(case.name, case.typed, *case.disagreements) for case in cases if case.disagreements]
    assert wrong == []
    refused = [case.refused for case in cases if case.refused]
    # A generator of refusals would judge nothing.
    assert len(refused) <= max(3, len(cases) / 2), refused


def test_judges_share_no_code_with_the_program() -> None:
    """Only ``using.py`` knows the program, and only what makes or doctors folders knows that."""
    home = Path(__file__).parent
    doors = {"using.py"}
    users = {"campaign.py", "using.py", *(path.name for path in home.glob("test_*.py"))}
    for path in home.glob("*.py"):
        modules = _imported(path)
        assert path.name in doors or not any(m.split(".")[0] == "sbafab" for m in modules), path
        assert path.name in users or "tests.judge.using" not in modules, path
        theirs = "tests.judge", "tests.quick"
        foreign = {m for m in modules if m.startswith("tests.") and not m.startswith(theirs)}
        assert not foreign, (path, foreign)


def _imported(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(node.module or "")
    return found
