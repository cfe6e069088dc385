"""The door of the ``sbafab`` command, which Ctrl-C ends plainly from the first moment on.

Until a command runs there is nothing to tidy up, and an interrupt that is raised amid imports may
be lost in them or come out as another error: so it ends the process there and then.
"""

from __future__ import annotations

import os

from sbafab.errors import BY_SIGNAL

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType

SIGINT = 2


def main() -> None:
    """Runs the command line with the arguments of the process."""
    try:
        import signal

        # Where it is ignored (nohup), it stays so.
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, stop_at_once)
        from sbafab.process import prepare

        prepare()
        from sbafab.cli import main as run
    except KeyboardInterrupt:
        stop_at_once(SIGINT, None)
    run()


def stop_at_once(number: int, frame: FrameType | None) -> None:
    """Says so and ends the process, without a way back."""
    try:
        os.write(2, b"sbafab: stopped\n")
    finally:
        os._exit(BY_SIGNAL + number)
