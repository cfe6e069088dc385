"""Meshes of the flat laminate; lengths are mm.

In: a ``Laminate``. Out: the watertight solid and its cavities, conforming volume and shell meshes,
and files of them, one writer a format.
"""
