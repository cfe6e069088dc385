"""``sbafab check``: rules on a design or on an output folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from sbafab.api import checks as api
from sbafab.api.designs import design_of, either_of
from sbafab.cli import options as opt
from sbafab.cli import show
from sbafab.errors import DesignError

YIELD_RULE = "registration-yield"
DEFAULT_KIT = "paper"
"""The kit of a design that names none."""


@click.command()
@opt.design_argument(metavar="DESIGN|FOLDER")
@opt.set_option
@opt.waive_option("Accept the failure of this rule; cut files would state it. Repeatable.")
@opt.option(
    "--target-yield",
    "Fail if fewer random builds are good than this share, e.g. 0.99, and say what `sbafab "
    "generate` would change for it with the same option.",
    opt.PARTIAL_SHARE,
)
@opt.option(
    "--nets FILE",
    "Also compare what the layers join with a netlist: JSON of sbafab/nets@1 or ParchMint.",
    opt.file_path(exists=True, dir_okay=False),
)
@opt.option("-v --verbose", "All findings, with places and reasons.", bool)
@opt.json_option
def check(source: str, as_json: bool, **options: Any) -> None:
    """Run the rules on a design or on an output folder.

    No files are written. For a FOLDER written by sbafab generate, the files on disk are checked.
    """
    is_folder = source not in api.template_names() and Path(source).is_dir()
    if is_folder and (options["assignments"] or options["waivers"] or options["target_yield"]):
        raise DesignError(
            "--set, --waive and --target-yield apply to a design; omit them to check a folder"
        )
    if is_folder:
        failed = _check_folder(Path(source), options["nets"], options["verbose"], as_json)
    else:
        failed = _check_design(source, as_json, **options)
    if failed:
        show.end_failed()


def _check_design(
    name: str,
    as_json: bool,
    *,
    assignments: tuple[str, ...],
    waivers: tuple[str, ...],
    target_yield: float | None,
    nets: Path | None,
    verbose: bool,
) -> bool:
    """Check a design or an assembly and print the outcome; return True if a rule failed.

    Raises DesignError, also if press or sheets are unsuitable.
    """
    source = either_of(name, assignments, waivers)
    for flag, value in (("--target-yield", target_yield), ("--nets", nets)):
        if value is not None and not isinstance(source, api.Design):
            raise DesignError(
                f"{flag} applies to a single design, but this is an assembly; check its parts' "
                "designs one by one"
            )
    advice, has_target = (
        None,
        isinstance(source, api.Design) and source.rules.target_yield is not None,
    )
    with show.progress(as_json) as progress:
        if target_yield is not None:
            with_target = (*assignments, f"rules.target_yield={target_yield}")
            fixed = frozenset(api.changed_keys(assignments))
            advice = api.reach_yield(design_of(name, with_target), target_yield, fixed, progress)
            source = design_of(name, with_target, waivers)
        order = api.make_order(source, progress=progress)
    if not order.failed:
        api.refuse_undoable(order.builds)
    findings, groups = order.findings, order.groups
    if nets is not None:
        (build,) = order.builds
        more = api.netlist_findings(build.laminate, build.design, api.read_netlist(nets), nets.name)
        findings = (*findings, *more)
        groups = {order.name: findings}
    if as_json:
        printed: dict[str, object] = {} if advice is None else {"advice": advice}
        printed["sizes"] = {b.design.name: api.sizes(b.design, b.laminate) for b in order.builds}
        printed["notes"] = order.notes
        designs = [build.design for build in order.builds]
        show.document(api.checks(findings, "design", order.name, designs, **printed))
        return bool(show.failed_rules(findings))
    _print_heads(order, verbose)
    show.findings(groups, verbose)
    if advice is not None:
        show.wrapped(advice.sentence)
    if advice is not None and show.failed_rules(findings) == [YIELD_RULE] and not has_target:
        show.failure(
            f"{order.name} failed: yield below the requested {advice.target:g}. Without "
            "--target-yield all rules pass, and it may be cut"
        )
        return True
    return _print_outcome(order.name, groups, verbose, "design")


def _print_heads(order: api.Order, verbose: bool) -> None:
    """Print sizes, kits and notes."""
    builds = order.builds
    for build in builds:
        label = "size" if len(builds) == 1 else f"{build.design.name}, size"
        show.phrases(label, api.size_phrases(build.design, build.laminate))
    designs = [build.design for build in builds]
    kits = [api.cited(design) for design in designs if verbose or design.kit != DEFAULT_KIT]
    for line in (*dict.fromkeys(kits), *(f"note: {note}" for note in order.notes)):
        show.wrapped(line)


def _check_folder(folder: Path, nets: Path | None, verbose: bool, as_json: bool) -> bool:
    """Check the files of an output folder and print the outcome; return True if a rule failed."""
    import logging

    # A broken file becomes a finding; the log of ezdxf would repeat it on the screen.
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())
    findings = api.check_folder(folder, nets)
    if as_json:
        show.document(api.checks(findings, "as-built", str(folder), notes=()))
        return bool(show.failed_rules(findings))
    show.line(f"as built: {folder}")
    show.findings({str(folder): findings}, verbose)
    return _print_outcome(str(folder), {str(folder): findings}, verbose, show.FILES)


def _print_outcome(name: str, groups: show.Groups, verbose: bool, change: str) -> bool:
    """Print the verdict; return True if a rule failed."""
    findings = [finding for group in groups.values() for finding in group]
    if not show.failed_rules(findings):
        show.passed(name, groups, "" if verbose else "-v")
        return False
    show.failed(name, findings, "It must not be cut", change)
    return True
