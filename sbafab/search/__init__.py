"""Many designs: sweeps over ranges of keys, the search for one that meets requirements, comparison.

Input: a design file, ranges or requirements. Output: a table of trials, the best design, or the
differences of two, each evaluated like ``check`` and ``predict``.
"""
