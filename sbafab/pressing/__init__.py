"""The heat press: steps, pins, pad and time.

Input: a ``Laminate`` and the press settings of its design. Output: a ``Schedule`` of press, seam
and fold steps with cautions, the holes of the base plate, and the press cycles of several copies.
"""
