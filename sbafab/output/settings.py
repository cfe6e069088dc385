"""A design's sections as the settings that rules, cutting and pressing take."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sbafab import __version__
from sbafab.actuators.stacking import used_films
from sbafab.cutting.dxf_write import TRUE_ARCS, Curves
from sbafab.cutting.properties import CutSettings
from sbafab.design.films import KerfWidth, Sheet, material
from sbafab.design.records import Design
from sbafab.design.writing import design_sha256
from sbafab.geometry.beam import Kerf
from sbafab.laminate.films import Material
from sbafab.laminate.laminate import Laminate
from sbafab.nesting.records import TURNS, Stock
from sbafab.pressing import dowels
from sbafab.pressing.build_up import Pad
from sbafab.pressing.schedule import PressSettings, plate_holes
from sbafab.rules.limits import Limits, Tolerances
from sbafab.rules.lowered import lowered

if TYPE_CHECKING:
    from sbafab.cutting.sheets import Machine

GENERATOR = f"sbafab {__version__}"


def kerf_widths(design: Design) -> dict[Material, Kerf | None]:
    """Full kerf width (or that along x and y) by material, None where it was not measured."""
    widths = _kerfs(design).items()
    return {name: None if isinstance(kerf, str) else kerf for name, kerf in widths}


def _kerfs(design: Design) -> dict[Material, KerfWidth]:
    others = {material(name): film.kerf for name, film in design.films.others.items()}
    return {"TPE": design.laser.kerf_tpe, "PTFE": design.laser.kerf_ptfe, **others}


def warnings(design: Design) -> dict[Material, str]:
    """What cut files of a film must say, by material."""
    return {name: film.warning for name, film in used_films(design).items() if film.warning}


def limits(design: Design) -> Limits:
    on_pins, on_one = design.pin_error, design.lone_pin_error
    return Limits(
        bond_width=design.rules.bond_width,
        mask_overhang=design.rules.mask_overhang,
        least_feature=design.laser.least_feature,
        kerf={name: kerf for name, kerf in kerf_widths(design).items() if kerf is not None},
        heated_width=design.press.platen_width,
        heated_length=design.press.platen_length,
        validated_balloons=design.rules.validated_balloons,
        tolerances=Tolerances(
            cutting=design.registration.cutting_error,
            pin=on_pins,
            lone_pin=on_one if on_one < on_pins else None,
            placement=design.registration.hand_placement,
            turn=design.registration.hand_turn,
            sheet=design.panel.sheet_error,
            second_cut=design.panel.second_cut_error,
        ),
        unknown_kerf=design.laser.unknown_kerf,
        pin_stretch=design.registration.pin_stretch,
        worst_bond_width=design.rules.worst_bond_width,
        worst_mask_overhang=design.rules.worst_mask_overhang,
        target_yield=design.rules.target_yield,
        yield_builds=design.rules.yield_builds,
        waive=frozenset(design.rules.waive),
    )


def cut_settings(
    design: Design, waived: tuple[str, ...], curves: Curves = TRUE_ARCS
) -> CutSettings:
    return CutSettings(
        design=design.name,
        design_sha256=design_sha256(design),
        kerf_widths=kerf_widths(design),
        waived=waived,
        lowered=lowered(limits(design)),
        curves=curves,
        generator=GENERATOR,
        warnings=warnings(design),
        platen=(design.press.platen_width, design.press.platen_length),
    )


def press_settings(design: Design) -> PressSettings:
    press = design.press
    return PressSettings(
        temperature_c=press.temperature_c,
        pressure_kpa=press.pressure_kpa,
        platen=(press.platen_width, press.platen_length),
        flash_bottom=press.flash_bottom_minutes,
        bond_bottom=press.bond_bottom_minutes,
        flash_middle=press.flash_middle_minutes,
        bond_all=press.bond_all_minutes,
        validated_balloons=design.rules.validated_balloons,
        pad=Pad(press.pad_material, press.pad_thickness, press.pad_hardness),
        plate_material=press.plate_material,
        plate_thickness=press.plate_thickness,
        release_film=press.release_film,
        release_thickness=press.release_thickness,
        underlay_thickness=press.underlay_thickness,
        pin_standard=design.registration.pin_standard,
        pin_lengths=design.registration.pin_lengths,
        plate_made_by=design.registration.plate_made_by,
        tack=design.panel.tack_minutes,
        carrier_limit=design.panel.carrier_limit_c,
    )


def hole_notes(design: Design, laminate: Laminate) -> tuple[str, ...]:
    """Return what a shop must know of the base plate's holes, line by line; none without pins.

    Raises DesignError where no pin or plate does.
    """
    if not laminate.pins:
        return ()
    holes = plate_holes(laminate, press_settings(design))
    return dowels.hole_notes(laminate.pins, holes, design.registration.plate_made_by)


def machine(design: Design) -> Machine:
    laser = design.laser
    from sbafab.cutting.sheets import Machine

    return Machine(
        cut_speed=laser.cut_speed,
        travel_speed=laser.travel_speed,
        pierce_seconds=laser.pierce_seconds,
        heat_distance=laser.heat_distance,
    )


def stocks(design: Design) -> dict[Material, Stock]:
    """The film sheets by material."""
    sheets = {"TPE": design.sheets.tpe, "PTFE": design.sheets.ptfe}
    sheets |= {material(name): film.sheet for name, film in design.films.others.items()}
    return {name: _stock(sheets[name], kerf) for name, kerf in _kerfs(design).items()}


def _stock(sheet: Sheet, kerf: object) -> Stock:
    return Stock(
        width=sheet.width,
        length=sheet.length,
        border=sheet.border,
        spacing=sheet.spacing,
        pins=sheet.pins,
        most=sheet.most,
        roll=sheet.roll,
        turns=(0, 2) if isinstance(kerf, tuple) else TURNS,
    )
