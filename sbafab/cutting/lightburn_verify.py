"""Whether a LightBurn project is the film sheet that was meant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sbafab.cutting.cut_layers import REFERENCE
from sbafab.cutting.dxf_write import Surroundings
from sbafab.cutting.lightburn import CUT_MODE, INDICES, MOST_TURN, POWERS, LaserRun, drawn, parts_of
from sbafab.cutting.lightburn_read import Bezier, LaserShape, Project, read_project, unit_circle
from sbafab.cutting.verify import TOLERANCE
from sbafab.errors import OutputError
from sbafab.geometry.edges import Edge, Line, Point, distance_to
from sbafab.geometry.region import Contour

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

BETWEEN = (0.25, 0.5, 0.75)
"""Of a curve, where it is looked at."""
SURE = 0.99
"""Share of the tolerance: what is found within it for all shapes at once needs no other look."""


def verify_project(path: Path, contours: Sequence[Contour], sheet: Surroundings) -> None:
    """Reads the project at ``path`` and compares it with the sheet that was meant.

    Every shape is on its layer, in its order, and within TOLERANCE of its contour; layers are in
    order, the frame is not cut and no power is set. Raises OutputError with what is not, and where.
    """
    found = read_project(path)
    try:
        wanted = list(drawn(contours, sheet))
        _check_settings(found, {run.layer for run in wanted})
        if len(found.shapes) != len(wanted):
            raise OutputError(f"it has {len(found.shapes)} shapes, not {len(wanted)}")
        pairs = list(zip(found.shapes, wanted, strict=True))
        for (shape, run), is_on in zip(pairs, _surely_on(pairs), strict=True):
            if shape.index != INDICES[run.layer] or shape.is_closed != run.closed:
                x, y = shape.curves[0].start
                raise OutputError(f"the shape at x {x:.3f}, y {y:.3f} is not one of {run.layer}")
            if not is_on:
                _check_shape(shape, run.edges)
    except OutputError as error:
        raise OutputError(f"{path.name}: {error}; regenerate it") from error


def _check_settings(found: Project, layers: set[str]) -> None:
    own = [layer for layer in INDICES if layer in layers]
    if list(found.settings) != [INDICES[layer] for layer in own]:
        raise OutputError("its layers are others, or in another order")
    for rank, layer in enumerate(own):
        wanted = {
            "type": CUT_MODE,
            "priority": str(rank),
            "doOutput": str(int(layer != REFERENCE)),
            **dict.fromkeys(("kerf", *POWERS), "0"),
        }
        told = found.settings[INDICES[layer]]
        for name, value in wanted.items():
            if told.get(name) != value:
                raise OutputError(f"{name} of layer {layer} is {told.get(name)}, not {value}")


def _surely_on(pairs: Sequence[tuple[LaserShape, LaserRun]]) -> list[bool]:
    """For each shape whether all that ``_check_shape`` looks at lies within the tolerance.

    All shapes at once. Of one that is drawn otherwise, or lies off, this is left to be said there.
    """
    surely = [False] * len(pairs)
    rounds = [i for i, (shape, run) in enumerate(pairs) if shape.circle and run.circle]
    paths = [i for i, (shape, run) in enumerate(pairs) if shape.rows and run.circle is None]
    for found, offs in (
        (rounds, _circle_offs([pairs[i] for i in rounds])),
        (paths, _path_offs([pairs[i] for i in paths])),
    ):
        for i, off in zip(found, offs, strict=True):
            surely[i] = off < SURE * TOLERANCE
    return surely


def _circle_offs(pairs: Sequence[tuple[LaserShape, LaserRun]]) -> list[float]:
    """How far the curves of drawn circles lie off those that are meant."""
    import numpy as np

    if not pairs:
        return []
    drawn_as = np.array([(*shape.circle[0], shape.circle[1]) for shape, _ in pairs if shape.circle])
    meant = np.array([(*run.circle[0], run.circle[1]) for _, run in pairs if run.circle])
    unit = np.array([p for curve in unit_circle() for p in (curve.start, curve.at(0.5))])
    x, y = (drawn_as[:, k, None] + drawn_as[:, 2:] * unit[:, k] - meant[:, k, None] for k in (0, 1))
    offs: list[float] = np.abs(np.hypot(x, y) - meant[:, 2:]).max(axis=1).tolist()
    return offs


def _path_offs(pairs: Sequence[tuple[LaserShape, LaserRun]]) -> list[float]:
    """How far the curves of paths lie off the edges that are meant; infinite for others in kind."""
    import numpy as np

    if not pairs:
        return []
    edges = np.array([_numbers(edge) for _, run in pairs for edge in run.edges])
    owner_of_edge = np.repeat(np.arange(len(pairs)), [len(run.edges) for _, run in pairs])
    sweep = _sweep(edges)
    # As many curves for an edge as ``parts_of`` makes parts.
    counts = np.maximum(1, np.ceil(np.abs(sweep) / MOST_TURN - 1e-9)).astype(int)
    wanted = np.bincount(owner_of_edge, counts, len(pairs)).astype(int)
    alike = wanted == [len(shape.rows) for shape, _ in pairs]
    offs = np.where(alike, 0.0, np.inf)
    chosen = np.flatnonzero(alike[owner_of_edge])
    if len(chosen):
        own = [shape for (shape, _), is_alike in zip(pairs, alike, strict=True) if is_alike]
        which = np.repeat(chosen, counts[chosen])
        step = np.arange(len(which)) - np.repeat(
            np.cumsum(counts[chosen]) - counts[chosen], counts[chosen]
        )
        known = {id(shape.rows): np.array(shape.rows) for shape in own}
        rows = np.concatenate(
            [known[id(shape.rows)] + np.tile(np.array(shape.place), 4) for shape in own]
        )
        straight = np.array([flag for shape in own for flag in shape.is_line])
        share = np.array([step, step + 1]) / counts[which]
        off = _row_offs(rows, straight, edges[which], sweep[which], share)
        np.maximum.at(offs, owner_of_edge[which], off)
    found: list[float] = offs.tolist()
    return found


def _numbers(edge: Edge) -> tuple[float, ...]:
    """Ends, centre, radius (0 of a line) and sense of an edge."""
    if isinstance(edge, Line):
        return *edge.start, *edge.end, 0.0, 0.0, 0.0, 0.0
    return *edge.start, *edge.end, *edge.centre, edge.radius, 1.0 if edge.ccw else -1.0


def _sweep(edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """The angle that each edge turns through, of a line 0."""
    import numpy as np

    ax, ay, bx, by = (edges[:, k] - edges[:, 4 + k % 2] for k in range(4))
    turn = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    sense = edges[:, 7]
    back = turn * sense <= -1e-9
    return np.where(sense == 0, 0.0, np.where(back, turn + sense * math.tau, turn))


def _row_offs(
    rows: NDArray[np.float64],
    straight: NDArray[np.bool_],
    edges: NDArray[np.float64],
    sweep: NDArray[np.float64],
    share: NDArray[np.float64],
) -> NDArray[np.float64]:
    """How far each curve lies off its part of an edge, which ``share`` says: from, and to.

    Its ends off the part's, and what lies between off the arc's circle.
    """
    import numpy as np

    centre, radius = edges[:, 4:6], edges[:, 6]
    first = np.arctan2(edges[:, 1] - edges[:, 5], edges[:, 0] - edges[:, 4])
    off = np.zeros(len(rows))
    for place, part, end in ((rows[:, 0:2], share[0], 0.0), (rows[:, 6:8], share[1], 1.0)):
        angle = first + sweep * part
        on = centre + radius[:, None] * np.array([np.cos(angle), np.sin(angle)]).T
        ends = edges[:, 0:2] if end == 0.0 else edges[:, 2:4]
        meant = np.where((part == end)[:, None], ends, on)
        off = np.maximum(off, np.hypot(*(place - meant).T))
    is_arc = radius > 0
    for t in BETWEEN:
        weights = np.array([(1 - t) ** 3, 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t * t, t**3])
        beside = np.einsum("i,nik->nk", weights, rows.reshape(-1, 4, 2)) - centre
        off = np.where(is_arc, np.maximum(off, np.abs(np.hypot(*beside.T) - radius)), off)
    return np.where(is_arc | straight, off, np.inf)


def _check_shape(shape: LaserShape, edges: Sequence[Edge]) -> None:
    """A full circle's curves may start anywhere; those of a path are its edges one by one."""
    circle = Contour(tuple(edges)).circle
    if circle is not None:
        centre, radius = circle
        points = [p for curve in shape.curves for p in (curve.start, curve.at(0.5))]
        offs = [(abs(math.dist(p, centre) - radius), p) for p in points]
        far = max(math.dist(p, q) for p, q in zip(points, points[len(points) // 2 :], strict=False))
        if far < 1.9 * radius:
            raise OutputError(f"the circle at x {centre[0]:.3f}, y {centre[1]:.3f} is not whole")
    else:
        parts = [part for edge in edges for part in parts_of(edge)]
        if len(parts) != len(shape.curves):
            x, y = edges[0].start
            raise OutputError(f"the shape at x {x:.3f}, y {y:.3f} has {len(shape.curves)} edges")
        pairs = zip(shape.curves, parts, strict=True)
        offs = [off for curve, part in pairs for off in _offs(curve, part)]
    off, (x, y) = max(offs)
    if off > TOLERANCE:
        raise OutputError(f"an edge is {off:.6f} mm off at x {x:.3f}, y {y:.3f}")


def _offs(curve: Bezier, part: Edge) -> Iterator[tuple[float, Point]]:
    """How far ends lie off, and what lies between them off the edge or the arc's circle."""
    yield math.dist(curve.start, part.start), curve.start
    yield math.dist(curve.end, part.end), curve.end
    if isinstance(part, Line) and curve.handles is None:
        return
    for t in BETWEEN:
        p = curve.at(t)
        if isinstance(part, Line):
            yield distance_to(part, p), p
        else:
            yield abs(math.dist(p, part.centre) - part.radius), p
