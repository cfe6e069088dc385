"""No program decides by a sentence: with each replaced by its id, all answers stay the same."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sbafab.catalogue import catalogue
from sbafab.models.quantity import ModelId, Quantity
from sbafab.rules import sentences
from tests.cli.conftest import Run
from tests.studio.asking import answers, job

IDS = {"rule", "verdict", "quantity", "model_id", "unit", "key", "kind", "status", "family", "role"}
"""Keys whose texts are ids; all other texts may be sentences."""
FEW = ("--set", "stack.balloons=3", "--set", "rules.yield_builds=100")
COMMANDS = {
    "check": ("check 3dof-15mm --json", *FEW, "--set", "bond.width=0.7"),
    "predict": ("predict 1dof-5mm --json --pressure 10", *FEW),
    "find": ("find 1dof-5mm --json --min stroke=2 --best mass --tries 8", "-o", "found"),
    "sweep": ("sweep 1dof-5mm --json --workers 1 --vary bond.width=0.7,0.75 -o swept", *FEW),
    "compare": ("compare 1dof-5mm 1dof-10mm --json",),
    "record": ("record 1dof-5mm --json --serial A1 --leak pass --height 0.5mm",),
    "report": ("record --report --json",),
    "generate": ("generate 1dof-5mm --json", *FEW),
}


def without_texts(value: Any, key: str = "") -> Any:
    """Numbers, truth values and ids of a document."""
    if isinstance(value, dict):
        return {name: without_texts(each, name) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [without_texts(each, key) for each in value]
    return "" if isinstance(value, str) and key not in IDS else value


@pytest.fixture
def ids_for_sentences(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    def replace() -> None:
        muted = {
            rule: {**table, "says": {name: f"{rule}.{name}" for name in table["says"]}}
            for rule, table in catalogue().items()
            if "says" in table
        }
        monkeypatch.setattr(sentences, "catalogue", lambda: {**catalogue(), **muted})
        monkeypatch.setattr(Quantity, "named", lambda quantity, at: f"{quantity.key}{at}")
        for model in ModelId:
            monkeypatch.setattr(model, "words", str(model))

    return replace


@pytest.mark.long
def test_answers_are_the_same_without_sentences(
    run: Run, ids_for_sentences: Callable[[], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes = []
    for round_ in ("told", "muted"):
        folder = tmp_path / round_
        folder.mkdir()
        monkeypatch.chdir(folder)
        monkeypatch.setenv("SBAFAB_LAB", str(folder / "lab.db"))
        rows: dict[str, Any] = {}
        for name, (command, *more) in COMMANDS.items():
            code, out, _ = run(command, *more)
            document = json.loads(out)
            if name == "check":
                first = document["findings"][0]
                is_id = first["message"].partition(";")[0] == "bond-width.narrowest-fail"
                assert is_id == (round_ == "muted"), first
            rows[name] = code, without_texts(document)
        design = tomllib.loads((folder / "out" / "1dof-5mm" / "design.toml").read_text())
        made = {
            path.name: path.read_bytes() for path in (folder / "out" / "1dof-5mm").rglob("*.dxf")
        }
        text = 'name = "soft"\nfamily = "1dof"\n[stack]\nballoons = 2\n'
        shown = [without_texts(answer) for answer in answers(job(folder, text))]
        outcomes.append((rows, design, made, shown))
        ids_for_sentences()
    told, muted = outcomes
    assert {name: code for name, (code, _) in told[0].items() if code} == {"check": 1}
    for name, row in told[0].items():
        assert muted[0][name] == row, name
    assert told[1:] == muted[1:]
