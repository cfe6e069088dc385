"""What lies in a folder beside its layers, made anew from its design and compared with it.

The design is that of the folder's ``design.toml``, whose layers the cut files have been held
against; the places of the parts on their film sheets are those of the folder's ``nest.json``.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sbafab.as_built.likeness import file_difference, index_difference
from sbafab.as_built.meant import drawn_settings
from sbafab.as_built.meshes import bodies
from sbafab.as_built.records import DESIGNED, Job, Manifest, Problem, is_joined
from sbafab.cutting.files import CutFile
from sbafab.cutting.fixture import PATH as FIXTURE
from sbafab.cutting.fixture import write_fixture
from sbafab.cutting.properties import chord_error_of, curves_property, layer_path
from sbafab.cutting.sheets import SheetFile
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.boolean import GeometryError
from sbafab.geometry.region import Region
from sbafab.nesting.parts import parts_of
from sbafab.nesting.records import Part as NestPart
from sbafab.output.batch import Drawing, plan_batch, write_batch
from sbafab.output.contents import TRAVELLER, Checked, Made, Part, schedule_of, write_contents
from sbafab.output.earlier import PRESS
from sbafab.output.manifest import as_json
from sbafab.output.settings import GENERATOR, cut_settings
from sbafab.output.shop import CutSet, find_nests, write_nested_sheets
from sbafab.pressing.together import design_runs

INDEX = "manifest.json"
UNMADE = (DesignError, OutputError, GeometryError, ArithmeticError, LookupError)
"""What a doctored design can raise where a sound one is made."""
NOT_COMPARED = ("files", "mesh_statistics", "meshes")
"""Keys of a manifest with hashes, and with meshes of more than one command."""


def derived_problems(
    folder: Path, claims: Manifest, checked: Checked, paths: Mapping[str, Region], of_job: bool
) -> list[Problem]:
    """Files of one design that are not what it makes; of a job's design, all but its sheets.

    ``paths`` holds the beam's path for every pattern of the design's laminate.
    """
    with _made_anew(folder) as (fresh, problems):
        parts = parts_of(checked.laminate, paths, checked.design.order.copies)
        index = _write_anew(folder, fresh, claims, checked, None if of_job else parts)
        problems.extend(_differences(folder, fresh, claims.files, claims.generator))
        problems.extend(_index_problems(folder, index, of_job))
        problems.extend(_prediction_problems(folder, fresh, claims, checked))
    return problems


def derived_job_problems(
    folder: Path, job: Job, checked: Sequence[Checked], curves: str | None
) -> list[Problem]:
    """Files of a job, and of its designs' folders, that are not what the designs make.

    ``curves`` is what the manifests of the designs say of their chords.
    """
    with _made_anew(folder) as (fresh, problems):
        whole = None
        waived: tuple[str, ...] = ()
        lowered: tuple[str, ...] = ()
        if is_joined(job):
            # An assembly's run checks what it has written, and so imports this module.
            from sbafab.output.assembly import checked_again

            whole = checked_again(folder, checked)
            waived, lowered = whole.waived, whole.lowered
        error = chord_error_of(curves_property(curves))
        drawing = Drawing("chords", error) if error else Drawing()
        batch = plan_batch(checked, job.name, folder, drawing, _quiet, waived, lowered)
        written = write_batch(batch, fresh, ("press", "mesh", "preview"), whole is None, _quiet)
        if whole is not None:
            from sbafab.output.assembly import write_whole

            write_whole(whole, batch, written, fresh, _quiet)
        problems.extend(_differences(folder, fresh, job.files, job.generator))
    return problems


def _quiet(what: str, done: int, total: int) -> None:
    pass


@contextmanager
def _made_anew(folder: Path) -> Iterator[tuple[Path, list[Problem]]]:
    """An empty folder, and problems to be added to: also that the design could not be made."""
    problems: list[Problem] = []
    with TemporaryDirectory() as name:
        try:
            yield Path(name), problems
        except UNMADE as error:
            message = f"{folder.name} could not be made anew to be compared: {error}"
            problems.append(Problem(DESIGNED, message))


def _write_anew(
    folder: Path,
    fresh: Path,
    claims: Manifest,
    checked: Checked,
    parts: Sequence[NestPart] | None,
) -> dict[str, Any]:
    """Writes what a run would have put beside the layers' files; its manifest, without hashes.

    The ``parts`` go on film sheets of their own; a design of a job has none.
    """
    design, laminate = checked.design, checked.laminate
    settings = drawn_settings(design, checked.waived, claims.curves)
    wanted = _parts(claims.files)
    # Pictures come with a run that makes everything: then there is a page as well.
    has_page = parts is not None and (TRAVELLER in claims.files or {"press", "preview"} <= wanted)
    wanted |= {"press", "preview"} if has_page else set()
    sheets: list[SheetFile] = []
    if parts is not None:
        nests = find_nests(parts, design, folder, _quiet)
        sheets = write_nested_sheets(nests, design, fresh, settings, _quiet)
    write_fixture(laminate, fresh, settings, design_runs(design, laminate).places)
    cut = CutSet(_cut_files(checked), FIXTURE if laminate.pins else None, claims.curves)
    pressing = schedule_of(checked) if "press" in wanted else None
    made = Made(cut, sheets, pressing, traveller=has_page)
    return write_contents(checked, wanted, made, fresh, _quiet)


def _cut_files(checked: Checked) -> tuple[CutFile, ...]:
    settings = cut_settings(checked.design, checked.waived)
    return tuple(
        CutFile(
            layer.index, layer_path(layer.name, settings.kerf_width(layer.film.material)), "", 0, 0
        )
        for layer in checked.laminate.layers
    )


def _parts(files: Collection[str]) -> set[Part]:
    """The parts of a run that a folder's files are of."""
    parts: set[Part] = {"cut"}
    if any(path in files for path in PRESS):
        parts.add("press")
    if any(path.startswith("preview/") for path in files):
        parts.add("preview")
    if any(path.startswith(("mesh/solid.", "mesh/cavity_")) for path in files):
        parts.add("mesh")
    return parts


