"""The custom properties that every cut file carries: what it is of, and how it was cut."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sbafab.cutting.dxf_write import DxfProfile
from sbafab.laminate.films import Material

UNCALIBRATED = "uncalibrated: nominal edges"
COMPENSATED = "compensated"
PTFE_WARNING = (
    "Hot PTFE gives off toxic fumes (COF2, HF): cut it with a laser only on a machine whose owner "
    "permits PTFE, or use a drag knife."
)


@dataclass(frozen=True)
class CutSettings:
    """What the cut files need to know beside the laminate.

    ``kerf_widths``: full width in mm by material, None or absent where it was not measured.
    ``waived``: names of the waived rules. ``chord_error`` in mm counts for profile "chords" only.
    ``generator``: program and version, for example ``sbafab 1.0.0``.
    """

    design: str
    design_sha256: str
    kerf_widths: Mapping[str, float | None] = field(default_factory=dict)
    waived: tuple[str, ...] = ()
    profile: DxfProfile = "bulges"
    chord_error: float = 0.005
    generator: str = "sbafab"

    def kerf_width(self, material: Material) -> float | None:
        return self.kerf_widths.get(material)


def file_properties(settings: CutSettings, material: Material, pattern: str) -> dict[str, str]:
    """Custom properties of the cut file of one pattern, equal for all layers that share it."""
    kerf = settings.kerf_width(material)
    properties = {
        "DESIGN": settings.design,
        "DESIGN_SHA256": settings.design_sha256,
        "PATTERN": pattern,
        "MATERIAL": material,
        "UNITS": "mm",
        "KERF_STATE": UNCALIBRATED if kerf is None else COMPENSATED,
        "KERF_WIDTH": "none" if kerf is None else f"{kerf:g}",
        "WAIVED": ", ".join(settings.waived) or "none",
        "GENERATOR": settings.generator,
    }
    if material == "PTFE":
        properties["WARNING"] = PTFE_WARNING
    return properties
