"""An output folder read back, made again from its design and compared.

The design is that of the folder's ``design.toml``, whose layers the cut files have been held
against; the places of the parts on their film sheets are those of the folder's ``nest.json``.
"""

from __future__ import annotations

import base64
import csv
import json
import math
import re
import struct
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple
from zipfile import BadZipFile, ZipFile

from pydantic import BaseModel

from sbafab.as_built.check import FolderReadBack, as_designed, read_back
from sbafab.as_built.claims import CUT_ENDINGS, could_be_cut
from sbafab.as_built.cut_files import sound_digest
from sbafab.as_built.expected import drawn_settings
from sbafab.as_built.records import DESIGNED, Problem, is_job, is_joined
from sbafab.assemblies.build import assemble
from sbafab.assemblies.files import DESIGN_FILE, load_assembly
from sbafab.cutting.dxf_read import ReadBack, read_profile
from sbafab.cutting.lightburn import ENDING
from sbafab.cutting.properties import FOLDER as LAYERS
from sbafab.cutting.properties import curves_of
from sbafab.cutting.sheets import SheetFile
from sbafab.cutting.verify import TOLERANCE, check_contours
from sbafab.errors import DesignError, GeometryError, OutputError
from sbafab.geometry.region import Region
from sbafab.meshing.surface import Surface, open_edges
from sbafab.models.figures import Asked, Factors
from sbafab.models.prediction import predict
from sbafab.nesting.records import NestPart, parts_of
from sbafab.output.artefacts import (
    ARTEFACTS,
    FINDINGS,
    TRAVELLER,
    DesignFolder,
    write_artefacts,
    write_nested_sheets,
    write_plates,
)
from sbafab.output.carry_over import MESH, PREDICTION, PRESS
from sbafab.output.checked import (
    EVERYTHING,
    PICTURES,
    Checked,
    DesignPlan,
    RunPart,
    plan_design,
    schedule_of,
)
from sbafab.output.folder import write_design, write_folder
from sbafab.output.job import CheckedJob, find_nests, of_assembly, plan_job
from sbafab.output.manifest import JobManifest, Manifest, as_json, file_names
from sbafab.process import unheard
from sbafab.rules.finding import Finding
from sbafab.simulators.simulator import NAMES as SIMULATORS
from sbafab.version import GENERATOR

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

INDEX = "manifest.json"
UNMADE = (DesignError, OutputError, GeometryError, ArithmeticError, LookupError)
"""What a doctored design can raise where a sound one is made."""
BY_OTHER_COMMANDS = (*MESH, *PREDICTION, *SIMULATORS)
"""Folders and files of an earlier run that lie beside what is made again."""
NOT_COMPARED = ("files", "mesh_statistics", "meshes")
"""Keys of a manifest with hashes, and with meshes of more than one command."""


def check_folder(folder: Path) -> tuple[Finding, ...]:
    """Everything found in an output folder: file integrity, the manifest's claims, the deck, and
    whether all that lies in it is what its design makes.

    Of a job's folder, that of every design, and of the film sheets they share. Raises OutputError
    with one sentence for a folder that holds no sound manifest or no cut files.
    """
    read = read_back(folder)
    return read.against_design(design_problems_of(folder, read))


def design_problems_of(folder: Path, read: FolderReadBack) -> list[Problem]:
    """Layers, and all that lies beside them, that are not what the folder's designs make."""
    checked = [as_designed(built) for built in read.designs]
    whole = [design for design in checked if design is not None]
    if len(whole) < len(checked):
        return [*read.problems]
    if read.job is not None:
        return [*read.problems, *_job_problems(folder, read.job, whole, read.designs[0].claims)]
    (built,) = read.designs
    assert built.meant is not None
    return [*read.problems, *_problems(folder, built.claims, whole[0], built.meant.paths)]


def _problems(
    folder: Path, claims: Manifest, checked: Checked, paths: Mapping[str, Region]
) -> list[Problem]:
    """Files of one design that are not what it makes; of a job's design, all but its sheets.

    ``paths`` holds the beam's path for every pattern of the design's laminate.
    """
    of_job = is_job(folder.absolute().parent)
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


