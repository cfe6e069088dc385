"""``sbafab generate``, ``cut``, ``press``, ``mesh``, ``nest``, ``simulate``: one folder each.

Each runs a design, prints the table of its files, and sets the exit code by the verdict.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args

import click

from sbafab import plugins
from sbafab.api import runs
from sbafab.api.designs import Assembly, Design, design_of, either_of
from sbafab.api.runs import TRUE_ARCS, DxfProfile, Element, MeshSettings, Run, Symmetry
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.cli.exit import print_error
from sbafab.errors import DesignError


def _chord_error(ctx: click.Context, _: click.Parameter, value: float | None) -> float:
    if value is not None and ctx.params["dxf_profile"] != "chords":
        raise click.UsageError("--chord-error needs --dxf-profile chords; add it")
    return value or TRUE_ARCS.chord_error


def cut_options(command: opt.Command) -> opt.Command:
    """Add ``--dxf-profile`` and ``--chord-error``, for programs that cannot read bulges, and
    ``--copies``, which sets a key of the design.
    """
    profile = opt.option(
        "--dxf-profile",
        "Write arcs as polyline bulges, ARC entities or chords.",
        get_args(DxfProfile),
        default=TRUE_ARCS.profile,
        is_eager=True,
    )
    chord = opt.option(
        "--chord-error MM",
        "Largest distance of a chord from its arc, with --dxf-profile chords.  "
        f"[default: {TRUE_ARCS.chord_error:g}]",
        opt.FiniteRange(0.0001, 0.1),
        callback=_chord_error,
    )
    count = opt.option(
        "--copies K", "Cut K copies of each actuator.  [default: the design's order.copies, 1]", int
    )
    return profile(chord(count(command)))


@click.command()
@opt.run_options(either_of)
@cut_options
@opt.option(
    "--target-yield",
    "Change the design as little as this share of good random builds needs, e.g. 0.95: order of "
    "stacking, bond and overhang, plate, ears. Keys of --set stay.",
    opt.PARTIAL_SHARE,
)
@opt.option("--decks", "Also write the input files of the simulators.", bool)
def generate(source: Design | Assembly, target_yield: float | None, **settings: Any) -> None:
    """Write everything: cut files, schedule, traveller, meshes.

    --decks also writes calculix/, sofa/ and mujoco/, like `sbafab simulate --export`. An assembly
    has a folder for each of its designs, and sheets, a traveller and a solid of the whole.
    --target-yield prints the changes and their cost, and the folder's design.toml is the changed
    design; if the share is not reached, no files are written and the exit code is 1.
    """
    if target_yield is None:
        _run(runs.generate, source, **settings)
    elif isinstance(source, Design):
        # Both designs are predicted, which a plain run does not do: models load slowly.
        changed_for_yield = plugins.load("sbafab.cli.search:changed_for_yield")
        design, more, before = changed_for_yield(source, target_yield, settings["as_json"])
        _run(runs.generate, design, before=before, more=more, **settings)
    else:
        raise DesignError(
            "--target-yield applies to a single design, but this is an assembly; generate its "
            "parts' designs one by one, and use the resulting files in the assembly"
        )


@click.command()
@opt.run_options(design_of)
@cut_options
def cut(design: Design, **settings: Any) -> None:
    """Write the cut files: a DXF for each layer, and film sheets."""
    _run(runs.cut, design, **settings)


@click.command()
@opt.run_options(design_of)
def press(design: Design, **settings: Any) -> None:
    """Write the heat-press schedule."""
    _run(runs.press, design, **settings)


@click.command()
@opt.run_options(design_of)
@opt.option("--h", "Edge length of the triangles.", opt.POSITIVE_LENGTH, default=MeshSettings.h)
@opt.option(
    "--element",
    "Second-order wedges or tetrahedra.",
    get_args(Element),
    default=MeshSettings.element,
)
@opt.option(
    "--symmetry",
    "Part of the actuator that is meshed.",
    get_args(Symmetry),
    default=MeshSettings.symmetry,
)
@opt.option(
    "--fill fill_ul",
    "Air volume of each balloon, e.g. 5ul.  [default: flat]",
    opt.VOLUME,
)
@opt.option("--gaps", "Keep films a mask thickness apart.", bool)
@opt.option("--flat", "Do not wrap designs for a tube.", bool)
@opt.option(
    "--format formats...",
    "Formats of the volume, shell and cavity meshes.  [default: all]",
    runs.conforming_endings(),
)
def mesh(
    design: Design,
    formats: tuple[str, ...],
    flat: bool,
    **more: Any,
) -> None:
    """Write meshes: solid, cavities, volume and shell.

    Volume and shell meshes need the extra "mesh": pip install "sbafab[mesh]".
    """
    formats = formats or runs.conforming_endings()
    _run(runs.mesh, design, formats=formats, wrapped=not flat, **more)


@click.command()
@opt.run_options(design_of, is_several=True)
@opt.option("--name", "Name of the folder OUT/<name>/.", default="job")
@cut_options
def nest(designs: Sequence[Design], **settings: Any) -> None:
    """Cut several designs from the same film sheets.

    OUT/<name>/ receives a folder for each DESIGN, and sheets/ with the parts of all. Overrides
    apply to every design. --copies sets the number of every design; the default is each design's
    order.copies.
    """
    _run(runs.nest, designs, **settings)


def _run(
    write: Callable[..., Run],
    source: object,
    as_json: bool,
    before: Callable[[], None] = lambda: None,
    more: Mapping[str, object] | None = None,
    **settings: Any,
) -> None:
    """Write a folder, print it and exit with 1 if a rule failed.

    ``before`` prints the lines before the files; ``more`` has additional keys of the document.
    """
    with show.progress(as_json) as progress:
        run = write(source, progress=progress, **settings)
    for name, reason in run.left_out:
        print_error(f"left out: {name}. {reason}")
    if as_json:
        show.document({**runs.run_document(run), **(more or {})})
    else:
        before()
        _print_run(run)
    if run.failed:
        show.end_failed()


# Printing: a table of facts, and the verdict.


UNCHANGED = (
    "is unchanged: it holds an earlier design or version. To see the findings and pictures of this "
    "one, give it another folder with --set name=NAME"
)
DECKS = ("calculix/actuator.inp", "sofa/actuator.scn", "mujoco/actuator.xml")
"""The file of each deck that its simulator opens."""
Facts = Iterator[tuple[str, str]]
"""Label and text of each row."""


def _print_run(run: Run) -> None:
    """Print the files of an order, remedies and, last, the verdict."""
    is_job, is_design = run.order.is_job, len(run.order.groups) == 1
    if is_job or not run.kept:
        show.facts(_design_facts(run) if is_design and not is_job else _order_facts(run))
        show.line("")
    groups = run.order.groups
    if is_design:
        show.remedies(run.findings)
    else:
        show.findings(groups)
    name, change = run.folder.name, "design" if is_design else "designs" if is_job else "assembly"
    if not run.failed:
        show.passed(name, groups, "" if is_job else f"sbafab check {run.folder}", run.folder)
        return
    consequence = "No cut files were written"
    if is_job:
        consequence = f"Nothing was written; {run.folder} is unchanged"
    elif run.kept:
        show.line(f"{run.folder} {UNCHANGED}")
    show.failed(name, run.findings, consequence, change)
    show.written(None if run.kept else run.folder)


def _order_facts(run: Run) -> Facts:
    """Yield rows about several designs: parts, copies, verdict, notes, film, meshes and folder."""
    index = run.manifest
    if run.between is not None:
        yield "assembly", f"{index['name']}, {index['design_sha256'][:12]}"
        parts = (f"{part['name']} ({part['design'] or part['kind']})" for part in index["parts"])
        yield "parts", ", ".join(parts)
    for build in run.builds:
        words = [show.several(build.design.order.quantity, "copy", "copies") + ", "]
        words += ["failed" if build.failed else "passed"]
        words += [f"; waived: {', '.join(build.waived)}"] if build.waived else []
        warned = sorted({f.rule for f in build.findings if f.verdict == "warn"})
        words += [f"; warnings: {', '.join(warned)}"] if warned else []
        yield build.design.name, "".join(words)
    for note in run.order.notes:
        yield "note", note
    for film in index.get("films", ()):
        yield f"{film['material']} film", _film_text(film, index["sheets"], 1)
    for mesh in index.get("meshes", ()):
        yield "solid", f"{mesh['file']}, with a node for each part"
    yield from _stale_facts(run)
    if index:
        yield "folder", str(run.folder)


def _design_facts(run: Run) -> Facts:
    """Yield rows about a design's run."""
    index, laminate = run.manifest, run.laminate
    balloons = show.several(laminate.balloons, "balloon")
    sha256 = index["design_sha256"][:12]
    yield "design", f"{laminate.name} ({laminate.family}, {balloons}), {sha256}"
    yield "kit", f"{index['kit']['name']}, version {index['kit']['version']}"
    sizes = index["sizes"].items()
    yield "sizes", ", ".join(f"{k.replace('_', ' ')} {v:.3f}" for k, v in sizes) + " mm"
    kinds = Counter(f"{layer.film.material} {layer.role}" for layer in laminate.layers)
    listed = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    yield "layers", f"{len(laminate.layers)} in {len(laminate.patterns)} patterns: {listed}"
    yield from _stale_facts(run)
    # Layers of a folded film share a file.
    files = {layer["file"] for layer in index["layers"] if layer["file"]}
    if files:
        plate = f", and the base plate {index['fixture']}" if index["fixture"] else ""
        read = "each read back and compared with the design"
        yield "cut files", f"{len(files)} in layers/{plate}, {read}"
    if run.design.order.why:
        yield "order", run.design.order.why
    for film in index["films"]:
        if "sheets" in film:
            yield f"{film['material']} film", _film_text(film, index["sheets"], index["copies"])
    yield from _press_facts(run)
    yield from _mesh_facts(run)
    scheduled = run.schedule.warnings if run.schedule is not None else ()
    yield from (("warning", warning) for warning in (index["warnings"] if files else ()))
    yield from (("note", note) for note in laminate.notes)
    yield from (("warning", warning) for warning in scheduled)
    yield "folder", str(run.folder)


