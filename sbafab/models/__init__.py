"""Mechanics: the predicted behaviour of an actuator.

Input: a ``Design`` with its laminate, pressures and calibrated factors. Output: balloons, their
maps and a ``Stack`` in equilibrium; a ``Prediction`` of figures, each with its quantity,
conditions, model, validity and interval.
"""
