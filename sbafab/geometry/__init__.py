"""Exact plane geometry of lines and circular arcs; lengths are mm.

In: points, edges and contours. Out: ``Region`` with booleans, offsets, widths and distances, in
which arcs stay arcs.
"""
