"""Runs the installed picpro in this Python, on ports without modem lines too.

picpro resets the programmer by DTR. A pseudo-terminal has no such line and refuses; there the programmer is
already awake, and picpro continues as with one that does not answer a reset. And `dump config` writes the
programmer's answer itself, because picpro 0.3.0 fails when it writes the answer that it has decoded.
"""

from __future__ import annotations

import errno
import struct
import sys
from collections.abc import Callable
from typing import Any

NO_SUCH_LINE = (errno.ENOTTY, errno.EINVAL)


def tolerant(update: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return `update` of a modem line in a form that tolerates ports without one."""

    def updated(line: Any) -> None:
        try:
            update(line)
        except OSError as error:
            if error.errno not in NO_SUCH_LINE:
                raise

    return updated


def as_answered(read_config: Callable[[Any], dict[str, Any]]) -> Callable[[Any], bytes]:
    """Return picpro's `read_config`, reassembled into the 26 bytes that the programmer sent."""

    def answered(interface: Any) -> bytes:
        config = read_config(interface)
        return struct.pack("<H8s7HH", config["chip_id"], config["id"], *config["fuses"], config["calibrate"])

    return answered


def main() -> None:
    """Run picpro with the arguments of this process."""
    import serial
    from picpro.bin import picpro
    from picpro.ProtocolInterface import ProtocolInterface

    if sys.argv[1:3] == ["dump", "config"]:
        ProtocolInterface.read_config = as_answered(ProtocolInterface.read_config)
    serial.Serial._update_dtr_state = tolerant(serial.Serial._update_dtr_state)
    picpro.main()


if __name__ == "__main__":
    main()
