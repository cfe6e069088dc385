"""Seams and folds on the technician's pages, in their order among the press steps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sbafab.geometry.region import chain_data, coord, path_data
from sbafab.laminate.films import ink
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.schedule import FoldStep, SeamStep
from sbafab.reports.traveller import units
from sbafab.reports.traveller.job import Action, Work
from sbafab.reports.traveller.lay_up import face_down

WIDEST = 90.0
"""mm: the longer side of a picture on the page."""
SEAM_INK, PATH_INK = "#d1495b", "#1a1a1a"


@dataclass(frozen=True)
class JointPage:
    """One seam or fold as it stands on the page: ``dials`` by name, blanks where nobody stated a
    value; ``picture`` is inline SVG.
    """

    step: int
    title: str
    reason: str
    dials: tuple[tuple[str, str], ...]
    blanks: tuple[str, ...]
    picture: str
    actions: tuple[Action, ...]


def joint_pages(work: Work) -> list[JointPage]:
    """Return the seams and folds of a laminate, by the number of their step."""
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
        picture = _picture(work.laminate, f"Seam {step.seam} from above", step.layers, seam)
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
    for index in step.adds:
        layer = work.laminate.layer(index)
        what = f"{layer.film.material} {layer.role.replace('-', ' ')} {layer.pattern}"
        yield Action(f"Lay layer {index}: {what}{face_down(layer)}, by eye.", (index,))
    yield Action(
        f"Try the {step.tool} on scrap of the same films until the seam holds and is "
        f"{units.millimetres(step.width_mm)} wide; write temperature, speed and pressure above."
    )
    yield Action(
        "Follow the path of the picture (seam file of layers/) with the middle of the tool, once, "
        "without a stop."
    )
    yield Action("Look along the seam: no gap, no hole, nothing bonded beside it.")


def _folds(work: Work) -> Iterator[JointPage]:
    for step in work.schedule.folds:
        yield JointPage(
            step.step,
            step.title,
            step.reason,
            (("Fold line", _line_words(step)),),
            (),
            "",
            (
                Action(step.instructions, tuple(range(step.layers[0], step.layers[1] + 1))),
                Action("Press the fold down with a fingertip; both edges lie on each other."),
            ),
        )


def _line_words(step: FoldStep) -> str:
    (x, y), (u, v) = step.line_mm
    return f"from x {x:.3f}, y {y:.3f} to x {u:.3f}, y {v:.3f}"


def _picture(laminate: Laminate, words: str, layers: tuple[int, ...], seam: Seam) -> str:
    """Return the films in hand from above, the seam as wide as it is, and its path."""
    stack = [laminate.layer(index) for index in layers]
    boxes = [layer.profile.bounds for layer in stack] + [seam.region.bounds]
    low_x, low_y = min(box[0] for box in boxes), min(box[1] for box in boxes)
    high_x, high_y = max(box[2] for box in boxes), max(box[3] for box in boxes)
    margin = 0.03 * max(high_x - low_x, high_y - low_y)
    width, height = high_x - low_x + 2 * margin, high_y - low_y + 2 * margin
    scale = min(WIDEST / max(width, height), 4.0)
    films = "".join(
        f'<path d="{path_data(layer.profile)}" fill="{ink(layer.film).fill}" fill-opacity="0.45" '
        f'stroke="{ink(layer.film).line}"/>'
        for layer in stack
    )
    path = "".join(chain_data(chain) for chain in seam.path)
    box = " ".join(map(coord, (low_x - margin, -high_y - margin, width, height)))
    return (
        f'<svg class="picture" role="img" aria-label="{words}" viewBox="{box}" '
        f'width="{coord(width * scale)}mm" height="{coord(height * scale)}mm">'
        f'<g transform="scale(1 -1)" fill-rule="evenodd" stroke-width="{coord(0.2 / scale)}">'
        f'{films}<path d="{path_data(seam.region)}" fill="{SEAM_INK}" fill-opacity="0.5"/>'
        f'<path d="{path}" fill="none" stroke="{PATH_INK}"/></g></svg>'
    )
