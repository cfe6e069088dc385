"""The empty DXF document that every cut file is filled into.

``python -m sbafab.cutting.skeleton`` regenerates it with ezdxf. Keeping it as a file means that
writing a cut file costs no import of ezdxf, nor does reading one back in this program's own form.
"""

from __future__ import annotations

from io import StringIO
from pathlib import Path

from sbafab.cutting.cut_layers import COLOURS, REFERENCE

SKELETON = Path(__file__).with_name("skeleton.dxf")


def skeleton_text() -> str:
    """An empty R2010 document in millimetres with the cut layers and fixed metadata."""
    from ezdxf import options  # type: ignore[attr-defined]
    from ezdxf.filemanagement import new

    # The switch holds for the whole process, so it goes back to what it was.
    before = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True
    try:
        document = new("R2010", units=4)
        document.header["$MEASUREMENT"] = 1
        for name, colour in COLOURS.items():
            document.layers.add(name, color=colour, plot=name != REFERENCE)
        # ezdxf adds classes in the order of a set; those that are there it leaves in place.
        document.classes.add_required_classes(document.dxfversion)
        document.classes.classes = dict(sorted(document.classes.classes.items()))
        stream = StringIO()
        document.write(stream)
    finally:
        options.write_fixed_meta_data_for_testing = before
    return stream.getvalue()


if __name__ == "__main__":
    SKELETON.write_text(skeleton_text(), encoding="utf-8", newline="\n")
