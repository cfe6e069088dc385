"""The cut files of a laminate: one a layer, each distinct pattern made and verified once."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.properties import FOLDER, CutSettings, file_properties, layer_path
from sbafab.cutting.sequence import cutting_sequence
from sbafab.cutting.verify import verify_file
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from sbafab.process import Counted


def write_layer_files(
    laminate: Laminate,
    paths: Mapping[str, Region],
    folder: Path,
    settings: CutSettings,
    progress: Counted | None = None,
) -> dict[str, str]:
    """Write ``layers/<layer name>.dxf`` under ``folder`` for every layer.

    ``paths`` holds the beam's path for every pattern. The name of a compensated file ends in its
    kerf: ``layers/001_TPE_base_kerf0.12.dxf``. A folded film has one file, its lowest layer's.
    Returns the SHA-256 of each file by its path in ``folder``. Raises OutputError if a file does
    not read back as its path, OSError if it cannot be written.
    """
    written: dict[str, str] = {}
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    for pattern, layers in laminate.patterns.items():
        if laminate.cut_with(layers[0]) != layers[0].index:
            continue
        material, path = layers[0].film.material, paths[pattern]
        properties = file_properties(settings, material, pattern)
        contours = cutting_sequence(path)
        data = dxf_text(contours, properties, settings.curves.profile).encode()
        files = [layer_path(layer.name, settings.kerf_width(material)) for layer in layers]
        for file in files:
            (folder / file).write_bytes(data)
            written[file] = hashlib.sha256(data).hexdigest()
            if progress is not None:
                progress(len(written), len(laminate.layers))
        verify_file(folder / files[0], path, properties)
    return written
