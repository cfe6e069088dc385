"""Seams and folds on the technician's pages, in order among the press steps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sbafab.cutting.seam_files import seam_path, shift_words
from sbafab.geometry.edges import Bounds, Point, box_round
from sbafab.geometry.region import Region, chain_data, coord, path_data, union
from sbafab.laminate.films import ink
from sbafab.laminate.folding import distance_from, unfolded
from sbafab.laminate.joints import Fold, Seam
from sbafab.laminate.laminate import Laminate, Layer
from sbafab.pressing.schedule import SeamStep, layers_in_words
from sbafab.reports import drawing as draw
from sbafab.reports.traveller import units
from sbafab.reports.traveller.job import Action, Work
from sbafab.reports.traveller.lay_up import EQUAL, face_down
from sbafab.reports.traveller.shapes import Picture, label
from sbafab.reports.traveller.shapes import flat as flat_matrix
from sbafab.reports.underlay import SEAMS

WIDEST = 90.0
"""Longer side of a picture on the page, mm."""
RIM, PAST_FOLD, NUMBER = 5.0, 3.0, 3.5
"""mm on the page: free round a picture, of a fold line past the part, and letters of numbers."""
HOT_TIP = (
    "Lay the films on a heat-proof mat, such as silicone or glass cloth with PTFE, and a release "
    "film of PTFE over them: the tip runs on that. (Our advice, not tried.)"
)
START = 0.9
"""mm on the page: radius of the dot where a path begins."""
SEAM_INK, PATH_INK = "#d1495b", "#1a1a1a"


@dataclass(frozen=True)
class JointPage:
    """One seam or fold on the page: ``dials`` by name, with blanks for values that are not stated;
    ``picture`` is inline SVG.
    """

    step: int
    title: str
    reason: str
    dials: tuple[tuple[str, str], ...]
    blanks: tuple[str, ...]
    picture: str
    actions: tuple[Action, ...]


def joint_pages(work: Work) -> list[JointPage]:
    """Return the seams and folds of a laminate, by step number."""
    pages = [*_seams(work), *_folds(work)]
    return sorted(pages, key=lambda page: page.step)


def _seams(work: Work) -> Iterator[JointPage]:
    by_name = {seam.name: seam for seam in work.laminate.seams}
    for step in work.schedule.seams:
        seam = by_name[step.seam]
        blanks = ["Speed", "Pressure"]
        dials = [
            ("Tool", f"{step.tool}, {units.millimetres(step.width_mm)} wide"),
            ("Seam", f"{step.kind}, {units.millimetres(step.length_mm)} long"),
            ("Joins", f"layers {step.joins[0]} and {step.joins[1]}"),
        ]
        if step.temperature_c is None:
            blanks.insert(0, "Temperature")
        else:
            dials.append(("Bonds at", units.temperature(step.temperature_c)))
        picture = _picture(work.laminate, step, seam)
        yield JointPage(
            step.step,
            step.title,
            step.reason,
            tuple(dials),
            tuple(blanks),
            picture,
            tuple(_seam_actions(work, step)),
        )


def _seam_actions(work: Work, step: SeamStep) -> Iterator[Action]:
    yield from _laid_for_a_seam(work.laminate, step)
    if step.tool == "hot-tip":
        yield Action(HOT_TIP)
    yield Action(
        f"Try the {step.tool} on scrap of the same films until the seam holds and is "
        f"{units.millimetres(step.width_mm)} wide; write temperature, speed and pressure above."
    )
    seam = next(seam for seam in work.laminate.seams if seam.name == step.seam)
    path = seam_path(seam)
    mirrored = ", mirrored left to right" if step.from_below else ""
    yield Action(
        f"Print {SEAMS} at 100 %{mirrored}, and measure its bars. Lay the films over it, edges on "
        f"the blue lines, and mark the path of step {step.step} on them: it begins at the circle "
        f"(the dot of the picture), {_start_words(work.laminate, step, seam)}. A machine takes the "
        f"file below{mirrored}."
    )
    offset = work.design.seam_offsets.get(seam.tool)
    if offset is not None:
        x, y = offset
        yield Action(
            f"The {shift_words(seam.tool, offset)}: the tool is "
            f"{x:.2f}, {y:.2f} mm from its machine's head. Set that head, not the tool, on the "
            "cross of the file."
        )
    yield Action(f"Follow the path ({path}) with the middle of the tool, once, without a stop.")
    yield Action("Look along the seam: no gap, no hole, nothing bonded beside it.")


def _laid_for_a_seam(laminate: Laminate, step: SeamStep) -> Iterator[Action]:
    """Yield the laying of a seam's films: over or under the films so far, or on the turned work."""
    held = [index for index in step.layers if index not in step.adds]
    if step.from_below:
        yield Action(
            f"Turn the work over, left to right, layer {max(held)} down: from above the tool would "
            "melt what lies over the seam. The picture shows it so, and the path is mirrored left "
            "to right."
        )
    for index in sorted(step.adds, reverse=step.from_below):
        layer = laminate.layer(index)
        what = f"{layer.film.material} {layer.role.replace('-', ' ')} {layer.pattern}"
        face = _upper_face_down(layer) if step.from_below else face_down(layer)
        is_under = bool(held) and index < min(held) and not step.from_below
        under = "; then what is joined on it, as it was" if is_under else ""
        yield Action(f"Lay layer {index}: {what}{face}, by eye{under}.", (index,))


