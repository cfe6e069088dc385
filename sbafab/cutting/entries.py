"""What is asked for where the beam begins and ends a contour, and of what holds a part."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Entries:
    """How contours of a film are begun, ended and held, in mm; 0 is none.

    ``tabs`` an outline leave ``tab_width`` of film each, so that the beam leaves out ``gap``, which
    is wider by its ``kerf``. Lead-ins keep ``clearance`` from all but their own contour. ``key`` is
    the design's table with these keys, for messages.
    """

    lead_in: float = 0.0
    overcut: float = 0.0
    tab_width: float = 0.0
    tabs: int = 0
    kerf: float = 0.0
    clearance: float = 0.2
    key: str = "sheets.tpe"

    @property
    def is_plain(self) -> bool:
        """True if contours are cut as they are."""
        return not (self.lead_in or self.overcut or self.tabs)

    @property
    def gap(self) -> float:
        """Length of an outline that a tab leaves uncut, mm."""
        return self.tab_width + self.kerf if self.tabs else 0.0

    @property
    def properties(self) -> dict[str, str]:
        """What machine files say of it."""
        width = f"{self.tabs} an outline, {self.tab_width:g} mm wide, {self.gap:g} mm uncut"
        said = {
            "LEAD_IN": f"{self.lead_in:g} mm" if self.lead_in else "",
            "OVERCUT": f"{self.overcut:g} mm" if self.overcut else "",
            "TABS": width if self.tabs else "",
        }
        return {name: text for name, text in said.items() if text}


PLAIN = Entries()
