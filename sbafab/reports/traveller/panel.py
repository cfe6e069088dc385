"""The section on registered sheets: cut, weed, tack, stack, press, cut free."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from sbafab.cutting.properties import CUT_OUTER
from sbafab.cutting.second_cut import PATH as SECOND_CUT
from sbafab.geometry.edges import Point
from sbafab.geometry.region import Region, coord, path_data
from sbafab.laminate.films import ink
from sbafab.laminate.laminate import Laminate, Layer, Pin, SheetPanel
from sbafab.pressing.schedule import joined_words
from sbafab.reports import drawing as draw
from sbafab.reports.traveller import bench, process, units
from sbafab.reports.traveller.bill import (
    PAPER_MINUTES,
    Cut,
    Item,
    Time,
    bill,
    cut_list,
)
from sbafab.reports.traveller.job import Action, Work
from sbafab.reports.traveller.process import StepPage
from sbafab.reports.traveller.shapes import Picture, label

WIDEST, TALLEST = 62.0, 74.0
EDGE, FOOT = 3.0, 5.0
SECOND = "#c8008c"
UNTRIED = (
    "No bench has tried this way of building. It follows how laminates are made that pop up: try "
    "one copy of two balloons first, and look at every step for what the page does not foresee."
)


def chapter(work: Work) -> dict[str, Any]:
    """Return the values of ``panel.html.j2``, and those that replace the pages for single parts."""
    panel = work.laminate.panel
    if panel is None:
        return {"panel": None}
    return {
        "panel": panel,
        "panel_size": units.size(*panel.size),
        "panel_untried": UNTRIED,
        "panel_kpa": max(step.film_kpa for step in work.schedule.steps),
        "panel_pictures": _pictures(work.laminate, panel),
        "panel_actions": _preparing(work, panel),
        "step_pages": _step_pages(work, panel),
        "cut_free": _cut_free(panel),
        "bill": _bill(work, panel),
        "cuts": _cuts(work, panel),
        "times": _times(work, panel),
    }


def _pairs(laminate: Laminate) -> list[tuple[Layer, tuple[Layer, ...]]]:
    """Return every film with the masks that lie on it."""
    pairs: list[tuple[Layer, tuple[Layer, ...]]] = []
    for layer in laminate.layers:
        if layer.is_mask and pairs:
            film, masks = pairs[-1]
            pairs[-1] = film, (*masks, layer)
        elif not layer.is_mask:
            pairs.append((layer, ()))
    return pairs


def _preparing(work: Work, panel: SheetPanel) -> list[Action]:
    """Return all that is done to the sheets before the first press step."""
    design, laminate = work.design, work.laminate
    pairs = [(film, masks) for film, masks in _pairs(laminate) if masks]
    ticks = tuple(
        f"{joined_words([str(mask.index) for mask in masks])} on {film.index}"
        for film, masks in pairs
    )
    tack = units.minutes(design.panel.tack_minutes)
    return [
        *bench.before_first_cut(),
        Action(_carrier(work)),
        Action(
            f"Stick {design.panel.carrier} on the back of every PTFE sheet. It stops short of the "
            "corners, so that it covers no pin hole."
        ),
        Action(
            "Cut every file in layers/ once for each batch, and a pattern's file once more for "
            "each of its spares, which the list above counts. Mask sheets lie PTFE side up and are "
            "drawn turned over: cut through the PTFE, not through the transfer film. Film sheets "
            "come off with their parts held by bridges: lift them by the edge."
        ),
        Action(
            "Write its layer's number on the edge of every sheet. Equal patterns have equal files, "
            "and the number tells where the sheet goes."
        ),
        Action(
            "Weed the mask sheets: take off the rings round the masks, the discs out of their "
            "bores and out of the pin holes. Masks and the sheet round them stay on the transfer "
            "film."
        ),
        Action(
            f"Pins into the plate, at the height for tacks: {_tack_pins(work)}. Prick a release "
            "film over them. Tack the masks, a film at a time: the film sheet on the pins, cut "
            "corner over the plate's, its mask sheet face down on it, a release film and the press "
            f"pad on top. The plate goes in cold each time: press for {tack} at "
            f"{units.temperature(design.press.temperature_c)} (ours), counted from when the plate "
            "is hot, let it cool until it can be touched, peel off the transfer film flat and "
            "slowly. Masks and PTFE sheet stay on the film.",
            tuple(mask.index for _, masks in pairs for mask in masks),
            ticks,
        ),
        Action(
            "Check every sheet against its picture: each mask lies inside its film's window, none "
            "is missing, none has folded."
        ),
    ]


def _step_pages(work: Work, panel: SheetPanel) -> list[StepPage]:
    """Return the press steps with the actions on sheets, and the panel in place of one copy."""
    pages = process.step_pages(work)
    panel_pages = []
    for page in pages:
        last = page is pages[-1]
        plan = _picture(
            work.laminate,
            panel,
            work.laminate.layers[-1 if last else 0],
            f"plan-{page.step.step}",
            "the sheets from above on their pins",
        )
        actions = tuple(_pressing(work, page, last))
        panel_pages.append(replace(page, plan=plan, actions=actions))
    return panel_pages


def _pressing(work: Work, page: StepPage, last: bool) -> list[Action]:
    step = page.step
    films = [pair for pair in _pairs(work.laminate) if pair[0].index in step.adds]
    ticks = tuple(
        f"{film.index} with {joined_words([str(mask.index) for mask in masks])}"
        if masks
        else str(film.index)
        for film, masks in films
    )
    lay = (
        "Lay the film sheets on the pins, lowest first, each with its masks on its upper side, cut "
        "corner over the plate's."
    )
    if last:
        lay = f"Lay the sheet of layer {films[0][0].index}, the cap, on the pins over the stack."
    start = [
        Action(
            "Base plate down, cold, cut corner at the back right; pins in on their shoulders, "
            "heights gauged (above); prick a release film over them."
        )
    ]
    end = [
        Action("The stack stays on the plate and its pins."),
    ]
    if last:
        start = []
        end = [
            Action(
                "Once the stack is cold: pad off, upper release film back on itself. Pins out: "
                "push them up from below through their push-out holes until their seats are free, "
                "the stack held down round them, and draw them with pliers."
            ),
            Action("Take off the lower release film. You now hold all sheets as one stack."),
        ]
    return [
        *start,
        Action(lay, tuple(i for i in step.adds), ticks if len(ticks) > 1 else ()),
        Action(
            "Check: every sheet's cut corner lies over the next, no sheet is stretched between its "
            "pins or folded, and every pin reaches through the highest sheet."
        ),
        process.closing(work, step),
        Action("Take it out on its plate and let it cool flat before you touch it."),
        *end,
    ]


def _cut_free(panel: SheetPanel) -> list[Action]:
    many = units.count(len(panel.places), "actuator")
    return [
        Action(
            "Fix the stack flat on the laser's bed, the cap up, by tape or magnets all along its "
            "rim, clear of the slots; air assist off or low, for what is freed is loose. Lay "
            f"{SECOND_CUT} by the "
            f"{len(panel.fiducials)} fiducials: a cross on REFERENCE stands in the middle of each "
            "hole. Check all of them before you cut."
        ),
        Action(
            f"Second cut: the slots on {CUT_OUTER} go through all films and the edges of the "
            "masks. PTFE is among what is cut: see the warnings. A sharp blade along the inner "
            "edge of every slot does the same."
        ),
        Action(f"Lift out {many}; the sheets round them come off one by one."),
        Action(
            "Part the balloons at the stubs with a blade's tip: a laser may have welded the films' "
            "cut edges to each other there."
        ),
        Action("Look through every lumen and into every tab: no scrap may be left in either."),
        Action("Leave the masks in their pockets."),
    ]


def _bill(work: Work, panel: SheetPanel) -> list[Item]:
    """Return the bill with sheets in place of parts, and the film that carries the masks."""
    items = []
    for item in bill(work):
        material = item.name.removesuffix(" film")
        material_layers = [
            layer for layer in work.laminate.layers if layer.film.material == material
        ]
        if material_layers:
            number_of = len(material_layers) * panel.batches
            number_of += sum(
                _spare_sheets(work, panel, pattern)
                for pattern in dict.fromkeys(layer.pattern for layer in material_layers)
            )
            rim = 2 * bench.RIM
            least = units.size(panel.size[0] + rim, panel.size[1] + rim)
            needed = f"{units.count(number_of, 'sheet')} of at least {least}"
            items.append(replace(item, quantity=needed))
        else:
            items.append(item)
    masks = sum(
        len(layers) * panel.batches + _spare_sheets(work, panel, pattern)
        for pattern, layers in work.laminate.patterns.items()
        if layers[0].is_mask
    )
    words = f"{work.design.panel.carrier}; carries the masks of one sheet each, off in the end"
    return [*items, Item("Carrier", words, units.count(masks, "piece"))]


def _cuts(work: Work, panel: SheetPanel) -> list[Cut]:
    """Return the cut list: a sheet for every layer of a pattern and every batch."""
    rows = []
    for row in cut_list(work):
        layers = work.laminate.patterns[row.pattern]
        sheet = work.laminate.first_cut(layers[0])
        length = sum(contour.length for contour in sheet.contours)
        rows.append(
            replace(
                row,
                count=len(layers) * panel.batches,
                pieces=1,
                spares=_spare_sheets(work, panel, row.pattern),
                cut_length=length,
            )
        )
    return rows


def _spare_sheets(work: Work, panel: SheetPanel, pattern: str) -> int:
    """Return the number of spare sheets of a pattern, for all batches together."""
    layers = work.laminate.patterns[pattern]
    return work.design.order.spare_parts(len(layers) * panel.batches)


def _times(work: Work, panel: SheetPanel) -> list[Time]:
    """Return the times of a batch; the paper's handling is of one actuator, and is not known of
    many.
    """
    plan, copies = work.schedule, len(panel.places)
    steps = " + ".join(units.plain(step.minutes) for step in plan.steps)
    tacking, pressed = plan.tacking, plan.total_press_minutes
    assert tacking is not None
    total = None if pressed is None else pressed + tacking.total_minutes
    each = None if total is None else total / copies
    many = units.count(copies, "actuator")
    return [
        Time("In the press", units.minutes(plan.total_press_minutes), f"{steps} min, one batch"),
        Time(
            "Tacking, from cold to cold",
            f"{tacking.total_minutes:.0f} min = {units.hours(tacking.total_minutes)}",
            f"{tacking.sheets} mask sheets, each {tacking.warm_minutes:g} min to warm the plate, "
            f"{tacking.press_minutes:g} min pressed and {tacking.cool_minutes:g} min to cool it, "
            f"one after the other on one plate; {tacking.basis}. Several plates in turn, or one "
            "cooled between cold blocks of metal, take less: how much nobody has tried",
        ),
        Time(
            "Both, one batch",
            units.whole_minutes(total),
            f"{many}, {units.minutes(each)} each",
        ),
        Time(
            "Handling",
            "not known",
            "cutting, weeding, stacking sheets, tubes; no bench has tried it",
        ),
        Time("The paper", f"{PAPER_MINUTES:g} min", "one actuator of single parts, in all"),
    ]


def _carrier(work: Work) -> str:
    """Return the properties of the transfer film to be known before it is pressed, blanks for
    unknown.
    """
    design = work.design.panel
    adhesive = design.carrier_adhesive or "________________"
    limit = "________ °C" if design.carrier_limit_c is None else f"{design.carrier_limit_c:g} °C"
    return (
        f"What carries the masks: {design.carrier}, product ________________, adhesive {adhesive}, "
        f"rated for {limit} by its maker. It goes into the press at "
        f"{units.temperature(work.design.press.temperature_c)}: without a rating above that it is "
        "not used. Acrylic and rubber adhesives hardly hold PTFE; silicone adhesives on polyester "
        "or polyimide are sold for such temperatures. Which of them holds the masks, and lets them "
        "go after the tack, nobody has tried: try one sheet first."
    )


def _tack_pins(work: Work) -> str:
    """Return the height of the corner pins for the tacks: far lower than for the whole stack."""
    tacking = work.schedule.tacking
    assert tacking is not None
    stands = joined_words(
        list(dict.fromkeys(units.millimetres(pin.stands_mm) for pin in tacking.pins))
    )
    lengths = joined_words(
        list(dict.fromkeys(units.millimetres(pin.length_mm) for pin in tacking.pins))
    )
    beneath = tacking.stack_mm + work.design.press.release_thickness
    out = units.millimetres(max(pin.stands_mm for pin in tacking.pins) - beneath)
    return (
        f"pins of {lengths} stand {stands} over the plate (one film with its masks is "
        f"{units.millimetres(tacking.stack_mm)} high; the pins press {out} into the pad, those for "
        "the whole stack would more)"
    )


def _pictures(laminate: Laminate, panel: SheetPanel) -> list[tuple[str, str]]:
    """Return one film sheet and one mask sheet as they come from the laser, with captions."""
    film = laminate.layers[0]
    mask = next(layer for layer in laminate.layers if layer.is_mask)
    return [
        (
            _picture(laminate, panel, film, "panel-film", "a film sheet after the first cut"),
            f"Layer {film.index}, a film sheet after the first cut. Pink: what the second cut "
            "takes out of the bridges.",
        ),
        (
            _picture(laminate, panel, mask, "panel-mask", "a mask sheet on its film"),
            f"Layer {mask.index}, a mask sheet as it lies on its film; its file is drawn turned "
            "over.",
        ),
    ]


def _picture(laminate: Laminate, panel: SheetPanel, layer: Layer, name: str, words: str) -> str:
    """Return a sheet from above, its pins filled, crosses in its fiducials, its slots pink."""
    width, length = panel.size
    scale = min(WIDEST / width, TALLEST / length)
    x0, _, _, y1 = panel.outline.bounds
    picture = Picture(name, width * scale + 2 * EDGE, length * scale + 2 * EDGE + FOOT, words)

    def at(p: Point) -> Point:
        return EDGE + (p[0] - x0) * scale, EDGE + (y1 - p[1]) * scale

    def shape(region: Region, fill: str, line: str) -> str:
        drawn = path_data(region.mapped(at, scale, mirror=True))
        return (
            f'<path d="{drawn}" fill="{fill}" fill-rule="evenodd" stroke="{line}" '
            'stroke-width="0.18"/>'
        )

    fill, line = ink(layer.film)
    picture.add(shape(panel.sheets[layer.index - 1], fill, line))
    if not layer.is_mask:
        picture.add(shape(panel.second, SECOND, SECOND))
    for pin in laminate.pins:
        picture.add(*_pin(pin, at(pin.centre), scale))
    for p in panel.fiducials:
        x, y = at(p)
        picture.add(
            draw.line([(x - 1.2, y), (x + 1.2, y)], width=0.2),
            draw.line([(x, y - 1.2), (x, y + 1.2)], width=0.2),
        )
    foot = f"seen from above, 1 : {1 / scale:.2f}; filled: pins; crosses: fiducials"
    picture.add(draw.text((EDGE, picture.height - 1.2), foot, size=2.2))
    return picture.svg()


def _pin(pin: Pin, at: Point, scale: float) -> tuple[str, str]:
    x, y = at
    r = pin.diameter * scale / 2
    return (
        f'<circle cx="{coord(x)}" cy="{coord(y)}" r="{coord(r)}" fill="{draw.DARK}"/>',
        label((x, y + r + 2.4), pin.name, 1.9),
    )
