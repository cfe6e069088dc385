"""Explanations of every rule and check by name, for ``sbafab explain`` and the reference pages."""

from __future__ import annotations

from collections.abc import Mapping

from sbafab.rules.deck import RULES
from sbafab.rules.rule import Explanation

DECK: Mapping[str, Explanation] = {rule.name: rule.explanation for rule in RULES}
"""The rules on a design, in the deck's order."""

BETWEEN_PARTS: Mapping[str, Explanation] = {
    "tube-match": Explanation(
        "a wrapped actuator is made for the tube that it goes round",
        "A wrap for another diameter gapes or overlaps.",
        "Set tube.diameter of its design, or the tube's own.",
        ("rules.tube_tolerance",),
    ),
    "inlet-match": Explanation(
        "a supply line fits the inlets that it feeds",
        "Another tube than the inlet is made for leaks or does not go in.",
        "Use one tube for both.",
    ),
    "line-clearance": Explanation(
        "a line passes the lumen or bore that it runs through, with room round it",
        "A tight line stiffens the actuator and chafes.",
        "Use a thinner line or a wider lumen.",
        ("rules.line_clearance",),
    ),
    "seat": Explanation(
        "enough of a part's face lies on the part that it is glued on",
        "A joint on a sliver of the face comes off.",
        "Move the part (offset, along), turn it, or choose another that is wider.",
        ("rules.seat_share",),
    ),
    "collision": Explanation(
        "no two parts run into each other, deflated",
        "They could not be put together.",
        "Move or turn one of the two.",
    ),
    "aperture": Explanation(
        "every part passes the aperture, lobes folded",
        "What does not go in cannot be deployed.",
        "Use fewer balloons, smaller chambers or a smaller part.",
        ("deploy.aperture_diameter",),
    ),
    "lumen-pass": Explanation(
        "deflated, the whole passes the lumen",
        "What does not go in cannot be deployed.",
        "Use a thinner tube or smaller chambers; fold tabs back.",
        ("deploy.lumen_diameter",),
    ),
    "lumen-brace": Explanation(
        "inflated, a radial part reaches the wall of the lumen",
        "What does not touch the wall holds nothing.",
        "Use wider or longer balloons, or more of them in the stack.",
        ("deploy.lumen_diameter",),
    ),
    "supply-tubes": Explanation(
        "the tubes of an actuator on a tube's end run back past all balloons",
        "A tube across a balloon is in its way when it inflates.",
        "Turn the actuator so that its inlets lie in the gaps.",
        ("deploy.lumen_diameter",),
    ),
}
"""The checks between the parts of an assembly."""

AS_BUILT: Mapping[str, Explanation] = {
    "file-integrity": Explanation(
        "every drawing in a folder can be read: closed, in millimetres, nothing beside its cuts",
        "What a laser program reads otherwise, it cuts otherwise.",
        "Generate again, or undo what another program changed in the file named.",
    ),
    "manifest-claims": Explanation(
        "hashes and manifest match the files, and the manifest is what design.toml makes",
        "Programs and people go by it.",
        "Generate again; keep files of your own out of layers/ and sheets/.",
    ),
    "as-designed": Explanation(
        "everything in the folder is what its design.toml makes",
        "A folder that was changed by hand is another design than the one that was checked.",
        "Change the design, not the files, and generate again.",
    ),
}
"""The checks on a folder, beside the rules on what it will cut."""

AGAINST_NETLIST: Mapping[str, Explanation] = {
    "netlist": Explanation(
        "the voids join what the netlist of check --nets lists, and nothing else",
        "A circuit from another program is only made if the layers join what it joins.",
        "Change the layer at the place named, or the netlist.",
    ),
}
"""The check of a design or folder against a netlist."""

EXPLAINED: Mapping[str, Explanation] = {**DECK, **BETWEEN_PARTS, **AS_BUILT, **AGAINST_NETLIST}
