"""Plans the longest capture that an analyser's memory, rate and RLE allow.

In: the device's memory and the requested capture. Out: a `CapturePlan`, or an `InputError` that shows the
arithmetic if the memory is too small.

    without RLE   one word per sample       rate · period words per frame
    with RLE      two words per level       2 · edges words per frame, and two more for each 32768 samples
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil, floor, isqrt

from servogen.bench.analysers import sump
from servogen.errors import InputError
from servogen.units import counted

TYPICAL_PERIOD_S = Fraction(1, 50)
TYPICAL_EDGES = 2 * 13
MIN_EDGES = 2
"""The edges of a frame of which nothing is known: a pulse on each pin, no two edges at one time; or on one
pin.
"""

MAX_DIVISOR = 1 << 24
"""The maximum ratio of the analyser's clock to its rate: the divider has 24 bits."""

RATES = tuple(
    sorted(
        rate
        for low in range(1, isqrt(sump.BASE_HZ) + 1)
        if sump.BASE_HZ % low == 0
        for rate in {low, sump.BASE_HZ // low}
        if rate * MAX_DIVISOR >= sump.BASE_HZ
    )
)
"""The usable rates: whole numbers of samples per second that the divider makes of the analyser's clock."""

SLACK = 4
"""Words beyond what is needed, because memory is requested in multiples of four."""


@dataclass(frozen=True, slots=True)
class CaptureNeeds:
    """The requested capture: frames of `period_s`, with `edges` changes per frame on average.

    `fewest` is the mean where the frames have the fewest changes; there, as many words take longer to fill.
    """

    period_s: Fraction
    edges: Fraction
    frames: int
    fewest: Fraction
    most: int
    """The maximum number of edges in any one frame."""

    def beside(self, other: CaptureNeeds) -> CaptureNeeds:
        """Return what a capture needs that also records the edges of another chip."""
        return replace(
            self,
            edges=self.edges + other.edges,
            fewest=self.fewest + other.fewest,
            most=self.most + other.most,
        )


@dataclass(frozen=True, slots=True)
class CapturePlan:
    """A capture of `words` words: `frames` whole frames, and the one in which it begins."""

    rate: Fraction
    rle: bool
    words: int
    frames: int
    seconds: Fraction
    """The maximum time that filling the words can take."""
    words_per_frame: Fraction
    """The mean number of words per frame."""
    fewest: Fraction
    """The same for frames with the fewest edges."""
    period_s: Fraction

    def shorter(self, by: int) -> CapturePlan:
        """Return the same plan with `by` fewer whole frames, but at least one."""
        by = min(by, self.frames - 1)
        words = self.words - floor(by * self.words_per_frame / 4) * 4
        return replace(
            self, words=words, frames=self.frames - by, seconds=words / self.fewest * self.period_s
        )


def plan(
    memory: int, rate: int, rle: bool, wanted: CaptureNeeds, several: bool = False, bits: int = sump.WORD_BITS
) -> CapturePlan:
    """Return the plan of a capture of all that is wanted or, if `several` are made, of as much as one can
    hold.

    Raises InputError if the memory is too small for it.
    """
    exact = Fraction(rate)
    if rate not in RATES:
        advised = max((usable for usable in RATES if usable < rate), default=RATES[0])
        raise InputError(
            "bad-rate",
            f"the analyser cannot take {rate} samples per second: "
            f"it divides {sump.BASE_HZ} by a whole number up to {MAX_DIVISOR}",
            hint=f"try {advised}",
        )
    room = min(memory // (bits // 8), sump.MAX_READ_WORDS) // 4 * 4
    # The trigger comes somewhere inside a frame: that one is not whole, but takes memory like the largest.
    first = words_of_frame(exact, rle, wanted.period_s, Fraction(wanted.most)) + SLACK
    per_frame = words_of_frame(exact, rle, wanted.period_s, wanted.edges)
    fits = floor((room - first) / per_frame)
    if fits < 1:
        raise InputError(
            "analyser-memory", _arithmetic(memory, room, exact, rle, wanted), hint=_advice(room, rle, wanted)
        )
    if fits < wanted.frames and not several:
        raise InputError(
            "analyser-memory",
            f"the analyser's memory is too small: {room} words hold {counted(fits, 'frame')} "
            f"of {float(per_frame):.3g} words and the one in which it begins, not {wanted.frames}",
            hint=f"at most --seconds {int(1000 * fits * wanted.period_s) / 1000:g} at a time; "
            "with --against, several captures are stitched",
        )
    frames = min(fits, wanted.frames)
    words = min(room, ceil((frames * per_frame + first) / 4) * 4)
    # With RLE the memory fills most slowly where the frames have few edges: the capture lasts no longer.
    fewest = 2 * wanted.fewest if rle else per_frame
    return CapturePlan(
        exact, rle, words, frames, words / fewest * wanted.period_s, per_frame, fewest, wanted.period_s
    )


def words_of_frame(rate: Fraction, rle: bool, period_s: Fraction, edges: Fraction) -> Fraction:
    samples = rate * period_s
    return 2 * edges + 2 * samples / (sump.longest_count() + 1) if rle else Fraction(ceil(samples))


def _arithmetic(memory: int, room: int, rate: Fraction, rle: bool, wanted: CaptureNeeds) -> str:
    per_frame = words_of_frame(rate, rle, wanted.period_s, Fraction(wanted.most))
    frame = f"a frame of {float(wanted.period_s * 1000):g} ms"
    how = (
        f"with {wanted.most} edges is {ceil(per_frame)} words with RLE"
        if rle
        else f"at {int(rate)} samples a second is {per_frame} samples of a word each"
    )
    return (
        f"the analyser's memory is too small: {memory} bytes are {room} words, and {frame} {how}; "
        "the frame in which it begins and a whole one must fit"
    )


def _advice(room: int, rle: bool, wanted: CaptureNeeds) -> str:
    if not rle:
        slower = floor(room / (2 * wanted.period_s))
        return f"with RLE (--rle), or with at most {slower} samples a second (--rate)"
    return "watch fewer servos at a time, or use an analyser with more memory"
