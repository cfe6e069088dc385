"""3MF, which states its unit: millimetres."""

from __future__ import annotations

from pathlib import Path

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
{vertices}</vertices>
<triangles>
{triangles}</triangles>
</mesh></object>
</resources>
<build><item objectid="2"/></build>
</model>
"""


def write_3mf(surface: Surface, path: Path, material: str = "TPE") -> None:
    """Write the surface in mm, as one object of one material."""
    # One format for the whole table is several times faster than one a row.
    vertex = '<vertex x="%.6f" y="%.6f" z="%.6f"/>\n'
    triangle = '<triangle v1="%d" v2="%d" v3="%d"/>\n'
    vertices = vertex * len(surface.points) % tuple(surface.points.ravel().tolist())
    triangles = triangle * len(surface.faces) % tuple(surface.faces.ravel().tolist())
    model = MODEL.format(material=material, vertices=vertices, triangles=triangles)
    _write_zip(
        path,
        {
            "[Content_Types].xml": CONTENT_TYPES,
            "_rels/.rels": RELATIONSHIPS,
            "3D/3dmodel.model": model,
        },
    )


def _write_zip(path: Path, parts: dict[str, str]) -> None:
    from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

    with ZipFile(path, "w") as archive:
        for name, text in parts.items():
            # ZipInfo's date is fixed where a bare name would take the clock's; the maker must
            # not depend on the system either.
            entry = ZipInfo(name)
            entry.compress_type = ZIP_DEFLATED
            entry.create_system = 3
            archive.writestr(entry, text, compresslevel=1)
