"""The content of a tape: the frames of a schedule as records, in the order in which they are read.

In: a schedule, the order of its channels in the program. Out: `Content`, whose bytes begin at address 0.
Each part begins with a record that is not a step. After END the tape is read on from the part that follows.

    address 0   identity, high and low byte: a CRC of all that follows, which the program knows
            2   records of the lead-in, with commands END, sum
    places[0]   records of the loop, END, sum
            1   with commands, of each direction: records of its start, AGAIN, sum,
            2   of its cycle, AGAIN, sum,
            3   of its stop, END, sum

    record   kind and more frames (1) │ data │ sum (1)
             STEP    n signed bytes: what each width is longer than in the frame before
             FULL    2n bytes: each width in cycles, low and high byte
             SILENT  no data: no pulses, the widths stay

The lower six bits of a record's first byte are the number of further frames for which it holds. The sum
begins with SEED at each record; each byte rotates it left by one bit and is added: another byte in a
record of the same length is another sum.
"""

from __future__ import annotations

import binascii
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from intelhex import IntelHex

from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Run

STEP, FULL, SILENT, END = 0x00, 0x40, 0x80, 0xC0
AGAIN = END | 1
"""The end of a start or a cycle: on to the cycle as long as it is commanded, else to the stop."""
KINDS, MORE = 0xC0, 0x3F
SEED = 0x5A
FIRST = 2
"""The address of the first record, behind the identity."""
LONGEST = 127
"""The maximum of a step's byte, and one less than its most negative value."""


@dataclass(frozen=True, slots=True)
class Content:
    """The bytes of a tape, and the addresses from which it is read on: of the loop, and of the start, the
    cycle and the stop of each direction.
    """

    data: bytes
    places: tuple[int, ...]

    @property
    def identity(self) -> tuple[int, int]:
        """Return the first two bytes."""
        return self.data[0], self.data[1]


def content(schedule: PulseSchedule, order: Sequence[int]) -> Content:
    """Return the tape of a schedule with pulses, which all channels have together."""
    directions = schedule.commands.directions if schedule.commands else ()
    records, places = b"", []

    def put(runs: Sequence[Run], end: int | None = None) -> int:
        nonlocal records
        place = FIRST + len(records)
        last = b"" if end is None else bytes([end])
        records += b"".join(_records(runs, order)) + last + bytes(sum_of(last) for _ in last)
        return place

    put(schedule.lead_in, END if directions and schedule.lead_in else None)
    places.append(put(schedule.loop, END))
    for direction in directions:
        places += [put(direction.start, AGAIN), put(direction.cycle, AGAIN), put(direction.stop, END)]
    identity = binascii.crc_hqx(records + b"".join(place.to_bytes(2, "big") for place in places), 0)
    return Content(identity.to_bytes(2, "big") + records, tuple(places))


def sum_of(record: bytes) -> int:
    """Return the sum of a record's bytes."""
    total = SEED
    for byte in record:
        total = (total << 1 | total >> 7) + byte & 0xFF
    return total


def tape_hex(data: bytes) -> str:
    """Return the Intel HEX file of a tape."""
    memory = IntelHex()
    memory.puts(0, data)
    text = io.StringIO()
    memory.write_hex_file(text)
    return text.getvalue()


def _records(runs: Sequence[Run], order: Sequence[int]) -> Iterator[bytes]:
    """Yield the records of runs; the first widths are given in full, whatever is read before them."""
    widths: list[int] = []
    for run in runs:
        pulses = [int(pulse.width) for channel in order if (pulse := run.pulses[channel]) is not None]
        for more in _shares(run.frames):
            kind, body = _body(pulses, widths) if pulses else (SILENT, b"")
            widths = pulses or widths
            record = bytes([kind | more - 1]) + body
            yield record + bytes([sum_of(record)])


def _body(widths: Sequence[int], before: Sequence[int]) -> tuple[int, bytes]:
    """Return the kind and the data of a record with pulses, after one with the widths `before`, if any."""
    if before:
        steps = [width - last for width, last in zip(widths, before, strict=True)]
        if all(-LONGEST - 1 <= step <= LONGEST for step in steps):
            return STEP, bytes(step & 0xFF for step in steps)
    return FULL, b"".join(width.to_bytes(2, "little") for width in widths)


def _shares(frames: int) -> Iterator[int]:
    while frames > 0:
        yield min(frames, MORE + 1)
        frames -= MORE + 1
