"""Claims of the manifest on files and hashes, order and roles, heights, properties."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath

from sbafab.actuators.stacking import film_of
from sbafab.as_built.cut_files import LayerFile
from sbafab.as_built.records import CLAIMS, Problem
from sbafab.cutting.lightburn import ENDING
from sbafab.cutting.properties import (
    LIMITS,
    curves_property,
    kerf_properties,
    layer_path,
    limit_properties,
    warning_property,
)
from sbafab.design.records import Design
from sbafab.errors import OutputError
from sbafab.laminate.folding import fold_roots
from sbafab.laminate.joints import chamber_gaps
from sbafab.laminate.laminate import Layer
from sbafab.output.checked import warnings
from sbafab.output.manifest import (
    JobManifest,
    KerfClaim,
    LayerClaim,
    Manifest,
    file_hashes,
    kerf_claim,
)
from sbafab.output.swap import (
    is_among_cut_files,
)
from sbafab.rules.finding import Verdict
from sbafab.rules.limits import lowered

CUT_ENDINGS = (
    *(".dxf", ".dwg", ".ai", ".cdr", ".eps", ".lbrn", ENDING),
    *(".rd", ".plt", ".hpgl", ".gcode", ".nc", ".ngc", ".tap"),
)
"""Suffixes of CAD and laser files; pictures and pages are not cut by mistake."""
HEIGHT = 1e-6
"""Tolerance of heights and thicknesses, mm."""


def claim(message: str, *layers: int) -> Problem:
    """Return a problem of a claim of the manifest."""
    return Problem(CLAIMS, message, layers)


def file_problems(folder: Path, claims: Manifest | JobManifest) -> list[Problem]:
    """Return files that are missing, changed or not in the manifest.

    An unlisted file that could be cut by mistake fails; any other is a warning. Raises OutputError
    if the folder cannot be read.
    """
    try:
        hashes = file_hashes(folder)
    except OSError as error:
        raise OutputError(f"{folder} cannot be read: {error.strerror or error}") from None
    hashes.pop("manifest.json", None)
    layers = claims.layers if isinstance(claims, Manifest) else ()
    layer_of = {layer.file: number for number, layer in enumerate(layers, start=1)}
    problems = []
    for path, digest in claims.files.items():
        layer_number = (layer_of[path],) if path in layer_of else ()
        if path not in hashes:
            problems.append(
                claim(f"{path} is in the manifest and not in the folder", *layer_number)
            )
        elif hashes[path] != digest:
            problems.append(
                claim(
                    f"{path} was changed: its sha256 is {hashes[path][:12]}..., the manifest's "
                    f"{digest[:12]}...",
                    *layer_number,
                )
            )
    for path in (*hashes, *_links(folder)):
        if path not in claims.files:
            message = f"{path} lies in the folder and is not in the manifest; remove it"
            verdict: Verdict = "fail" if could_be_cut(path) else "warn"
            problems.append(Problem(CLAIMS, message, verdict=verdict))
    return problems


def could_be_cut(path: str) -> bool:
    """Return True if a file, by its folder or suffix, may be taken for a cut file.

    Any file among the cut files may: laser programs also open pictures, pages and files without a
    suffix.
    """
    return is_among_cut_files(PurePosixPath(path)) or path.lower().endswith(CUT_ENDINGS)


def _links(folder: Path) -> list[str]:
    """Return links to folders, and everything else without a hash of its contents."""
    return [
        path.relative_to(folder).as_posix()
        for path in sorted(folder.rglob("*"))
        if not path.is_file() and (path.is_symlink() or not path.is_dir())
    ]


def order_problems(claims: Manifest, design: Design) -> list[Problem]:
    """Return indices, names, roles and films that do not fit their place in the stack."""
    problems = []
    roots = fold_roots(design.stated_folds)
    expected = [*design.layer_roles] or _roles([layer.role for layer in claims.layers])
    expected += ["none"] * (len(claims.layers) - len(expected))
    for position, (layer, role) in enumerate(zip(claims.layers, expected, strict=False), start=1):
        if layer.index != position:
            problems.append(
                claim(f"layer {position} of the manifest has index {layer.index}", position)
            )
        name = f"{layer.index:03d}_{layer.material}_{layer.role}"
        if layer.name != name:
            problems.append(
                claim(f"layer {position} is named {layer.name!r}, not {name}", position)
            )
        kerf = claims.kerf.get(layer.material)
        cut = roots.get(position, position)
        of = claims.layers[cut - 1].name if cut <= len(claims.layers) else name
        file = layer_path(name if cut == position else of, kerf.width if kerf is not None else None)
        if layer.file not in (None, file):
            message = f"layer {position} ({name}) is cut from {layer.file!r}, not {file}"
            problems.append(claim(message, position))
        if layer.role != role:
            message = f"layer {position} has the role {layer.role}, where the order asks for {role}"
            problems.append(claim(message, position))
        if layer.material != film_of(design, layer.role, position).material:
            message = f"layer {position} is {layer.material}, which no {layer.role} is made of"
            problems.append(claim(message, position))
    return problems


def _roles(roles: Sequence[str]) -> list[str]:
    """Return the roles of a stack of as many layers, with a sheet below if there is one."""
    carrier = ["sheet", "separator-mask"] if "sheet" in roles[:2] else []
    count = len(roles) - len(carrier)
    turn = ("separator-mask", "wall", "chamber-mask", "wall")
    stack = ["base" if n == 0 else turn[(n + 1) % 4] for n in range(count)]
    if stack:
        stack[-1] = "cap"
    return [*carrier, *stack][: len(roles)]


def height_problems(claims: Manifest, layers: Sequence[Layer], design: Design) -> list[Problem]:
    """Return differences of thicknesses, heights and balloon numbers from the design."""
    problems = []
    stock = {film.material: film.thickness for film in design.films.stock.values()}
    placed = {layer.index: layer for layer in layers}
    z = 0.0
    for position, layer in enumerate(claims.layers, start=1):
        nominal = film_of(design, layer.role, position).thickness
        if abs(layer.thickness - nominal) > HEIGHT:
            problems.append(
                claim(
                    f"layer {position} is {layer.thickness:g} mm thick in the manifest and "
                    f"{nominal:g} in the design",
                    position,
                )
            )
        if abs(layer.z - z) > HEIGHT:
            message = f"layer {position} lies at z {layer.z:g}, and the films below it sum to {z:g}"
            problems.append(claim(message, position))
        layer_cut = placed.get(position)
        if layer_cut is not None and layer_cut.balloon != layer.balloon:
            message = (
                f"layer {position} is of balloon {layer.balloon} in the manifest and lies in "
                f"balloon {layer_cut.balloon}"
            )
            problems.append(claim(message, position))
        z += layer.thickness
    return problems + _film_problems(claims, stock)


def _film_problems(claims: Manifest, stock: Mapping[str, float]) -> list[Problem]:
    problems = []
    for material in dict.fromkeys(layer.material for layer in claims.layers):
        film_layers = [layer for layer in claims.layers if layer.material == material]
        area = sum(layer.area for layer in film_layers)
        film = next((film for film in claims.films if film.material == material), None)
        if film is None:
            problems.append(claim(f"the manifest's films have no {material}"))
            continue
        if film.layers != len(film_layers):
            message = (
                f"films: {film.layers} layers of {material}, and {len(film_layers)} are listed"
            )
            problems.append(claim(message))
        if abs(film.area - area) > 1e-4 * area:
            message = f"films: {film.area:g} mm2 of {material}, and its layers sum to {area:g}"
            problems.append(claim(message))
        nominal = stock.get(material, math.nan)
        if not abs(film.thickness - nominal) <= HEIGHT:
            message = f"films: {material} of {film.thickness:g} mm, and {nominal:g} in the design"
            problems.append(claim(message))
    return problems


def design_problems(claims: Manifest, design: Design, digest: str) -> list[Problem]:
    """Return differences of the manifest from the design beside it."""
    gaps = chamber_gaps([layer.role for layer in claims.layers], design.seamed_layers)
    balloons = sum(gaps.values())
    agree = (
        ("design_sha256", claims.design_sha256[:12], digest[:12]),
        ("name", claims.name, design.name),
        ("family", claims.family, design.family),
        ("registration.method", claims.registration.method, design.registration.method),
        ("balloons", balloons, design.stack.balloons),
        ("copies", claims.copies, design.order.quantity),
    )
    problems = [
        claim(f"{key} is {claimed} in the manifest and {stated} by design.toml")
        for key, claimed, stated in agree
        if claimed != stated
    ]
    for material, width in design.kerf_widths.items():
        claimed = claims.kerf.get(material)
        expected = kerf_claim(width)
        if claimed != expected:
            problems.append(
                claim(
                    f"the kerf of {material} is {_kerf(claimed)} in the manifest and "
                    f"{_kerf(expected)} by design.toml"
                )
            )
    problems += lowered_problems(claims.lowered_limits, lowered(design))
    for rule in claims.waived:
        if rule not in design.rules.waive:
            problems.append(claim(f"{rule} is waived in the manifest and not in design.toml"))
    return problems


def lowered_problems(claimed: Sequence[str], designed: Sequence[str]) -> list[Problem]:
    """Return lowered limits that only one of manifest and design.toml names."""
    missing = [limit for limit in designed if limit not in claimed]
    added = [limit for limit in claimed if limit not in designed]
    return [
        *(
            claim(f"design.toml lowers {limit}, which the manifest does not say")
            for limit in missing
        ),
        *(claim(f"{limit} is lowered in the manifest and not in design.toml") for limit in added),
    ]


def _kerf(kerf: KerfClaim | None) -> str:
    return "missing" if kerf is None else f"{kerf.state} ({kerf.width})"


def property_problems(
    files: Iterable[LayerFile], claims: Manifest, design: Design
) -> list[Problem]:
    """Return custom properties of the cut files that differ from the manifest, joined by value."""
    layers_of: dict[str, list[int]] = {}
    bare = [file for file in files if file.part is not None and not file.part.properties]
    dangers = warnings(design)
    for file in files:
        if file.part is None or file in bare:
            continue
        properties = file.part.properties
        for name, expected in _expected_properties(file.claim, claims, dangers).items():
            if properties.get(name) != expected:
                message = f"custom property {name} is {properties.get(name)!r}, not {expected!r}"
                layers_of.setdefault(message, []).append(file.position)
    problems = []
    if bare:
        parts = [file.part for file in bare if file.part is not None]
        of = f"the files of {len(bare)} layers" if len(bare) > 1 else f"the file of {bare[0].label}"
        has_units = all(part.units for part in parts)
        problems.append(bare_problem(of, has_units, *(file.position for file in bare)))
    for message, layers in layers_of.items():
        shown = ", ".join(map(str, layers[:5])) + (" ..." if len(layers) > 5 else "")
        plural = "layers" if len(layers) > 1 else "layer"
        problems.append(claim(f"{plural} {shown}: {message}", *layers))
    return problems


def bare_problem(files: str, has_units: bool, *layers: int) -> Problem:
    """Return a warning on files without custom properties: formats before R2004 cannot hold any."""
    lost = "custom properties" if has_units else "custom properties and no units"
    message = (
        f"{files} carry no {lost}: save as DXF R2004 or later to keep them; kerf, waivers and "
        "curves are taken to be as the manifest tells"
    )
    return Problem(CLAIMS, message, layers, verdict="warn")


def _expected_properties(
    layer: LayerClaim, claims: Manifest, dangers: Mapping[str, str]
) -> dict[str, str | None]:
    kerf = claims.kerf.get(layer.material)
    width = kerf.width if kerf is not None else None
    return {
        "DESIGN": claims.name,
        "DESIGN_SHA256": claims.design_sha256,
        # Layers of a folded film are cut from the file of the lowest.
        "PATTERN": next(other.pattern for other in claims.layers if other.file == layer.file),
        "MATERIAL": layer.material,
        "UNITS": "mm",
        **kerf_properties(width),
        **curves_property(claims.curves),
        **waiver_properties(claims),
        "GENERATOR": claims.generator,
        **warning_property(dangers.get(layer.material)),
    }


def waiver_properties(claims: Manifest) -> dict[str, str | None]:
    """Return the properties of every cut file on waived rules and lowered limits."""
    return {
        "WAIVED": ", ".join(claims.waived) or "none",
        LIMITS: limit_properties(claims.lowered_limits).get(LIMITS),
    }
