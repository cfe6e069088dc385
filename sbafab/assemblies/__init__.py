"""Assemblies: stacked balloon actuators with tubes, magnets, cups and lines (paper, Sec. 2.1).

In: an assembly file and the designs it names. Out: an ``Assembled``, every part with its place, and
the findings of the checks between parts.
"""
