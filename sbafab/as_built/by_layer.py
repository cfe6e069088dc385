"""What rules find on files as they lie: on a whole stack, or on the layers that can be read."""

from __future__ import annotations

from collections.abc import Sequence

from sbafab.as_built.cut_files import LayerFile
from sbafab.as_built.stack import stacked_layers
from sbafab.design.records import Design
from sbafab.laminate.laminate import Laminate
from sbafab.output.manifest_records import Manifest
from sbafab.rules import film_limits
from sbafab.rules.deck import RULES, Rule, run_rule
from sbafab.rules.finding import Finding, Place
from sbafab.rules.limits import Limits
from sbafab.rules.measures import Measures

BY_LAYER = (film_limits.NAME,)
"""Rules that need no layer but the one they look at."""
UNMEASURED = (ArithmeticError, ValueError, LookupError, StopIteration)
"""What shapes that no rule foresees can raise; a mistake of the program's own is not among them."""


def findings_as_built(rule: Rule, measures: Measures) -> list[Finding]:
    """What a rule finds; doctored files can make shapes that no rule can measure, which fails."""
    try:
        return run_rule(rule, measures.laminate, measures.limits, measures)
    except UNMEASURED as error:
        message = f"cannot be measured on these files ({error}); regenerate them"
        return [Finding(rule.name, "fail", None, None, "", Place(), message)]


def rules_by_layer(
    files: Sequence[LayerFile], claims: Manifest, design: Design, limits: Limits
) -> tuple[Finding, ...]:
    """The rules that can run on the layers that could be read; the others say that they did not."""
    layers = stacked_layers(files, design)
    lost = tuple(file.position for file in files if file.part is None)
    some = Laminate(
        name=claims.name,
        family=claims.family,
        layers=layers,
        chambers=(),
        bores=(),
        inlets=(),
        pins=(),
        lumen=None,
        balloons=0,
        registration=design.registration.method,
    )
    why = "it needs every layer, and not all could be read" if lost else "there is no whole stack"
    found: list[Finding] = []
    measures = Measures(some, limits)
    for rule in RULES:
        if layers and rule.name in BY_LAYER:
            found += findings_as_built(rule, measures)
        else:
            message = f"not run: {why}"
            found.append(Finding(rule.name, "warn", None, None, "", Place(None, lost), message))
    return tuple(found)