def _upper_face_down(layer: Layer) -> str:
    """Return the face of a layer that is laid down when the work is turned over."""
    upper, lower = layer.faces
    if upper != lower:
        return f", {upper} face down"
    return "" if layer.turned else ", upper face down"


def _start_words(laminate: Laminate, step: SeamStep, seam: Seam) -> str:
    """Return the start of a path from the left and lower edge of the films as they lie."""
    x, y = seam.path[0][0].start
    low_x, low_y, high_x, _ = _box([laminate.layer(index).profile for index in step.layers])
    if step.from_below:
        x, low_x = -x, -high_x
    across = f"{_apart(x - low_x)} {'right' if x >= low_x else 'left'} of the films' left edge"
    return f"{across} and {_apart(y - low_y)} {'above' if y >= low_y else 'below'} their lower edge"


def _apart(distance: float) -> str:
    return f"{abs(distance):.1f} mm"


def _folds(work: Work) -> Iterator[JointPage]:
    by_layers = {(fold.lower, fold.upper): fold for fold in work.laminate.folds}
    for step in work.schedule.folds:
        flat = _opened(work.laminate, by_layers[step.layers])
        lower, upper = step.layers
        masks = range(lower + 1, upper)
        laid = f" Lay {layers_in_words(tuple(masks))} on half {lower}." if masks else ""
        face = face_down(work.laminate.layer(lower))
        words = f"{flat.lengths[0]:.1f} mm from {flat.ends[0]}"
        yield JointPage(
            step.step,
            step.title,
            step.reason,
            (("Fold line", f"{words}, and {flat.lengths[1]:.1f} mm from {flat.ends[1]}"),),
            (),
            _fold_picture(work.laminate, flat, f"fold-{step.step}"),
            (
                Action(f"Lay the flat part down as in the picture{face}.{laid}"),
                Action(f"Mark the fold line with a pen: fold {words}."),
                Action(
                    f"Fold half {upper} up along the line and over onto half {lower}, which stays "
                    "where it lies.",
                    tuple(range(lower, upper + 1)),
                ),
                Action("Press the fold down with a fingertip; both edges lie on each other."),
            ),
        )


class _Opened(NamedTuple):
    """Two halves of a film unfolded about their fold line, which runs along x through (0, 0).

    The lower half lies above the line on the page. ``lengths`` are of the lower and the upper half,
    perpendicular to the line, mm; ``ends`` describe where they end.
    """

    fold: Fold
    halves: tuple[Region, Region]
    lengths: tuple[float, float]
    ends: tuple[str, str]


def _opened(laminate: Laminate, fold: Fold) -> _Opened:
    (x0, y0), (x1, y1) = fold.line
    degrees = math.degrees(math.atan2(y1 - y0, x1 - x0))
    lower, upper = (laminate.layer(index).profile for index in (fold.lower, fold.upper))
    flat = lower, unfolded(upper, [fold.line])
    above, below = (half.moved(-x0, -y0).turned(-degrees) for half in flat)
    lengths = above.bounds[3], -below.bounds[1]
    tabs = [distance_from(fold.line, inlet.mouth) for inlet in laminate.inlets]

    def end(index: int, length: float) -> str:
        is_tab = any(abs(length - tab) < EQUAL for tab in tabs)
        return f"the tab's end of half {index}" if is_tab else f"the far edge of half {index}"

    ends = end(fold.lower, lengths[0]), end(fold.upper, lengths[1])
    return _Opened(fold, (above, below), lengths, ends)


