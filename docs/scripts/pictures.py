"""Makes the pictures that README and docs show, from the templates.

python -m docs.scripts.pictures
"""

from __future__ import annotations

from pathlib import Path

import sbafab
from sbafab.laminate.laminate import Laminate
from sbafab.reports.assembly_png import assembly_png
from sbafab.reports.inflated_picture import PictureWish, write_picture
from sbafab.reports.layers_svg import layers_svg
from sbafab.reports.relation_svg import relation_svg
from sbafab.reports.solid_png import solid_png
from sbafab.reports.stack_svg import stack_svg

IMAGES = Path(__file__).parents[1] / "images"


def inflated(laminate: Laminate) -> None:
    """The actuator bent by two of its chambers, and with pressure going round all three."""
    stack = sbafab.stack("3dof-15mm")
    bent = PictureWish({"chamber1": 5.0, "chamber2": 5.0}, width=1200, height=900)
    write_picture(laminate, stack, bent, IMAGES / "inflated.png")
    round_all = PictureWish({"": 5.0}, width=480, height=384, motion="circle", frames=36)
    write_picture(laminate, stack, round_all, IMAGES / "moving.webp")


def main() -> None:
    for name in ("1dof-5mm", "3dof-15mm", "radial-15mm"):
        (IMAGES / f"{name}-solid.png").write_bytes(solid_png(sbafab.build(name), 1200, 900))
    (IMAGES / "brace-assembled.png").write_bytes(assembly_png(sbafab.assemble("brace")))
    laminate = sbafab.build("3dof-15mm")
    inflated(laminate)
    (IMAGES / "3dof-15mm-layers.svg").write_text(layers_svg(laminate), encoding="utf-8")
    (IMAGES / "3dof-15mm-stack.svg").write_text(stack_svg(laminate), encoding="utf-8")
    for relation in sbafab.predict("3dof-15mm").relations:
        if relation.name == "force":
            plot = relation_svg("3dof-15mm", relation)
            (IMAGES / "3dof-15mm-force.svg").write_text(plot, encoding="utf-8")


if __name__ == "__main__":
    main()
