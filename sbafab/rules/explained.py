"""What every rule and check asks, why, and what to change: for people, by name.

``sbafab explain`` and the reference of the documentation read it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Explanation(NamedTuple):
    """What ``holds`` where a rule passes, ``why`` that matters, how to ``mend`` a failure.

    ``keys`` of a design file set the limit or what it is held against.
    """

    holds: str
    why: str
    mend: str
    keys: tuple[str, ...] = ()


DECK: Mapping[str, Explanation] = {
    "bond-width": Explanation(
        "every bond is at least 0.75 mm wide between facing edges",
        "A narrower ring peels or leaks under pressure; the paper found 0.75 mm to hold (Sec. 2).",
        "Make bond.width larger, move what lies near the edge away from it, or round the outline.",
        ("rules.bond_width", "bond.width"),
    ),
    "mask-overhang": Explanation(
        "every mask reaches at least 0.50 mm past the film edges it keeps apart",
        "Film that melts at an edge runs round the end of a short mask and welds the pocket shut.",
        "Make mask.overhang larger. A flush mask at a pinned bore is meant, and waived by itself.",
        ("rules.mask_overhang", "mask.overhang"),
    ),
    "facing-films": Explanation(
        "films of two balloons meet where they are meant to bond, and nowhere else",
        "The press welds any two films with neither film nor mask between them, neighbours or not.",
        "Make balloons more alike, tabs shorter, or masks larger where the message says.",
        ("rules.mask_overhang", "mask.overhang", "chamber.diameter"),
    ),
    "sealing": Explanation(
        "every pocket is reached from its own chamber's inlet and from nowhere else",
        "A pocket that opens elsewhere leaks; one that is cut off never inflates.",
        "Look at the place named: an opening too near another, or a mask that crosses a bond.",
        ("bore.diameter", "lumen.diameter", "inlet.width"),
    ),
    "channel-clear": Explanation(
        "all openings along a bore, and along the lumen, together pass its diameter",
        "One layer off its axis narrows the channel to what all openings have in common.",
        "Draw the openings about one axis, or ask for less: bore.diameter, lumen.diameter.",
        ("bore.diameter", "lumen.diameter"),
    ),
    "tube-fit": Explanation(
        "the inlet strip, cut at its narrowest, opens to the tube and its own film",
        "A flat channel opens to half the perimeter of what goes in; less, and the tube tears it.",
        "Leave inlet.width out, so that it follows the tube, or use a thinner tube.",
        ("inlet.width", "inlet.tube_outer_diameter", "laser.unknown_kerf"),
    ),
    "piece-count": Explanation(
        "every layer falls into the pieces that its role says",
        "A film in two pieces is no film; a mask in one piece too many shifts in the press.",
        "Make the chamber larger or the bond narrower, so that the layer hangs together.",
        ("chamber.diameter", "bond.width"),
    ),
    "pin-holes": Explanation(
        "every pin finds its holes, no film stands in its way, two pins hold what ears pin",
        "A pin without a hole lifts the film; a film on one pin turns about it.",
        "Use the registration method's own holes; see the place named.",
        ("registration.method", "registration.pin_diameter"),
    ),
    "pin-fit": Explanation(
        "every film goes on its pins with hole and pin at their worst: 30 % stretch at most",
        "Holes come out narrower than drawn; a film stretched further over its pin tears.",
        "Use a thinner pin, a wider bore, or registration.pin_clearance.",
        ("registration.pin_stretch", "bore.clearance", "bore.pin_diameter"),
    ),
    "bridges": Explanation(
        "every part hangs in its registered sheet by bridges that the second cut frees",
        "A part that hangs on too little shifts; one that is not freed is torn off.",
        "Make panel.bridge_width larger, or move the copies apart with panel.web.",
        ("panel.bridge_width", "panel.second_cut_error"),
    ),
    "scrap": Explanation(
        "all scrap of registered sheets comes off, and every inlet is free",
        "Scrap that is welded to a part, or locked in it, cannot be taken away after pressing.",
        "Move the copies apart with panel.web, or make the tab longer.",
        ("panel.web", "inlet.tab_length"),
    ),
    "film-limits": Explanation(
        "nothing is finer than the laser cuts, before and after kerf",
        "A slot or web below the beam's own width burns away or stays uncut.",
        "Make the feature at the place named wider, or measure the kerf.",
        ("laser.least_feature", "laser.kerf_tpe", "laser.kerf_ptfe"),
    ),
    "press-fit": Explanation(
        "the laminate lies in the heated area; more than 20 balloons, and films whose minutes "
        "nobody stated, draw a warning",
        "What lies outside the platen is not bonded; heat may not reach a tall stack's middle.",
        "Make the actuator smaller, tell press.platen_width of a larger press, stack fewer; try "
        "another film on a sample and name it in press.minutes_for.",
        (
            "press.platen_width",
            "press.platen_length",
            "rules.validated_balloons",
            "press.minutes_for",
        ),
    ),
    "registration-nominal": Explanation(
        "bores are coaxial and the two outlines of a balloon congruent, to 1 um",
        "What is drawn off its place is off before any hand has touched it.",
        "Draw both from the same edge.",
    ),
    "registration-worst-case": Explanation(
        "with every error at its worst 0.5 mm of a bond and 0.25 mm of an overhang are left",
        "Cutting and pins must leave that (else it fails); what a hand may take only warns.",
        'Lay up with care, set registration.method = "ears", or make bond and overhang larger.',
        ("rules.worst_bond_width", "rules.worst_mask_overhang", "registration.hand_placement"),
    ),
    "registration-yield": Explanation(
        "enough random builds keep what registration-worst-case asks",
        "The worst of all errors at once is rare; this counts how rare. The hand is calibrated on "
        "the paper's success of nine in ten, not measured.",
        "Run sbafab check DESIGN --target-yield 0.95: it advises bond and overhang.",
        ("rules.target_yield", "registration.hand_placement", "registration.hand_turn"),
    ),
}
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
        "the manifest says what lies in the folder: hashes, areas, pieces, order, sheets",
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

EXPLAINED: Mapping[str, Explanation] = {**DECK, **BETWEEN_PARTS, **AS_BUILT}
