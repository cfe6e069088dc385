"""Calibration: from measured curves to the posterior of the models' unknowns."""
