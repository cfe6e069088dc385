"""How steady a hand the paper's success rate speaks of: ``python docs/hand.py``.

The paper gives largest errors of cutting and pins, none of the hand, and says that 90 % of its
actuators came out. Shift and turn of the hand, 0.2 mm to 1 degree as one factor, are set so that
the designs it built keep their limits that often.
"""

from __future__ import annotations

from sbafab.actuators import build, load_design
from sbafab.design.sections import Registration
from sbafab.rules.registration_yield import simulate

BUILT = ("1dof-5mm", "1dof-10mm", "3dof-15mm")
"""What the paper built and gives the rate of (Sec. 6)."""
FACTORS = (0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5)


def share(name: str, factor: float, builds: int = 10_000) -> float:
    """Share of good builds of a template whose hand is ``factor`` times as rough as the default."""
    design = load_design(name)
    usual = design.registration
    hand = {
        "hand_placement": factor * usual.hand_placement,
        "hand_turn": factor * usual.hand_turn,
    }
    wanted = design.with_(registration=hand, rules={"yield_builds": builds})
    return simulate(build(design), wanted).whole.value


def main() -> None:
    """The table in ``docs/registration.md``."""
    names = (*BUILT, "radial-15mm")
    print("| hand | " + " | ".join(f"`{name}`" for name in names) + " |")
    print("|---" * (len(names) + 1) + "|")
    usual = Registration.model_construct()
    for factor in FACTORS:
        hand = f"{factor * usual.hand_placement:.3g} mm, {factor * usual.hand_turn:.3g} degrees"
        print(f"| {hand} | " + " | ".join(f"{share(name, factor):.1%}" for name in names) + " |")


if __name__ == "__main__":
    main()
