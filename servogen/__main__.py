"""The process `servogen`, also as `python -m servogen`: Ctrl-C ends it at any moment with 130, no traceback.

Importing the commands takes a third of a second. A process that is interrupted meanwhile has not begun any
work and can end at once; an exception would be caught, or shown, by the module that is being imported.
"""

import os
import signal
import sys
from types import FrameType

from servogen import INTERRUPTED


def main() -> None:
    """Run the command line and exit."""
    # A shell starts background jobs with Ctrl-C ignored; they must continue to ignore it.
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
        if interruptible:  # the exit code is set, and Python's clean-up must not be cut short
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    main()
