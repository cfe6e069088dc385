"""Seams, faces and folds of random pouches, judged from their files by other code.

``SBAFAB_JUDGED=300`` judges that many in place of the few.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from pathlib import Path

import pytest

from tests.judge.joints import drawn_stack, has_an_order, judge_joints
from tests.judge.using import sbafab
from tests.judge.welded_drafts import welded_draft
from tests.quick import few

COUNT = int(os.environ.get("SBAFAB_JUDGED", "16"))
SEED = int(os.environ.get("SBAFAB_SEED", "1"))
SHARES = 4
WAIVED = ("bond-width", "sealing", "mask-overhang", "tube-fit", "channel-clear", "facing-films")


@pytest.mark.parametrize("share", few(range(SHARES), 2, setting="SBAFAB_JUDGED"))
def test_the_judge_agrees_on_bonds_voids_and_order(share: int, tmp_path: Path) -> None:
    wrong = []
    seen: Counter[str] = Counter()
    for number in range(share, COUNT, SHARES):
        draft = welded_draft(SEED, number)
        design = draft.write(tmp_path)
        ended = sbafab("check", design, "--json")
        if ended.code == 2:
            seen["refused"] += 1
            if draft.fault == "no neck":
                if "layers 2 and 3 face each other with nylon and nylon" not in ended.said:
                    wrong.append((draft, ended.said))
            elif has_an_order(drawn_stack(design)):
                wrong.append((draft, f"there is an order, and the program says {ended.said}"))
            continue
        findings = json.loads(ended.out)["findings"]
        verdicts = {finding["rule"]: finding["verdict"] for finding in reversed(findings)}
        waived = [word for rule in WAIVED for word in ("--waive", rule)]
        for command in ("cut", "press"):
            made = sbafab(command, design, "-o", tmp_path / "out", *waived)
            if made.code:
                wrong.append((draft, made.said))
        if made.code:
            continue
        folder = tmp_path / "out" / draft.tables["name"]
        wrong += [(draft, said) for said in judge_joints(folder, design, verdicts)]
        is_sound = verdicts["bond-width"] == verdicts["sealing"] == "pass"
        seen["sound" if is_sound else "faulty"] += 1
        if is_sound != (draft.fault in ("none", "wide top")):
            wrong.append((draft, f"{draft.fault} was planted, and the verdicts are {verdicts}"))
    assert wrong == [], wrong[0][1]
    assert min(seen["sound"], seen["faulty"]) > 0, seen


def test_the_judge_can_fail(tmp_path: Path) -> None:
    """A verdict, and an order, that the files do not bear out."""
    number = next(n for n in range(1, 60, 3) if welded_draft(SEED, n).fault == "none")
    draft = welded_draft(SEED, number)
    design = draft.write(tmp_path)
    for command in ("cut", "press"):
        assert sbafab(command, design, "-o", tmp_path / "out").code == 0
    folder = tmp_path / "out" / draft.tables["name"]
    sound = {"bond-width": "pass", "sealing": "pass"}
    assert list(judge_joints(folder, design, sound)) == []
    said = list(judge_joints(folder, design, {"bond-width": "fail", "sealing": "fail"}))
    assert [one.judge for one in said] == ["bond-width", "sealing"]
    press = json.loads((folder / "press.json").read_text(encoding="utf-8"))
    # The neck last: the tool would have to go through both pouches.
    for seam in press["seams"]:
        seam["step"] += 10 * (seam["seam"] == "neck")
    (folder / "press.json").write_text(json.dumps(press), encoding="utf-8")
    assert "neck is covered from both sides" in str(list(judge_joints(folder, design, sound)))
