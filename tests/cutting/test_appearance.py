"""How other programs may say that a line is drawn as its layer's; what they may not say."""

from __future__ import annotations

from collections.abc import Callable
from io import StringIO

import ezdxf
import pytest
from ezdxf.document import Drawing
from ezdxf.entities.dxfgfx import DXFGraphic

from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.errors import OutputError
from sbafab.geometry.region import disc
from tests.quick import few

Edit = Callable[[Drawing, DXFGraphic], object]


def saved(edit: Edit, version: str = "R2010") -> str:
    """A disc's cut file, changed and saved by ezdxf as another program might."""
    text = dxf_text(disc((3.0, 2.0), 4.0).contours, {"DESIGN": "disc"})
    document = ezdxf.read(StringIO(text))
    document.dxfversion = version
    edit(document, next(iter(document.modelspace().query("CIRCLE"))))
    stream = StringIO()
    document.write(stream)
    return stream.getvalue()


def coloured(entity: DXFGraphic, rgb: tuple[int, int, int]) -> None:
    entity.rgb = rgb


@pytest.mark.parametrize("version", few(["R2000", "R2004", "R2018"], 1))
@pytest.mark.parametrize(
    "edit",
    [
        lambda d, e: None,
        lambda d, e: e.dxf.set("color", 1),
        lambda d, e: e.dxf.set("linetype", "BYLAYER"),
        lambda d, e: e.dxf.set("linetype", "CONTINUOUS"),
        lambda d, e: e.dxf.set("lineweight", 25),
        lambda d, e: d.layers.get("CUT_OUTER").dxf.set("lineweight", 50),
        lambda d, e: d.layers.get("ENGRAVE").off(),
        lambda d, e: d.layers.get("REFERENCE").dxf.set("plot", 1),
    ],
)
def test_what_cuts_the_same_is_read(edit: Edit, version: str) -> None:
    assert len(read_profile(saved(edit, version)).region.outers) == 1


def test_a_true_colour_may_be_the_layers() -> None:
    assert read_profile(saved(lambda d, e: coloured(e, (255, 0, 0)))).region.outers


def test_an_entity_marked_as_one_of_paper_space_is_refused() -> None:
    text = saved(lambda d, e: None).replace(
        "CUT_OUTER\n100\nAcDbC", "CUT_OUTER\n 67\n1\n100\nAcDbC"
    )
    with pytest.raises(OutputError, match="CIRCLE is in paper space"):
        read_profile(text)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda d, e: d.layers.get("REFERENCE").off(), "REFERENCE is off"),
        (lambda d, e: d.layers.remove("CUT_OUTER"), "not in the layer table"),
        (lambda d, e: e.dxf.set("thickness", 2.0), "2 mm high"),
        (lambda d, e: setattr(e, "transparency", 0.5), "is transparent"),
    ],
)
def test_what_may_be_skipped_is_refused(edit: Edit, said: str) -> None:
    """The catalogue of faults has the other ways."""
    with pytest.raises(OutputError, match=said):
        read_profile(saved(edit))
