"""Random shapes on grids where edges often coincide or only touch."""

from __future__ import annotations

from hypothesis import strategies as st

from sbafab.geometry.region import Region, disc, rectangle, stadium, strip

coarse = st.integers(-8, 8).map(lambda n: n / 2)
fine = st.floats(-4, 4, allow_nan=False).map(lambda x: round(x, 3))
nudges = st.sampled_from([0.0, 0.0, 0.0, 1e-7, 1e-6, 3e-6, 1e-5, 1e-4])
sizes = st.integers(1, 8).map(lambda n: n / 2)


@st.composite
def shapes(draw: st.DrawFn) -> Region:
    """A disc, rectangle, stadium or strip, mostly on a grid, at times a hair beside it."""
    number = draw(st.sampled_from([coarse, coarse, fine]))
    x, y, width, length = draw(number), draw(number), draw(sizes), draw(sizes)
    kind = draw(st.sampled_from(["disc", "rectangle", "stadium", "strip"]))
    if kind == "disc":
        shape = disc((x, y), width)
    elif kind == "rectangle":
        shape = rectangle((x, y), (x + width, y + length))
    elif kind == "stadium":
        angle = draw(st.sampled_from([0, 90, 45, 30, 17.3]))
        shape = stadium((x, y), width, width + length).turned(angle, (x, y))
    else:
        shape = strip((x, y), (x + draw(coarse), y + length), width)
    return shape.moved(draw(nudges), draw(nudges))
