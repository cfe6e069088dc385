"""A laminate on a tube: the sheet wrapped round it, with the balloons on the sheet.

Flat balloons are wrapped with their sheet. Filled ones straighten: they are bent only as far as no
film is stretched round the tube by more than in the flat laminate, but follow the tube where they
are bonded to the sheet.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sbafab.errors import DesignError
from sbafab.meshing.conforming.layup import FormedFilm, Layup, Ply, bodies
from sbafab.meshing.wrap import TubeWrap, tube_wrap

SLACK = 1e-3
"""mm of apparent overlap allowed into the sheet, or past the middle between two balloons."""

NEAR = 12
"""A film leaves the tube beside its bond to the sheet with this power of its depth."""


def round_tube(stack: Layup, forms: Sequence[FormedFilm]) -> list[FormedFilm]:
    """The films in their wrapped position if the laminate is on a tube; otherwise unchanged.

    Raises DesignError if filled balloons meet round the tube.
    """
    wrap = tube_wrap(stack.laminate) if stack.settings.wrapped else None
    if wrap is None:
        return list(forms)
    x = stack.plane.points[:, 0]
    placed = []
    for k, (ply, form) in enumerate(zip(stack.plies, forms, strict=True)):
        if ply.layer.role == "sheet":
            lifted = form.base + np.outer(wrap.raised(x), (0.0, 0.0, 1.0))
            everywhere = np.arange(len(x))
            moved = _moved(stack, ply, wrap, form._replace(base=lifted), (everywhere, 0.0, 1.0))
        else:
            moved = form
            on_sheet = stack.plies[k - 1].layer.role == "sheet"
            for nodes, middle, share in _bodies(stack, forms):
                moved = _moved(stack, ply, wrap, moved, (nodes, middle, share), on_sheet)
        placed.append(moved)
    _check_room(stack, wrap, placed)
    return placed


def _bodies(
    stack: Layup, forms: Sequence[FormedFilm]
) -> Iterator[tuple[NDArray[np.int64], float, float]]:
    """Nodes of the plane of each body on the sheet, the x it is fixed at, its share of the bend."""
    of_node, of_centre = bodies(stack)
    top = forms[-1].base[:, 2] + stack.plies[-1].thickness
    for body in np.unique(of_centre).tolist():
        nodes = np.flatnonzero(of_node == body)
        fixed_at = [
            c[0] for c, owner in zip(stack.centres, of_centre, strict=True) if owner == body
        ]
        # One body of several stacks, joined by a manifold, goes all round.
        share = 1.0
        if len(fixed_at) == 1:
            share = min(1.0, stack.laminate.thickness / max(float(top[nodes].max()), 1e-9))
        yield nodes, sum(fixed_at) / len(fixed_at), share


def _moved(
    stack: Layup,
    ply: Ply,
    wrap: TubeWrap,
    form: FormedFilm,
    body: tuple[NDArray[np.int64], float, float],
    on_sheet: bool = False,
) -> FormedFilm:
    """The film with the nodes of one body in place."""
    nodes, middle, share = body
    flat = form.base[nodes]
    base, up = form.base.copy(), np.array(form.up)
    base[nodes] = wrap.placed(flat, middle, share)
    lean = wrap.angle(flat[:, 0], middle, share) + middle / (wrap.radius + wrap.neutral)
    up[nodes] = np.column_stack([np.cos(lean), np.sin(lean), np.zeros(len(lean))])
    # Points farther out than the sheet's middle are stretched round the tube.
    bend = share / wrap.radius
    height = flat[:, 2] + (ply.thickness / 2 if stack.is_thick else 0.0)
    longer = np.zeros(len(base))
    longer[nodes] = (1 + bend * height) / (1 + bend * wrap.neutral) - 1
    moved = FormedFilm(base, up, form.growth)
    if on_sheet:
        moved, shorter = _laid(wrap, moved, body, flat)
        longer += shorter
    cells = stack.plane.triangles[ply.cells]
    sizes = stack.plane.areas()[ply.cells]
    # Only the mid-side nodes carry weight in a second-order triangle.
    growth = float((longer[cells[:, 3:]].mean(axis=1) * sizes).sum() / sizes.sum())
    return moved._replace(growth=form.growth + growth)


def _laid(
    wrap: TubeWrap,
    moved: FormedFilm,
    body: tuple[NDArray[np.int64], float, float],
    flat: NDArray[np.float64],
) -> tuple[FormedFilm, NDArray[np.float64]]:
    """A body's film on the sheet, drawn down to the tube at its bond and near it, and how much that
    shortens it round the tube.
    """
    nodes, middle, share = body
    low, high = flat[:, 2].min(), flat[:, 2].max()
    base, shorter = moved.base.copy(), np.zeros(len(moved.base))
    if high - low > SLACK:
        up = moved.up[nodes]
        part = ((high - flat[:, 2]) / (high - low)) ** NEAR
        down = part * ((wrap.placed(flat, middle) - base[nodes]) * up).sum(axis=1)
        base[nodes] += down[:, None] * up
        shorter[nodes] = share / wrap.radius * down
    return moved._replace(base=base), shorter


def _check_room(stack: Layup, wrap: TubeWrap, placed: Sequence[FormedFilm]) -> None:
    """Raises DesignError if balloons reach past the middle between them, or into the sheet."""
    of_node, of_centre = bodies(stack)
    middles: dict[int, list[float]] = {}
    for (x, _), body in zip(stack.centres, of_centre.tolist(), strict=True):
        middles.setdefault(body, []).append(x)
    least = wrap.radius
    for ply, form in zip(stack.plies, placed, strict=True):
        if ply.layer.role == "sheet":
            least = wrap.radius + ply.z + (ply.thickness if stack.is_thick else 0.0)
            continue
        covered = np.unique(stack.plane.triangles[ply.cells])
        for body, fixed_at in middles.items():
            nodes = covered[of_node[covered] == body]
            x, y, _ = form.base[nodes].T
            at = (sum(fixed_at) / len(fixed_at)) / (wrap.radius + wrap.neutral)
            aside = np.abs(np.angle(np.exp(1j * (np.arctan2(y, x) - at))))
            room = math.pi / len(middles)
            if len(middles) > 1 and float((aside - room).max() * wrap.radius) > SLACK:
                raise DesignError(
                    f"filled balloons meet round the tube of {2 * wrap.radius:g} mm: film "
                    f"{ply.layer.index} reaches {math.degrees(aside.max()):.1f} degrees round it "
                    f"where each has {math.degrees(room):.1f}; ask for less fill"
                )
            if float(np.hypot(x, y).min()) < least - SLACK:
                raise DesignError(
                    f"film {ply.layer.index} would pass through its sheet by "
                    f"{least - float(np.hypot(x, y).min()):.3f} mm; ask for another fill"
                )
