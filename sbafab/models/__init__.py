"""Mechanics: what an actuator will do.

In: a ``Design`` with its laminate, pressures and calibrated factors. Out: balloons, their maps and
a ``Stack`` in equilibrium; a ``Prediction`` of figures, each with its quantity, conditions, model,
validity and interval.
"""
