"""Search, sweep and comparison of designs, and changes for a yield."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from sbafab.actuators import load_design
from sbafab.api.designs import Source, command, load, numbers
from sbafab.design.files import Change, changed_keys, name_of
from sbafab.design.records import Design, Free
from sbafab.laminate.burst import is_near_burst
from sbafab.models.pneumatics import MOST_PRESSURE
from sbafab.runtime import Progress, ignore_progress
from sbafab.search import compare as comparing
from sbafab.search.advice import YieldDesign
from sbafab.search.advice import reach_yield as run_reach_yield
from sbafab.search.compare import DesignComparison, YieldEntry, load_compared, write_page
from sbafab.search.compare import compare as run_compare
from sbafab.search.find import (
    MEDIANS,
    FoundDesign,
    find_document,
    found_toml,
    free_keys,
    refuse_existing,
    write_found,
)
from sbafab.search.find import find as run_find
from sbafab.search.quantities import quantity_lines, read_all
from sbafab.search.space import FindRequest, free_of, read_free
from sbafab.search.sweep import SweepDocument, SweepRequest, SweptDesigns
from sbafab.search.sweep import sweep as run_sweep
from sbafab.search.vary import format_keys, format_value, varied_keys

Limits = Mapping[str, float | str] | Sequence[str]
"""Limits by quantity, or texts ``QUANTITY=VALUE``."""


@command
def find(
    source: Source,
    *changes: Change,
    least: Limits = (),
    most: Limits = (),
    best: str = "mass",
    flow_ml_min: float = 35.0,
    free: str | Sequence[Free | str] | None = None,
    tries: int = FindRequest.tries,
    sure: float | None = None,
    **tables: Any,
) -> FoundDesign:
    """Return the design that meets the requirements and is best in one quantity, or the nearest
    miss.

    ``find("3dof-15mm", least={"lumen": 3, "force@12.5mm@50kPa": 3}, most={"outline_diameter":
    20})``: ``least`` and ``most`` are in mm, degrees, N, N/mm, s, g and kPa, or texts with a unit;
    a ``time`` is for water at ``flow_ml_min``. ``free`` are the keys to vary instead of the
    family's own, as texts ``["chamber.diameter=8:12:0.1", "stack.balloons=6:9:1"]``, mm. The other
    arguments are the fields of ``FindRequest``, such as ``sure``, the probability (a share) of
    meeting each requirement; ``tables`` override tables of the design. ``found.best.values`` are
    the found keys, ``found.intervals`` the 90 % intervals. Raises DesignError for an unknown
    quantity, with the known ones.
    """
    requirements, goal = read_all(_texts(least), _texts(most), best, flow_ml_min)
    design = load(source, *changes, **tables)
    keys = None if free is None else free_of(design, free)
    return run_find(FindRequest(design, requirements, goal, keys, tries, sure))


def _texts(limits: Limits) -> list[str]:
    if isinstance(limits, Mapping):
        return [f"{name}={value}" for name, value in limits.items()]
    return list(limits)


@command
def reach_yield(source: Source, *changes: Change, target: float, **tables: Any) -> YieldDesign:
    """Return the design with the smallest change that reaches a yield, and the cost of that change.

    ``reach_yield("3dof-15mm", target=0.95).design`` goes to ``generate``; ``target`` is the share
    of random builds that are good. Order of stacking, bond, overhang, base plate and ears may
    change; keys in ``changes`` and ``tables`` do not change. In the result, ``changes`` has both
    values of each key, ``comparison`` the figures of both designs, ``share`` the share; ``design``
    is None if no change reaches the target, and ``sentence`` explains why. Raises DesignError.
    """
    fixed = frozenset(changed_keys([*changes, tables]))
    return run_reach_yield(load(source, *changes, **tables), target, fixed)


@command
def compare(
    first: Source,
    second: Source,
    *,
    pressures_kpa: float | Sequence[float] | None = None,
    flow_ml_min: float = 35.0,
    out: str | Path | None = None,
) -> DesignComparison:
    """Compare two designs: keys and rules that differ, and the figures of each with 90 % intervals.

    Each is a design, or the name of a template, a design file or an output folder. Figures are at
    ``pressures_kpa``, by default 10, times at ``flow_ml_min``. With ``out``,
    ``out/compare/compare.html`` is written, with pictures of both. Raises DesignError, and
    OutputError.
    """
    (a, name_a), (b, name_b) = (
        (source, source.name)
        if isinstance(source, Design)
        else (load_compared(source), str(source))
        for source in (first, second)
    )
    pressures = None if pressures_kpa is None else numbers("pressures_kpa", pressures_kpa)
    comparison = run_compare(a, b, (name_a, name_b), pressures, flow_ml_min)
    if out is not None:
        write_page(comparison, Path(out))
    return comparison


@command
def sweep(
    source: Source,
    *changes: Change,
    vary: Mapping[str, str | Iterable[Any]] | Sequence[str],
    out: str | Path = "out",
    samples: int | None = None,
    seed: int = 0,
    pressures_kpa: float | Sequence[float] = SweepRequest.pressures_kpa,
    workers: int | None = None,
    dask: str | None = None,
    seconds: float = SweepRequest.seconds,
    least: Limits = (),
    most: Limits = (),
    progress: Progress | None = None,
    **tables: Any,
) -> SweptDesigns:
    """Check and predict a design with varied keys; write one row per design.

    Files go to ``out/<name>-sweep/``. ``vary`` has the values of each key, ``{"chamber.diameter":
    numpy.linspace(4, 8, 9), "stack.balloons": [3, 6, 9]}`` (lengths in mm), or their range as
    text, ``"4:8:0.5"``; or it holds texts such as ``"chamber.diameter=4:8:0.5"``. ``samples`` and
    the arguments after it are the fields of ``SweepRequest``, with the ``seconds`` s that a design
    may take; ``least`` and ``most`` are limits as in ``find``, and a design that misses one fails;
    ``progress`` is called with each design; ``tables`` override tables of the design.
    ``swept.frame()`` returns the rows. Raises DesignError for an unknown key, and OutputError.
    """
    request = SweepRequest(
        load(source, *changes, **tables),
        varied_keys(vary),
        samples,
        seed,
        numbers("pressures_kpa", pressures_kpa),
        workers,
        dask,
        seconds,
        read_all(_texts(least), _texts(most))[0],
    )
    return run_sweep(request, Path(out), progress or ignore_progress)
