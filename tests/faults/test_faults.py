"""Every fault is caught by the rule named for it, as ``docs/measured/faults.csv`` records it.

A few of them are put here: the first of every rule in each template, and every fifth of a draw.
``python -m tests.faults`` puts all faults into all templates and writes the page; with ``--check``
it compares.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, suppress
from pathlib import Path

import pytest

from sbafab.design.files import rule_names
from sbafab.errors import DesignError
from sbafab.folders.as_cut import CutPart
from sbafab.folders.differences import CLAIMS, DESIGNED, INTEGRITY
from tests.faults.catalogue import (
    FAULTS,
    KINDS,
    PAGE,
    TEMPLATES,
    Goods,
    caught_by,
    cell,
    cells_of,
    text,
)
from tests.faults.record import PAPER, Fault
from tests.faults.specimen import LEFT_OUT, failing, quick, unabridged
from tests.quick import few

MOST, WIDER = "1dof-5mm", "1dof-10mm"
DRAWN = [
    (fault, template)
    for place, template in enumerate(TEMPLATES)
    for number, fault in enumerate(FAULTS)
    if number % 4 == place or (template == MOST and number % 4 == 2)
]
DRAWN += [(fault, name) for fault in FAULTS for name in fault.templates if name not in PAPER]
CELLS = cells_of(PAGE.read_text())


def is_caught(fault: Fault, template: str) -> bool:
    """Tell from the page whether its rule catches a fault that applies to a template."""
    return CELLS.get((fault.name, template), "").startswith("caught")


# A rule whose faults fell to templates that they do not apply to.
MISSING = {f.rule for f in FAULTS} - {f.rule for f, template in DRAWN if is_caught(f, template)}
DRAWN += [(fault, MOST) for fault in FAULTS if fault.rule in MISSING]
# Of every rule the first fault that it catches in each template, of the rest every fifth.
FIRST = {
    (fault.rule, template): fault
    for fault, template in reversed(DRAWN)
    if is_caught(fault, template)
}
SUITE = [
    (fault, template)
    for number, (fault, template) in enumerate(DRAWN)
    if FIRST.get((fault.rule, template)) is fault or number % 5 == 0
]
CASES = [pytest.param(fault, template, id=f"{template}-{fault.name}") for fault, template in SUITE]


@pytest.fixture(autouse=True)
def _quick(
    parts: dict[str, CutPart], remember: Callable[[], AbstractContextManager[None]]
) -> Iterator[None]:
    # For one test at a time: other tests of the session must meet the program as it is.
    with quick(parts), remember():
        yield


@pytest.mark.parametrize(("fault", "template"), CASES)
def test_the_rule_named_for_a_fault_catches_it(
    fault: Fault, template: str, goods: Goods, tmp_path: Path
) -> None:
    found = caught_by(fault, template, goods, tmp_path / "faulty")
    if not isinstance(found, str):
        assert fault.rule in found
    stated = CELLS[fault.name, template]
    assert stated == cell(fault, found), "python -m tests.faults writes the page"


@pytest.mark.parametrize("template", few(TEMPLATES, 3))
def test_a_folder_without_a_fault_passes(template: str, goods: Goods) -> None:
    planted = (fault for fault in FAULTS if template in fault.templates)
    for settings in dict.fromkeys(fault.settings for fault in planted):
        with suppress(DesignError):
            assert failing(goods(template, settings, False).doctor.folder) == ()
    if template != WIDER:
        with unabridged():
            assert failing(goods(template, (), True).doctor.folder) == ()


def test_the_page_is_of_this_catalogue() -> None:
    page = PAGE.read_text()
    assert text(cells_of(page)) == page


def test_there_are_enough_faults_and_every_rule_has_one() -> None:
    names = [fault.name for fault in FAULTS]
    assert len(set(names)) == len(names) >= 40
    # No template of the catalogue declares nets, and its faults keep pockets as wide as they are:
    # tests/rules/test_nets.py and test_deck.py plant faults of those.
    assert {fault.rule for fault in FAULTS} == {*rule_names(), INTEGRITY, CLAIMS, DESIGNED} - {
        *LEFT_OUT,
        "nets",
        "pressure-rating",
    }
    assert all(kind.faults for kind in KINDS)
    assert {f.rule for f, template in SUITE if is_caught(f, template)} == {
        fault.rule for fault in FAULTS
    }
