"""Entry settings: how the beam begins and ends a contour, and which tabs hold a part."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Entries:
    """Lead-ins, overcuts and tabs of a film's contours, in mm; 0 turns one off.

    Each outline has ``tabs``, each ``tab_width`` of film wide; the beam skips ``gap``, which is
    wider by its ``kerf``. Lead-ins keep ``clearance`` from everything but their own contour.
    ``key`` is the design's table with these keys, for messages.
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
        """Text on the entries for machine files."""
        width = f"{self.tabs} an outline, {self.tab_width:g} mm wide, {self.gap:g} mm uncut"
        said = {
            "LEAD_IN": f"{self.lead_in:g} mm" if self.lead_in else "",
            "OVERCUT": f"{self.overcut:g} mm" if self.overcut else "",
            "TABS": width if self.tabs else "",
        }
        return {name: text for name, text in said.items() if text}


PLAIN = Entries()
