"""Designs and assemblies from their files to laminates, places, solids and drawings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab import actuators
from sbafab.assemblies.build import Assembled, PlacedPart
from sbafab.assemblies.build import assemble as put_together
from sbafab.assemblies.files import load as load_either
from sbafab.assemblies.files import load_assembly, load_text, plain_tables
from sbafab.assemblies.records import Assembly
from sbafab.assemblies.shapes import bent_surface
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.order import cutting_order
from sbafab.design.files import Change, template_names, template_text
from sbafab.design.records import Design
from sbafab.design.records import resolved as written_out
from sbafab.laminate import laminate_file
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.meshing.solid import solid as surface_of
from sbafab.meshing.surface import Surface
from sbafab.reports.drawing import Dimension
from sbafab.reports.drawing import dimensions as measured

if TYPE_CHECKING:
    from ezdxf.document import Drawing

Source = Design | str | Path
"""A design: itself, a template's name, or a TOML file."""


def design_of(source: Source, changes: Sequence[Change], tables: Mapping[str, Any]) -> Design:
    """Return the design with its keys changed. Raises DesignError."""
    if isinstance(source, Design):
        return source.with_(*changes, **tables) if changes or tables else source
    return actuators.load_design(source, [*changes, tables])


def either_of(
    source: Source | Assembly, changes: Sequence[Change], tables: Mapping[str, Any]
) -> Design | Assembly:
    """Return the design or the assembly with its keys changed. Raises DesignError."""
    if isinstance(source, Assembly):
        return source
    if isinstance(source, Design):
        return design_of(source, changes, tables)
    return load_either(source, [*changes, tables])


def parted(options: Mapping[str, Any], record: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split keywords into fields of the record and tables of a design."""
    names = {field.name for field in fields(record)}
    return (
        {name: value for name, value in options.items() if name in names},
        {name: value for name, value in options.items() if name not in names},
    )


def templates() -> list[str]:
    """Return the names of the designs and assemblies that ship, in alphabetical order."""
    return template_names()


def template(name: str) -> str:
    """Return the text (TOML) of a design that ships. Raises DesignError for another name."""
    return template_text(name)


def schema() -> dict[str, Any]:
    """Return the JSON schema (2020-12) of a design file: every key, its default and meaning."""
    return actuators.schema(Assembly)


def load(source: Source, *changes: Change, **tables: Any) -> Design:
    """Return a design, with keys changed and checked like those of a file.

    Lengths are mm, or texts with a unit such as ``"0.75 mm"`` and ``"6 in"``. Raises DesignError
    with field, value and what is allowed.
    """
    return design_of(source, changes, tables)


def loads(text: str, path: str | Path = "design.toml") -> Design | Assembly:
    """Return a design or an assembly from the text of a file. Raises DesignError.

    Relative paths in it start beside ``path``.
    """
    return load_text(text, Path(path))


def resolved(design: Design | Assembly) -> dict[str, Any]:
    """Return the tables of a design or assembly with every default written out; lengths are mm."""
    return written_out(design) if isinstance(design, Design) else plain_tables(design)


def build(source: Source, *changes: Change, **tables: Any) -> Laminate:
    """Return the laminate of a design: its layers bottom to top, lengths in mm, the axis at (0, 0).

    Notebooks display it as a picture. Raises DesignError. The lay-up is the paper's
    (Sec. 2).
    """
    return actuators.build(load(source, *changes, **tables))


def read_laminate(path: str | Path) -> Laminate:
    """Return the laminate of a ``laminate.json``, equal to the one that was written.

    Raises DesignError, which names the file and the place in it, for what is no such file.
    """
    return laminate_file.read_laminate(Path(path))


def assemble(source: str | Path | Assembly, *changes: Change, **tables: Any) -> Assembled:
    """An assembly from a template's name, a TOML file or its record: parts, designs and places.

    Places are mm and degrees in the frame of the part that stands on nothing. Raises DesignError
    where a part cannot sit where it should. The templates are the paper's (Sec. 2.1).
    """
    if isinstance(source, Assembly):
        return put_together(source)
    return put_together(load_assembly(source, [*changes, tables]))


def solid(source: Source | Laminate | PlacedPart, *changes: Change, **tables: Any) -> Surface:
    """Return the closed surface of the flat actuator in mm, as for ``solid(...).trimesh()``.

    Films have their nominal thickness, pockets that of their mask. Of an assembly's part it is the
    outside, in the part's own frame and bent round its tube; ``part.pose`` places it. Raises
    DesignError.
    """
    if isinstance(source, PlacedPart):
        return bent_surface(source, filled=True)
    flat = source if isinstance(source, Laminate) else build(source, *changes, **tables)
    return surface_of(flat)


def drawing(layer: Layer) -> Drawing:
    """Return a layer as an ezdxf document in mm: nominal edges as in its cut file, without kerf.

    It is DXF R2010: a closed LWPOLYLINE with bulges a contour, CIRCLE for a full circle.
    """
    from ezdxf.filemanagement import read

    text = dxf_text(cutting_order(layer.profile), {"PATTERN": layer.pattern, "UNITS": "mm"})
    return read(StringIO(text))


def dimensions(laminate: Laminate, layer: Layer) -> list[Dimension]:
    """Return the dimensions on a layer's drawing: circles, radii and widths in mm, with labels."""
    return measured(laminate, layer)
