"""What the functions are given: a design in one of three ways, and keywords of two kinds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sbafab import actuators
from sbafab.design.files import Change, template_names, template_text
from sbafab.design.records import Design

if TYPE_CHECKING:
    from ezdxf.document import Drawing

    from sbafab.assemblies.build import Assembled, PlacedPart
    from sbafab.assemblies.records import Assembly
    from sbafab.laminate.laminate import Laminate, Layer
    from sbafab.meshing.surface import Surface
    from sbafab.process import Progress
    from sbafab.reports.drawing import Dimension
    from sbafab.rules.finding import Findings

Source = Design | str | Path
"""A design: itself, a template's name, or a TOML file."""


def design_of(source: Source, changes: Sequence[Change], tables: Mapping[str, Any]) -> Design:
    """The design with its keys changed. Raises DesignError."""
    if isinstance(source, Design):
        return source.with_(*changes, **tables) if changes or tables else source
    return actuators.load_design(source, [*changes, tables])


def either_of(
    source: Source | Assembly, changes: Sequence[Change], tables: Mapping[str, Any]
) -> Design | Assembly:
    """The design or the assembly, likewise."""
    from sbafab.assemblies.files import load
    from sbafab.assemblies.records import Assembly

    if isinstance(source, Assembly):
        return source
    if isinstance(source, Design):
        return design_of(source, changes, tables)
    return load(source, [*changes, tables])


