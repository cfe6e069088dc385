"""Output folders: their files, the swap that puts a folder in place, and the check of a folder.

In: a ``RunRequest`` or an ``Order`` of builds. Out: a folder with a row of ``ARTEFACTS`` a file and
its manifest; of ``check FOLDER`` the findings on a folder that is made again and compared.
"""
