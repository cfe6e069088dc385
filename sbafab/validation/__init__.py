"""Predictions against what others measured.

In: published curves with source, set-up and error. Out: a calibration fitted to them, and the
paper's figures beside the predictions.
"""
