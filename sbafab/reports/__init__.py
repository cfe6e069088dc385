"""Documents for the bench and for the designer.

In: ``Build``, findings, schedule and figures as data. Out: the traveller, the page of findings,
pictures (SVG, PNG) and prints at 1:1 (PDF).
"""
