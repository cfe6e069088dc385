"""The empty DXF document that every cut file is filled into.

``python -m sbafab.cutting.skeleton`` writes it anew with ezdxf. Keeping it as a file means that
writing a cut file costs no import of ezdxf, and that reading one back is an independent check.
"""

from __future__ import annotations

from io import StringIO
from pathlib import Path

from sbafab.cutting.cut_layers import COLOURS, REFERENCE

SKELETON = Path(__file__).with_name("skeleton.dxf")


def skeleton_text() -> str:
    """An empty R2010 document in millimetres with the cut layers and fixed metadata."""
    import ezdxf

    # The switch holds for the whole process, so it goes back to what it was.
    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        document = ezdxf.new("R2010", units=4)
        document.header["$MEASUREMENT"] = 1
        for name, colour in COLOURS.items():
            document.layers.add(name, color=colour, plot=name != REFERENCE)
        stream = StringIO()
        document.write(stream)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before
    return stream.getvalue()


if __name__ == "__main__":
    SKELETON.write_text(skeleton_text(), encoding="utf-8", newline="\n")
