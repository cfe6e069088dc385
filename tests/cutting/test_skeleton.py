"""The packaged empty document is what ezdxf writes."""

from __future__ import annotations

import ezdxf
import pytest

from sbafab.cutting.cut_settings import COLOURS
from sbafab.cutting.dxf_write import SKELETON, skeleton_text


@pytest.mark.skipif(ezdxf.version < (1, 4), reason="older ezdxf writes more tags")
def test_packaged_document_is_the_one_ezdxf_writes() -> None:
    assert SKELETON.read_text(encoding="utf-8") == skeleton_text()


def test_it_is_an_empty_document_in_millimetres_with_the_cut_layers() -> None:
    document = ezdxf.readfile(SKELETON)
    assert document.dxfversion == "AC1024"
    assert (document.header["$INSUNITS"], document.header["$MEASUREMENT"]) == (4, 1)
    assert len(document.modelspace()) == 0
    colours = {layer.dxf.name: layer.dxf.color for layer in document.layers}
    assert colours.items() >= COLOURS.items()
    assert document.layers.get("REFERENCE").dxf.plot == 0
    assert document.layers.get("CUT_OUTER").dxf.plot == 1
