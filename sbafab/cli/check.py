"""``sbafab check``: the rule deck on a design or on an output folder; nothing is written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sbafab.cli.options import json_option, set_option, waive_option
from sbafab.cli.working import RULE_FAILED

if TYPE_CHECKING:
    from sbafab.assemblies.records import Assembly
    from sbafab.design.records import Design
    from sbafab.output.advice import Advice
    from sbafab.progress import Progress
    from sbafab.rules.finding import Finding

    Told = tuple[str, tuple[Finding, ...], list[str], list[Design]]
    """What was checked ("design" or "as-built"), what was found, notes, and the designs."""


@click.command()
@click.argument("source", metavar="DESIGN|FOLDER")
@set_option
@waive_option
@click.option(
    "--target-yield",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    metavar="SHARE",
    help="Fail below this share of good random builds, and advise the least bond and overhang "
    "that reach it, e.g. 0.99.",
)
@json_option
def check(
    source: str,
    assignments: tuple[str, ...],
    waivers: tuple[str, ...],
    target_yield: float | None,
    as_json: bool,
) -> None:
    """Run the rule deck on a design, or on the cut files of a folder; write nothing.

    FOLDER is one that sbafab generate has written: its files are read back as they lie on disk.
    """
    from sbafab.cli.printing import console, findings_table, print_json
    from sbafab.design.kits import cited
    from sbafab.output.manifest import checks
    from sbafab.rules.deck import has_failed

    kind, findings, notes, designs = _findings(source, assignments, waivers, target_yield, as_json)
    advice = None if target_yield is None else _advice(source, assignments, target_yield, as_json)
    if as_json:
        advised = {"advice": advice.as_dict()} if advice else {}
        print_json({**checks(findings, kind, designs), "notes": notes, **advised})
    else:
        out = console()
        if kind == "as-built":
            out.print(f"as built: {source}", markup=False, soft_wrap=True)
        for said in dict.fromkeys(map(cited, designs)):
            out.print(said, markup=False, soft_wrap=True)
        for note in notes:
            out.print(f"note: {note}", markup=False, soft_wrap=True)
        out.print(findings_table(findings))
        if advice:
            out.print(advice.sentence, markup=False, soft_wrap=True)
    if has_failed(findings):
        click.get_current_context().exit(RULE_FAILED)


def _of_design(design: Design, progress: Progress) -> Told:
    """The findings and notes; what press and sheets cannot do is refused, as a run would do."""
    from sbafab.cli.printing import notes_of
    from sbafab.output.batch import refuse_undoable
    from sbafab.output.planned import Checked
    from sbafab.output.run import check as run_check

    checked = Checked(design, *run_check(design, progress))
    if not checked.failed:
        refuse_undoable([checked])
    return "design", checked.findings, notes_of([checked]), [design]


def _of_assembly(assembly: Assembly, progress: Progress) -> Told:
    """Those of its designs and between its parts, likewise."""
    from sbafab.cli.printing import notes_of
    from sbafab.output.assembly import check_assembly
    from sbafab.output.batch import refuse_undoable

    checked = check_assembly(assembly, progress)
    if not checked.failed:
        refuse_undoable(checked.designs)
    designs = [one.design for one in checked.designs]
    return "design", checked.findings, notes_of(checked.designs), designs


def _advice(source: str, assignments: tuple[str, ...], target: float, quiet: bool) -> Advice:
    from sbafab.actuators import load_design
    from sbafab.cli.printing import shown_progress
    from sbafab.output.advice import advise

    with shown_progress(quiet) as tell:
        return advise(load_design(source, _asking(assignments, target)), target, tell)


def _asking(assignments: tuple[str, ...], target: float) -> tuple[str, ...]:
    return (*assignments, f"rules.target_yield={target}")


def _findings(
    source: str,
    assignments: tuple[str, ...],
    waivers: tuple[str, ...],
    target: float | None,
    quiet: bool,
) -> Told:
    from sbafab.cli.printing import shown_progress
    from sbafab.design.reading import template_names
    from sbafab.errors import DesignError

    if source in template_names() or not Path(source).is_dir():
        from sbafab.actuators import load_design
        from sbafab.assemblies.reading import load
        from sbafab.assemblies.records import Assembly

        found = load(source, assignments, waivers)
        with shown_progress(quiet) as progress:
            if isinstance(found, Assembly):
                if target is not None:
                    raise DesignError(
                        "--target-yield goes with a design, and this is an assembly; check its "
                        "parts' designs one by one"
                    )
                return _of_assembly(found, progress)
            if target is not None:
                found = load_design(source, _asking(assignments, target), waivers)
            return _of_design(found, progress)
    if assignments or waivers or target is not None:
        raise DesignError(
            "--set, --waive and --target-yield go with a design; a folder is checked as it lies, "
            "so leave them out"
        )
    import logging

    from sbafab.as_built.check import check_folder

    # A broken file is told of in a finding; what ezdxf logs of it would stand in between.
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())
    return "as-built", check_folder(Path(source)), [], []
