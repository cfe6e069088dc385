"""Random designs: valid ones break no rule, broken ones are refused by name.

``SBAFAB_EXAMPLES=500`` draws that many valid designs, and as many broken ones, in place of the few.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sbafab.actuators import load_design
from sbafab.cli import main
from sbafab.errors import DesignError
from sbafab.folders.build import make_build
from tests.properties.designs import Draft, lobed, mm, one_dof, radial, valid

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


def strip(draft: Draft) -> float:
    """Width of the inlet strip, as asked for or half the tube's perimeter."""
    inlet = draft.tables["inlet"]
    return float(inlet.get("width", math.pi * inlet["tube_outer_diameter"] / 2))


Families = st.SearchStrategy[Draft]
Change = Callable[[Draft, float], dict[str, float]]
FLAT = one_dof() | lobed()
STACKED = FLAT.filter(lambda draft: draft.tables["stack"]["balloons"] > 1)
FAULTS: dict[str, tuple[str, Families, tuple[float, float], Change]] = {
    "bond.width below its limit": (
        "bond-width", one_dof(), (0.3, 0.748),
        lambda _, by: {"bond.width": by, "rules.bond_width": 0.75},
    ),
    "rules.bond_width above the bonds": (
        "bond-width", valid(), (0.002, 1.0),
        lambda draft, by: {"rules.bond_width": draft.tables["bond"]["width"] + by},
    ),
    "window narrower than a bond": (
        "bond-width", radial(), (0.25, 0.748), lambda _, by: {"window.width": by},
    ),
    "rules.mask_overhang above the masks": (
        "mask-overhang", valid(), (0.002, 1.0),
        lambda draft, by: {"rules.mask_overhang": draft.tables["mask"]["overhang"] + by},
    ),
    "strip below half the tube's perimeter": (
        "tube-fit", valid(), (0.002, 0.4),
        lambda draft, by: {
            "inlet.width": math.pi * draft.tables["inlet"]["tube_outer_diameter"] / 2 - by
        },
    ),
    "tube above what the strip opens to": (
        "tube-fit", valid(), (0.002, 2.0),
        lambda draft, by: {
            "inlet.width": strip(draft),
            "inlet.tube_outer_diameter": 2 * strip(draft) / math.pi + by,
        },
    ),
    # The strip is wider by what cutting takes.
    "least feature above the strip": (
        "film-limits", FLAT, (0.5, 2.0),
        lambda draft, by: {"laser.least_feature": strip(draft) + by},
    ),
    "kerf wider than the bore": (
        "film-limits", STACKED, (0.2, 0.9),
        lambda _, by: {"bore.diameter": by, "laser.kerf_ptfe": 1.0},
    ),
    "laminate larger than the platen": (
        "press-fit", valid(), (1.0, 2.5), lambda _, by: {"press.platen_width": by},
    ),
}  # fmt: skip
"""What is wrong: the rule that must fail, designs to break, and what is set by a length in mm."""


@pytest.mark.parametrize("fault", FAULTS)
@share(1, len(FAULTS))
@given(data=st.data())
def test_broken_designs_fail_the_rule_named_for_it(fault: str, data: st.DataObject) -> None:
    rule, families, (low, high), change = FAULTS[fault]
    draft = data.draw(families)
    for key, value in change(draft, data.draw(mm(low, high))).items():
        draft = draft.having(key, value)
    code, out, errors = refused(draft)
    failed = {entry["rule"] for entry in json.loads(out)["findings"] if entry["verdict"] == "fail"}
    assert (code, errors) == (1, "")
    assert rule in failed
