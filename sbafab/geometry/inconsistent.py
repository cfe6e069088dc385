"""What is raised where edges cannot be told apart."""

from __future__ import annotations

from sbafab.errors import SbafabError


class GeometryError(SbafabError, ArithmeticError):
    """An operation on regions came out inconsistent; the message says where."""


class InconsistentError(ArithmeticError):
    """Two ways to a face do not agree; the argument is the point where they meet."""