def _job_problems(
    folder: Path, job: JobManifest, checked: Sequence[Checked], claims: Manifest
) -> list[Problem]:
    """Files of a job, and of its designs' folders, that are not what the designs make.

    ``claims`` are those of one of the designs, which say how chords were drawn.
    """
    curves = curves_of(claims.curves)
    with _made_anew(folder) as (fresh, problems):
        whole = CheckedJob(job.schema_name, job.name, tuple(checked))
        if is_joined(job):
            whole = of_assembly(assemble(load_assembly(folder / DESIGN_FILE)), checked)
        wanted = PICTURES if is_joined(job) and whole.failed else EVERYTHING
        designs = [plan_design(design, wanted, curves) for design in checked]
        write_folder(plan_job(whole, designs, folder, unheard), fresh, unheard)
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
    design = checked.design
    settings = drawn_settings(design, checked.waived, claims.curves)
    wanted = _parts(claims.files)
    # Pictures come with a run that makes everything: then there is a page as well.
    has_page = parts is not None and (TRAVELLER in claims.files or {"press", "preview"} <= wanted)
    wanted |= {"press", "preview"} if has_page else set()
    sheets: list[SheetFile] = []
    if parts is not None:
        nests = find_nests(parts, design, folder, unheard)
        sheets = write_nested_sheets(nests, design, fresh, settings, unheard)
    write_plates(checked, paths, fresh, settings)
    pressing = schedule_of(checked) if "press" in wanted else None
    plan = DesignPlan(checked, frozenset(wanted), settings, pressing)
    return write_design(DesignFolder(plan, sheets, fresh, unheard, parts is not None))


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
    try:
        told = _Predicted.model_validate_json((folder / "predict.json").read_bytes()).asked
        measured = told.pocket_loss, told.modulus_mpa
        factors = Factors(told.press_factor, told.contact_factor, *measured)
        wish = Asked(told.pressures_kpa, told.flow_ml_min, told.volumes_ul, factors)
        apart = fresh / "prediction"
        apart.mkdir()
        settings = drawn_settings(checked.design, checked.waived, claims.curves)
        prediction = predict(checked.design, wish)
        plan = DesignPlan(checked, frozenset(("predict",)), settings, prediction=prediction)
        rows = [row for row in ARTEFACTS if row.part == "predict"]
        write_artefacts(DesignFolder(plan, (), apart, unheard), rows)
    except (ValueError, OSError) as error:
        said = f"predict.json does not say what was asked for ({error})"
        return [_other(said, claims.generator, is_done=False)]
    return _differences(folder, apart, claims.files, claims.generator)


# Whether two files hold the same: bytes first, then what a reader takes from them.
#
# Bytes may differ where another program has saved a drawing, or another version of a library has
# made a mesh or a picture, and nothing differs that is cut, pressed or read.


SHARE, LEAST = 1e-6, 1e-6
"""Numbers that differ by less, relatively or at all, say the same: libraries round otherwise."""
GREY = 1.0
"""Mean difference of two pictures, of 255 levels, that antialiasing may make."""
SEEN, FEW = 48, 2e-4
"""A pixel that differs by as much is seen; that share of them may be."""
UNREADABLE = (ValueError, LookupError, ArithmeticError, RecursionError, csv.Error)
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
PICTURE = re.compile(r"data:image/png;base64,([A-Za-z0-9+/=\s]+)")
LONGEST_SHOWN = 40


def file_difference(found: Path, meant: Path, name: str) -> str:
    """What differs between a file and what it should be, in a sentence; empty where nothing does.

    ``name`` is what the sentence calls the file.
    """
    data, wanted = found.read_bytes(), meant.read_bytes()
    if data == wanted:
        return ""
    try:
        said = _readers()[meant.suffix](found, meant)
    except (
        OutputError,
        ValueError,
        LookupError,
        ArithmeticError,
        RecursionError,
        csv.Error,
    ) as error:
        said = f"it cannot be read ({error})"
    return f"{name} is not what design.toml makes: {said}" if said else ""


def index_difference(found: Any, meant: Any, left_out: Collection[str]) -> str:
    """Where a manifest differs from one, but for the keys left out; empty where nowhere."""
    if not isinstance(found, dict):
        return "it is no index"
    own, wanted = (
        {key: value for key, value in index.items() if key not in left_out}
        for index in (found, meant)
    )
    return _value_difference(own, wanted, "")


def _readers() -> dict[str, Callable[[Path, Path], str]]:
    return {
        ".json": _json_difference,
        ".dxf": _drawing_difference,
        ".png": lambda found, meant: _picture_difference(found.read_bytes(), meant.read_bytes()),
        ".csv": _table_difference,
        ".pdf": lambda found, meant: "it shows something else",
        **dict.fromkeys((".svg", ".toml", ".html", ENDING), _text_difference),
        **dict.fromkeys((".stl", ".3mf", ".glb"), mesh_difference),
    }


