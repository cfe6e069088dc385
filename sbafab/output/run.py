"""One run: a design becomes a folder with all that was asked for, written whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from sbafab.actuators import build
from sbafab.cutting.dxf_write import DxfProfile
from sbafab.cutting.files import CutFile, write_layer_files
from sbafab.cutting.fixture import write_fixture
from sbafab.design.records import Design
from sbafab.design.writing import design_toml, outline_file
from sbafab.errors import DesignError
from sbafab.geometry.boolean import GeometryError
from sbafab.laminate.laminate import Laminate
from sbafab.meshing.files import MeshFile, write_meshes
from sbafab.output.manifest import as_json, carried_over, checks, file_hashes, manifest
from sbafab.output.settings import cut_settings, limits, press_settings
from sbafab.output.swap import read_manifest, replaced_folder
from sbafab.pressing.schedule import Schedule, press_csv, press_json, schedule
from sbafab.rules.deck import has_failed, run_deck
from sbafab.rules.finding import Finding

Part = Literal["cut", "press", "mesh", "preview"]
EVERYTHING: tuple[Part, ...] = ("cut", "press", "mesh", "preview")
Progress = Callable[[str, int, int], None]
"""Told what is being done, and how much of how much is done."""


@dataclass(frozen=True)
class Run:
    """What a run made. ``findings`` tell whether the design holds; without cut files if not."""

    design: Design
    laminate: Laminate
    findings: tuple[Finding, ...]
    folder: Path
    manifest: dict[str, Any]
    schedule: Schedule | None

    @property
    def failed(self) -> bool:
        """Whether a rule failed that the design does not waive; no cut file was written then."""
        return has_failed(self.findings)


def check(design: Design, progress: Progress | None = None) -> tuple[Laminate, tuple[Finding, ...]]:
    """The laminate of a design and what the rule deck finds in it."""
    try:
        laminate = build(design)
        return laminate, run_deck(laminate, limits(design), progress)
    except GeometryError as error:
        raise DesignError(f"design {design.name} cannot be resolved: {error}") from None


def waived_rules(findings: Collection[Finding]) -> tuple[str, ...]:
    """The rules that fail and that the design waives by name."""
    return tuple(dict.fromkeys(finding.rule for finding in findings if finding.by_user))


def generate(
    design: Design,
    out: Path = Path("out"),
    parts: Sequence[Part] = EVERYTHING,
    progress: Progress | None = None,
    dxf_profile: DxfProfile = "bulges",
    chord_error: float = 0.005,
) -> Run:
    """Writes ``out/<design name>/`` and returns what was made.

    A design that breaks a rule gets its findings and pictures, but no cut files, schedule or
    meshes. With some of the ``parts`` only, the others stay if they are of the same design.
    Raises DesignError or OutputError; the old folder is then whole.
    """
    tell = progress or (lambda what, done, total: None)
    laminate, findings = check(design, tell)
    waived = waived_rules(findings)
    wanted = set(parts)
    if has_failed(findings):
        wanted &= {"preview"}
    # The schedule is made before anything is written: it may refuse the design.
    pressing = _schedule(design, laminate, waived) if "press" in wanted else None
    target = out / design.name
    with replaced_folder(target) as folder:
        cut_files: list[CutFile] = []
        meshes: list[MeshFile] = []
        plate: str | None = None
        if "cut" in wanted:
            settings = cut_settings(design, waived, dxf_profile, chord_error)
            cut_files = write_layer_files(
                laminate,
                folder,
                settings,
                lambda done, total: tell("cut files", done, total),
            )
            plate = write_fixture(laminate, folder, settings)
        if pressing is not None:
            _write(folder / "press.json", as_json(press_json(pressing)))
            _write(folder / "press.csv", press_csv(pressing))
        if "mesh" in wanted:
            meshes = write_meshes(
                laminate, folder, progress=lambda done, total: tell("meshes", done, total)
            )
        if "preview" in wanted:
            _write_pictures(_marked(laminate, findings, waived), folder, tell)
        _write(folder / "checks.json", as_json(checks(findings, "design")))
        _write_design(design, folder)
        index = manifest(design, laminate, waived, cut_files, plate, meshes)
        if not has_failed(findings):
            _carry_over(target, folder, index)
        index["files"] = file_hashes(folder)
        _write(folder / "manifest.json", as_json(index))
    return Run(design, laminate, findings, target, index, pressing)


def _schedule(design: Design, laminate: Laminate, waived: tuple[str, ...]) -> Schedule:
    made = schedule(laminate, press_settings(design))
    if not waived:
        return made
    said = f"made although it breaks rules that the design waives: {', '.join(waived)}"
    first, *others = made.steps
    marked = replace(first, instructions=f"{said[:1].upper()}{said[1:]}. {first.instructions}")
    return replace(made, steps=(marked, *others), warnings=(said, *made.warnings))


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def _marked(laminate: Laminate, findings: Sequence[Finding], waived: Sequence[str]) -> Laminate:
    """The laminate with a note for its pictures where a rule failed or is waived."""
    failed = dict.fromkeys(finding.rule for finding in findings if finding.verdict == "fail")
    notes = [f"not to be built, failed: {', '.join(failed)}"] if failed else []
    notes += [f"waived: {', '.join(waived)}"] if waived else []
    return replace(laminate, notes=(*laminate.notes, *notes)) if notes else laminate


def _write_pictures(laminate: Laminate, folder: Path, tell: Progress) -> None:
    from sbafab.reports.layers_svg import layers_svg
    from sbafab.reports.solid_png import solid_png
    from sbafab.reports.stack_svg import stack_svg

    preview = folder / "preview"
    preview.mkdir()
    _write(preview / "layers.svg", layers_svg(laminate))
    tell("pictures", 1, 3)
    _write(preview / "stack.svg", stack_svg(laminate))
    tell("pictures", 2, 3)
    (preview / "solid.png").write_bytes(solid_png(laminate))
    tell("pictures", 3, 3)


def _write_design(design: Design, folder: Path) -> None:
    drawn = outline_file(design)
    if drawn is not None:
        name = f"outline{drawn.suffix.lower()}"
        shutil.copyfile(drawn, folder / name)
        chamber = design.chamber.model_copy(update={"outline": name})  # type: ignore[attr-defined]
        design = design.model_copy(update={"chamber": chamber})
    _write(folder / "design.toml", design_toml(design))


def _carry_over(old_folder: Path, folder: Path, index: dict[str, Any]) -> None:
    """Keeps files of the old run that this one did not make, if they are of the same design."""
    old = read_manifest(old_folder)
    if old is None or not carried_over(old, index):
        return
    made = file_hashes(folder)
    files = old.get("files")
    kept = file_hashes(old_folder)
    carried: set[str] = set()
    for path, digest in (files if isinstance(files, dict) else {}).items():
        if path not in made and kept.get(path) == digest:
            target = folder / path
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(old_folder / path, target)
            carried.add(path)
    layers, meshes, plate = old.get("layers"), old.get("meshes"), old.get("fixture")
    if _are_files(layers, carried):
        index["layers"] = layers
        index["fixture"] = plate if plate in carried else None
    if _are_files(meshes, carried):
        index["meshes"] = meshes


def _are_files(entries: object, carried: set[str]) -> bool:
    """Whether manifest entries name files that were all carried over."""
    return (
        isinstance(entries, list)
        and bool(entries)
        and all(isinstance(entry, dict) and entry.get("file") in carried for entry in entries)
    )
