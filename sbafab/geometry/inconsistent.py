"""What is raised where edges cannot be told apart."""


class InconsistentError(ArithmeticError):
    """Two ways to a face do not agree; the argument is the point where they meet."""
