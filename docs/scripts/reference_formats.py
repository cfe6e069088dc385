"""The page of file formats, with a JSON schema and a stable id each."""

from __future__ import annotations

import json
from pathlib import Path

from sbafab.cli.formats import FORMATS, schema_of
from sbafab.folders.artefacts import artefacts

HEAD = """# File formats

Each format but a design file and the list of templates carries its id as `schema`; additions keep the id, an
incompatible change gets a new number. `sbafab schema NAME` prints these schemas (JSON Schema 2020-12), and tests
validate what is written and printed.

| name | id | what it describes | schema |
|---|---|---|---|
"""

CUT = """
## Cut files

ASCII DXF R2010 in millimetres (`$INSUNITS` 4), model space only, everything at z = 0.

| DXF layer | colour | what it holds |
|---|---|---|
| `ENGRAVE` | 7 | labels, in waste only |
| `CUT_INNER` | 5 | holes, cut first |
| `CUT_OUTER` | 1 | outlines |
| `CUT_SHEET` | 6 | the parting cut, last |
| `REFERENCE` | | not cut: datum cross, sheet frame |
| `SEAM` | 3 | in files of its own: the path that the middle of a tool follows |

One closed `LWPOLYLINE` with bulges a contour, `CIRCLE` for a full circle. Layer files have the actuator's axis at
(0, 0); sheets have their lower left corner there. Custom properties hold the design's hash, the state of the kerf and
what was waived. See [cutting](../cutting.md) for kerf, order and readers that take no bulges.

## Laminates

`laminate.json` holds all that cut files, meshes and rules are made from. Lengths are mm, layers go bottom to top, z is a
layer's lower face. Films and shapes stand once each; `film`, `shape` and `outline` are places in these lists, from 0.

| part | what stands there |
|---|---|
| shape | contours, each a list of edges; holes run clockwise |
| line | `[x0, y0, x1, y1]`, from start to end |
| arc | `[x0, y0, x1, y1, xc, yc, r, ccw]`: start, end, centre, radius, and `true` if counter-clockwise |
| `chambers` | voids, to which `bores` and `inlets` belong by name, in all `balloons` or those listed |
| `faces`, `turned` | what a film's upper and lower face are of; a turned layer lies upper face down |
| `bonds` | pairs of faces that bond, and by what; without any all structural films bond in the press |
| `seams` | bonds of a tool between two layers: half of `width` on both sides of `path`, in `order` |
| `folds` | `lower` and `upper` are halves of one film, which goes on at `line` |
| `ports`, `nets` | places in the gap between two layers, and which of them are joined |

`sbafab schema laminate` prints its JSON schema; `sbafab import FILE` also looks at references, heights and geometry, and
names the first fault at its place.

## Meshes

STL, 3MF and GLB of the flat solid and of each chamber's cavity in millimetres (GLB in metres, as its standard asks);
conforming meshes as VTU, legacy VTK, Gmsh MSH 2.2 and Abaqus INP with named sets: see [meshing](../meshing.md).

## A folder

| file | what it is | format |
|---|---|---|
| `manifest.json` | the index: every file with its SHA-256, layers, interfaces, sheets, bores, films | `sbafab/manifest@1` |
"""

TAIL = """
The other JSON files serve the program itself and may change: `sheets/nest.json` (where parts lie) and what a simulator's
folder holds beside its `result.json`.
"""


def write(folder: Path) -> None:
    """The page, and beside it the schemas as files."""
    rows = []
    for name, each in FORMATS.items():
        text = json.dumps(schema_of(name), indent=1) + "\n"
        (folder / f"{name}.schema.json").write_text(text, encoding="utf-8")
        link = f"{{download}}`{name}.schema.json`"
        rows.append(f"| `{name}` | `{each.identity}` | {each.about} | {link} |")
    files = "".join(
        f"| `{file.path}` | {file.about} | {f'`{file.schema}`' if file.schema else ''} |\n"
        for file in artefacts()
    )
    page = HEAD + "\n".join(rows) + "\n" + CUT + files + TAIL
    (folder / "formats.md").write_text(page, encoding="utf-8")
