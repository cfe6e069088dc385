"""Designs found, swept, compared, or changed for a yield."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sbafab.api.designs import Source, load, parted
from sbafab.design.files import Change, changed_keys
from sbafab.design.records import Design
from sbafab.search.compare import PRESSURES, DesignComparison, load_compared, write_page
from sbafab.search.compare import compare as run_compare
from sbafab.search.find import FindRequest, FoundDesign
from sbafab.search.find import find as run_find
from sbafab.search.sweep import SweepRequest, SweptDesigns
from sbafab.search.sweep import sweep as run_sweep
from sbafab.search.target_yield import ReachedYield
from sbafab.search.target_yield import reach_yield as run_reach_yield
from sbafab.search.trial import read_all
from sbafab.search.vary import read_varied


def find(
    source: Source,
    *changes: Change,
    least: Mapping[str, float] | None = None,
    most: Mapping[str, float] | None = None,
    best: str = "mass",
    flow_ml_min: float = 35.0,
    **options: Any,
) -> FoundDesign:
    """The design that meets requirements and is best in one thing, or the nearest miss.

    ``find("3dof-15mm", least={"lumen": 3, "force@12.5mm@50kPa": 3}, most={"outline_diameter":
    20})``: ``least`` and ``most`` are in mm, degrees, N, N/mm, s, g and kPa, a ``time`` is with
    water at ``flow_ml_min``. ``options`` holds fields of ``FindRequest``, such as ``tries``, or
    ``sure=0.9`` for requirements that must hold with that probability, beside tables of the design;
    ``found.best.values`` are the found keys, ``found.intervals`` the 90 % intervals. Raises
    DesignError for a quantity that it does not know, with those it does.
    """
    settings, tables = parted(options, FindRequest)
    at_least = [f"{name}={value!r}" for name, value in (least or {}).items()]
    at_most = [f"{name}={value!r}" for name, value in (most or {}).items()]
    requirements, goal = read_all(at_least, at_most, best, flow_ml_min)
    return run_find(FindRequest(load(source, *changes, **tables), requirements, goal, **settings))


def reach_yield(source: Source, *changes: Change, target: float, **tables: Any) -> ReachedYield:
    """The design changed as little as a yield needs, and what that costs.

    ``reach_yield("3dof-15mm", target=0.95).design`` goes to ``generate``; ``target`` is the share
    of random builds that are good. Order of stacking, bond, overhang, base plate and ears may
    change; keys in ``changes`` and ``tables`` stay. Of the result, ``changes`` has both values of
    each key, ``comparison`` the figures of both designs, ``found.share`` the share; ``design`` is
    None where no change reaches the target, and ``sentence`` says why. Raises DesignError.
    """
    fixed = frozenset(changed_keys([*changes, tables]))
    return run_reach_yield(load(source, *changes, **tables), target, fixed)


def compare(
    first: Source,
    second: Source,
    *,
    pressures_kpa: Sequence[float] = PRESSURES,
    flow_ml_min: float = 35.0,
    out: str | Path | None = None,
) -> DesignComparison:
    """Compare two designs: keys and rules that differ, and the figures of each with 90 % intervals.

    Each is a design, or the name of a template, a design file, an output folder, or a row of a
    sweep such as ``"out/1dof-5mm-sweep/sweep.csv:12"``. Figures are at ``pressures_kpa``, times at
    ``flow_ml_min``. With ``out``, ``out/compare/compare.html`` is written, with pictures of both.
    Raises DesignError, and OutputError.
    """
    designs = [
        source if isinstance(source, Design) else load_compared(source)
        for source in (first, second)
    ]
    names = [
        source.name if isinstance(source, Design) else str(source) for source in (first, second)
    ]
    comparison = run_compare(
        designs[0], designs[1], (names[0], names[1]), pressures_kpa, flow_ml_min
    )
    if out is not None:
        write_page(comparison, Path(out))
    return comparison


def sweep(
    source: Source,
    *changes: Change,
    vary: Sequence[str],
    out: str | Path = "out",
    **options: Any,
) -> SweptDesigns:
    """Checks and predicts a design with keys varied into ``out/<name>-sweep/``; a row a design.

    ``vary`` holds texts such as ``"chamber.diameter=4:8:0.5"`` (mm) and
    ``"stack.balloons=3,6,9"``. ``options`` holds fields of ``SweepRequest``, such as ``samples``,
    ``pressures_kpa``, ``workers`` and ``dask``, beside tables of the design. Raises DesignError for
    a key that is not there, and OutputError.
    """
    settings, tables = parted(options, SweepRequest)
    design = load(source, *changes, **tables)
    varied = tuple(read_varied(text) for text in vary)
    return run_sweep(SweepRequest(design, varied, **settings), Path(out))
