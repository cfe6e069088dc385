"""What lies in a folder beside its layers, made again from its design and compared with it.

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

from pydantic import BaseModel

from sbafab.as_built.claims import CUT_ENDINGS, could_be_cut
from sbafab.as_built.likeness import file_difference, index_difference
from sbafab.as_built.meant import drawn_settings
from sbafab.as_built.meshes import bodies
from sbafab.as_built.records import DESIGNED, Problem, is_joined
from sbafab.cutting.fixture import write_fixture
from sbafab.cutting.properties import FOLDER as LAYERS
from sbafab.cutting.properties import curves_of
from sbafab.cutting.sheets import SheetFile
from sbafab.errors import DesignError, OutputError
from sbafab.geometry.inconsistent import GeometryError
from sbafab.geometry.region import Region
from sbafab.nesting.parts import parts_of
from sbafab.nesting.records import NestPart
from sbafab.output.batch import plan_batch, write_batch
from sbafab.output.contents import FINDINGS, TRAVELLER, write_contents
from sbafab.output.earlier import MESH, PREDICTION, PRESS
from sbafab.output.manifest import as_json, file_names
from sbafab.output.manifest_records import JobManifest, Manifest
from sbafab.output.planned import EVERYTHING, Checked, Planned, RunPart, plan, schedule_of
from sbafab.output.settings import GENERATOR, hole_notes
from sbafab.output.shop import find_nests, write_nested_sheets, write_panel
from sbafab.pressing.together import design_runs
from sbafab.progress import unheard
from sbafab.simulators.simulator import NAMES as SIMULATORS

INDEX = "manifest.json"
UNMADE = (DesignError, OutputError, GeometryError, ArithmeticError, LookupError)
"""What a doctored design can raise where a sound one is made."""
BY_OTHER_COMMANDS = (*MESH, *PREDICTION, *SIMULATORS)
"""Folders and files of an earlier run that lie beside what is made again."""
NOT_COMPARED = ("files", "mesh_statistics", "meshes")
"""Keys of a manifest with hashes, and with meshes of more than one command."""


def derived_problems(
    folder: Path, claims: Manifest, checked: Checked, paths: Mapping[str, Region], of_job: bool
) -> list[Problem]:
    """Files of one design that are not what it makes; of a job's design, all but its sheets.

    ``paths`` holds the beam's path for every pattern of the design's laminate.
    """
    with _made_anew(folder) as (fresh, problems):
        order = checked.design.order
        parts = parts_of(checked.laminate, paths, order.quantity, order.spare_parts)
        index = _write_anew(folder, fresh, claims, checked, paths, None if of_job else parts)
        made = {*file_names(fresh), *(layer["file"] for layer in index["layers"])}
        # The pages of a job's design show the sheets of the job, and are compared there.
        others = (*BY_OTHER_COMMANDS, TRAVELLER, FINDINGS) if of_job else BY_OTHER_COMMANDS
        problems.extend(_foreign_problems(claims, made, others))
        problems.extend(_differences(folder, fresh, claims.files, claims.generator))
        problems.extend(_index_problems(folder, index, of_job))
        problems.extend(_prediction_problems(folder, fresh, claims, checked))
    return problems


def derived_job_problems(
    folder: Path, job: JobManifest, checked: Sequence[Checked], curves: str | None
) -> list[Problem]:
    """Files of a job, and of its designs' folders, that are not what the designs make.

    ``curves`` is what the manifests of the designs say of their chords.
    """
    with _made_anew(folder) as (fresh, problems):
        if is_joined(job):
            # An assembly's run checks what it has written, and so imports this module.
            from sbafab.output.assembly import checked_again, plan_assembly, write_assembly

            whole = checked_again(folder, checked)
            batch = plan_assembly(whole, folder, unheard, curves_of(curves))
            write_assembly(whole, batch, fresh, unheard)
        else:
            planned = [plan(one, EVERYTHING, curves_of(curves)) for one in checked]
            batch = plan_batch(job.schema_name, job.name, planned, folder, unheard)
            write_batch(batch, fresh, unheard)
        problems.extend(_foreign_problems(job, file_names(fresh)))
        problems.extend(_differences(folder, fresh, job.files, job.generator))
    return problems


def _foreign_problems(
    claims: Manifest | JobManifest, made: Collection[str], others: Collection[str] = ()
) -> list[Problem]:
    """Return the files that a manifest lists and its design does not make.

    ``others``: folders and files of commands that are not run again here; what could be cut is not
    theirs either.
    """
    return [
        _other(
            f"{path} is listed and is no file of this design",
            claims.generator,
            is_done=path.lower().endswith(CUT_ENDINGS),
        )
        for path in claims.files
        if path not in made and (could_be_cut(path) or path.partition("/")[0] not in others)
    ]


@contextmanager
def _made_anew(folder: Path) -> Iterator[tuple[Path, list[Problem]]]:
    """An empty folder, and problems to be added to: also that the design could not be made."""
    problems: list[Problem] = []
    with TemporaryDirectory() as name:
        try:
            yield Path(name), problems
        except UNMADE as error:
            message = f"{folder.name} could not be made again to be compared: {error}"
            problems.append(Problem(DESIGNED, message))


def _write_anew(
    folder: Path,
    fresh: Path,
    claims: Manifest,
    checked: Checked,
    paths: Mapping[str, Region],
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
        nests = find_nests(parts, design, folder, unheard)
        sheets = write_nested_sheets(nests, design, fresh, settings, unheard)
    places = design_runs(design, laminate).places
    write_fixture(laminate, fresh, settings, places, hole_notes(design, laminate))
    write_panel(laminate, paths, fresh, settings)
    pressing = schedule_of(checked) if "press" in wanted else None
    planned = Planned(checked, frozenset(wanted), settings, pressing)
    return write_contents(planned, sheets, fresh, unheard, parts is not None)


def _parts(files: Collection[str]) -> set[RunPart]:
    """The parts of a run that a folder's files are of."""
    parts: set[RunPart] = {"cut"}
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
    """Files that are not as they are made again.

    What another version of this program has written may read otherwise and be right: then it is a
    warning, but for what is cut and pressed.
    """
    problems = []
    for path in sorted(path for path in fresh.rglob("*") if path.is_file()):
        name = path.relative_to(fresh).as_posix()
        if name == INDEX or (path.parent.name == LAYERS and path.suffix == ".dxf"):
            continue
        if name not in listed or not (folder / name).is_file():
            said = f"{name} is missing"
        elif name.endswith(f"/{INDEX}"):
            said = index_difference(_index(folder / name), _index(path), ("files",))
            said = f"{name}: {said}" if said else ""
        else:
            said = file_difference(folder / name, path, name)
        if said:
            is_done = name.endswith((*PRESS, *CUT_ENDINGS))
            problems.append(_other(said, generator, is_done))
    return problems


