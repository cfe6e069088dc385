"""What the section's leaders point at, measured on the section itself."""

from __future__ import annotations

from typing import NamedTuple

from sbafab.geometry.section import Interval
from sbafab.laminate.films import Material
from sbafab.reports.features import length
from sbafab.reports.stack_section import Joint, Section, Slab, opening


class Label(NamedTuple):
    """Words for the place ``s`` along the section, ``z`` high in the layer ``index``."""

    words: str
    s: float
    z: float
    index: int
    material: Material | None = None


def layer_labels(section: Section) -> list[Label]:
    """Number and role of every layer shown, pointing near its end at the inlet's side."""
    return [
        Label(
            f"{slab.layer.index} {slab.layer.role.replace('-', ' ')}",
            slab.spans[-1][1] - 0.12,
            slab.layer.z + slab.layer.film.thickness / 2,
            slab.layer.index,
            slab.layer.film.material,
        )
        for slab in section.slabs
        if slab.spans
    ]


def feature_labels(section: Section) -> list[Label]:
    """Bond, neck ring, overhang, bore, pocket, lumen and inlet, where the section has them."""
    found = [
        _bond(section),
        _pocket(section),
        _neck_ring(section),
        _overhang(section),
        _bore(section),
        _lumen(section),
        _inlet(section),
    ]
    return [label for label in found if label is not None]


def _joints(section: Section, kind: str) -> list[Joint]:
    return [joint for joint in section.joints if joint.interface.kind == kind and joint.spans]


def _in_gap(words: str, s: float, joint: Joint) -> Label:
    interface = joint.interface
    return Label(words, s, interface.z + interface.gap / 2, interface.masks[0].index)


def _bond(section: Section) -> Label | None:
    """The bonded ring beside the bottom pocket, on the side away from the inlet."""
    for joint in _joints(section, "chamber"):
        beside = [span for span in joint.spans if span[1] < 0]
        if beside:
            start, end = beside[-1]
            return _in_gap(f"bond {length(end - start)}", (start + end) / 2, joint)
    return None


def _pocket(section: Section) -> Label | None:
    """The pocket of the second balloon, or of the only one."""
    joints = _joints(section, "chamber")[:2]
    for joint in reversed(joints):
        pocket = opening(joint.spans, 0.0)
        if pocket is not None:
            words = f"chamber pocket {length(pocket[1] - pocket[0])}"
            return _in_gap(words, 0.6 * pocket[0], joint)
    return None


def _neck_ring(section: Section) -> Label | None:
    for joint in _joints(section, "separator"):
        beside = [span for span in joint.spans if span[1] <= 0]
        if beside:
            start, end = max(beside)
            return _in_gap(f"neck ring, bond {length(end - start)}", (start + end) / 2, joint)
    return None


def _overhang(section: Section) -> Label | None:
    """The lowest separator mask past the wall above it, on the side away from the inlet."""
    for below, above in zip(section.slabs, section.slabs[1:], strict=False):
        if below.layer.role != "separator-mask" or not below.spans or not above.spans:
            continue
        span = _past(below, above)
        if span is not None and not section.cropped:
            s = (span[0] + span[1]) / 2
            return _in_slab(f"overhang {length(span[1] - span[0])}", s, below)
    return None


def _past(mask: Slab, wall: Slab) -> Interval | None:
    start, end = mask.spans[0][0], wall.spans[0][0]
    return (start, end) if end - start > 1e-3 else None


def _bore(section: Section) -> Label | None:
    for slab in section.slabs:
        through = opening(slab.spans, 0.0)
        if not slab.layer.is_mask and through is not None:
            return _in_slab(f"bore ⌀{length(through[1] - through[0])}", 0.0, slab)
    return None


def _lumen(section: Section) -> Label | None:
    if section.lumen is None:
        return None
    cap = section.slabs[-1]
    through = opening(cap.spans, section.lumen)
    if through is None:
        return None
    return _in_slab(f"lumen ⌀{length(through[1] - through[0])}", section.lumen, cap)


def _inlet(section: Section) -> Label | None:
    """The strip that keeps the tab open for the tube: a mask that reaches past every film."""
    mask = max(
        (slab for slab in section.slabs if slab.layer.role == "chamber-mask" and slab.spans),
        key=lambda slab: slab.spans[-1][1],
        default=None,
    )
    base = section.slabs[0]
    if mask is None or mask.spans[-1][1] < base.spans[-1][1]:
        return None
    return _in_slab("inlet strip", mask.spans[-1][1] - 2.0, mask)


def _in_slab(words: str, s: float, slab: Slab) -> Label:
    layer = slab.layer
    return Label(words, s, layer.z + layer.film.thickness / 2, layer.index)
