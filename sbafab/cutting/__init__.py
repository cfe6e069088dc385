"""Cut files: beam paths, cutting order, film sheets, DXF and laser programs.

Input: the profiles of a laminate, kerf and sheet settings. Output: a DXF with true arcs for every
layer, film sheets with nested pieces, and laser program files; each file is read back and compared
with its path.
"""
