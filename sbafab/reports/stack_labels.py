"""What the section's leaders point at, measured on the section itself."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

from sbafab.laminate.films import Film
from sbafab.reports.features import length
from sbafab.reports.stack_section import Joint, SectionSlab, StackSection, opening


class StackLabel(NamedTuple):
    """Words for the place ``s`` along the section, ``z`` high in or beside a layer (its index)."""

    words: str
    s: float
    z: float
    layer: int
    film: Film | None = None


def layer_labels(section: StackSection) -> list[StackLabel]:
    """Number and role of every layer shown, pointing near its end at the inlet's side."""
    base_end = max(slab.spans[-1][1] for slab in section.slabs if not slab.layer.is_mask)
    labels = []
    for slab in section.slabs:
        if not slab.spans:
            continue
        end = slab.spans[-1][1]
        words = f"{slab.layer.index} {slab.layer.role.replace('-', ' ')}"
        if slab.layer.role == "chamber-mask" and end > base_end:
            words += ", inlet strip"
        found = _in_slab(words, end - min(0.2, 0.25 * (end - slab.spans[-1][0])), slab)
        labels.append(found._replace(film=slab.layer.film))
    return labels


def pin_labels(section: StackSection, beyond_tab: bool) -> list[StackLabel]:
    """Name and press steps of the pins on this side of the tab's end, or beyond it."""
    mouth = section.tab[1] if section.tab else section.high
    slabs = {slab.layer.index: slab for slab in section.slabs}
    return [
        _in_slab(rod.words, rod.middle, slabs[rod.stacks[-1][1]])
        for rod in section.rods
        if (rod.middle > mouth) == beyond_tab
    ]


def feature_labels(section: StackSection) -> list[StackLabel]:
    """Bond, neck ring, overhang, bore, pocket and lumen, where the section has them."""
    found = [
        _bond(section),
        _pocket(section),
        _neck_ring(section),
        _overhang(section),
        _bore(section),
        _lumen(section),
    ]
    return [label for label in found if label is not None]


def _joints(section: StackSection, kind: str) -> list[Joint]:
    return [joint for joint in section.joints if joint.interface.kind == kind and joint.spans]


def _in_gap(words: str, s: float, joint: Joint) -> StackLabel:
    interface = joint.interface
    return StackLabel(words, s, interface.z + interface.gap / 2, interface.masks[0].index)


def _bond(section: StackSection) -> StackLabel | None:
    """The bonded ring beside the bottom pocket, on the side away from the inlet."""
    for joint in _joints(section, "chamber"):
        beside = [span for span in joint.spans if span[1] < 0]
        if beside:
            start, end = beside[-1]
            return _in_gap(f"bond {length(end - start)}", (start + end) / 2, joint)
    return None


def _pocket(section: StackSection) -> StackLabel | None:
    """The pocket of the second balloon, or of the only one (open toward its inlet)."""
    joints = _joints(section, "chamber")[:2]
    for joint in reversed(joints):
        pocket = opening(joint.spans, 0.0)
        if pocket is not None:
            words = f"chamber pocket {length(pocket[1] - pocket[0])}"
            return _in_gap(words, 0.6 * pocket[0], joint)
        before = [end for _, end in joint.spans if end < 0]
        if before:
            return _in_gap("chamber pocket", 0.6 * max(before), joint)
    return None


def _neck_ring(section: StackSection) -> StackLabel | None:
    """The bond beside the bore that carries one balloon on the next, or a sheet's window."""
    for joint in _joints(section, "separator"):
        for start, end in joint.spans:
            if start < 0 < end:
                return _in_gap(f"window, bond {length(end - start)}", (start + end) / 2, joint)
        beside = [span for span in joint.spans if span[1] <= 0]
        if beside:
            start, end = max(beside)
            return _in_gap(f"neck ring, bond {length(end - start)}", (start + end) / 2, joint)
    return None


def _overhang(section: StackSection) -> StackLabel | None:
    """The lowest separator mask past the wall above it, away from the inlet if that shows."""
    for mask, wall in pairwise(section.slabs):
        if mask.layer.role != "separator-mask" or not mask.spans or not wall.spans:
            continue
        start, end = mask.spans[0][0], wall.spans[0][0]
        if section.cropped:
            start, end = wall.spans[-1][1], mask.spans[-1][1]
        if end - start > 1e-3:
            return _in_slab(f"overhang {length(end - start)}", (start + end) / 2, mask)
    return None


def _bore(section: StackSection) -> StackLabel | None:
    for slab in section.slabs:
        through = opening(slab.spans, 0.0)
        if not slab.layer.is_mask and through is not None:
            return _in_slab(f"bore ⌀{length(through[1] - through[0])}", 0.0, slab)
    return None


def _lumen(section: StackSection) -> StackLabel | None:
    if section.lumen is None:
        return None
    cap = section.slabs[-1]
    through = opening(cap.spans, section.lumen)
    if through is None:
        return None
    return _in_slab(f"lumen ⌀{length(through[1] - through[0])}", section.lumen, cap)


def _in_slab(words: str, s: float, slab: SectionSlab) -> StackLabel:
    layer = slab.layer
    return StackLabel(words, s, layer.z + layer.film.thickness / 2, layer.index)
