"""Designs and assemblies from their files to laminates, places, solids and drawings."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import wraps
from inspect import signature
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar, overload

from sbafab import actuators
from sbafab.assemblies.build import Assembled, PlacedPart
from sbafab.assemblies.build import assemble as put_together
from sbafab.assemblies.files import load as load_either
from sbafab.assemblies.files import load_assembly, load_text, plain_tables
from sbafab.assemblies.records import Assembly
from sbafab.assemblies.shapes import bent_surface
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.design.files import (
    Change,
    as_in_a_file,
    key_paths,
    shown,
    template_names,
    template_text,
)
from sbafab.design.records import Design
from sbafab.design.records import resolved as written_out
from sbafab.errors import DesignError
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.meshing.solid import solid as surface_of
from sbafab.meshing.surface import Surface

if TYPE_CHECKING:
    from ezdxf.document import Drawing

    from sbafab.actuators.drawn import DrawnDesign
    from sbafab.actuators.lobed import LobedDesign
    from sbafab.actuators.one_dof import OneDofDesign
    from sbafab.actuators.radial import RadialDesign

Source = Design | str | Path
"""A design: itself, a template's name, or a TOML file."""
AnyDesign = TypeVar("AnyDesign", bound=Design)
Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


def command(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Return a command's function that also accepts tables of a design as keywords.

    NumPy numbers and arrays are converted to Python's. Raises DesignError for a misspelt keyword,
    with the most similar argument.
    """
    arguments = list(signature(function).parameters)

    @wraps(function)
    def call(*args: Arguments.args, **keywords: Arguments.kwargs) -> Returned:
        for name in keywords.keys() - set(arguments):
            near = difflib.get_close_matches(name, arguments, 1, 0.7)
            tables = near and {*Assembly.model_fields}.union(
                *(record.model_fields for record in actuators.records().values())
            )
            if near and name not in tables:
                raise DesignError(
                    f"{name} is neither an argument of {function.__name__} nor a table of a "
                    f"design; did you mean {near[0]}?"
                )
        plain = {name: as_in_a_file(value) for name, value in keywords.items()}
        return function(*args, **plain)

    return call


def numbers(name: str, values: float | Sequence[float]) -> tuple[float, ...]:
    """Return one or several numbers as a tuple. Raises DesignError."""
    try:
        return tuple(map(float, values if isinstance(values, Sequence) else [values]))
    except (TypeError, ValueError):
        raise DesignError(f"{name} = {shown(values)} must be a number or a list of them") from None


def design_of(source: Source, changes: Sequence[Change], waivers: Sequence[str] = ()) -> Design:
    """Return the design with its keys changed, for a file also with additional waivers.

    Raises DesignError.
    """
    if isinstance(source, Design):
        return source.with_(*changes) if any(changes) else source
    return actuators.load_design(source, changes, waivers)


def either_of(
    source: Source | Assembly, changes: Sequence[Change], waivers: Sequence[str] = ()
) -> Design | Assembly:
    """Return the design, like ``design_of``, or the assembly. Raises DesignError."""
    if isinstance(source, Assembly):
        return source
    if isinstance(source, Design):
        return design_of(source, changes)
    return load_either(source, changes, waivers)


def templates() -> list[str]:
    """Return the names of the bundled designs and assemblies, in alphabetical order."""
    return template_names()


def template(name: str) -> str:
    """Return the text (TOML) of a bundled design. Raises DesignError for another name."""
    return template_text(name)


def schema() -> dict[str, Any]:
    """Return the JSON schema (2020-12) of a design file: every key, its default and meaning."""
    return actuators.schema(Assembly)


def kinds_of_keys() -> dict[str, object]:
    """Return every dotted key of design files of all families, with its annotation."""
    paths = map(key_paths, actuators.records().values())
    return {key: kind for keys in paths for key, kind in keys.items()}


NAMED = "NAME"
"""In a key, a name that the design file chooses, as of a film or a shape."""
ROW = "[]"
"""In a key, behind a list of tables."""
JsonSchema = Mapping[str, Any]


def family_tables(schema: JsonSchema) -> Iterator[tuple[str, JsonSchema]]:
    """Yield each family's name and table of the schema of design files; "assembly" is one."""
    for reference in schema["oneOf"]:
        record = _resolved(reference, schema)
        family = record["properties"]["family"]
        yield family.get("const") or family["default"], record


def schema_keys(
    table: JsonSchema, schema: JsonSchema, prefix: str = ""
) -> Iterator[tuple[str, JsonSchema]]:
    """Yield the dotted keys of a table and of the tables below it, each with its rule."""
    for key, rule in table.get("properties", {}).items():
        below = [*_tables(rule, schema)]
        for infix, inner in below:
            yield from schema_keys(inner, schema, f"{prefix}{key}{infix}.")
        if not below:
            yield f"{prefix}{key}", rule


def _tables(rule: JsonSchema, schema: JsonSchema) -> Iterator[tuple[str, JsonSchema]]:
    """Yield the tables that a key may hold, each with the infix between the key and its own."""
    for choice in (rule, *rule.get("anyOf", ())):
        resolved = _resolved(choice, schema)
        if isinstance(more := resolved.get("additionalProperties"), dict):
            yield from ((f".{NAMED}", table) for _, table in _tables(more, schema))
        if "items" in resolved:
            yield from ((ROW, table) for _, table in _tables(resolved["items"], schema))
        if resolved.get("properties"):
            yield "", resolved


def _resolved(rule: JsonSchema, schema: JsonSchema) -> JsonSchema:
    resolved: JsonSchema = rule
    if "$ref" in rule:
        resolved = schema["$defs"][rule["$ref"].rpartition("/")[2]]
    return resolved


@overload
def load(source: AnyDesign, *changes: Change, **tables: Any) -> AnyDesign: ...
@overload
def load(
    source: Literal["1dof-5mm", "1dof-10mm"], *changes: Change, **tables: Any
) -> OneDofDesign: ...
@overload
def load(source: Literal["3dof-15mm"], *changes: Change, **tables: Any) -> LobedDesign: ...
@overload
def load(source: Literal["radial-15mm"], *changes: Change, **tables: Any) -> RadialDesign: ...
@overload
def load(
    source: Literal["array", "diode", "finger", "folded", "gripper", "pouch", "truss", "vacuum"],
    *changes: Change,
    **tables: Any,
) -> DrawnDesign: ...
@overload
def load(source: str | Path, *changes: Change, **tables: Any) -> Design: ...
def load(source: Source, *changes: Change, **tables: Any) -> Design:
    """Return a design, optionally with changed keys.

    Keys are checked like keys of a file. Lengths are mm, or texts with a unit such as ``"0.75 mm"``
    and ``"6 in"``. A type checker knows a template's family, and so
    ``load("3dof-15mm").chamber.diameter``; for a file, state the family with
    ``typing.cast(LobedDesign, load("my.toml"))``, where ``LobedDesign`` is from
    ``sbafab.actuators.lobed``. Raises DesignError with field, value and the allowed values.
    """
    return design_of(source, [*changes, tables])


def loads(text: str, path: str | Path = "design.toml") -> Design | Assembly:
    """Return a design or an assembly from the text of a file. Raises DesignError.

    Relative paths in it are based on the folder of ``path``.
    """
    return load_text(text, Path(path))


def resolved(design: Design | Assembly) -> dict[str, Any]:
    """Return the tables of a design or assembly with every default written out; lengths are mm."""
    return written_out(design) if isinstance(design, Design) else plain_tables(design)


def build(source: Source, *changes: Change, **tables: Any) -> Laminate:
    """Return the laminate of a design: its layers bottom to top, lengths in mm, the axis at (0, 0).

    Notebooks display it as a picture. Raises DesignError. The lay-up follows the paper (Sec. 2).
    """
    return actuators.build(load(source, *changes, **tables))


def assemble(source: str | Path | Assembly, *changes: Change, **tables: Any) -> Assembled:
    """Return an assembly from a template's name, a TOML file or its record: parts, designs and
    places.

    Places are in mm and degrees in the root part's frame. Raises DesignError if a part cannot be
    placed as required. The templates are the paper's (Sec. 2.1).
    """
    if isinstance(source, Assembly):
        return put_together(source)
    return put_together(load_assembly(source, [*changes, tables]))


def solid(source: Source | Laminate | PlacedPart, *changes: Change, **tables: Any) -> Surface:
    """Return the closed surface of the flat actuator in mm, as for ``solid(...).trimesh()``.

    Films have their nominal thickness, pockets their mask's thickness. For an assembly's part it is
    the outside, in the part's frame and bent around its tube; ``part.pose`` places it. Raises
    DesignError.
    """
    if isinstance(source, PlacedPart):
        return bent_surface(source, filled=True)
    flat = source if isinstance(source, Laminate) else build(source, *changes, **tables)
    return surface_of(flat)


def drawing(layer: Layer) -> Drawing:
    """Return a layer as an ezdxf document in mm: nominal edges as in its cut file, without kerf.

    It is DXF R2010: a closed LWPOLYLINE with bulges for each contour, or a CIRCLE.
    """
    from ezdxf.filemanagement import read

    text = dxf_text(cutting_sequence(layer.profile), {"PATTERN": layer.pattern, "UNITS": "mm"})
    return read(StringIO(text))
