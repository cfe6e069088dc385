"""Assemblies: stacked balloon actuators with tubes, magnets, cups and lines (paper, Sec. 2.1)."""
