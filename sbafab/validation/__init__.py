"""Predictions compared with measurements of others.

Input: published curves with source, set-up and error. Output: a calibration fitted to them, and the
paper's figures beside the predictions.
"""