def _text(path: Path) -> str:
    with path.open(encoding="utf-8", newline="") as file:
        return file.read()


def _json_difference(found: Path, meant: Path) -> str:
    own, wanted = (json.loads(_text(path)) for path in (found, meant))
    return _value_difference(own, wanted, "")


def _table_difference(found: Path, meant: Path) -> str:
    """Where two tables differ, by row and column; rows are counted below the columns' names."""
    own, wanted = ([*csv.reader(_text(path).splitlines(True))] for path in (found, meant))
    if own[:1] != wanted[:1]:
        names, others = (", ".join(row) for table in (own, wanted) for row in table[:1] or [[]])
        return f"its columns are {_shown(names)}, not {_shown(others)}"
    if len(own) != len(wanted):
        return f"it has {_rows(len(own) - 1)}, not {len(wanted) - 1}"
    for number, (row, other) in enumerate(zip(own[1:], wanted[1:], strict=True), start=1):
        if len(row) != len(other):
            return f"row {number} has {len(row)} cells, not {len(other)}"
        for name, cell, meant_cell in zip(wanted[0], row, other, strict=True):
            said = _value_difference(cell, meant_cell, f"row {number}, column {name}")
            if said:
                return said
    return ""


def _rows(count: int) -> str:
    return f"{count} row{'' if count == 1 else 's'}"


def _value_difference(found: Any, meant: Any, where: str) -> str:
    if isinstance(meant, dict) and isinstance(found, dict):
        for key in meant | found:
            if key not in found or key not in meant:
                return f"{where}{key} is {'missing' if key not in found else 'one too many'}"
            said = _value_difference(found[key], meant[key], f"{where}{key}.")
            if said:
                return said
        return ""
    if isinstance(meant, list) and isinstance(found, list):
        if len(meant) != len(found):
            return f"{where.rstrip('.')} has {len(found)} entries, not {len(meant)}"
        pairs = zip(found, meant, strict=True)
        told = (_value_difference(*pair, f"{where}{n}.") for n, pair in enumerate(pairs, start=1))
        return next(filter(None, told), "")
    if _is_number(meant) and _is_number(found):
        same = _alike(float(found), float(meant))
    elif isinstance(meant, str) and isinstance(found, str):
        same = not _words_difference(found, meant)
    else:
        same = type(found) is type(meant) and found == meant
    return "" if same else f"{where.rstrip('.')} is {_shown(found)}, not {_shown(meant)}"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _alike(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=SHARE, abs_tol=LEAST)


