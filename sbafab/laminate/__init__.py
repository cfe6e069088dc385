"""Laminates: the model that all other rooms read.

Input: films and profiles of layers, bottom to top, with pins, inlets, seams and folds. Output: a
``Laminate`` with its interfaces (contact, bond, unbonded), patterns, and lay-up in press steps.
"""
