"""Builds and their output folders: what follows from a design, written, swapped in and checked.

In: a ``Design``, several, or an ``Assembly``. Out: a ``Build`` with its laminate, findings, beam
paths and press schedule; of a ``RunRequest`` a folder, whose files are the rows of ``artefacts``,
and its manifest; of ``check FOLDER`` the findings on a folder that is made again and compared.
"""
