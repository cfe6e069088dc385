"""The cut files of a laminate: one a layer, each distinct pattern made and verified once."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import compensate
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import CutSettings, file_properties
from sbafab.cutting.verify import verify_file
from sbafab.errors import DesignError, OutputError
from sbafab.laminate.laminate import Laminate, Layer

FOLDER = "layers"
Progress = Callable[[int, int], None]
"""Told how many of how many layers are written."""


@dataclass(frozen=True)
class CutFile:
    """One written cut file: ``path`` relative to the output folder, ``cut_length`` in mm."""

    layer: int
    path: str
    sha256: str
    contours: int
    cut_length: float


def write_layer_files(
    laminate: Laminate, folder: Path, settings: CutSettings, progress: Progress | None = None
) -> list[CutFile]:
    """Writes ``layers/<layer name>.dxf`` under ``folder`` for every layer, bottom to top.

    Raises DesignError where the kerf leaves no path, OutputError where a file does not read back
    as its profile, OSError where it cannot be written.
    """
    written: dict[int, CutFile] = {}
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    for layers in laminate.patterns.values():
        for file in _write_pattern(layers, folder, settings):
            written[file.layer] = file
            if progress is not None:
                progress(len(written), len(laminate.layers))
    return [written[layer.index] for layer in laminate.layers]


def _write_pattern(layers: Sequence[Layer], folder: Path, settings: CutSettings) -> list[CutFile]:
    """The files of the layers that share one pattern: the first made, the others copied."""
    first = layers[0]
    material = first.film.material
    try:
        path = compensate(first.profile, settings.kerf_width(material) or 0.0)
    except DesignError as error:
        raise DesignError(f"layer {first.name}: {error}") from error
    properties = file_properties(settings, material, first.pattern)
    contours = cutting_order(path)
    text = dxf_text(contours, properties, settings.profile, settings.chord_error)
    data = text.encode()
    original = folder / FOLDER / f"{first.name}.dxf"
    original.write_bytes(data)
    chord_error = settings.chord_error if settings.profile == "chords" else 0.0
    verify_file(original, path, properties, chord_error)
    digest = hashlib.sha256(data).hexdigest()
    length = sum(contour.length for contour in contours)
    files = []
    for layer in layers:
        target = folder / FOLDER / f"{layer.name}.dxf"
        if layer is not first:
            shutil.copyfile(original, target)
        if hashlib.sha256(target.read_bytes()).hexdigest() != digest:
            raise OutputError(f"{target.name}: differs from what was written; write it anew.")
        files.append(CutFile(layer.index, f"{FOLDER}/{target.name}", digest, len(contours), length))
    return files
