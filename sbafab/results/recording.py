"""Recording what came out of one design or of a whole assembly: the same for command and Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.loading import load
from sbafab.assemblies.writing import assembly_sha256
from sbafab.design.reading import Change
from sbafab.design.records import Design
from sbafab.design.writing import design_sha256
from sbafab.errors import DesignError
from sbafab.output.settings import GENERATOR
from sbafab.results.batch import read_batch
from sbafab.results.builds import kit_name, promised, promised_assembly
from sbafab.results.records import ERRORS, NUMBERS, TEXTS, LabResult, Record, checked
from sbafab.results.store import Lab

SAID = (*TEXTS, "leak", *(quantity.name for quantity in (*NUMBERS, *ERRORS)))
"""What can be said of an actuator, by its name."""


def built_from(source: str | Path | Design, changes: Sequence[Change] = ()) -> Design | Assembled:
    """The design, or the assembly put together, of a template, a file or the folder built from."""
    if isinstance(source, Design):
        return source.with_(*changes) if changes else source
    resolved = Path(source) / "design.toml"
    found = load(resolved if resolved.is_file() else source, changes)
    return found if isinstance(found, Design) else assemble(found)


def record(
    lab: Lab, built: Design | Assembled, results: Sequence[LabResult], is_again: bool = False
) -> list[Record]:
    """Stores results of what was built, with what it promises; all or none.

    ``is_again``: as new attempts of actuators that were mended and tested again. Raises
    DesignError.
    """
    if isinstance(built, Design):
        sha256, kit = design_sha256(built), kit_name(built)
    else:
        sha256 = assembly_sha256(built)
        kit = ", ".join(dict.fromkeys(kit_name(made.design) for made in built.designs))
    results = [replace(result, kit=result.kit or kit) for result in results]
    if lab.knows(sha256, GENERATOR):
        return lab.add(sha256, None, results, is_again)
    said = promised(built) if isinstance(built, Design) else promised_assembly(built)
    return lab.add(sha256, said, results, is_again)


def results_of(said: Mapping[str, Any], table: str | Path | None = None) -> list[LabResult]:
    """One result of what is said by name, or those of a table. Raises DesignError.

    Errors are one number or several.
    """
    if table is not None:
        if said:
            raise DesignError(f"a table says it all; leave out {', '.join(said)}")
        return read_batch(Path(table))
    if not said.get("serial"):
        raise DesignError("an actuator needs its serial; give serial, as on its traveller")
    errors = {q.name: said[q.name] for q in ERRORS if q.name in said}
    serial, operator, kit, note, leak = (str(said.get(name, "")) for name in (*TEXTS, "leak"))
    result = LabResult(
        serial=serial,
        leak=leak,
        operator=operator,
        kit=kit,
        note=note,
        numbers={q.name: float(said[q.name]) for q in NUMBERS if q.name in said},
        errors={
            name: tuple(map(float, (value,) if isinstance(value, int | float) else value))
            for name, value in errors.items()
        },
    )
    if result.is_empty:
        raise DesignError('say what came out, such as leak="pass" or a note')
    return [checked(result)]
