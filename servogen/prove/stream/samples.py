"""The gaps between looks at the line, and when each bit of a byte is sampled as a consequence.

In: the looks of an interrupt in their order, as its execution meets them. Out: `SampleTimes`: the earliest
and the latest sample of each bit, from the beginning of its byte.

    line   ▔▔▔▔▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁ …
    looks    HUNT      START      WAIT …  WAIT       BIT
             ├── gap ──┤ stamp            ├─ wait ───┤ the first stamp after the bit is due, then its sample
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from servogen.engines.stream.interrupt_code import ROUND
from servogen.engines.stream.protocol import BITS
from servogen.engines.stream.settings import SAMPLE_AFTER, STOP_AFTER, UNIT
from servogen.prove.stream.looks import BIT, HUNT, NONE, SENT, START, WAIT, Kind


class LastLook(NamedTuple):
    """The latest look at the line; times are cycles of the round."""

    kind: Kind = NONE
    sample: int = 0
    stamp: int = 0


NO_LOOK = LastLook()


class SeenStart(NamedTuple):
    """A look that sees a start bit, after one that saw none."""

    stamp: int
    """The cycle of its round in which its time stamp is made."""
    since_sample: int
    """The cycles from its sample to its time stamp."""
    gap: int
    """The cycles from the sample before to its own: the byte may have begun in any of them."""


class StampGap(NamedTuple):
    """Two time stamps within a byte, one after the other."""

    stamp: int
    """The former's cycle of its round."""
    wait: int
    """The cycles to the next one."""


@dataclass(frozen=True, slots=True)
class SampleTimes:
    """When bits are sampled, for every line."""

    starts: frozenset[SeenStart]
    waits: frozenset[StampGap]

    @property
    def start_gap(self) -> int:
        """Return the maximum cycles between two samples of the line while a start bit is looked for."""
        return max(start.gap for start in self.starts)

    @property
    def bit_gap(self) -> int:
        """Return the maximum cycles between two time stamps within a byte."""
        return max(gap.wait for gap in self.waits)

    def latest(self, k: int, first_units: int, bit_units: int) -> int:
        """Return the maximum cycles from the beginning of a byte to the sample of bit k (0: the start bit).

        A start's time stamp fixes the cycle of its round in which each bit is due. Only those pairs of time
        stamps count between which that cycle is.
        """
        after = STOP_AFTER if k == BITS - 1 else SAMPLE_AFTER[1]
        before, wait = np.array(sorted(self.waits), dtype=np.int64).T
        latest = 0
        for stamp, since_sample, gap in self.starts:
            due = UNIT * (stamp // UNIT + first_units + 1 + k * bit_units)
            # The bit is taken by the first look whose time stamp is at `due` or later: within a wait in which
            # `due` falls, that is the look at its end.
            passed = (due - before - 1) % ROUND
            later = (wait - 1 - passed)[passed < wait]
            latest = max(latest, gap + since_sample + due - stamp + int(later.max(initial=0)) + after)
        return latest

    def earliest(self, k: int, first_units: int, bit_units: int) -> int:
        """Return the minimum cycles from the beginning of a byte to the sample of bit k."""
        due = UNIT * (first_units + 1 + k * bit_units)
        return SAMPLE_AFTER[0] + min(
            start.since_sample + due + UNIT * (start.stamp // UNIT) - start.stamp for start in self.starts
        )


@dataclass(slots=True)
class LookSequence:
    """Which looks can follow each other, and the gaps between those that did."""

    answers: bool
    """Whether the chip answers on a pin."""
    min_first_bit_cycles: int
    """The minimum number of cycles from a start bit's time stamp to the first bit's."""
    starts: set[SeenStart] = field(default_factory=set)
    waits: set[StampGap] = field(default_factory=set)

    def may_follow(self, last: LastLook, kind: Kind, stamp: int) -> bool:
        """Return whether a look can be the next one after `last`."""
        if last.kind == START:
            return kind == WAIT or (kind == BIT and stamp - last.stamp >= self.min_first_bit_cycles)
        if kind in (HUNT, START):
            return last.kind != SENT  # more bits of the answer are to come
        # After a hunt without a start bit only main can have set `rx_bits`: it answers.
        return last.kind != HUNT or self.answers

    def append(self, last: LastLook, kind: Kind, sample: int, stamp: int) -> LastLook:
        """Return a look as the latest one; note the gap from `last`."""
        if last.kind in (HUNT, BIT) and kind == START:
            self.starts.add(SeenStart(stamp % ROUND, stamp - sample, sample - last.sample))
        elif last.kind in (START, WAIT, BIT) and kind in (WAIT, BIT):
            self.waits.add(StampGap(last.stamp % ROUND, stamp - last.stamp))
        return LastLook(SENT if (last.kind, kind) == (HUNT, BIT) else kind, sample, stamp)

    def times(self) -> SampleTimes:
        return SampleTimes(frozenset(self.starts), frozenset(self.waits))
