"""Output folders: what is written, how it is swapped in whole, and how a folder is checked.

In: a ``RunRequest`` or an ``Order`` of builds. Out: a folder with a row of ``ARTEFACTS`` a file and
its manifest; of ``check FOLDER`` the findings on a folder that is made again and compared.
"""
