"""3MF, which states its unit: millimetres."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sbafab.meshing.surface import Surface

CONTENT_TYPES = """<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
"""

RELATIONSHIPS = """<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Target="/3D/3dmodel.model" Id="rel0" \
Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
"""

MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xml:lang="en-US" \
xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources>
<basematerials id="1"><base name="{material}" displaycolor="#E4DFD2"/></basematerials>
<object id="2" type="model" pid="1" pindex="0"><mesh>
<vertices>
|</vertices>
<triangles>
|</triangles>
</mesh></object>
</resources>
<build><item objectid="2"/></build>
</model>
"""
AT_ONCE = 8192
"""Rows written together: few enough to stay in the processor's cache."""
VERTEX = b'<vertex x="%s" y="%s" z="%s"/>\n'
TRIANGLE = b'<triangle v1="%s" v2="%s" v3="%s"/>\n'


def write_3mf(surface: Surface, path: Path, material: str = "TPE") -> None:
    """Write the surface in mm, as one object of one material."""
    # Most points share their x, y or z with others, so format each number once.
    corners = _counted(len(surface.points))
    vertices = _rows(VERTEX, [_worded(along) for along in surface.points.T])
    triangles = _rows(TRIANGLE, [corners[along] for along in surface.faces.T])
    head, middle, end = MODEL.format(material=material).encode().rsplit(b"|", 2)
    model = b"".join([head, vertices, middle, triangles, end])
    _write_zip(
        path,
        {
            "[Content_Types].xml": CONTENT_TYPES.encode(),
            "_rels/.rels": RELATIONSHIPS.encode(),
            "3D/3dmodel.model": model,
        },
    )


def _worded(numbers: NDArray[np.float64]) -> NDArray[np.bytes_]:
    """Format each number with six decimals."""
    # Compare bits, which distinguish -0 from 0 as the formatted numbers do.
    bits, place = np.unique(np.ascontiguousarray(numbers).view(np.int64), return_inverse=True)
    words: NDArray[np.bytes_] = np.array([b"%.6f" % n for n in bits.view(np.float64).tolist()])
    return words[place]


def _counted(count: int) -> NDArray[np.bytes_]:
    """The first ``count`` whole numbers from 0, padded with leading NUL."""
    width = len(str(count))
    digits = np.arange(count)[:, None] // 10 ** np.arange(width - 1, -1, -1)
    signs = (digits % 10 + ord("0")).astype(np.uint8)
    signs[:, :-1][digits[:, :-1] == 0] = 0
    words: NDArray[np.bytes_] = signs.view(f"S{width}").ravel()
    return words


def _rows(form: bytes, columns: Sequence[NDArray[np.bytes_]]) -> bytes:
    """The form once per row, its placeholders filled from the columns."""
    first, *rest = (np.asarray(part) for part in form.split(b"%s"))
    fields = [first, *chain.from_iterable(zip(columns, rest, strict=True))]
    kinds = [(str(number), field.dtype) for number, field in enumerate(fields)]
    parts = []
    for start in range(0, len(columns[0]), AT_ONCE):
        rows = np.empty(min(AT_ONCE, len(columns[0]) - start), dtype=kinds)
        for (name, _), field in zip(kinds, fields, strict=True):
            rows[name] = field[start : start + AT_ONCE] if field.shape else field
        # Entries shorter than their column are padded with NUL.
        parts.append(rows.tobytes().translate(None, b"\0"))
    return b"".join(parts)


def _write_zip(path: Path, parts: dict[str, bytes]) -> None:
    from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

    with ZipFile(path, "w") as archive:
        for name, data in parts.items():
            # ZipInfo has a fixed date, whereas a bare name would take the clock's; the creating
            # system must not vary either.
            entry = ZipInfo(name)
            entry.compress_type = ZIP_DEFLATED
            entry.create_system = 3
            archive.writestr(entry, data, compresslevel=1)
