"""Cut files that are swapped, missing or broken, or that another program wrote carelessly."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable

from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.contour import Contour
from sbafab.geometry.edges import Line, meeting_points
from sbafab.geometry.region import Region, disc
from tests.faults import record
from tests.faults.holes import bore
from tests.faults.record import Fault, Kind, of_text
from tests.faults.specimen import Change, Pick, Specimen, mask, separator, tabbed_wall, wall

CLAIMS = "manifest-claims"
POLYLINE = "AcDbPolyline\n"


def broken(name: str, change: Callable[[bytes], bytes], rule: str = "file-integrity") -> Fault:
    """A fault in the file of the lowest wall."""
    return record.edited(name, rule, lambda s: s.doctor.path(tabbed_wall(s.clean).index), change)


def edited(name: str, change: Callable[[str], str]) -> Fault:
    return broken(name, of_text(change))


def inches(text: str) -> str:
    return text.replace("$INSUNITS\n 70\n4\n", "$INSUNITS\n 70\n1\n")


def imperial(text: str) -> str:
    return text.replace("$MEASUREMENT\n 70\n1\n", "$MEASUREMENT\n 70\n0\n")


def opened(text: str) -> str:
    head, marker, tail = text.rpartition(POLYLINE)
    return head + marker + tail.replace(" 70\n1\n", " 70\n0\n", 1)


def doubled(text: str) -> str:
    """The last contour twice, the second time under a handle of its own."""
    start = text.rindex("  0\nLWPOLYLINE\n")
    end = text.index("  0\n", start + 4)
    head, handle, rest = text[start:end].partition("  5\n")
    _, line, rest = rest.partition("\n")
    return text[:end] + head + handle + "FFFF" + line + rest + text[end:]


def on_layer(layer: str) -> Callable[[str], str]:
    """The outline moved to another DXF layer."""

    def change(text: str) -> str:
        start = text.rindex("  0\nLWPOLYLINE\n")
        return text[:start] + text[start:].replace("CUT_OUTER", layer, 1)

    return change


def raised(text: str) -> str:
    """The outline lifted off the plane by 1 mm."""
    head, marker, tail = text.rpartition(POLYLINE)
    return head + marker + tail.replace(" 70\n1\n", " 70\n1\n 38\n1.0\n", 1)


def with_stroke(layer: str) -> Callable[[str], str]:
    """A line more, from the middle of the part out, on a layer that has no business there."""
    line = (
        f"  0\nLINE\n  5\nFFF1\n330\n17\n100\nAcDbEntity\n  8\n{layer}\n100\nAcDbLine\n"
        " 10\n2.0\n 20\n0.0\n 30\n0.0\n 11\n40.0\n 21\n1.0\n 31\n0.0\n"
    )
    return lambda text: text.replace("  2\nENTITIES\n", f"  2\nENTITIES\n{line}", 1)


def without_datum(text: str) -> str:
    """One of the two lines of the datum cross removed."""
    start = text.rindex("  0\nLINE\n")
    return text[:start] + text[text.index("  0\n", start + 4) :]


def in_table(layer: str, **wrong: str) -> Callable[[str], str]:
    """A layer's record with other flags, colour or linetype, or with a word more."""

    def change(text: str) -> str:
        start = text.index(f"AcDbLayerTableRecord\n  2\n{layer}\n")
        head, record = text[:start], text[start:]
        for group, value in (("flags", " 70"), ("colour", " 62"), ("linetype", "  6")):
            if group in wrong:
                new = f"\n{value}\n{wrong[group]}\n"
                record = re.sub(rf"\n{value}\n.*\n", new, record, count=1)
        if "plot" in wrong:
            record = re.sub(r"(\n  6\n.*\n)", rf"\g<1>290\n{wrong['plot']}\n", record, count=1)
        return head + record

    return change


def on_entity(group: str) -> Callable[[str], str]:
    """The outline with an attribute of its own."""

    def change(text: str) -> str:
        start = text.rindex("  0\nLWPOLYLINE\n")
        return text[:start] + text[start:].replace(
            "  8\nCUT_OUTER\n", f"  8\nCUT_OUTER\n{group}\n", 1
        )

    return change


def redone(change: Callable[[Region], Region]) -> Callable[[bytes], bytes]:
    def rewrite(text: str) -> str:
        found = read_profile(text)
        return dxf_text(cutting_sequence(change(found.region)), found.properties)

    return of_text(rewrite)


def as_chords(text: str) -> str:
    found = read_profile(text)
    drawn = in_chords(found.region, "separator-mask", 0.005)
    return dxf_text(cutting_sequence(drawn), found.properties, "chords")


