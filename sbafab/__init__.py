"""Fabrication CAD for soft Stacked Balloon Actuators."""

__version__ = "0.1.0"
