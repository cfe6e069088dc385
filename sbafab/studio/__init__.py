"""The studio: a page in the browser, served on this machine, that edits and shows a design.

``app.py`` starts it and holds the routes and the guard, ``workers.py`` runs ``jobs.py`` in separate
processes; ``static/`` is the page.
"""