def _press_facts(run: Run) -> Facts:
    """Yield rows about folds, seams, press steps and press cycles."""
    schedule = run.schedule
    if schedule is None:
        return
    if schedule.folds:
        yield "folds", f"{len(schedule.folds)}, each film cut flat as one part; press.json"
    if schedule.seams:
        tools = ", ".join(dict.fromkeys(seam.tool for seam in schedule.seams))
        yield "seams", f"{len(schedule.seams)} by {tools}; press.json"
    if not schedule.steps:
        return
    first = schedule.steps[0]
    yield (
        "press",
        f"{len(schedule.steps)} steps, {_minutes(schedule.total_press_minutes)} at "
        f"{first.temperature_c:g} C, {first.force_n / 1000:.3f} kN; press.json, press.csv",
    )
    cycles = run.builds[0].cycles
    if cycles.copies > 1:
        times = runs.batch_times(cycles, schedule)
        sizes = ", ".join(map(str, dict.fromkeys(cycles.cycles)))
        yield (
            "batch",
            f"{cycles.copies} copies in {show.several(cycles.count, 'press cycle')} of {sizes}: "
            f"{_minutes(times.press)} in the press, {_minutes(times.total)} in all",
        )


def _minutes(value: float | None) -> str:
    return "minutes not stated" if value is None else f"{value:g} min"


