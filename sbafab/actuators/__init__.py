"""Actuator families: each module holds a family's design record and builds its laminate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from sbafab.actuators import lobed, one_dof, radial
from sbafab.design.reading import add_waivers, design_path, override, read_toml, validated
from sbafab.design.records import Design
from sbafab.laminate.laminate import Laminate

FAMILIES: dict[str, tuple[type[Design], Callable[[Any], Laminate]]] = {
    "1dof": (one_dof.OneDofDesign, one_dof.build),
    "lobed": (lobed.LobedDesign, lobed.build),
    "radial": (radial.RadialDesign, radial.build),
}

OUTLINE = "chamber.outline"


def load_design(
    source: str | Path, assignments: Iterable[str] = (), waivers: Sequence[str] = ()
) -> Design:
    """A design from a template's name or a TOML file, with ``key=value`` assignments applied.

    ``waivers`` are rule names added to those that the file waives. Raises DesignError with one
    sentence where it cannot be built.
    """
    path = design_path(source)
    assignments = list(assignments)
    data = add_waivers(override(read_toml(path), assignments), waivers)
    data.setdefault("name", path.stem)
    if any(assignment.partition("=")[0].strip() == OUTLINE for assignment in assignments):
        # A path typed on the command line starts where the user stands, not at the design file.
        chamber = data["chamber"]
        chamber["outline"] = str(Path(str(chamber["outline"])).absolute())
    records = {family: record for family, (record, _) in FAMILIES.items()}
    return validated(data, records, path.parent)


def build(design: Design) -> Laminate:
    """The laminate of a design of any family. Raises DesignError where parts do not fit.

    Its notes say what size a drawn outline was understood to have.
    """
    laminate = FAMILIES[design.family][1](design)
    outline = getattr(getattr(design, "chamber", None), "outline", None)
    if outline is None:
        return laminate
    from sbafab.design.outline import understood

    said = understood(design.folder / outline).said
    return replace(laminate, notes=(said, *laminate.notes))


def schema(*others: type[BaseModel]) -> dict[str, Any]:
    """JSON schema of a design file of any family, or of ``others`` (draft 2020-12)."""
    from pydantic.json_schema import models_json_schema

    records = [*(record for record, _ in FAMILIES.values()), *others]
    _, definitions = models_json_schema([(record, "validation") for record in records])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "sbafab design",
        "oneOf": [{"$ref": f"#/$defs/{record.__name__}"} for record in records],
        **definitions,
    }
