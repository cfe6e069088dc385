"""Import what other programs wrote as a design of drawn layers.

In: a folder of drawings, a laminate.json, ParchMint, polygons or popupCAD. Out: an ``Imported``:
``design.toml`` with the drawings of its layers.
"""