def _mesh_facts(run: Run) -> Facts:
    """Yield rows about meshes and simulator decks."""
    index = run.manifest
    if index["meshes"]:
        yield "meshes", ", ".join(mesh["file"] for mesh in index["meshes"])
    decks = [path for path in DECKS if path in index["files"]]
    if decks:
        yield "simulators", ", ".join(decks)
    conforming = run.conforming
    if conforming is None:
        return
    for name, figures in conforming.statistics.items():
        yield (
            f"{name} mesh",
            f"{figures['elements']:,} {figures['element']} elements, {figures['nodes']:,} nodes, "
            f"least scaled Jacobian {figures['least_scaled_jacobian']:.3f}, worst aspect "
            f"{figures['worst_aspect']:.1f}, {figures['volume_mm3']:.3f} mm3",
        )
    for note in conforming.volume.notes:
        yield "", note
    if conforming.settings.fill_ul is not None:
        yield "", "solid.* and cavity_<chamber>.stl are flat; skin.* is filled"


def _stale_facts(run: Run) -> Facts:
    if run.dropped:
        names = ", ".join(dict.fromkeys(path.partition("/")[0] for path in run.dropped))
        count = show.several(len(run.dropped), "stale file")
        own = "--set name=NAME gives a design another folder"
        yield "replaced", f"removed {count} ({names}); {own}"


def _film_text(film: Mapping[str, Any], sheets: Sequence[Mapping[str, Any]], copies: int) -> str:
    """Return the use of a film as text: sheets, size, density, waste and cutting time."""
    film_sheets = [sheet for sheet in sheets if sheet["material"] == film["material"]]
    sizes = dict.fromkeys(f"{sheet['width']:g} x {sheet['length']:g}" for sheet in film_sheets)
    minutes = sum(sheet["estimated_minutes"] for sheet in film_sheets)
    many = f" for {copies} copies" if copies > 1 else ""
    bare = any(sheet["label"] == "no room" for sheet in film_sheets)
    unlabelled = "; their borders have no room for labels: label them by hand"
    return (
        f"{show.several(len(film_sheets), 'sheet')} of {', '.join(sizes)} mm{many}, "
        f"{film['density']:.0%} used, {film['waste'] / 100:.0f} cm2 waste, about {minutes:.1f} min "
        f"of cutting; {', '.join(sheet['file'] for sheet in film_sheets)}"
        f"{unlabelled if bare else ''}"
    )