def _fold_picture(laminate: Laminate, flat: _Opened, name: str) -> str:
    """Return the flat part from above: a dash-dot fold line, both halves' numbers and lengths."""
    low_x, low_y, high_x, high_y = _box(flat.halves)
    scale = min(WIDEST / max(high_x - low_x, high_y - low_y), 4.0)
    width, height = scale * (high_x - low_x) + 4 * RIM, scale * (high_y - low_y) + 2 * RIM
    picture = Picture(name, width, height, f"flat part of {_names(flat)}, fold line dash-dot")

    def at(x: float, y: float) -> Point:
        return RIM + scale * (x - low_x), RIM + scale * (high_y - y)

    colours = ink(laminate.layer(flat.fold.lower).film)
    matrix = " ".join(map(coord, flat_matrix(scale, at(0.0, 0.0))))
    for half in flat.halves:
        picture.add(
            f'<path d="{path_data(half)}" transform="matrix({matrix})" fill="{colours.fill}" '
            'fill-rule="evenodd"/>',
        )
    whole = union(flat.halves)
    picture.add(
        f'<path d="{path_data(whole)}" transform="matrix({matrix})" fill="none" '
        f'stroke="{colours.line}" stroke-width="{coord(0.22 / scale)}"/>'
    )
    (left, y), (right, _) = at(low_x, 0.0), at(high_x, 0.0)
    ends = f"M{coord(left - PAST_FOLD)} {coord(y)}L{coord(right + PAST_FOLD)} {coord(y)}"
    picture.add(f'<path d="{ends}" {draw.fold_style()}/>')
    numbers = flat.fold.lower, flat.fold.upper
    for number, way, length in zip(numbers, (1, -1), flat.lengths, strict=True):
        middle = (low_x + high_x) / 2
        picture.add(label(at(middle, way * length / 2), f"half {number}", NUMBER))
        far = at(high_x, way * length)
        tips = (far, (right, y)) if way > 0 else ((right, y), far)
        picture.add(*draw.dimension(*tips, f"{length:.1f}", (1.0, 0.0), RIM))
    return picture.svg()


def _names(flat: _Opened) -> str:
    return f"halves {flat.fold.lower} and {flat.fold.upper}"


def _box(regions: Sequence[Region]) -> Bounds:
    return box_round([region.bounds for region in regions])


def _picture(laminate: Laminate, step: SeamStep, seam: Seam) -> str:
    """Return the films as they lie, the seam at its width, and its path."""
    stack = [laminate.layer(index) for index in step.layers]
    words = f"Seam {step.seam} {'from below, turned over' if step.from_below else 'from above'}"
    low_x, low_y, high_x, high_y = _box([*(layer.profile for layer in stack), seam.region])
    margin = 0.03 * max(high_x - low_x, high_y - low_y)
    width, height = high_x - low_x + 2 * margin, high_y - low_y + 2 * margin
    scale = min(WIDEST / max(width, height), 4.0)
    films = "".join(
        f'<path d="{path_data(layer.profile)}" fill="{ink(layer.film).fill}" fill-opacity="0.45" '
        f'stroke="{ink(layer.film).line}"/>'
        for layer in stack
    )
    path = "".join(chain_data(chain) for chain in seam.path)
    x, y = map(coord, seam.path[0][0].start)
    left, over = (-high_x, -1) if step.from_below else (low_x, 1)
    box = " ".join(map(coord, (left - margin, -high_y - margin, width, height)))
    return (
        f'<svg class="picture" role="img" aria-label="{words}" viewBox="{box}" '
        f'width="{coord(width * scale)}mm" height="{coord(height * scale)}mm">'
        f'<g transform="scale({over} -1)" fill-rule="evenodd" stroke-width="{coord(0.2 / scale)}">'
        f'{films}<path d="{path_data(seam.region)}" fill="{SEAM_INK}" fill-opacity="0.5"/>'
        f'<path d="{path}" fill="none" stroke="{PATH_INK}"/>'
        f'<circle cx="{x}" cy="{y}" r="{coord(START / scale)}" fill="{PATH_INK}"/></g></svg>'
    )
