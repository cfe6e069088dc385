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
<basematerials id="1"><base name="TPE" displaycolor="{colour}"/></basematerials>
<object id="2" type="model" pid="1" pindex="0"><mesh>
<vertices>
{vertices}
</vertices>
<triangles>
{triangles}
</triangles>
</mesh></object>
</resources>
<build><item objectid="2"/></build>
</model>
"""


def write_3mf(surface: Surface, path: Path, colour: str = "#E4DFD2") -> None:
    """Write the surface in mm, one object of one material, with an sRGB colour."""
    points = surface.points.round(6).tolist()
    vertices = [f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in points]
    triangles = [f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in surface.faces.tolist()]
    model = MODEL.format(
        colour=colour, vertices="\n".join(vertices), triangles="\n".join(triangles)
    )
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
            # ZipInfo's own date is fixed, the clock's would change the bytes; so would the
            # system's default for the maker.
            entry = ZipInfo(name)
            entry.compress_type = ZIP_DEFLATED
            entry.create_system = 3
            archive.writestr(entry, text, compresslevel=1)
