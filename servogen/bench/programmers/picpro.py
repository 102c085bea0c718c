"""Runs the installed picpro in this Python, on ports without modem lines too.

picpro resets the programmer by DTR, and waits for it and its answer, nearly a second at each command. A
pseudo-terminal has no such line and refuses; there nothing is reset, and picpro goes on at once. And
`dump config` writes the programmer's answer itself, because picpro 0.3.0 fails when it writes the answer
that it has decoded.
"""

from __future__ import annotations

import errno
import struct
import sys
from collections.abc import Callable
from typing import Any

NO_SUCH_LINE = (errno.ENOTTY, errno.EINVAL)


def tolerant(update: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return `update` of a port's DTR in a form that tolerates ports without one, and marks them."""

    def updated(port: Any) -> None:
        port.lacks_dtr = False
        try:
            update(port)
        except OSError as error:
            if error.errno not in NO_SUCH_LINE:
                raise
            port.lacks_dtr = True

    return updated


def where_it_acts(reset: Callable[[Any], bool]) -> Callable[[Any], bool]:
    """Return picpro's `reset`, which has seen no answer at once on a port that cannot reset a programmer."""

    def reset_there(interface: Any) -> bool:
        return not interface.port.lacks_dtr and reset(interface)

    return reset_there


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
    ProtocolInterface.reset = where_it_acts(ProtocolInterface.reset)
    serial.Serial._update_dtr_state = tolerant(serial.Serial._update_dtr_state)
    picpro.main()


if __name__ == "__main__":
    main()
