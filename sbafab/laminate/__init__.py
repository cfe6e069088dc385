"""Laminates: the model that everything else reads.

In: films and profiles of layers, bottom to top, with pins, inlets, seams and folds. Out: a
``Laminate`` with its interfaces (contact, bond, unbonded), patterns, and the lay-up in press steps.
"""
