"""Import files of other programs as a design of drawn layers.

Input: a folder of drawings, a laminate.json, ParchMint, polygons or popupCAD. Output: an
``Imported``: ``design.toml`` with the drawings of its layers.
"""
