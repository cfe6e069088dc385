"""What lies beside the layers' files: pictures, pin plate, schedule, page, meshes, findings."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from sbafab.cutting.cut_settings import ENGRAVE
from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.region import Region
from sbafab.laminate.laminate import Laminate
from tests.faults.record import Fault, Kind, edited, of_text
from tests.faults.specimen import Specimen

RULE, CLAIMS = "as-designed", "manifest-claims"
PROJECT = "sheets/TPE_1.lbrn2"
SOLID, GLB, MODEL = "mesh/solid.stl", "mesh/solid.glb", "mesh/solid.3mf"


def changed(name: str, file: str, change: Callable[[bytes], bytes], rule: str = RULE) -> Fault:
    return edited(name, rule, lambda s: s.doctor.folder / file, change, beside=True)


def replaced(name: str, file: str, pattern: str, new: str) -> Fault:
    """A text in which the first match stands otherwise."""
    return changed(name, file, of_text(lambda text: re.sub(pattern, new, text, count=1)))


def told(name: str, file: str, change: Callable[[Any], object], rule: str = RULE) -> Fault:
    """A JSON file of which one value is another."""

    def edit(text: str) -> str:
        document = json.loads(text)
        change(document)
        return json.dumps(document)

    return changed(name, file, of_text(edit), rule)


def lost(name: str, file: str) -> Fault:
    """A file removed, and struck from the manifest."""

    def put(specimen: Specimen) -> None:
        (specimen.doctor.folder / file).unlink()
        specimen.doctor.set_manifest(lambda manifest: manifest["files"].pop(file))

    return Fault(name, RULE, put, beside=True)


def plate(name: str, change: Callable[[Region], Region]) -> Fault:
    """The pin plate drawn otherwise, its holes where they were."""

    def put(specimen: Specimen) -> None:
        path: Path = specimen.doctor.folder / specimen.doctor.manifest["fixture"]
        found = read_profile(path)
        (piece,) = found.region.pieces
        outline = change(Region(tuple(piece.outers)))
        region = Region((*outline.outers, *found.region.holes))
        # After the datum cross come the letters that tell the shop of its holes.
        notes = [[edges[0].start, *(e.end for e in edges)] for _, edges in found.strokes[2:]]
        text = dxf_text(cutting_sequence(region), found.properties, notes=notes)
        path.write_text(text, newline="\n")

    return Fault(name, RULE, put, no_pins, beside=True)


def no_pins(laminate: Laminate) -> str:
    return "" if laminate.pins else "no pins"


def flipped(region: Region) -> Region:
    """Turned over about its own middle, so that the cut-off corner is another one."""
    low, _, high, _ = region.bounds
    return region.mapped(lambda p: (low + high - p[0], p[1]), 1.0, True)


def engraved(text: str) -> str:
    """A stroke more in the waste of a sheet, at its lower edge."""
    stroke = (
        "  0\nLWPOLYLINE\n  5\nFFF1\n330\n17\n100\nAcDbEntity\n  8\n"
        f"{ENGRAVE}\n100\nAcDbPolyline\n 90\n2\n 70\n0\n 10\n1.0\n 20\n1.0\n 10\n2.0\n 20\n1.5\n"
    )
    return text.replace("  2\nENTITIES\n", f"  2\nENTITIES\n{stroke}", 1)


def painted(data: bytes) -> bytes:
    from PIL import Image

    image = Image.open(BytesIO(data)).convert("RGB")
    image.paste((200, 30, 30), (40, 40, 90, 90))
    out = BytesIO()
    image.save(out, "PNG")
    return out.getvalue()


def moved_corner(data: bytes) -> bytes:
    """The first triangle's first corner 0.05 mm off."""
    import numpy as np

    x = float(np.frombuffer(data[96:100], "<f4")[0]) + 0.05
    return data[:96] + np.float32(x).tobytes() + data[100:]


def scaled(data: bytes) -> bytes:
    import numpy as np

    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    rows = np.frombuffer(data[84:], kind).copy()
    rows["corners"] *= 1.002
    return data[:84] + rows.tobytes()


