"""What a design will do, by models, and the design that does what is wanted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.api.designs import load
from sbafab.api.sources import Source, parted
from sbafab.design.reading import Change

if TYPE_CHECKING:
    from sbafab.laminate.laminate import Laminate
    from sbafab.models.figures import Prediction
    from sbafab.models.motion import Motion
    from sbafab.models.stack import Stack
    from sbafab.search.find import FoundDesign
    from sbafab.search.sweep import SweptDesigns


def predict(
    source: Source,
    *changes: Change,
    pressures_kpa: Sequence[float] = (10.0, 100.0),
    flow_ml_min: float = 35.0,
    volumes_ul: Sequence[float] = (),
    quick: bool = False,
    laminate: Laminate | None = None,
    **asked: Any,
) -> Prediction:
    """What a design will do; each figure has a unit and names its model and its trust.

    Forces and works are at ``pressures_kpa``, times at ``flow_ml_min`` into each chamber, strokes
    with ``volumes_ul`` in each balloon. ``quick`` leaves out the curves and the figures of the
    elastic stack, which take seconds; ``laminate`` is the design's, where it is built already. ``asked`` holds
    fields of ``Factors``: ``press_factor``, ``contact_factor``, ``pocket_loss`` mm and
    ``modulus_mpa``, beside tables of the design. Raises
    DesignError for what is out of every model's range. Models: the paper's Eqs. 1-4 (Sec. 3), and
    elastic balloons of axisymmetric film in balance.
    """
    from sbafab.models.figures import Asked, Factors
    from sbafab.models.prediction import predict as model_predict

    factors, tables = parted(asked, Factors)
    wish = Asked(tuple(pressures_kpa), flow_ml_min, tuple(volumes_ul), Factors(**factors))
    return model_predict(load(source, *changes, **tables), wish, laminate, quick)


def stack(source: Source, *changes: Change, most_pressure: float = 110.0, **asked: Any) -> Stack:
    """The actuator as plates joined by balloons, for poses in real time: ``stack.pose((5, 5, 0))``.

    ``most_pressure`` kPa is the most that it may be asked for; ``asked`` holds fields of
    ``Factors`` beside tables of the design. Raises DesignError for pockets that are not round.
    Balloons lengthen and tilt and carry no shear (paper, Sec. 4.4).
    """
    from sbafab.models.figures import Factors
    from sbafab.models.stack import stack as stack_of

    factors, tables = parted(asked, Factors)
    design = load(source, *changes, **tables)
    return stack_of(design, most_pressure=most_pressure, factors=Factors(**factors))


def motion(stack: Stack, length: float = 150.0, diameter: float = 0.635, **load: Any) -> Motion:
    """A stack that is fed with air through tubes, to call ``motion.step(dt, pressures=...)``.

    ``length`` and inner ``diameter`` of each chamber's tube are mm (the default is the paper's
    tube, Sec. 2); ``load`` is what ``stack.pose`` takes beside pressures. Flow is laminar
    (Poiseuille) or turbulent (Blasius), air isothermal. Raises DesignError.
    """
    from sbafab.models.pneumatics import AIR, Line

    return stack.motion(line=Line(AIR, length, diameter), **load)


def find(
    source: Source,
    *changes: Change,
    least: Mapping[str, float] | None = None,
    most: Mapping[str, float] | None = None,
    best: str = "mass",
    **asked: Any,
) -> FoundDesign:
    """The design that meets requirements and is best in one thing, or the nearest miss.

    ``find("3dof-15mm", least={"lumen": 3, "force@12.5mm@50kPa": 3}, most={"outline_diameter":
    20})``: ``least`` and ``most`` are in mm, N, g and kPa. ``asked`` holds fields of
    ``FindRequest``, such as ``tries``, beside tables of the design; ``found.best.values`` are the
    found keys. Raises DesignError for a quantity that it does not know, with those it does.
    """
    from sbafab.search.find import FindRequest
    from sbafab.search.find import find as run_find
    from sbafab.search.requirements import read_all

    settings, tables = parted(asked, FindRequest)
    at_least = [f"{name}={value!r}" for name, value in (least or {}).items()]
    at_most = [f"{name}={value!r}" for name, value in (most or {}).items()]
    requirements, goal = read_all(at_least, at_most, best)
    return run_find(FindRequest(load(source, *changes, **tables), requirements, goal, **settings))


def sweep(
    source: Source,
    *changes: Change,
    vary: Sequence[str],
    out: str | Path = "out",
    **asked: Any,
) -> SweptDesigns:
    """Checks and predicts a design with keys varied into ``out/<name>-sweep/``; a row a design.

    ``vary`` holds texts such as ``"chamber.diameter=4:8:0.5"`` (mm) and
    ``"stack.balloons=3,6,9"``. ``asked`` holds fields of ``SweepRequest``, such as ``samples``,
    ``pressures_kpa``, ``workers`` and ``dask``, beside tables of the design. Raises DesignError for
    a key that is not there, and OutputError.
    """
    from sbafab.search.sweep import SweepRequest
    from sbafab.search.sweep import sweep as run_sweep
    from sbafab.search.vary import read_varied

    settings, tables = parted(asked, SweepRequest)
    design = load(source, *changes, **tables)
    varied = tuple(read_varied(text) for text in vary)
    return run_sweep(SweepRequest(design, varied, **settings), Path(out))