def _other(said: str, generator: str, is_done: bool) -> Problem:
    if generator == GENERATOR or is_done:
        return Problem(DESIGNED, f"{said}; regenerate the folder")
    said = f"{said}, but it was made by {generator}, and this is {GENERATOR}; regenerate the folder"
    return Problem(DESIGNED, said, verdict="warn")


def _index(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def _index_problems(folder: Path, index: dict[str, Any], of_job: bool) -> list[Problem]:
    """Where the manifest is not the design's; sheets of a job are claimed by the job."""
    left_out = (*NOT_COMPARED, "sheets", "films") if of_job else NOT_COMPARED
    found, wanted = _index(folder / INDEX), json.loads(as_json(index))
    said = index_difference(found, wanted, left_out) or _mesh_difference(folder, found, wanted)
    return [Problem(DESIGNED, f"manifest.json: {said}; regenerate the folder")] if said else []


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


class _Wish(BaseModel):
    pressures_kpa: tuple[float, ...]
    flow_ml_min: float
    volumes_ul: tuple[float, ...]
    press_factor: float
    contact_factor: float
    pocket_loss: float
    modulus_mpa: float | None


class _Predicted(BaseModel):
    """What of ``predict.json`` says what was asked for."""

    asked: _Wish


def _prediction_problems(
    folder: Path, fresh: Path, claims: Manifest, checked: Checked
) -> list[Problem]:
    """The prediction, asked for again what the file says that was asked for."""
    if "predict.json" not in claims.files:
        return []
    from sbafab.models.figures import Asked, Factors
    from sbafab.models.prediction import predict
    from sbafab.output.predicting import FOLDER, with_prediction

    try:
        told = _Predicted.model_validate_json((folder / "predict.json").read_bytes()).asked
        measured = told.pocket_loss, told.modulus_mpa
        factors = Factors(told.press_factor, told.contact_factor, *measured)
        wish = Asked(told.pressures_kpa, told.flow_ml_min, told.volumes_ul, factors)
        apart = fresh / FOLDER
        apart.mkdir()
        with_prediction(checked.design, predict(checked.design, wish))(checked.laminate, apart)
    except (ValueError, OSError) as error:
        said = f"predict.json does not say what was asked for ({error})"
        return [_other(said, claims.generator, is_done=False)]
    return _differences(folder, apart, claims.files, claims.generator)
