"""The process `servogen`, also as `python -m servogen`: Ctrl-C ends it at any moment with 130, no traceback.

The commands import for a third of a second. What is interrupted there has begun nothing, so that the process
can end at once; an exception would be caught, or shown, by whatever is being imported.
"""

import os
import signal
import sys
from types import FrameType

from servogen import INTERRUPTED


def main() -> None:
    """Runs the command line and exits."""
    # A shell starts background jobs with Ctrl-C ignored, which stays so.
    interruptible = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if interruptible:
        signal.signal(signal.SIGINT, _end)
    from servogen.cli import main as run

    try:
        if interruptible:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        run()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    finally:
        if interruptible:  # the exit code is set: what Python tidies up is not to be cut short
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    main()
