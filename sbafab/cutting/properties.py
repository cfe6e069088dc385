"""The custom properties that every cut file carries: what it is of, and how it was cut."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sbafab.cutting.dxf_write import DxfProfile
from sbafab.errors import OutputError
from sbafab.laminate.films import Material

UNCALIBRATED = "uncalibrated: nominal edges"
COMPENSATED = "compensated"
CHORDS = "chords within"
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
    properties = _properties(settings, material, pattern, settings.kerf_width(material))
    if material == "PTFE":
        properties["WARNING"] = PTFE_WARNING
    return properties


def fixture_properties(settings: CutSettings) -> dict[str, str]:
    """Custom properties of the pin plate's cut file; its edges are nominal."""
    return _properties(settings, "plate", "fixture", None)


def _properties(
    settings: CutSettings, material: str, pattern: str, kerf: float | None
) -> dict[str, str]:
    return {
        "DESIGN": settings.design,
        "DESIGN_SHA256": settings.design_sha256,
        "PATTERN": pattern,
        "MATERIAL": material,
        "UNITS": "mm",
        "KERF_STATE": UNCALIBRATED if kerf is None else COMPENSATED,
        "KERF_WIDTH": "none" if kerf is None else f"{kerf:g}",
        "WAIVED": ", ".join(settings.waived) or "none",
        "GENERATOR": settings.generator,
        **_curves(settings),
    }


def _curves(settings: CutSettings) -> dict[str, str]:
    """Nothing for true arcs: only what departs from them has to be said."""
    if settings.profile != "chords":
        return {}
    return {"CURVES": f"{CHORDS} {settings.chord_error:g} mm"}


def chord_error_of(properties: Mapping[str, str]) -> float:
    """The sagitta in mm within which a file says its chords stay; 0 where it claims true arcs.

    Raises OutputError where the property cannot be understood.
    """
    said = properties.get("CURVES")
    if said is None:
        return 0.0
    number = said.removeprefix(CHORDS).removesuffix(" mm")
    try:
        error = float(number)
    except ValueError:
        error = 0.0
    if not 0 < error <= 0.1:
        raise OutputError(
            f"custom property CURVES is {said!r}, not {CHORDS} up to 0.1 mm; write it anew."
        )
    return error
