"""The door of the ``sbafab`` command, which Ctrl-C ends plainly from the first moment on.

Until a command runs there is nothing to tidy up, and an interrupt that is raised amid imports may
be lost in them or come out as another error: so it ends the process there and then.
"""

from __future__ import annotations

import os

from sbafab.errors import BY_SIGNAL, STOPPED

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType

SIGINT = 2
YOUNG = 200_000
"""Records after which they are looked through for rings that nothing holds: a run makes many
records, keeps them to its end and makes hardly any ring, and looking takes a thirtieth of its time.
"""


def main() -> None:
    """Runs the command line with the arguments of the process."""
    try:
        import atexit
        import gc
        import signal

        # Where it is ignored (nohup), it stays so.
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, stop_at_once)
        # Plugins of pydantic, which have no part in this, are looked for in every package there is.
        os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
        # Matrices here are small: more threads take longer, and may sum in another order elsewhere.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        gc.set_threshold(YOUNG, *gc.get_threshold()[1:])
        # What is left when the process ends goes with it: looking for rings takes 0.05 s and more.
        atexit.register(gc.freeze)
        from sbafab.cli import main as run
    except KeyboardInterrupt:
        stop_at_once(SIGINT, None)
    run()


def stop_at_once(number: int, frame: FrameType | None) -> None:
    """Says so and ends the process, without a way back."""
    try:
        os.write(2, f"sbafab: {STOPPED}\n".encode())
    finally:
        os._exit(BY_SIGNAL + number)
