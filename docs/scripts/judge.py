"""Lets KLayout and GDAL judge random designs: ``python -m docs.scripts.judge [NUMBER]``."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import pyogrio
from hypothesis import HealthCheck, Phase, given, settings

from sbafab.actuators import build, load_design
from tests.interop.judging import Compared, areas, overhang, widths
from tests.properties.designs import Draft, valid


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

    def show(self) -> None:
        print("designs:", ", ".join(f"{n} {family}" for family, n in self.families.items()))
        print(f"GDAL: {len(self.errors)} areas, largest departure {max(self.errors):.2e}")
        print("| measure | compared | square | corners | aslant | apart by at most | disagree |")
        for what in ("bond", "overhang", "web", "slot"):
            own = [measure for measure in self.measures if measure.what == what]
            hows = Counter(measure.how for measure in own)
            apart = [
                abs(m.ours - m.theirs) for m in own if m.theirs is not None and m.how != "aslant"
            ]
            disagree = [measure for measure in own if not measure.agrees]
            ways = " | ".join(str(hows[how]) for how in ("square", "corners", "aslant"))
            print(f"| {what} | {len(own)} | {ways} | {max(apart):.4f} | {len(disagree)} |")
            for measure in disagree:
                print(measure)


def main() -> None:
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 200
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
    verdicts.show()


if __name__ == "__main__":
    main()
