"""The fingerprint: everything that a machine's future depends on, as bytes.

In: the state vector. Out: bytes that are equal for two states exactly if the machine will behave identically
from both, given the same program, clock and options, and no stimulus. The search for unlimited time
(`recurrence.py`) relies on it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from servogen.pic.device import EEPROM_BYTES, RAM_FIRST, RAM_LAST, STACK_LEVELS
from servogen.simulator import layout as at
from servogen.simulator.slots import Future, SlotFacts


def fingerprint(s: npt.NDArray[np.int64]) -> bytes:
    """Return everything that the machine's future depends on except absolute time; equal bytes mean equal
    behaviour from then on.

    Times are relative to now; the stack's ring is rotated so that its top comes first; data that only serves
    reports is omitted. RAM that was never written counts with the value that it happens to have.
    """
    now = int(s[at.CYCLE])
    ram = s[RAM_FIRST : RAM_LAST + 1] & 0xFF
    ring = np.roll(s[at.STACK : at.STACK + STACK_LEVELS], -int(s[at.SP]))
    times = _times(s, _OWN_TIMES)
    times.append(int(s[at.T0_FLAGGED] == now))
    if s[at.EE_STEP]:
        times.append(min(now - int(s[at.EE_STEP_AT]), 3))
    parts = (
        ram,
        ring,
        s[_VALUES],
        np.array(times, dtype=np.int64),
        s[at.EEPROM : at.EEPROM + EEPROM_BYTES],
    )
    return b"".join(part.astype(np.int64).tobytes() for part in parts)


def shift(s: npt.NDArray[np.int64], cycles: int) -> None:
    """Have all that happened and all that is to come be `cycles` later; no fingerprint shows that."""
    for slot in _MOMENTS:
        if s[slot] != at.NEVER:
            s[slot] += cycles


def unknown_bits(s: npt.NDArray[np.int64]) -> bytes:
    """Return which bits are unknown, and the state of the shortest watchdog: later uses of unknown values
    depend on these.
    """
    ram = s[RAM_FIRST : RAM_LAST + 1] >> at.UNKNOWN_SHIFT & 0xFF
    masks = [int(s[mask]) & row.bits for row, mask in at.UNCERTAIN]
    masks += s[_OTHER_VALUES].tolist()
    masks += _times(s, _OTHER_TIMES)
    return ram.tobytes() + np.array(masks, dtype=np.int64).tobytes()


def _slots(other_chips: bool) -> tuple[list[int], tuple[SlotFacts, ...]]:
    """Return the slots whose values count, and the rows of those that hold times."""
    rows = [row for row in at.ROWS if row.other_chips is other_chips]
    values = [row.number for row in rows if row.future in (Future.VALUE, Future.STIMULUS)]
    return values, tuple(row for row in rows if row.future in (Future.MOMENT, Future.UNTIL, Future.SINCE))


_VALUES, _OWN_TIMES = _slots(other_chips=False)
_OTHER_VALUES, _OTHER_TIMES = _slots(other_chips=True)
_MOMENTS = [
    at.CYCLE,
    at.HORIZON,
    at.T0_FLAGGED,
    at.EE_STEP_AT,
    *(row.number for row in (*_OWN_TIMES, *_OTHER_TIMES)),
]


def _times(s: npt.NDArray[np.int64], rows: tuple[SlotFacts, ...]) -> list[int]:
    """Return the times in the slots of `rows`, relative to now."""
    now = int(s[at.CYCLE])
    times = []
    for row in rows:
        when = int(s[row.number])
        if row.future is Future.MOMENT:
            times.append(when if when == at.NEVER else when - now)
        elif row.future is Future.UNTIL:
            times.append(max(when - now, 0))
        else:
            times.append(now - when if s[at.WDT_PERIOD] else 0)
    return times
