"""Errors a user can act on: each is one sentence that names the remedy."""

from __future__ import annotations

BY_SIGNAL = 128
"""Added to a signal's number, as shells do: the exit code of a command that it stopped."""
ERROR_SCHEMA = "sbafab/error@1"
"""Id of what a command prints of an error for programs."""
STOPPED = "stopped; the output folder is whole, as it was before or as the run made it"


class Stopped(KeyboardInterrupt):
    """An interrupt with a sentence of its own about what it has ended; then the signal's number."""

    def __init__(self, sentence: str, *number: object) -> None:
        super().__init__(*number)
        self.sentence = sentence


class SbafabError(Exception):
    """Base of every error whose message is meant for the user."""


class DesignError(SbafabError, ValueError):
    """A design that cannot be built: field, value, what is allowed, what would fix it."""


class TooLargeError(DesignError):
    """A part that does not fit the film it is cut from: it ends as a failed rule does."""


class OutputError(SbafabError, OSError):
    """Files that could not be written or read back as they should be."""


class DefectError(SbafabError):
    """Files that the program wrote and that are not what it was asked for: a defect of its own."""


# What is raised where edges cannot be told apart.


class GeometryError(SbafabError, ArithmeticError):
    """An operation on regions came out inconsistent; the message says where."""


class InconsistentError(ArithmeticError):
    """Two ways to a face do not agree; the argument is the point where they meet."""
