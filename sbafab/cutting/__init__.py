"""Cut files: the beam's paths, their sequence, film sheets, DXF and laser programs.

In: the profiles of a laminate, kerf and sheet settings. Out: a DXF with true arcs for every layer,
film sheets with pieces nested on them, and programs of lasers; each file is read back and compared
with its path.
"""
