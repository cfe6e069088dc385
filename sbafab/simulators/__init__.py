"""Simulators: CalculiX and Abaqus, SOFA, MuJoCo; one module each.

Input: a ``Laminate``, its meshes and load settings. Output: the input files of a simulator and,
after a run, its result, read back and judged.
"""
