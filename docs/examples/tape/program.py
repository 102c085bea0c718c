"""Write tape.bin into a serial EEPROM, by a PIC16F84 with programmer.asm on a serial port.

python program.py /dev/ttyUSB0 build/dance/tape.bin
"""

import sys
from collections.abc import Iterator
from pathlib import Path

BLOCK = 32


def blocks(data: bytes) -> Iterator[bytes]:
    """Yield the blocks of a tape as programmer.asm takes them; the last one is filled with FFh."""
    for address in range(0, len(data), BLOCK):
        body = address.to_bytes(2, "big") + data[address : address + BLOCK].ljust(BLOCK, b"\xff")
        yield body + bytes([sum(body) & 0xFF])


def main(port: str, file: str) -> None:
    import serial  # pip install pyserial

    data = Path(file).read_bytes()
    with serial.Serial(port, 9600, timeout=1) as line:
        for number, block in enumerate(blocks(data)):
            for _ in range(3):
                line.write(block)
                if line.read(1) == b"K":
                    break
            else:
                sys.exit(f"byte {number * BLOCK}: no answer, or not written")
            print(f"\r{min(len(data), (number + 1) * BLOCK)} of {len(data)} bytes", end="")
    print()


if __name__ == "__main__":
    main(*sys.argv[1:])
