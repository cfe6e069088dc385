"""The rule deck on designs, assemblies and folders."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from sbafab.api.designs import Source, build, command, either_of, load
from sbafab.assemblies.records import Assembly
from sbafab.design.files import Change, changed_keys, template_names
from sbafab.design.identity import cited
from sbafab.design.records import Design
from sbafab.documents import Document
from sbafab.folders.build import refuse_undoable
from sbafab.folders.checks_json import FindingEntry, checks
from sbafab.folders.order import Order, make_order
from sbafab.geometry.region import Region
from sbafab.laminate.joints import PortKind
from sbafab.laminate.laminate import Laminate
from sbafab.laminate.netlist import SCHEMA as NETS
from sbafab.laminate.netlist import read_netlist
from sbafab.models.sizes import size_phrases, sizes
from sbafab.reports.nets_svg import NetMap, net_map
from sbafab.rules.deck import RULES, run_rule
from sbafab.rules.finding import Finding, Findings
from sbafab.rules.measures import Measures
from sbafab.rules.nets import connectivity, netlist_findings
from sbafab.runtime import Progress
from sbafab.search.advice import reach_yield

PAIR = Field(min_length=2, max_length=2)


class NamedPort(Document):
    """A port of a netlist, with its position if it is not a port of the design."""

    name: str
    at: Annotated[Sequence[float], PAIR] = ()
    """x, y, mm"""
    layers: Annotated[Sequence[int], PAIR] = ()
    """structural layers below and above, from 1"""
    kind: PortKind = "place"


class NetsDocument(Document, schema=NETS):
    """A netlist."""

    nets: dict[str, list[str | NamedPort]] = Field(min_length=1)
    """name -> ports and chambers of the design, or ports with their place"""


@command
def check(
    source: Source | Assembly, *changes: Change, progress: Progress | None = None, **tables: Any
) -> Findings:
    """Check a design with the rule deck; an assembly also between its parts.

    Each finding has its limit and worst measured value in its ``unit``. ``progress`` is called with
    each rule; an exception in it stops the check. Raises DesignError if the design cannot be built.
    Limits are the paper's (Sec. 2) if it gives one, else ours.
    """
    # A job takes models, hence numpy; a page without numpy has the rules of a design.

    return Findings(make_order(either_of(source, [*changes, tables]), progress=progress).findings)


def checking(
    source: Source, laminate: Laminate | None = None, pause: Callable[[], None] | None = None
) -> Iterator[tuple[str, Findings]]:
    """Yield every rule's name and its findings in a design, as they are measured.

    Iteration may stop at any rule; registration-yield, which samples builds, comes last.
    ``laminate`` is the design's, if already built; ``pause`` is called between parts of long rules,
    and an exception in it stops the deck. Raises DesignError.
    """
    design = load(source)
    measures = Measures(laminate or build(design), design, pause or (lambda: None))
    for rule in RULES:
        yield rule.name, Findings(run_rule(rule, measures))


def nets_of(source: Source, *changes: Change, **tables: Any) -> NetMap:
    """Return the nets of a design: their colours, the voids of every interface, and faults.

    ``areas`` have an ``interface``, counted from 1 at the bottom, a ``net`` ("" for none), its
    ``colour`` and their outline as SVG ``path``, mm. ``faults`` are opens, shorts, leaks, dead ends
    and voids outside all nets, each with its place. If a design declares no nets, every chamber is
    a net and ``faults`` is empty. Raises DesignError.
    """
    design = load(source, *changes, **tables)
    laminate = build(design)
    voids = connectivity(laminate, design, faults=bool(laminate.nets))
    return net_map(laminate, voids)


def check_folder(folder: str | Path, nets: str | Path | None = None) -> Findings:
    """Check the cut files of an output folder on disk with the rule deck.

    Also checks that the folder matches its ``design.toml`` (findings ``manifest-claims``,
    ``as-designed``, ``file-integrity``), and with ``nets``, a file, that its layers connect as that
    netlist lists (``netlist``). Raises OutputError if the folder cannot be read, DesignError if the
    netlist cannot be read.
    """
    # Reading a folder back takes longer to load than the rules.
    from sbafab.folders.check import check_folder as read_and_check

    return Findings(read_and_check(Path(folder), None if nets is None else Path(nets)))
