"""Many designs: sweeps over ranges of keys, the search for one that meets requirements, comparison.

In: a design file, ranges or requirements. Out: a table of trials, the best design, or the
differences of two, each measured as ``check`` and ``predict`` do.
"""
