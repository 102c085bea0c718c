"""The fingerprint: everything that a machine's future depends on, as bytes.

In: the state vector. Out: bytes that are equal for two states exactly if the machine will behave identically
from both, given the same program, clock and options, and no stimulus. The proof for unlimited time
(`recurrence.py`) relies on it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from servogen.pic.device import EEPROM_BYTES, RAM_FIRST, RAM_LAST, STACK_LEVELS
from servogen.simulator import layout as at


def fingerprint(s: npt.NDArray[np.int64]) -> bytes:
    """Return everything that the machine's future depends on except absolute time; equal bytes mean equal
    behaviour from then on.

    Times are relative to now; the stack's ring is rotated so that its top comes first; data that only serves
    reports is omitted. RAM that was never written counts with the value that it happens to have.
    """
    now = int(s[at.CYCLE])
    ram = s[RAM_FIRST : RAM_LAST + 1] & 0xFF
    ring = np.roll(s[at.STACK : at.STACK + STACK_LEVELS], -int(s[at.SP]))
    plain = s[[*_PLAIN]]
    times = [_after(int(s[slot]), now) for slot in _TIMES]
    times.append(max(int(s[at.T0_AT]) - now, 0))
    times.append(int(s[at.T0_FLAGGED] == now))
    times.append(max(int(s[at.T0_HELD]) - now, 0))
    times.append(now - int(s[at.WDT_AT]) if s[at.WDT_PERIOD] else 0)
    if s[at.EE_STEP]:
        times.append(min(now - int(s[at.EE_STEP_AT]), 3))
    parts = (ram, ring, plain, np.array(times, dtype=np.int64), s[at.EEPROM : at.EEPROM + EEPROM_BYTES])
    return b"".join(part.astype(np.int64).tobytes() for part in parts)


def unknown_bits(s: npt.NDArray[np.int64]) -> bytes:
    """Return which bits are unknown, and the state of the shortest watchdog: later uses of unknown values
    depend on these.
    """
    ram = s[RAM_FIRST : RAM_LAST + 1] >> at.UNKNOWN_SHIFT & 0xFF
    masks = [int(s[slot]) & 0xFF for slot in _UNKNOWN_BYTES]
    masks += [int(s[slot]) for slot in _UNKNOWN_BITS]
    masks.append(_after(int(s[at.WDT_EARLIEST]), int(s[at.CYCLE])))
    masks.append(int(s[at.CYCLE] - s[at.WDT_CLEARED]) if s[at.WDT_SHORTEST] else 0)
    return ram.tobytes() + np.array(masks, dtype=np.int64).tobytes()


_UNKNOWN_BYTES = (
    at.W_UNKNOWN,
    at.STATUS_UNKNOWN,
    at.FSR_UNKNOWN,
    at.T0_UNKNOWN,
    at.EEDATA_UNKNOWN,
    at.EEADR_UNKNOWN,
)
_UNKNOWN_BITS = (
    at.PRESCALER_UNKNOWN,
    at.EECON1_UNKNOWN,
    at.INTCON_UNKNOWN,
    at.PINS_UNKNOWN,
    at.LATCH_UNKNOWN,
    at.RB_OLD_UNKNOWN,
)


_PLAIN = (
    at.PC,
    at.W,
    at.STATUS,
    at.FSR,
    at.PCLATH,
    at.INTCON,
    at.OPTION,
    at.SLEEPING,
    at.IN_RESET,
    at.T0_VALUE,
    at.PRESCALER,
    at.LATCH,
    at.TRIS,
    at.PINS,
    at.RB_OLD,
    at.EXT_MASK,
    at.EXT_LEVEL,
    at.EEDATA,
    at.EEADR,
    at.EECON1,
    at.EE_STEP,
    at.EE_CELL,
    at.EE_BYTE,
)
_TIMES = (at.IRQ_AT, at.T0_TICK, at.EE_DONE_AT)


def _after(when: int, now: int) -> int:
    return -1 if when == at.NEVER else when - now
