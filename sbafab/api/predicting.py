"""What a design will do, by models, and the design that does what is wanted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab.api.designs import Source, load, parted
from sbafab.design.files import Change
from sbafab.errors import DesignError

if TYPE_CHECKING:
    from sbafab.assemblies.build import Assembled
    from sbafab.assemblies.records import Assembly
    from sbafab.laminate.laminate import Laminate
    from sbafab.meshing.surface import Surface
    from sbafab.models.figures import Prediction
    from sbafab.models.stack import Motion, Stack
    from sbafab.reports.assembly_prediction import AssemblyPrediction, Grip
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
    elastic stack, which take seconds; ``laminate`` is the design's, where it is built already.
    ``asked`` holds fields of ``Factors``: ``press_factor``, ``contact_factor``, ``pocket_loss`` mm
    and ``modulus_mpa``, beside tables of the design. Raises DesignError for what is out of every
    model's range. Models: the paper's Eqs. 1-4 (Sec. 3), and elastic balloons of axisymmetric film
    in balance.
    """
    from sbafab.models.figures import Asked, Factors
    from sbafab.models.prediction import predict as model_predict

    factors, tables = parted(asked, Factors)
    wish = Asked(tuple(pressures_kpa), flow_ml_min, tuple(volumes_ul), Factors(**factors))
    return model_predict(load(source, *changes, **tables), wish, laminate, quick)


def predict_assembly(
    source: str | Path | Assembly | Assembled,
    *changes: Change,
    pressure_kpa: float = 10.0,
    load_g: float = 1.2,
    pause: Callable[[], None] | None = None,
    **tables: Any,
) -> AssemblyPrediction:
    """What the parts of an assembly do inflated: reach, load, grip, and what they then touch.

    All actuators are at ``pressure_kpa``, and ``load_g`` g hangs across their tips; the paper's
    marble by default (Sec. 5). ``pause`` is called between parts of the work, which takes seconds;
    what it raises ends it. Raises DesignError for pressures that the models do not reach.
    """
    from sbafab.api.designs import assemble
    from sbafab.assemblies.build import Assembled
    from sbafab.reports.assembly_prediction import predict_assembly as model_predict

    found = source if isinstance(source, Assembled) else assemble(source, *changes, **tables)
    return model_predict(found, pressure_kpa, load_g, pause or (lambda: None))


def grip(assembled: Assembled, part: str) -> tuple[Grip, Surface] | None:
    """How a radial part of an assembly holds, and its inflated balloons; None for other parts.

    The surface is in mm in the part's own frame, as high as the lumen leaves room, free without
    one: lenses of two arcs of film that does not stretch (as for the paper's Sec. 5). Raises
    DesignError where the assembly has no such part.
    """
    from sbafab.assemblies.build import PlacedSba
    from sbafab.errors import DesignError
    from sbafab.reports.assembly_prediction import grip as grip_of
    from sbafab.reports.inflated import gripping

    names = [placed.name for placed in assembled.parts]
    if part not in names:
        raise DesignError(f"no part is named {part!r}; there are {', '.join(names)}")
    placed = assembled[part]
    found = grip_of(assembled, placed) if isinstance(placed, PlacedSba) else None
    if found is None or not isinstance(placed, PlacedSba):
        return None
    free = (found.free - found.deflated) / 2 / placed.made.laminate.balloons
    return found, gripping(placed, found.room or free)


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


def motion(
    stack: Stack,
    length: float = 150.0,
    diameter: float = 0.635,
    *,
    fluid: str = "air",
    dead_volume: float = 0.0,
    delay: float = 0.0,
    pressures: Sequence[float] | None = None,
    **load: Any,
) -> Motion:
    """A stack that is fed through tubes, to call ``motion.step(dt, pressures=...)`` with pressures
    (kPa) at the valves, or ``motion.step(dt, flows=...)`` with flows (ul/s) of the pumps.

    ``length`` and inner ``diameter`` of each chamber's tube are mm (the default is the paper's
    tube, Sec. 2); ``fluid`` is air or water; ``dead_volume`` are ul between pump and tube
    (syringe, valve, fittings), ``delay`` s until they act; ``pressures`` (kPa, by default 0) are
    those to begin with; ``load`` is what ``stack.pose`` takes beside pressures. Flow is laminar
    (Poiseuille) or turbulent (Blasius), air isothermal. Raises DesignError.
    """
    from sbafab.models.pneumatics import FLUIDS, Line

    if fluid not in FLUIDS:
        raise DesignError(f'fluid = "{fluid}" must be one of {", ".join(sorted(FLUIDS))}')
    line = Line(FLUIDS[fluid], length, diameter, dead_volume, delay)
    return stack.motion(pressures, line, **load)


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
    from sbafab.search.trial import read_all

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
