"""Builds and their output folders: everything derived from a design, written, swapped in and
checked.

Input: a ``Design``, several, or an ``Assembly``. Output: a ``Build`` with its laminate, findings,
beam paths and press schedule; for a ``RunRequest`` a folder, whose files are the rows of
``artefacts``, and its manifest; for ``check FOLDER`` the findings on a folder, compared with a
regenerated one.
"""
