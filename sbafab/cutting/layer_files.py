"""The cut files of a laminate: one a layer, each distinct pattern made and verified once."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.properties import FOLDER, CutSettings, file_properties, layer_path
from sbafab.cutting.sequence import cutting_sequence
from sbafab.cutting.verify import verify_file
from sbafab.errors import OutputError
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.process import Counted


@dataclass(frozen=True)
class CutFile:
    """One written cut file: ``path`` relative to the output folder, ``cut_length`` in mm."""

    layer: int
    path: str
    sha256: str
    contours: int
    cut_length: float


def write_layer_files(
    laminate: Laminate,
    paths: Mapping[str, Region],
    folder: Path,
    settings: CutSettings,
    progress: Counted | None = None,
) -> list[CutFile]:
    """Writes ``layers/<layer name>.dxf`` under ``folder`` for every layer, bottom to top.

    ``paths`` holds the beam's path for every pattern. The name of a compensated file ends in its
    kerf: ``layers/001_TPE_base_kerf0.12.dxf``. A folded film has one file, its lowest
    layer's. Raises OutputError if a file does not read
    back as its path, OSError if it cannot be written.
    """
    written: dict[int, CutFile] = {}
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    for pattern, layers in laminate.patterns.items():
        if laminate.cut_with(layers[0]) != layers[0].index:
            continue
        for file in _write_pattern(layers, paths[pattern], folder, settings):
            written[file.layer] = file
            if progress is not None:
                progress(len(written), len(laminate.layers))
    return [written[layer.index] for layer in laminate.layers if layer.index in written]


def _write_pattern(
    layers: Sequence[Layer], path: Region, folder: Path, settings: CutSettings
) -> list[CutFile]:
    """The files of the layers that share one pattern: the first made, the others copied."""
    first = layers[0]
    material = first.film.material
    kerf = settings.kerf_width(material)
    properties = file_properties(settings, material, first.pattern)
    contours = cutting_sequence(path)
    text = dxf_text(contours, properties, settings.curves.profile)
    data = text.encode()
    original = folder / layer_path(first.name, kerf)
    original.write_bytes(data)
    verify_file(original, path, properties)
    digest = hashlib.sha256(data).hexdigest()
    length = sum(contour.length for contour in contours)
    files = []
    for layer in layers:
        path_of_layer = layer_path(layer.name, kerf)
        target = folder / path_of_layer
        if layer is not first:
            shutil.copyfile(original, target)
        if hashlib.sha256(target.read_bytes()).hexdigest() != digest:
            raise OutputError(f"{target.name}: differs from what was written; regenerate it.")
        files.append(CutFile(layer.index, path_of_layer, digest, len(contours), length))
    return files
