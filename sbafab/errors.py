"""Errors with messages for the user: one sentence with place, limit and remedy."""

from __future__ import annotations

BY_SIGNAL = 128
"""Added to a signal's number, as shells do: the exit code of a command that it stopped."""
ERROR_SCHEMA = "sbafab/error@1"
"""Schema id of an error as JSON."""
STOPPED = "stopped; the output folder is complete: either the earlier one or the new one"


class Stopped(KeyboardInterrupt):
    """An interrupt with a sentence about the interrupted work, and the number of the signal."""

    def __init__(self, sentence: str, *number: object) -> None:
        super().__init__(*number)
        self.sentence = sentence


class SbafabError(Exception):
    """The base of all errors with a message for the user."""


class DesignError(SbafabError, ValueError):
    """A design that cannot be built: field, value, permitted values, remedy."""


class UnreachableError(DesignError):
    """A place that the tip of a stack cannot reach: the nearest tip found, and its distance."""


class BeyondError(DesignError):
    """A state beyond a film's limit; ``excess`` is the fraction by which it exceeds the limit."""

    def __init__(self, sentence: str, excess: float = 0.0) -> None:
        super().__init__(sentence)
        # With a default, so that it can be pickled: an error is made again from its sentence.
        self.excess = excess


class TooLargeError(DesignError):
    """A part that is larger than its film; the exit code is that of a failed rule."""


class OutputError(SbafabError, OSError):
    """Files that cannot be written, or read back as written."""


class OccupiedError(OutputError):
    """A folder that holds another design's files, which a run would replace."""


class VoidError(OutputError):
    """A simulation with an impossible result; the exit code is that of a failed rule."""


class DefectError(SbafabError):
    """Written files that differ from the design: a defect of the program."""


# Errors of geometry.


class GeometryError(SbafabError, ArithmeticError):
    """An operation on regions with an inconsistent result; the message gives the location."""


class InconsistentError(ArithmeticError):
    """Two paths to a face with different results; the argument is the point where they meet."""
