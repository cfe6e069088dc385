"""The lab: what was built and measured.

In: readings of builds, scans of cut sheets, widths of a kerf coupon. Out: build records with rates
and predictions beside readings, the places and errors of cut edges, a kerf with its error.
"""