def in_inches(data: bytes) -> bytes:
    with ZipFile(BytesIO(data)) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    out = BytesIO()
    with ZipFile(out, "w") as archive:
        for name, part in parts.items():
            archive.writestr(name, part.replace(b'unit="millimeter"', b'unit="inch"'))
    return out.getvalue()


KIND = Kind(
    "What lies beside the layers",
    "The layers' files are as they were written, hashes are put right; what is lost is struck from "
    "the manifest as well.",
    (
        changed("sheet's picture emptied", "sheets/TPE_1.svg", lambda data: b""),
        replaced("sheet's picture of another size", "sheets/TPE_1.svg", r'height="\d', 'height="9'),
        replaced("part lost in a sheet's picture", "sheets/PTFE_1.svg", r"<path [^>]*/>\n", ""),
        lost("sheet's LightBurn project missing", PROJECT),
        replaced("vertex off in a LightBurn project", PROJECT, r"(V\d+\.\d)\d*", r"\g<1>"),
        replaced("part lost in a LightBurn project", PROJECT, r'<Shape [^\n]*CutIndex="2".*\n', ""),
        replaced("frame cut by a LightBurn project", PROJECT, r'put Value="0"', 'put Value="1"'),
        replaced("LightBurn project mirrored", PROJECT, r'MirrorX="False"', 'MirrorX="True"'),
        replaced(
            "power set in a LightBurn project", PROJECT, r'maxPower Value="0', 'maxPower Value="9'
        ),
        changed("stray engraving in the waste", "sheets/TPE_1.dxf", of_text(engraved)),
        told("parts placed otherwise", "sheets/nest.json", lambda d: d["nests"]["TPE"].reverse()),
        plate("pin plate turned over", flipped),
        plate("pin plate of another size", lambda region: region.moved(1.0, 0.0)),
        told("press at 270 C", "press.json", lambda d: d["steps"][0].update(temperature_c=270)),
        told("press step missing", "press.json", lambda d: d["steps"].pop(1)),
        told("press without its pins", "press.json", lambda d: d["steps"][0].update(pins=["x"])),
        replaced("table of press steps at 270 C", "press.csv", r",135(\.0)?,", ",270,"),
        replaced("press step missing in the table", "press.csv", r"\n2,.*", ""),
        lost("table of press steps missing", "press.csv"),
        replaced("traveller at 270 C", "traveller.html", r"135(\s|&nbsp;|\u00a0)", r"270\1"),
        changed("traveller cut short", "traveller.html", lambda data: data[: len(data) // 2]),
        lost("traveller missing", "traveller.html"),
        replaced(
            "warning hidden from the designer", "findings.html", r"<td>warn</td>", "<td>pass</td>"
        ),
        lost("findings missing", "findings.html"),
        changed(
            "underlay at 98 %", "underlay.pdf", lambda data: data.replace(b"2.8346", b"2.7779")
        ),
        lost("underlay missing", "underlay.pdf"),
        changed("solid with a corner elsewhere", SOLID, moved_corner),
        changed("solid scaled by 1.002", SOLID, scaled),
        changed("solid without its last triangle", SOLID, lambda data: data[:-50]),
        changed("solid in inches", MODEL, in_inches),
        changed("solid in mm for metres", GLB, lambda data: data.replace(b"0.001", b"1.000")),
        lost("solid missing", SOLID),
        replaced("picture of the layers", "preview/layers.svg", r"mm2?<", "in<"),
        replaced("picture of the stack", "preview/stack.svg", r"TPE", "TPU"),
        changed("picture of the solid painted", "preview/solid.png", painted),
        told("finding that failed", "checks.json", lambda d: d["findings"][0].update(limit=0.5)),
        told("other version", "manifest.json", lambda d: d.update(generator="sbafab 0.0.1")),
        told(
            "volume of the solid",
            "manifest.json",
            lambda d: d["meshes"][0].update(volume_mm3=1.0),
            CLAIMS,
        ),
        told(
            "cutting time of a sheet",
            "manifest.json",
            lambda d: d["sheets"][0].update(estimated_minutes=0.01),
            CLAIMS,
        ),
        told("another kit", "manifest.json", lambda d: d["kit"].update(version="0"), CLAIMS),
        told("note", "manifest.json", lambda d: d.update(notes=["safe to cut"]), CLAIMS),
    ),
)
