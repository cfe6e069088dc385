"""The studio: a page in the browser, served on this machine, that edits a design and shows it.

``app.py`` starts it and has the routes and the guard, ``workers.py`` runs ``jobs.py`` in processes
of their own; ``static/`` is the page.
"""
