"""Design rules: one module a rule.

Input: a ``Laminate`` and the limits of its design, as ``Measures``. Output: findings, each a
verdict with its value, limit, place and the id of a sentence in ``sentences.toml``.
"""