def parted(asked: Mapping[str, Any], record: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """What of the keywords are fields of the record, and what are tables of a design."""
    names = {field.name for field in fields(record)}
    return (
        {name: value for name, value in asked.items() if name in names},
        {name: value for name, value in asked.items() if name not in names},
    )


# A design from its file to its laminate, what the rules find in it, and its shapes.


def templates() -> list[str]:
    """Names of the designs and assemblies that ship, in alphabetical order."""
    return template_names()


def template(name: str) -> str:
    """The commented text (TOML) of a design that ships. Raises DesignError for another name."""
    return template_text(name)


def schema() -> dict[str, Any]:
    """JSON schema (2020-12) of a design or assembly file: every key, its default and meaning."""
    from sbafab.assemblies.records import Assembly

    return actuators.schema(Assembly)


def load(source: Source, *changes: Change, **tables: Any) -> Design:
    """A design, with keys changed and checked like those of a file.

    Lengths are mm, or texts with a unit such as ``"0.75 mm"`` and ``"6 in"``. Raises DesignError
    with field, value and what is allowed.
    """
    return design_of(source, changes, tables)


def loads(text: str, path: str | Path = "design.toml") -> Design | Assembly:
    """A design or an assembly from the text of a file; relative paths in it start beside ``path``.

    Raises DesignError.
    """
    from sbafab.assemblies.files import load_text

    return load_text(text, Path(path))


def resolved(design: Design | Assembly) -> dict[str, Any]:
    """The tables of a design or an assembly with every default written out; lengths are mm."""
    from sbafab.assemblies.files import plain_tables
    from sbafab.design.files import resolved as written_out

    return written_out(design) if isinstance(design, Design) else plain_tables(design)


def build(source: Source, *changes: Change, **tables: Any) -> Laminate:
    """The laminate of a design: its layers bottom to top, lengths in mm, the axis at (0, 0).

    In a notebook it shows itself as a picture. Raises DesignError. The lay-up is the paper's
    (Sec. 2).
    """
    return actuators.build(load(source, *changes, **tables))


def assemble(source: str | Path | Assembly, *changes: Change, **tables: Any) -> Assembled:
    """An assembly from a template's name, a TOML file or its record: parts, designs and places.

    Places are mm and degrees in the frame of the part that stands on nothing. Raises DesignError
    where a part cannot sit where it should. The templates are the paper's (Sec. 2.1).
    """
    from sbafab.assemblies.build import assemble as put_together
    from sbafab.assemblies.files import load_assembly
    from sbafab.assemblies.records import Assembly

    if isinstance(source, Assembly):
        return put_together(source)
    return put_together(load_assembly(source, [*changes, tables]))


def check(
    source: Source | Assembly,
    *changes: Change,
    progress: Progress | None = None,
    **tables: Any,
) -> Findings:
    """What the rule deck finds in a design; of an assembly, also what is found between parts.

    Each finding has its limit and worst measured value in its own ``unit``. ``progress`` is told
    each rule; what it raises ends the check. Raises DesignError for what cannot be built. Limits
    are the paper's (Sec. 2) where it gives one, else ours.
    """
    from sbafab.assemblies.records import Assembly
    from sbafab.output.assembly import check_assembly
    from sbafab.output.checked import check as run_check
    from sbafab.rules.finding import Findings

    found = either_of(source, changes, tables)
    if isinstance(found, Assembly):
        return Findings(check_assembly(found, progress).findings)
    return Findings(run_check(found, progress)[1])


def checking(
    source: Source, laminate: Laminate | None = None, pause: Callable[[], None] | None = None
) -> Iterator[tuple[str, Findings]]:
    """Every rule's name and what it finds in a design, one after the other, as they are measured.

    Who stops asking stops the deck; registration-yield, which draws builds, comes last.
    ``laminate`` is the design's, where it is built already; ``pause`` is called between parts of
    long rules, and what it raises ends the deck. Raises DesignError.
    """
    from sbafab.output.checked import limits
    from sbafab.rules.deck import RULES, run_rule
    from sbafab.rules.finding import Findings
    from sbafab.rules.measures import Measures

    design = load(source)
    measures = Measures(laminate or build(design), limits(design), pause or (lambda: None))
    for rule in RULES:
        found = run_rule(rule, measures.laminate, measures.limits, measures)
        yield rule.name, Findings(found)


def check_folder(folder: str | Path) -> Findings:
    """What the rule deck finds in the cut files of an output folder as they lie on disk.

    Also whether the folder is what its ``design.toml`` makes (findings ``manifest-claims``,
    ``as-designed``, ``file-integrity``). Raises OutputError where none can be read there.
    """
    from sbafab.as_built.check import check_folder as read_and_check
    from sbafab.rules.finding import Findings

    return Findings(read_and_check(Path(folder)))


def solid(source: Source | Laminate | PlacedPart, *changes: Change, **tables: Any) -> Surface:
    """The closed surface of the flat actuator in mm, for example for ``solid(...).trimesh()``.

    Films have their nominal thickness, pockets that of their mask. Of an assembly's part it is the
    outside, in the part's own frame and bent round its tube; ``part.pose`` places it. Raises
    DesignError.
    """
    from sbafab.assemblies.build import PlacedPart
    from sbafab.assemblies.shapes import bent_surface
    from sbafab.laminate.laminate import Laminate
    from sbafab.meshing.solid import solid as surface_of

    if isinstance(source, PlacedPart):
        return bent_surface(source, filled=True)
    flat = source if isinstance(source, Laminate) else build(source, *changes, **tables)
    return surface_of(flat)


def drawing(layer: Layer) -> Drawing:
    """A layer as an ezdxf document in mm: nominal edges as in its cut file, no kerf taken off.

    It is DXF R2010: a closed LWPOLYLINE with bulges a contour, CIRCLE for a full circle.
    """
    from io import StringIO

    from ezdxf.filemanagement import read

    from sbafab.cutting.dxf_write import dxf_text
    from sbafab.cutting.order import cutting_order

    text = dxf_text(cutting_order(layer.profile), {"PATTERN": layer.pattern, "UNITS": "mm"})
    return read(StringIO(text))


def dimensions(laminate: Laminate, layer: Layer) -> list[Dimension]:
    """What a drawing of a layer gives the size of: circles, radii and widths in mm, each with its
    words.
    """
    from sbafab.reports.drawing import dimensions as measured

    return measured(laminate, layer)
