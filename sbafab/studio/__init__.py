"""The studio: a page in the browser, served on this machine, that edits a design and shows it.

``serving.py`` starts it; ``app.py`` has the routes, ``guard.py`` decides who may ask,
``workers.py`` runs ``jobs.py`` in processes of their own; ``static/`` is the page.
"""