def _differences(
    folder: Path, fresh: Path, listed: Collection[str], generator: str
) -> list[Problem]:
    """Files that are not as they are made anew.

    What another version of this program has written may read otherwise and be right: then it is a
    warning, but for what is cut and pressed.
    """
    problems = []
    for path in sorted(path for path in fresh.rglob("*") if path.is_file()):
        name = path.relative_to(fresh).as_posix()
        if name == INDEX or "layers/" in name:
            continue
        if name not in listed or not (folder / name).is_file():
            said = f"{name} is missing"
        elif name.endswith(f"/{INDEX}"):
            said = index_difference(_index(folder / name), _index(path), ("files",))
            said = f"{name}: {said}" if said else ""
        else:
            said = file_difference(folder / name, path, name)
        if said:
            is_done = name.endswith((*PRESS, ".dxf"))
            problems.append(_other(said, generator, is_done))
    return problems


def _other(said: str, generator: str, is_done: bool) -> Problem:
    if generator == GENERATOR or is_done:
        return Problem(DESIGNED, f"{said}; write the folder anew")
    said = f"{said}, but it was made by {generator}, and this is {GENERATOR}; write the folder anew"
    return Problem(DESIGNED, said, verdict="warn")


def _index(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def _index_problems(folder: Path, index: dict[str, Any], of_job: bool) -> list[Problem]:
    """Where the manifest is not the design's; sheets of a job are claimed by the job."""
    left_out = (*NOT_COMPARED, "sheets", "films") if of_job else NOT_COMPARED
    found, wanted = _index(folder / INDEX), json.loads(as_json(index))
    said = index_difference(found, wanted, left_out) or _mesh_difference(folder, found, wanted)
    return [Problem(DESIGNED, f"manifest.json: {said}; write the folder anew")] if said else []


def _mesh_difference(folder: Path, found: dict[str, Any], wanted: dict[str, Any]) -> str:
    """Surfaces that the manifest lists otherwise; a library may make other triangles of them."""
    said = [one for one in found.get("meshes", []) if isinstance(one, dict)]
    listed = [one for one in said if one.get("kind") in ("solid", "cavity")]
    if len(listed) != len(wanted["meshes"]):
        return f"it lists {len(listed)} surfaces, not {len(wanted['meshes'])}"
    for mesh in wanted["meshes"]:
        own: dict[str, Any] = next((m for m in listed if m.get("file") == mesh["file"]), {})
        count = mesh["elements"]
        if own.get("elements") != count:
            count = sum(len(body.surface.faces) for body in bodies(folder / mesh["file"]))
        off = index_difference(own, {**mesh, "elements": count}, ())
        if off:
            return f"{mesh['file']}: {off}"
    return ""


def _prediction_problems(
    folder: Path, fresh: Path, claims: Manifest, checked: Checked
) -> list[Problem]:
    """The prediction, asked for again what the file says that was asked for."""
    if "predict.json" not in claims.files:
        return []
    from sbafab.models.figures import Asked, Calibration
    from sbafab.models.prediction import predict
    from sbafab.output.predicting import FOLDER, with_prediction

    try:
        asked = _index(folder / "predict.json")["asked"]
        factors = Calibration(float(asked["press_factor"]), float(asked["contact_factor"]))
        pressures, volumes = (tuple(map(float, asked[k])) for k in ("pressures_kpa", "volumes_ul"))
        wish = Asked(pressures, float(asked["flow_ml_min"]), volumes, factors)
        apart = fresh / FOLDER
        apart.mkdir()
        with_prediction(checked.design, predict(checked.design, wish))(checked.laminate, apart)
    except (TypeError, ValueError, LookupError, OSError) as error:
        said = f"predict.json does not say what was asked for ({error})"
        return [_other(said, claims.generator, is_done=False)]
    return _differences(folder, apart, claims.files, claims.generator)
