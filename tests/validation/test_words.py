"""Words of figures and models are for people alone: with keys in their place every answer stays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import sbafab
from sbafab.lab.builds import promised
from sbafab.models.quantity import Conditions, FigureKey, ModelId, Quantity
from sbafab.search.sweep import SweepRequest, sweep
from sbafab.search.vary import read_varied

DESIGN = "1dof-5mm", "stack.balloons=2", "rules.yield_builds=100"


def _answers(folder: Path) -> dict[str, Any]:
    """Values that programs ask for, by commands."""
    design = sbafab.load(*DESIGN)
    wider = sbafab.load(*DESIGN, "chamber.diameter=6")
    prediction = sbafab.predict(design)
    compared = sbafab.compare(design, wider, pressures_kpa=[10.0])
    request = SweepRequest(
        design, (read_varied("chamber.diameter=5:6:1"),), workers=1, pressures_kpa=(10.0,)
    )
    table = sweep(request, folder).table
    first = table.first(Quantity.BLOCKED_FORCE, Conditions(share=0.0))
    found = sbafab.find(design, least={"stroke@10kPa": 2.0, "force@0mm": 0.1}, tries=12)
    return {
        "verdict": [line.quantity for line in prediction.verdict],
        "chosen": [figure.key for figure in prediction.figures if not figure.other],
        "measured": [figure.key for figure in prediction.figures if figure.measured],
        "intervals": [figure.interval for figure in prediction.figures],
        "main": [(pair.quantity, pair.differs) for pair in compared.figures if pair.main],
        "force": first and table.figures[first],
        "promised": {of: value for of, (value, _) in promised(design).predicted.items()},
        "found": found.best.figures if found.best else None,
    }


@pytest.mark.long
def test_no_program_reads_the_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = _answers(tmp_path / "usual")
    assert usual["main"]
    assert usual["measured"]
    assert usual["found"]
    monkeypatch.setattr(Quantity, "named", lambda self, at: str(FigureKey(self, at, ModelId.EQ_4)))
    monkeypatch.setattr(ModelId, "words", property(lambda self: self.value), raising=False)
    assert _answers(tmp_path / "keys") == usual
