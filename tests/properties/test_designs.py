"""Random designs: valid ones break no rule, broken ones are refused by name.

``SBAFAB_EXAMPLES=500`` draws that many valid designs, and as many broken ones, in place of the few.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sbafab.actuators import load_design
from sbafab.cli import main
from sbafab.errors import DesignError
from sbafab.folders.build import make_build
from sbafab.folders.check import check_folder
from sbafab.folders.run import RunRequest, generate
from tests.properties.designs import Draft, lobed, one_dof, radial, valid
from tests.properties.faults import REFUSALS, RULES

ASKED = int(os.environ.get("SBAFAB_EXAMPLES", "0"))


def share(few: int, parts: int) -> settings:
    """The settings of one of several tests that share the number of examples asked for."""
    return settings(max_examples=max(few, -(-ASKED // parts)))


def failures(draft: Draft) -> list[str]:
    with TemporaryDirectory() as folder:
        findings = make_build(load_design(draft.write(Path(folder)))).findings
    return [finding.message for finding in findings if finding.verdict == "fail"]


def failures_beside_ears(draft: Draft) -> list[str]:
    """Ears that find no room are refused with the way out; then what fails on that way."""
    way_out = "registration.method", "channel-pin"
    try:
        return failures(draft)
    except DesignError as refusal:
        said = str(refusal)
    if '{} = "{}"'.format(*way_out) not in said:
        return [said]
    return failures(draft.having(*way_out))


def refused(draft: Draft) -> tuple[int, str, str]:
    """Exit code, output and errors of ``sbafab check`` on a design."""
    out, errors = io.StringIO(), io.StringIO()
    with (
        TemporaryDirectory() as folder,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(errors),
        pytest.raises(SystemExit) as ending,
    ):
        main(["check", str(draft.write(Path(folder))), "--json"])
    return int(ending.value.code or 0), out.getvalue(), errors.getvalue()


@share(8, 3)
@given(one_dof())
def test_valid_1dof_designs_break_no_rule(draft: Draft) -> None:
    assert failures(draft) == []


@share(6, 3)
@given(lobed(ears=True))
def test_valid_lobed_designs_break_no_rule(draft: Draft) -> None:
    assert failures_beside_ears(draft) == []


@share(3, 3)
@given(radial())
def test_valid_radial_designs_break_no_rule(draft: Draft) -> None:
    assert failures(draft) == []


@share(2, 1)
@given(valid())
def test_valid_designs_break_no_rule_as_they_lie_on_disk(draft: Draft) -> None:
    with TemporaryDirectory() as name:
        run = generate(
            RunRequest(load_design(draft.write(Path(name))), Path(name) / "out", ("cut",))
        )
        findings = check_folder(run.folder)
    assert [finding.message for finding in findings if finding.verdict == "fail"] == []


@pytest.mark.parametrize("fault", RULES)
@share(1, 2 * len(RULES))
@given(data=st.data())
def test_broken_designs_fail_the_rule_named_for_it(fault: str, data: st.DataObject) -> None:
    rule, designs = RULES[fault]
    code, out, errors = refused(data.draw(designs))
    failed = {entry["rule"] for entry in json.loads(out)["findings"] if entry["verdict"] == "fail"}
    assert (code, errors) == (1, "")
    assert rule in failed


@pytest.mark.parametrize("fault", REFUSALS)
@share(2, 2 * len(REFUSALS))
@given(data=st.data())
def test_impossible_designs_are_refused_in_one_sentence(fault: str, data: st.DataObject) -> None:
    words, designs = REFUSALS[fault]
    code, out, errors = refused(data.draw(designs))
    told = json.loads(out)
    assert (code, told["schema"], told["error"]["exit_code"]) == (2, "sbafab/error@1", 2)
    assert words in errors
    assert errors.count("\n") == 1
