"""Meshes of the flat laminate; lengths are mm.

Input: a ``Laminate``. Output: the watertight solid and its cavities, conforming volume and shell
meshes, and their files, with one writer per format.
"""
