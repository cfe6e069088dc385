"""The plan of a batch, judged from plan.csv alone: nothing is booked twice, all is in its order."""

from __future__ import annotations

import csv
import io
from collections import defaultdict
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise

import pytest

from sbafab.actuators import build, load_design
from sbafab.output.checked import press_settings
from sbafab.pressing.cycles import design_runs
from sbafab.pressing.schedule import Schedule, schedule
from sbafab.pressing.work_plan import plan_csv

Row = dict[str, str]
PAPER = (3, 12, 10, 20)
"""Minutes of the paper's four steps."""
HANDS = 60
"""Minutes by hand that the paper leaves for an actuator."""


def table(template: str, *changes: str) -> tuple[list[Row], Schedule]:
    design = load_design(template, changes)
    laminate = build(design)
    plan = schedule(laminate, press_settings(design), design_runs(design, laminate).cycles)
    text = plan_csv(design, laminate, plan)
    assert text is not None
    return list(csv.DictReader(io.StringIO(text))), plan


# The judge. It reads cells of the table and shares no code with the program.


def span(row: Row) -> tuple[Fraction, Fraction]:
    """Start and end in minutes from the start of the first shift."""
    start = 1440 * (int(row["day"]) - 1) + Fraction(row["start_minutes"])
    return start, start + Fraction(row["minutes"])


def copies(row: Row) -> range:
    return range(int(row["first_copy"]), int(row["last_copy"]) + 1)


def copy_span(row: Row, copy: int) -> tuple[Fraction, Fraction]:
    """When one copy of a row is worked on, where a row takes one after the other."""
    start, end = span(row)
    if row["task"] not in ("cut", "sort", "tubes", "test"):
        return start, end
    each = (end - start) / len(copies(row))
    first = start + each * (copy - copies(row)[0])
    return first, first + each


def overlapping(spans: Sequence[tuple[Fraction, Fraction]]) -> bool:
    ordered = sorted(spans)
    return any(after[0] < before[1] for before, after in pairwise(ordered))


def double_bookings(rows: Sequence[Row]) -> Iterator[str]:
    taken = defaultdict(list)
    lying: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        if row["technician"]:
            taken["technician", row["technician"]].append(span(row))
        if row["press"]:
            taken["press", row["press"]].append(span(row))
        if row["task"] == "cut":
            taken["laser", "1"].append(span(row))
        if row["base_plate"]:
            lying[row["cycle"], row["step"]].append(row)
    for step in lying.values():
        # Films lie on the plate from the first of them until they are taken down.
        (plate,) = {row["base_plate"] for row in step}
        ends = [span(row) for row in step]
        taken["plate", plate].append((min(s for s, _ in ends), max(e for _, e in ends)))
    for name, spans in taken.items():
        if overlapping(spans):
            yield f"{name} is booked twice"