def _shown(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def _text_difference(found: Path, meant: Path) -> str:
    own, wanted = _text(found), _text(meant)
    pictures, others = PICTURE.findall(own), PICTURE.findall(wanted)
    if len(pictures) != len(others):
        return f"it has {len(pictures)} pictures, not {len(others)}"
    for number, (one, other) in enumerate(zip(pictures, others, strict=True), start=1):
        said = _picture_difference(base64.b64decode(one), base64.b64decode(other))
        if said:
            return f"picture {number}: {said}"
    return _words_difference(PICTURE.sub("", own), PICTURE.sub("", wanted))


def _words_difference(found: str, meant: str) -> str:
    """The first word or number that differs; how texts are broken into lines does not count."""
    own, wanted = [*_tokens(found)], [*_tokens(meant)]
    for one, other in zip(own, wanted, strict=False):
        if one != other and not (
            NUMBER.fullmatch(one) and NUMBER.fullmatch(other) and _alike(float(one), float(other))
        ):
            return f"{_shown(one)} stands where {_shown(other)} should"
    if len(own) != len(wanted):
        return f"it has {len(own)} words and numbers, not {len(wanted)}"
    return ""


def _tokens(text: str) -> Iterator[str]:
    last = 0
    for match in NUMBER.finditer(text):
        yield from text[last : match.start()].split()
        yield match[0]
        last = match.end()
    yield from text[last:].split()


def _picture_difference(found: bytes, meant: bytes) -> str:
    """Pixels are compared, so that another library's compression is no difference."""
    import numpy as np
    from PIL import Image, UnidentifiedImageError

    try:
        own, wanted = (
            np.asarray(Image.open(BytesIO(data)).convert("RGBA"), dtype=np.int16)
            for data in (found, meant)
        )
    except (UnidentifiedImageError, OSError, SyntaxError) as error:
        return f"it is no sound picture ({error})"
    if own.shape != wanted.shape:
        return f"it measures {own.shape[1]} x {own.shape[0]} pixels"
    off = np.abs(own - wanted).max(axis=2)
    seen = np.argwhere(off >= SEEN)
    if off.mean() > GREY or len(seen) > FEW * off.size:
        y, x = seen[0] if len(seen) else np.unravel_index(int(off.argmax()), off.shape)
        return f"pixels differ, as at {x}, {y}"
    return ""


def _drawing_difference(found: Path, meant: Path) -> str:
    """Contours, strokes and properties of two drawings."""
    sound_digest(found)
    own, wanted = read_profile(found), read_profile(meant)
    try:
        check_contours(own.region, wanted.region, TOLERANCE)
    except OutputError as error:
        return str(error).rstrip(".")
    # A version of DXF that knows no properties drops all of them, which is told once elsewhere.
    for name, value in wanted.properties.items() if own.properties else ():
        if own.properties.get(name) != value:
            return f"custom property {name} is {own.properties.get(name)!r}, not {value!r}"
    return _stroke_difference(own, wanted)


def _stroke_difference(own: ReadBack, wanted: ReadBack) -> str:
    """Engraving, parting cut, frame or datum that another drawing has, or has not."""
    left = [*wanted.strokes]
    for layer, edges in own.strokes:
        points = [edges[0].start, *(edge.end for edge in edges)]
        match = next((one for one in left if one[0] == layer and _follows(points, one[1])), None)
        if match is None:
            x, y = points[0]
            return f"the stroke on {layer} at x {x:.3f}, y {y:.3f} should not be there"
        left.remove(match)
    if left:
        (x, y) = left[0][1][0].start
        return f"the stroke on {left[0][0]} at x {x:.3f}, y {y:.3f} is missing"
    return ""


def _follows(points: list[tuple[float, float]], edges: Any) -> bool:
    wanted = [edges[0].start, *(edge.end for edge in edges)]
    return len(wanted) == len(points) and any(
        all(math.dist(p, q) <= TOLERANCE for p, q in zip(points, run, strict=True))
        for run in (wanted, wanted[::-1])
    )


# Surfaces read back from STL, 3MF and GLB files, and compared.


NEAR = 2e-5
"""mm by which a point stored in single precision, or to 6 decimals, may be off."""
MESH_SHARE = 1e-5
"""Share of a volume by which two triangulations of one solid may differ."""
MOST_BYTES = 500_000_000
MOST_SIZE = 1e5
"""mm from the origin."""
MODEL = "3D/3dmodel.model"
VERTEX = re.compile(r'<vertex x="([^"]*)" y="([^"]*)" z="([^"]*)" */>')
TRIANGLE = re.compile(r'<triangle v1="([^"]*)" v2="([^"]*)" v3="([^"]*)" */>')


class Body(NamedTuple):
    """A surface, and what its file says of it beside points and faces."""

    surface: Surface
    said: str


def mesh_difference(found: Path, meant: Path) -> str:
    """What differs between two mesh files of one format; empty where they hold the same bodies.

    Triangles may lie otherwise, as another version of a library lays them; points, enclosed
    volume, area and watertightness may not differ.
    """
    own, wanted = bodies(found), bodies(meant)
    if len(own) != len(wanted):
        return f"it holds {len(own)} bodies, not {len(wanted)}"
    pairs = zip(own, wanted, strict=True)
    return next(filter(None, (_difference(one, other) for one, other in pairs)), "")


def bodies(path: Path) -> list[Body]:
    """The bodies of a mesh file, in mm. Raises OutputError for what is none."""
    if path.stat().st_size > MOST_BYTES:
        raise OutputError(f"larger than {MOST_BYTES:,} bytes")
    readers = {".stl": _stl, ".3mf": _3mf, ".glb": _glb}
    try:
        return readers[path.suffix](path)
    except (ValueError, LookupError, TypeError, struct.error, BadZipFile) as error:
        raise OutputError(f"no sound mesh: {error}") from error


def _difference(own: Body, wanted: Body) -> str:
    if own.said != wanted.said:
        return "names, materials or scales of its bodies are others"
    surface, meant = own.surface, wanted.surface
    said = _unsound(surface)
    if said:
        return said
    for one, other, what in ((surface, meant, "too many"), (meant, surface, "missing")):
        stray = _stray(one.points, other.points)
        if stray is not None:
            x, y, z = stray
            return f"the point at x {x:.3f}, y {y:.3f}, z {z:.3f} is {what}"
    if abs(surface.volume - meant.volume) > MESH_SHARE * abs(meant.volume):
        return f"it encloses {surface.volume:.4f} mm3, not {meant.volume:.4f}"
    if abs(_area(surface) - _area(meant)) > MESH_SHARE * _area(meant):
        return f"its surface is {_area(surface):.3f} mm2, not {_area(meant):.3f}"
    return ""


def _unsound(surface: Surface) -> str:
    import numpy as np

    points, faces = surface.points, surface.faces
    if not len(points) or not len(faces):
        return "it is empty"
    if not np.isfinite(points).all() or float(np.abs(points).max()) > MOST_SIZE:
        return "it has a point that is nowhere"
    if int(faces.min()) < 0 or int(faces.max()) >= len(points):
        return "it has a face of a point that is not there"
    return "it is not watertight" if len(open_edges(surface)) else ""


def _area(surface: Surface) -> float:
    import numpy as np

    a, b, c = (surface.points[surface.faces[:, corner]] for corner in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _stray(points: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """A point with none of the others nearer than NEAR."""
    import numpy as np

    def cells(of: NDArray[np.float64], shift: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.floor(of / (4 * NEAR) + shift).astype(np.int64)

    # A point and its like share a cell of one grid or of another one shifted by half a cell.
    left = np.unique(points, axis=0)
    for shift in np.ndindex(2, 2, 2):
        if not len(left):
            return None
        by = np.array(shift) / 2
        known = {row.tobytes() for row in cells(others, by)}
        own = cells(left, by)
        left = left[[row.tobytes() not in known for row in own]]
    stray: NDArray[np.float64] | None = left[0] if len(left) else None
    return stray


def _stl(path: Path) -> list[Body]:
    import numpy as np

    data = path.read_bytes()
    (count,) = struct.unpack_from("<I", data, 80)
    if len(data) != 84 + 50 * count or not count:
        raise OutputError("its length is not that of its triangles")
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    rows = np.frombuffer(data, kind, offset=84)
    points, faces = np.unique(rows["corners"].reshape(-1, 3), axis=0, return_inverse=True)
    surface = Surface(points.astype(np.float64), faces.reshape(-1, 3).astype(np.int64))
    edges = surface.points[surface.faces]
    normal = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    against = np.einsum("ij,ij->i", normal, rows["normal"].astype(np.float64))
    if (against < 0).any():
        raise OutputError("a triangle's normal points inward")
    return [Body(surface, "")]


def _3mf(path: Path) -> list[Body]:
    import numpy as np

    with ZipFile(path) as archive:
        if sum(info.file_size for info in archive.infolist()) > MOST_BYTES:
            raise OutputError(f"holds more than {MOST_BYTES:,} bytes")
        parts = {name: archive.read(name).decode() for name in sorted(archive.namelist())}
    model = parts.pop(MODEL)
    points = np.array(VERTEX.findall(model), dtype=np.float64).reshape(-1, 3)
    faces = np.array(TRIANGLE.findall(model), dtype=np.int64).reshape(-1, 3)
    frame = TRIANGLE.sub("", VERTEX.sub("", model)).split()
    return [Body(Surface(points, faces), json.dumps([parts, frame]))]


def _glb(path: Path) -> list[Body]:
    import numpy as np

    data = path.read_bytes()
    magic, _, total, size, kind = struct.unpack_from("<4sII I4s", data)
    if magic != b"glTF" or kind != b"JSON" or total != len(data):
        raise OutputError("no binary glTF")
    document: dict[str, Any] = json.loads(data[20 : 20 + size])
    start = 28 + size
    found = []
    for node in document["nodes"]:
        (primitive,) = document["meshes"][node["mesh"]]["primitives"]
        arrays = []
        for number, kind in (
            (primitive["attributes"]["POSITION"], "<f4"),
            (primitive["indices"], "<u4"),
        ):
            accessor = document["accessors"][number]
            view = document["bufferViews"][accessor["bufferView"]]
            begin = start + view.get("byteOffset", 0)
            arrays.append(
                np.frombuffer(data[begin : begin + view["byteLength"]], kind).reshape(-1, 3)
            )
        material = document["materials"][primitive["material"]]
        surface = Surface(arrays[0].astype(np.float64), arrays[1].astype(np.int64))
        own = {key: value for key, value in node.items() if key != "mesh"}
        found.append(Body(surface, json.dumps([own, material, document["scenes"]])))
    return found
