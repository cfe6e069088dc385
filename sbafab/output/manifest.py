"""What ``manifest.json`` holds: the records that a run writes it from, and that it is read with.

A key with a default may be missing in a folder that is read. What the manifest claims is held
against the files by ``as_built``, which measures it there and asks nothing that wrote it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from sbafab.cutting.fixture import PATH as FIXTURE
from sbafab.cutting.lightburn import projects
from sbafab.cutting.properties import CutSettings, layer_path, said_of
from sbafab.cutting.second_cut import PATH as SECOND_CUT
from sbafab.cutting.sheets import SheetFile
from sbafab.design.files import design_sha256
from sbafab.design.kits import citation
from sbafab.design.records import Design
from sbafab.geometry.offset import Kerf
from sbafab.laminate.films import Film
from sbafab.laminate.laminate import Interface, Laminate, Layer, SheetPanel
from sbafab.meshing.files import MeshFile
from sbafab.models.formulas import sizes
from sbafab.output.checked import GENERATOR, Planned, kerf_widths, warnings
from sbafab.output.manifest_records import (
    BatchClaim,
    BatchSchema,
    BoreClaim,
    DesignClaim,
    FiducialClaim,
    FilmClaim,
    FilmUseClaim,
    InletClaim,
    InterfaceClaim,
    JobManifest,
    KerfClaim,
    KitClaim,
    LayerClaim,
    Manifest,
    MeshClaim,
    PanelClaim,
    PinClaim,
    PlaceClaim,
    RegistrationClaim,
    SheetClaim,
    SheetPartClaim,
    SheetPinClaim,
)
from sbafab.output.shop import film_use
from sbafab.output.swap import SCHEMA
from sbafab.pressing.cycles import Runs, design_runs

# ``manifest.json`` and ``checks.json``: what a program reads of an output folder.


def as_json(value: object) -> str:
    """Text of a JSON file: readable, and the same for the same value."""
    return json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def manifest(
    planned: Planned, sheets: Sequence[SheetFile], meshes: Sequence[MeshFile]
) -> dict[str, Any]:
    """The index of an output folder, but for the hashes of its files."""
    checked, is_cut = planned.checked, "cut" in planned.wanted
    design, laminate = checked.design, checked.laminate
    curves = said_of(planned.settings.curves) if is_cut else None
    optional: dict[str, Any] = {}
    if curves is not None:
        optional["curves"] = curves
    runs = design_runs(design, laminate)
    if runs.copies > 1:
        optional["batch"] = _batch(runs)
    if is_cut and laminate.panel is not None:
        optional["panel"] = _panel(laminate, laminate.panel, planned.settings)
    if planned.conforming is not None:
        optional["mesh_statistics"] = planned.conforming.statistics
    return Manifest(
        schema=SCHEMA,
        name=laminate.name,
        family=laminate.family,
        units="mm",
        design_sha256=design_sha256(design),
        generator=GENERATOR,
        kit=KitClaim.model_validate_json(as_json(citation(design))),
        registration=RegistrationClaim(
            method=laminate.registration,
            pins=tuple(
                PinClaim(name=pin.name, **_place(pin.centre), diameter=pin.diameter)
                for pin in laminate.pins
            ),
        ),
        kerf={name: kerf_claim(width) for name, width in kerf_widths(design).items()},
        waived=checked.waived,
        lowered_limits=checked.lowered,
        sizes={name: round(value, 6) for name, value in sizes(design, laminate).items()},
        notes=laminate.notes,
        copies=design.order.quantity,
        films=_films(laminate, sheets),
        warnings=tuple(dict.fromkeys(warnings(design).values())),
        layers=tuple(_layer(planned, layer) for layer in laminate.layers),
        interfaces=tuple(_interface(interface) for interface in laminate.interfaces),
        bores=tuple(
            BoreClaim(chamber=bore.chamber, **_place(bore.centre), diameter=bore.diameter)
            for bore in laminate.bores
        ),
        inlets=tuple(
            InletClaim(
                chamber=inlet.chamber,
                **_place(inlet.mouth),
                width=inlet.width,
                tube_outer_diameter=inlet.tube_diameter,
            )
            for inlet in laminate.inlets
        ),
        lumen=laminate.lumen,
        fixture=FIXTURE if is_cut and laminate.pins else None,
        sheets=tuple(_sheet(sheet) for sheet in sheets),
        meshes=tuple(
            MeshClaim(**{**asdict(mesh), "volume_mm3": round(mesh.volume_mm3, 6)})
            for mesh in meshes
        ),
        **optional,
        files={},
    ).as_dict()


def job_manifest(
    schema: BatchSchema,
    name: str,
    settings: CutSettings,
    designs: Sequence[Design],
    sheets: Sequence[SheetFile],
) -> dict[str, Any]:
    """The index of the folder of several designs, but for the hashes of its files.

    ``settings`` are those of the shared ``sheets``.
    """
    return JobManifest(
        schema=schema,
        name=name,
        units="mm",
        designs_sha256=settings.design_sha256,
        generator=GENERATOR,
        waived=settings.waived,
        lowered_limits=settings.lowered,
        designs=tuple(
            DesignClaim(
                name=design.name,
                folder=design.name,
                copies=design.order.quantity,
                design_sha256=design_sha256(design),
                kit=KitClaim.model_validate_json(as_json(citation(design))),
            )
            for design in designs
        ),
        films=tuple(
            FilmUseClaim(material=material, **use) for material, use in film_use(sheets).items()
        ),
        sheets=tuple(_sheet(sheet) for sheet in sheets),
        files={},
    ).as_dict()


def kerf_claim(width: Kerf | None) -> KerfClaim:
    return KerfClaim(state="uncalibrated" if width is None else "compensated", width=width)


def _batch(runs: Runs) -> BatchClaim:
    """How several copies are pressed, and where each lies on the base plate."""
    places = tuple(PlaceClaim(**_place(place)) for place in runs.places)
    return BatchClaim(at_once=runs.together, cycles=runs.cycles, places=places)


def _panel(laminate: Laminate, panel: SheetPanel, settings: CutSettings) -> PanelClaim:
    masks = dict.fromkeys(layer.film.material for layer in laminate.layers if layer.is_mask)
    width, length = (round(side, 6) for side in panel.size)
    return PanelClaim(
        size=(width, length),
        places=tuple(PlaceClaim(**_place(place)) for place in panel.places),
        batches=panel.batches,
        second_cut=SECOND_CUT,
        fiducials=tuple(
            FiducialClaim(**_place(place), diameter=panel.fiducial_diameter)
            for place in panel.fiducials
        ),
        turned_over=", ".join(masks),
        projects=tuple(projects(laminate, settings)),
    )


def _place(point: tuple[float, float]) -> dict[str, float]:
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    return {"x": round(point[0], 6) + 0.0, "y": round(point[1], 6) + 0.0}


def _sheet(sheet: SheetFile) -> SheetClaim:
    """A film sheet as the manifest lists it; lengths mm, areas mm2."""
    stock = sheet.nest.stock
    return SheetClaim(
        file=sheet.path,
        picture=sheet.picture,
        project=sheet.project,
        material=sheet.material,
        number=sheet.number,
        width=sheet.width,
        length=round(sheet.length, 6),
        border=stock.border,
        spacing=stock.spacing,
        pins=tuple(SheetPinClaim(x=x, y=y, diameter=d) for x, y, d in stock.pins),
        engine=sheet.nest.engine,
        parts=tuple(
            SheetPartClaim(design=design, pattern=pattern, count=count)
            for design, pattern, count in sheet.counts
        ),
        parts_area=round(sheet.parts_area, 6),
        density=round(sheet.density, 4),
        label=sheet.label,
        contours=sheet.contours,
        cut_length=round(sheet.cut_length, 3),
        travel=round(sheet.travel, 3),
        unsorted_travel=round(sheet.unsorted_travel, 3),
        estimated_minutes=round(sheet.minutes, 2),
    )


def _films(laminate: Laminate, sheets: Sequence[SheetFile]) -> tuple[FilmClaim, ...]:
    use = film_use(sheets)
    layers: dict[Film, list[Layer]] = {}
    for layer in laminate.layers:
        layers.setdefault(layer.film, []).append(layer)
    return tuple(
        FilmClaim(
            material=film.material,
            product=film.product,
            thickness=film.thickness,
            layers=len(own),
            area=round(sum(layer.profile.area for layer in own), 6),
            **use.get(film.material, {}),
        )
        for film, own in layers.items()
    )


def _layer(planned: Planned, layer: Layer) -> LayerClaim:
    kerf = planned.settings.kerf_width(layer.film.material)
    bores = planned.checked.laminate.bores
    return LayerClaim(
        index=layer.index,
        name=layer.name,
        material=layer.film.material,
        role=layer.role,
        balloon=layer.balloon,
        thickness=layer.film.thickness,
        z=layer.z,
        file=layer_path(layer.name, kerf) if "cut" in planned.wanted else None,
        pattern=layer.pattern,
        area=round(layer.profile.area, 6),
        pieces=len(layer.profile.pieces),
        bores=tuple(bore.chamber for bore in bores if _is_open(layer, bore.centre)),
    )


def _is_open(layer: Layer, place: tuple[float, float]) -> bool:
    return any(hole.winding(place) != 0 for hole in layer.profile.holes)


def _interface(interface: Interface) -> InterfaceClaim:
    return InterfaceClaim(
        below=interface.below.index,
        above=interface.above.index,
        masks=tuple(mask.index for mask in interface.masks),
        kind=interface.kind,
        contact_area=round(interface.contact.area, 6),
        bond_area=round(interface.bond.area, 6),
    )


def file_hashes(folder: Path) -> dict[str, str]:
    """sha256 of every file of a folder, by relative path."""
    return {name: file_hash(folder / name) for name in file_names(folder)}


def file_names(folder: Path) -> list[str]:
    """The relative paths of all files of a folder."""
    paths = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return [path.relative_to(folder).as_posix() for path in paths]


def file_hash(path: Path) -> str:
    """sha256 of what a file holds."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def identity(design: Design, waived: Sequence[str]) -> dict[str, Any]:
    """What a manifest says of the design and version that its files are of."""
    sha256 = design_sha256(design)
    return {"design_sha256": sha256, "generator": GENERATOR, "waived": list(waived)}


def carried_over(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """Whether files of the old run still belong to the new one's design and version."""
    return all(old.get(key) == new.get(key) for key in ("design_sha256", "generator", "waived"))
