"""The heat press: steps, pins, pad and time.

In: a ``Laminate`` and the press settings of its design. Out: a ``Schedule`` of press, seam and
fold steps with cautions, the holes of the base plate, and the press cycles of several copies.
"""
