"""What the rules found, as people read it: a line a rule, what to do, a summary last."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from sbafab.cli.lines import console, print_wrapped, wrapped
from sbafab.cli.printing import COLOURS
from sbafab.rules.finding import counted

if TYPE_CHECKING:
    from sbafab.output.planned import Checked
    from sbafab.rules.finding import Finding, Verdict


SHARES = {"pin-fit": "stretch", "registration-yield": "hold"}
"""Rules that measure a share, and what it is of: a film stretches over its pin, builds hold."""


class Group(NamedTuple):
    """Findings that belong together: of one design, or between the parts of an assembly."""

    name: str
    findings: Sequence[Finding]


def groups_of(
    checked: Iterable[Checked], between: Sequence[Finding] | None = None
) -> tuple[Group, ...]:
    """A group a design, and one for what lies between parts."""
    own = tuple(Group(one.design.name, one.findings) for one in checked)
    return own if between is None else (*own, Group("between the parts", between))


def print_findings(groups: Sequence[Group], verbose: bool = False) -> None:
    """A line for every rule; for several groups, and below, what needs something done."""
    out = console()
    for group in groups:
        if len(groups) > 1:
            out.print(f"{group.name}: {counted(group.findings)}", style="bold", markup=False)
        if verbose:
            print_lines(group.findings, verbose)
            continue
        if len(groups) == 1:
            print_lines(group.findings)
        print_open(group.findings)


def print_lines(findings: Sequence[Finding], verbose: bool = False) -> None:
    """A line a rule: the finding that decides; ``verbose`` all of them, each with what it says."""
    from rich.text import Text

    from sbafab.rules.finding import decisive

    out = console()
    shown = findings if verbose else list(decisive(findings).values())
    wide = max((len(one.rule) for one in shown), default=0)
    out.print(Text(f"{'rule':{wide}}  verdict  {'measured':>13}  {'limit':>14}", style="bold"))
    for one in shown:
        line = Text(f"{one.rule:{wide}}  ")
        line.append(f"{one.verdict:7}", style=COLOURS[one.verdict])
        measured = short_figure(one.measured, _unit(one))
        line.append(f"  {measured:>13}  {limit_said(one):>14}")
        line.rstrip()
        out.print(line, soft_wrap=True)
        for said in wrapped(one.message, out.width, "    ", "    ") if verbose else ():
            out.print(Text(said), soft_wrap=True)


def print_open(findings: Sequence[Finding]) -> None:
    """What to do about each warning, and what is wrong in each failure."""
    # Bond and overhang may ask for the same.
    for said, verdict in dict.fromkeys(_told(findings)):
        print_wrapped(said, COLOURS[verdict])


def _told(findings: Sequence[Finding]) -> Iterator[tuple[str, Verdict]]:
    for one in findings:
        if one.verdict in ("fail", "warn") or one.by_user:
            yield f"{one.rule}: {one.remedy or one.message}", one.verdict


def verdict_said(name: str, groups: Sequence[Group], more: str) -> str:
    """The closing line of what holds; ``more`` tells where the details are."""
    if len(groups) == 1:
        return f"{name} holds: {counted(groups[0].findings)}. {more}"
    return f"{name} holds. {more}"


def limit_said(finding: Finding) -> str:
    """A limit with its sense: ">=" the least that may be measured, "<=" the most."""
    if finding.limit is None:
        return "no target" if finding.rule in SHARES else ""
    sense = "<=" if _is_most(finding.rule) else ">="
    return f"{sense} {short_figure(finding.limit, _unit(finding))}"


def _unit(finding: Finding) -> str:
    """The unit of a finding's figures; of a share what is counted, after a per cent sign."""
    return f"% {SHARES[finding.rule]}" if finding.rule in SHARES else finding.unit


def _is_most(rule: str) -> bool:
    from sbafab.rules.deck import AT_MOST, rule_names

    if rule in rule_names():
        return rule in AT_MOST
    from sbafab.assemblies.checks import AT_MOST as BETWEEN_PARTS

    return rule in BETWEEN_PARTS


def short_figure(value: float | None, unit: str) -> str:
    """A measured value in a column; none where nothing was measured."""
    if value is None:
        return ""
    if unit.startswith("%"):
        return f"{100 * value:.3g}{unit}"
    digits = f"{value:.3f}" if unit == "mm" else f"{value:.4g}"
    return f"{digits} {unit}".strip()
