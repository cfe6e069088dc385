"""Lets KLayout and GDAL judge random designs: ``python -m docs.scripts.judge [NUMBER]``.

Of 200 designs, the usual number, it writes the tables of docs/testing.md.
"""

from __future__ import annotations

import sys
from collections import Counter
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory

import pyogrio
from hypothesis import HealthCheck, Phase, given, settings

from docs.scripts.measured import Record, keep, texts, versions
from docs.scripts.tables import Table
from sbafab.actuators import build, load_design
from tests.interop.judging import Compared, areas, overhang, widths
from tests.properties.designs import Draft, valid

USUAL = 200
COMMAND = f"python -m docs.scripts.judge {USUAL}"
WAYS = ("square", "corners", "aslant")


class Verdicts:
    """What the judges found so far."""

    def __init__(self) -> None:
        self.families: Counter[str] = Counter()
        self.measures: list[Compared] = []
        self.errors: list[float] = []

    def add(self, draft: Draft) -> None:
        self.families[draft.tables["family"]] += 1
        with TemporaryDirectory() as name:
            laminate = build(load_design(draft.write(Path(name))))
            found = areas(laminate, Path(name))
            self.errors += [abs(theirs / ours - 1) for ours, theirs in found]
        self.measures += widths(laminate)
        reach = overhang(laminate)
        self.measures += [reach] if reach else []

    def tables(self) -> dict[str, Table]:
        """What was compared and how far it is apart, as the page shows it; prints what differs."""
        families = sorted(self.families)
        counts = [self.families[family] for family in families]
        far = f"{100 * max(self.errors):.2g} %"
        rows = []
        for what in ("bond", "overhang", "web", "slot"):
            own = [measure for measure in self.measures if measure.what == what]
            hows = Counter(measure.how for measure in own)
            apart = [
                abs(m.ours - m.theirs) for m in own if m.theirs is not None and m.how != "aslant"
            ]
            disagree = [measure for measure in own if not measure.agrees]
            ways = [hows[how] for how in WAYS]
            rows.append([what, len(own), *ways, f"{max(apart):.4f}", len(disagree)])
            for measure in disagree:
                print(measure)
        heads = ["measure", "compared", *WAYS, "apart by at most, mm", "disagree"]
        designs = [sum(counts), *counts, len(self.errors), far]
        return {
            "widths": Table(heads, texts(rows)),
            "designs": Table(
                ["designs", *families, "areas read by GDAL", "farthest off"], texts([designs])
            ),
        }


def main() -> None:
    number = int(sys.argv[1]) if len(sys.argv) > 1 else USUAL
    pyogrio.set_gdal_config_options({"OGR_ARC_STEPSIZE": "0.25"})
    verdicts = Verdicts()

    @settings(
        max_examples=number,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(valid())
    def judge(draft: Draft) -> None:
        verdicts.add(draft)

    judge()
    tables = verdicts.tables()
    for table in tables.values():
        print(table.markdown)
    if number == USUAL:
        told = versions(KLayout="klayout", pyogrio="pyogrio", hypothesis="hypothesis")
        keep("klayout", Record(COMMAND, date.today().isoformat(), told, tables))


if __name__ == "__main__":
    main()
