"""Documents for the bench and for the designer.

Input: ``Build``, findings, schedule and figures as data. Output: the traveller, the page of
findings, pictures (SVG, PNG) and prints at 1:1 (PDF).
"""
