"""Assemblies: stacked balloon actuators with tubes, magnets, cups and lines (paper, Sec. 2.1).

Input: an assembly file and its designs. Output: an ``Assembled``, every part with its place, and
the findings of the checks between parts.
"""
