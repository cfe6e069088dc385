"""The entry point of the ``sbafab`` command, where Ctrl-C ends the process at once.

An interrupt raised during imports may be lost or become another error, and before a command runs
there is nothing to clean up.
"""

from __future__ import annotations

import os

from sbafab.errors import BY_SIGNAL

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType

SIGINT = 2


def main() -> None:
    """Run the command line with the arguments of the process."""
    try:
        import signal

        # An ignored signal (nohup) stays ignored.
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, stop_at_once)
        # Guarded: Ctrl-C while they are loaded ends the process as it does later.
        from sbafab.runtime import prepare

        prepare()
        from sbafab.cli import main as run
    except KeyboardInterrupt:
        stop_at_once(SIGINT, None)
    run()


def stop_at_once(number: int, frame: FrameType | None) -> None:
    """Print "stopped" and end the process."""
    try:
        os.write(2, b"sbafab: stopped\n")
    finally:
        os._exit(BY_SIGNAL + number)
