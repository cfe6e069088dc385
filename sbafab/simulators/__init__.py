"""Simulators: CalculiX and Abaqus, SOFA, MuJoCo; one module each.

In: a ``Laminate``, its meshes and load settings. Out: the input files of a simulator, and its
result, read back and judged, after a run.
"""