def crossing_itself(region: Region) -> Region:
    """Two neighbouring vertices of the first outline in each other's place, where lines cross."""
    outline = region.outers[0]
    edges = outline.edges
    for n in range(len(edges) - 3):
        a, b, c, d = (edge.start for edge in edges[n : n + 4])
        if meeting_points(Line(a, c), Line(b, d)):
            lines = (Line(a, c), Line(c, b), Line(b, d))
            crossed = Contour((*edges[:n], *lines, *edges[n + 3 :]))
            return Region(tuple(crossed if own is outline else own for own in region.contours))
    raise AssertionError


def swapped(name: str, rule: str, first: Pick, second: Pick, tell: bool) -> Fault:
    """Two layers' profiles in each other's file; with ``tell`` the claims follow."""

    def put(specimen: Specimen) -> None:
        one, other = first(specimen.clean), second(specimen.clean)
        if tell:
            specimen.redraw([one], lambda region, _: other.profile)
            specimen.redraw([other], lambda region, _: one.profile)
            return
        paths = [specimen.doctor.path(layer.index) for layer in (one, other)]
        texts = [path.read_text() for path in paths]
        for path, text in zip(paths, reversed(texts), strict=True):
            path.write_text(text, newline="\n")

    return Fault(name, rule, put)


def missing(specimen: Specimen) -> None:
    """Deleted, and struck from the list of hashes."""
    path = specimen.doctor.path(tabbed_wall(specimen.clean).index)
    path.unlink()
    own = path.relative_to(specimen.doctor.folder).as_posix()
    specimen.doctor.set_manifest(lambda claims: claims["files"].pop(own))


def spare(specimen: Specimen) -> None:
    path = specimen.doctor.path(wall(specimen.clean).index)
    shutil.copy(path, path.with_name("spare.dxf"))


def unhashed(specimen: Specimen) -> None:
    """A wall shifted and nothing put right."""
    specimen.doctor.redraw(wall(specimen.clean).index, lambda region: region.moved(0.15, 0.0))


def plate(name: str, change: Change) -> Fault:
    def put(specimen: Specimen) -> None:
        path = specimen.doctor.folder / specimen.doctor.manifest["fixture"]
        rewrite = redone(lambda region: change(region, specimen.clean))
        path.write_bytes(rewrite(path.read_bytes()))

    return Fault(name, "as-designed", put)


KIND = Kind(
    "Files",
    "The broken file is that of the lowest wall. Hashes are put right, but in the rows on a file "
    "changed and a file too many.",
    (
        swapped("mask and separator swapped", CLAIMS, mask, separator, tell=False),
        swapped("mask and separator swapped, claims too", "sealing", mask, separator, tell=True),
        swapped("two walls swapped", CLAIMS, tabbed_wall, wall, tell=False),
        swapped(
            "two walls swapped, claims too", "registration-nominal", tabbed_wall, wall, tell=True
        ),
        Fault("file missing", "file-integrity", missing),
        broken("file empty", lambda data: b""),
        broken("file truncated", lambda data: data[:12_000]),
        broken("file not DXF", lambda data: b"\x89PNG\r\n\x1a\n\0\0"),
        edited("inch header", inches),
        edited("imperial header", imperial),
        edited("contour open", opened),
        edited("contour doubled", doubled),
        broken("contour crossing itself", redone(crossing_itself)),
        edited("contour on the wrong cut layer", on_layer("CUT_INNER")),
        edited("contour on a layer that is not cut", on_layer("REFERENCE")),
        edited("contour on layer 0", on_layer("0")),
        edited("contour off the plane", raised),
        broken("contours as chords", of_text(as_chords), "as-designed"),
        *(
            edited(f"stray line on {layer} through the part", with_stroke(layer))
            for layer in ("CUT_SHEET", "ENGRAVE", "REFERENCE")
        ),
        edited("datum cross not whole", without_datum),
        edited("layer off", in_table("CUT_OUTER", colour="-1")),
        edited("layer frozen", in_table("CUT_OUTER", flags="1")),
        edited("layer not plotted", in_table("CUT_OUTER", plot="0")),
        edited("layer of another colour", in_table("CUT_OUTER", colour="5")),
        edited("layer dashed", in_table("CUT_OUTER", linetype="DASHED")),
        edited("contour invisible", on_entity(" 60\n1")),
        edited("contour dashed", on_entity("  6\nDASHED")),
        edited("contour of another colour", on_entity(" 62\n5")),
        edited("contour of another true colour", on_entity("420\n255")),
        edited("contour in paper space", on_entity(" 67\n1")),
        Fault("file changed after it was written", CLAIMS, unhashed, hashes=False),
        Fault("a cut file too many", CLAIMS, spare),
        plate("pin plate without a hole", lambda region, own: region | disc(bore(own), 0.8)),
        plate("pin plate's holes shifted 0.15", lambda region, _: region.moved(0.15, 0.0)),
    ),
)
