"""The lab: records of builds and measurements.

Input: readings of builds, scans of cut sheets, widths of a kerf coupon. Output: build records with
success rates, predictions beside readings, positions and errors of cut edges, and a kerf with its
uncertainty.
"""
