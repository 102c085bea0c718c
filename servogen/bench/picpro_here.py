"""Runs the installed picpro in this Python, on ports without modem lines too.

picpro resets the programmer by DTR. A pseudo-terminal has no such line and refuses; there the programmer is
found awake, and picpro goes on as it does with one that answers no reset.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import Any

NO_SUCH_LINE = (errno.ENOTTY, errno.EINVAL)


def tolerant(update: Callable[[Any], None]) -> Callable[[Any], None]:
    """`update` of a modem line, where there may be none."""

    def updated(line: Any) -> None:
        try:
            update(line)
        except OSError as error:
            if error.errno not in NO_SUCH_LINE:
                raise

    return updated


def main() -> None:
    """picpro with the arguments of this process."""
    import serial
    from picpro.bin import picpro

    serial.Serial._update_dtr_state = tolerant(serial.Serial._update_dtr_state)
    picpro.main()


if __name__ == "__main__":
    main()