def out_of_order(rows: Sequence[Row], steps: int, cured: Fraction) -> Iterator[str]:
    """Yield what a copy has done to it out of order, too often or never."""
    by_copy: dict[int, dict[str, list[Row]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        for copy in copies(row):
            by_copy[copy][row["task"] + row["step"]].append(row)
    sorted_by = max(span(row)[1] for row in rows if row["task"] == "sort")
    chain = ["cut", "sort"]
    for step in range(1, steps + 1):
        chain += [f"{task}{step}" for task in ("lay", "press", "open", "cool", "unpin")]
    chain += ["tubes", "cure", "test"]
    for copy, tasks in by_copy.items():
        if {name: len(rows) for name, rows in tasks.items()} != dict.fromkeys(chain, 1):
            yield f"copy {copy} is not done once in every task"
            continue
        spans = [copy_span(tasks[name][0], copy) for name in chain]
        for (name, before), after in zip(zip(chain, spans, strict=True), spans[1:], strict=False):
            if after[0] < before[1]:
                yield f"copy {copy} goes on before {name} has ended"
        for step in range(1, steps + 1):
            lay, press, opened, cool = (
                span(tasks[f"{task}{step}"][0]) for task in ("lay", "press", "open", "cool")
            )
            if not (lay[1] == press[0] and press[1] == opened[0] and opened[1] == cool[0]):
                yield f"copy {copy}: loose or hot films wait in step {step}"
        if span(tasks["lay1"][0])[0] < sorted_by:
            yield f"copy {copy} is laid up before all sheets are sorted"
        if span(tasks["cure"][0])[1] - span(tasks["cure"][0])[0] != cured:
            yield f"copy {copy} does not cure as long"


def outside_shift(rows: Sequence[Row], shift: int) -> Iterator[str]:
    """Yield work past the end of a shift, save cooling, curing, and a step longer than a shift."""
    attended: dict[tuple[str, ...], list[tuple[Fraction, Fraction]]] = defaultdict(list)
    for number, row in enumerate(rows):
        if row["task"] in ("lay", "press", "open"):
            attended[row["cycle"], row["step"]].append(span(row))
        elif row["task"] not in ("cool", "cure"):
            attended[str(number),].append(span(row))
    for name, spans in attended.items():
        start, end = min(s for s, _ in spans), max(e for _, e in spans)
        within = start % 1440
        if within + end - start > shift and not (within == 0 and end - start > shift):
            yield f"{name} runs from {within} to {within + end - start} of {shift}"


def hands_off(rows: Sequence[Row]) -> bool:
    free = {"press", "cool", "cure"}
    return all(
        (row["needs_hands"] == "no") == (row["task"] in free) == (not row["technician"])
        for row in rows
    )


def wrong_serials(rows: Sequence[Row], cycles: Sequence[int]) -> Iterator[str]:
    """Yield rows whose laminates are not those of their copies, by letters and places."""
    names = [
        f"{letter}-{place:02d}"
        for letter, size in zip("ABCDEFGHIJKLMNOPQRSTUVWXYZ", cycles, strict=False)
        for place in range(1, size + 1)
    ]
    for row in rows:
        ends = row["laminates"].split(" to ")
        expected = [names[copies(row)[0] - 1], names[copies(row)[-1] - 1]]
        if ends != expected[: len(ends)] or len(copies(row)) > len(ends) == 1:
            yield row["laminates"]
        if row["cycle"] and {name[0] for name in expected} != {row["cycle"]}:
            yield f"{row['laminates']} in cycle {row['cycle']}"


def lower_bound(rows: Sequence[Row], people: int, plates: int) -> Fraction:
    """Worked minutes that no plan of these rows can undercut until the last tube is fitted."""
    hands = sum(
        span(row)[1] - span(row)[0] for row in rows if row["technician"] and row["task"] != "test"
    )
    sheets = sum(span(row)[1] - span(row)[0] for row in rows if row["task"] in ("cut", "sort"))
    laser = sum(span(row)[1] - span(row)[0] for row in rows if row["task"] == "cut")
    held = sum(span(row)[1] - span(row)[0] for row in rows if row["base_plate"])
    of_a_cycle = max(
        sum(span(row)[1] - span(row)[0] for row in rows if row["cycle"] == c and row["base_plate"])
        for c in {row["cycle"] for row in rows if row["base_plate"]}
    )
    first = max(laser, sheets / people)
    return max(first + (hands - sheets) / people, first + held / plates, first + of_a_cycle)


SHOPS = [
    ("order.copies=20",),
    ("order.copies=20", "order.base_plates=2"),
    ("order.copies=20", "order.technicians=2", "order.base_plates=3"),
    ("order.copies=20", "order.technicians=3", "order.presses=2", "order.base_plates=4"),
    ("order.copies=9", "order.shift_hours=3"),
    ("order.copies=3", "order.shift_hours=1"),
    ("order.copies=60", "order.technicians=4", "order.presses=3", "order.base_plates=9"),
    ("order.copies=8", "order.cure_hours=2", "press.cool_minutes=60", "press.time_constant=4"),
]


def value(changes: Sequence[str], key: str, usual: float) -> float:
    return next((float(c.partition("=")[2]) for c in changes if c.startswith(f"{key}=")), usual)


@pytest.mark.parametrize("template", ["3dof-15mm", "1dof-5mm"])
@pytest.mark.parametrize("changes", SHOPS, ids=" ".join)
def test_the_plan_holds(template: str, changes: tuple[str, ...]) -> None:
    rows, _ = table(template, *changes)
    count = int(value(changes, "order.copies", 1))
    assert {copy for row in rows for copy in copies(row)} == set(range(1, count + 1))
    assert not [*double_bookings(rows)]
    cured = Fraction(60) * int(value(changes, "order.cure_hours", 24))
    assert not [*out_of_order(rows, 4, cured)]
    assert not [*outside_shift(rows, int(60 * value(changes, "order.shift_hours", 8)))]
    assert hands_off(rows)
    assert not [*wrong_serials(rows, plan_cycles(rows))]
    for kind, key in (("technician", "technicians"), ("press", "presses")):
        used = {row[kind] for row in rows if row[kind]}
        assert used <= {str(n) for n in range(1, int(value(changes, f"order.{key}", 1)) + 1)}
    # An hour a copy, and the tests: a tube, connected in 2 min, is held 60 s three times.
    tubes = 3 if template == "3dof-15mm" else 1
    hands = sum(Fraction(row["minutes"]) for row in rows if row["technician"])
    assert hands == count * (HANDS + 5 * tubes)
    # 3.135 time constants from 20 C to 130 C between platens at 135 C.
    warm = value(changes, "press.time_constant", 0) * 3.135
    for row in rows:
        if row["task"] == "press":
            clock = float(row["minutes"]) - PAPER[int(row["step"]) - 1]
            assert clock == pytest.approx(warm, abs=0.06) or (not warm and 0 < clock < 5)


def plan_cycles(rows: Sequence[Row]) -> list[int]:
    """Return the copies of each cycle, as the rows of its first step have them."""
    laid = {r["cycle"]: len(copies(r)) for r in rows if (r["task"], r["step"]) == ("lay", "1")}
    return [laid[cycle] for cycle in sorted(laid, key=lambda name: (len(name), name))]


@pytest.mark.parametrize(
    ("changes", "most"),
    [(SHOPS[0], 1.12), (SHOPS[1], 1.25), (SHOPS[2], 1.4), (SHOPS[3], 1.3), (SHOPS[6], 1.3)],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else str(value),
)
def test_the_plan_is_near_its_lower_bound(changes: tuple[str, ...], most: float) -> None:
    rows, _ = table("3dof-15mm", *changes)
    shift = 480
    last = max(span(row)[1] for row in rows if row["task"] == "tubes")
    days, rest = divmod(last, 1440)
    people = int(value(changes, "order.technicians", 1))
    plates = int(value(changes, "order.base_plates", 1))
    bound = lower_bound(rows, people, plates)
    ratio = (days * shift + rest) / bound
    assert 1 <= ratio <= most


def test_one_copy_and_unstated_minutes_have_no_plan() -> None:
    for changes in (["order.copies=1"], ["order.copies=4", "press.minutes_for=[]"]):
        design = load_design("1dof-5mm", changes)
        laminate = build(design)
        plan = schedule(laminate, press_settings(design), (1,))
        assert plan_csv(design, laminate, plan) is None


FAULTS = {
    "the press opens late": ("open", "start_minutes", 1.0),
    "taken down hot": ("unpin", "start_minutes", -1.0),
    "laid up too soon": ("lay", "start_minutes", -30.0),
    "sorted before it is cut": ("sort", "start_minutes", -20.0),
    "tested before it has cured": ("test", "day", -1),
    "past the shift": ("tubes", "start_minutes", 470.0),
    "a copy left out": ("tubes", "first_copy", 1),
}


@pytest.mark.parametrize("name", FAULTS)
def test_the_judge_sees_a_fault(name: str) -> None:
    task, column, change = FAULTS[name]
    rows, _ = table("1dof-5mm", "order.copies=9")
    row = next(row for row in reversed(rows) if row["task"] == task)
    row[column] = str(Fraction(row[column]) + Fraction(change))
    faults = [*double_bookings(rows), *out_of_order(rows, 4, Fraction(1440))]
    assert faults or [*outside_shift(rows, 480)]
