"""Records do not change after they are made, but for a few that hold a state."""

from __future__ import annotations

from pathlib import Path

import sbafab
from tests.packaging.sources import sources

ROOT = Path(sbafab.__file__).parent
STATES = {
    "geometry/edges.py": {"Arc", "Line"},
    "models/motion.py": {"Motion", "BatchMotion"},
    "folders/artefacts.py": {"DesignFolder"},
    "rules/voids.py": {"VoidGraph"},
    "studio/answers.py": {"AnswerShapes"},
    "studio/app.py": {"Studio"},
    "studio/workers.py": {"WaitingJob"},
}
"""Dataclasses that gather or step, by module. Edges keep their lengths and boxes; as frozen records
they would take a fifteenth more of the time of a check.
"""


def test_records_are_frozen() -> None:
    changeable = {
        source.path.relative_to(ROOT).as_posix(): source.unfrozen
        for source in sources(ROOT)
        if source.unfrozen
    }
    assert changeable == STATES
