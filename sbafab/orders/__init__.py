"""Builds and orders: a design with its results, and designs that are made together.

In: a ``Design``, several, or an ``Assembly``. Out: a ``Build`` with its laminate, findings, cut
paths and press schedule, each computed when first asked for; an ``Order`` of builds with their
shared film sheets and the checks between parts.
"""