# Simulations.


@click.command()
@opt.run_options(design_of)
@opt.option("--with simulator", "Simulator.", runs.NAMES, required=True)
@opt.option(
    "--pressure P",
    'Gauge pressure in all chambers, kPa or with a unit ("60 mbar"); a vacuum is negative and '
    "for calculix.  [default: calculix 6, others 5; of a design that works under a vacuum -6]",
    opt.PRESSURE,
)
@opt.option(
    "--chamber chambers NAME=P...",
    "Pressure in one chamber; the others have --pressure if given, else none.",
    opt.OfChamber(opt.PRESSURE),
)
@opt.option(
    "--minutes",
    "Time limit, minutes; results up to then are kept.",
    opt.FiniteRange(0, 10_000, min_open=True),
    default=runs.SimulationRequest.minutes,
)
@opt.option("--export", "Write the input files of the simulator without running it.", bool)
@opt.option("--h MM", "calculix: mesh size.  [default: 0.35]", opt.LENGTH)
@opt.option(
    "--symmetry",
    "calculix: part that is computed; only the full one wrinkles and bends freely."
    "  [default: full]",
    runs.CHOICES["symmetry"],
)
@opt.option(
    "--procedure",
    "calculix: static is faster but stops when films wrinkle.  [default: dynamic]",
    runs.CHOICES["procedure"],
)
@opt.option("--scene", "sofa: scene that is run.  [default: shell]", runs.CHOICES["scene"])
@opt.option(
    "--seconds S",
    "sofa, mujoco: simulated time, s; for mujoco at least 2.  [default: sofa 8, mujoco 5]",
    float,
)
@opt.option(
    "--volume volumes NAME=UL...",
    "sofa, scene volume: volume added to a chamber.",
    opt.OfChamber(opt.VOLUME),
)
def simulate(design: Design, as_json: bool, **settings: Any) -> None:
    """Inflate a design in an installed simulator.

    OUT/<name>/calculix/ receives stroke, air volume and wall stress over pressure as a table, and
    the deformed shape as VTU; OUT/<name>/sofa/ or mujoco/ the input files of the run. result.json
    holds height, tip, tilt and volumes over time. If a run stops early, its results are kept and
    the exit code is 1. An impossible result, such as a negative volume of air, is void: the reason
    is printed, the log is kept, and the exit code is 1.
    """
    with show.progress(as_json) as progress, _printed_warnings():
        simulation = runs.simulate(design, progress=progress, **settings)
    if simulation.folder is None:
        if as_json:
            show.document(runs.checks(simulation.findings, "design", design.name))
        else:
            show.findings({design.name: simulation.findings})
            show.failed(design.name, simulation.findings, "It was not simulated", "design")
        show.end_failed()
    result = simulation.result
    if as_json:
        show.document({**runs.result_json(result), "folder": str(simulation.folder)})
    else:
        _print_result(design, result, simulation.folder)
    if simulation.beside:
        print_error(f"{simulation.beside}; the results were put into {simulation.folder}")
    if result is not None and result.stopped is not None:
        print_error(result.stopped)
        show.end_failed()


@contextmanager
def _printed_warnings() -> Iterator[None]:
    """Print warnings as sentences on standard error at once, since a run may then take hours."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = lambda message, *_: print_error(f"warning: {message}")
        yield


def _print_result(design: Design, result: runs.Result | None, folder: Path) -> None:
    if result is None:
        show.verdict(f"{design.name} exported. Written to {folder}", folder)
        return
    width = max(len(label) for label, _, _ in result.rows)
    for label, value, unit in result.rows:
        # Adding 0 makes -0 a plain 0.
        click.echo(f"{label:{width}} {round(value, 3) + 0:10.3f} {unit}".rstrip())
    factors = runs.factors_of(design)
    if factors.calibration and runs.has_balloons(design.form):
        show.wrapped(
            "(film as bought, pockets as drawn; predict uses the calibration "
            f"{factors.calibration}: {factors.modulus_ratio:.3g} times the modulus, pocket radii "
            f"{factors.pocket_loss:.2g} mm smaller)"
        )
    outcome = "simulated" if result.stopped is None else "failed: the simulation stopped early"
    show.verdict(f"{design.name} {outcome}. Written to {folder}", folder)
