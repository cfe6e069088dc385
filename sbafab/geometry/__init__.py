"""Exact plane geometry of lines and circular arcs; lengths are mm.

Input: points, edges and contours. Output: ``Region`` with booleans, offsets, widths and distances;
arcs remain arcs.
"""
