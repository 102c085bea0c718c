"""The longest capture that an analyser's memory, rate and RLE allow; one that is too short is rejected with
the arithmetic.

In: the device's memory and what is to be seen. Out: a `Plan`, or an `InputError` that shows the numbers.

    without RLE   a word a sample           rate · period words a frame
    with RLE      two words a level         2 · edges words a frame, and two more for each 32768 samples
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil, floor

from servogen.bench.analysers import sump
from servogen.errors import InputError

USUAL_PERIOD_S = Fraction(1, 50)
USUAL_EDGES = 2 * 13
FEWEST_EDGES = 2
"""Of a frame of which nothing is known: a pulse on each pin, no two edges at one time; or on one alone."""

SLACK = 4
"""Words beyond what is needed: memory is asked for in fours."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """The requested capture: frames of `period_s`, with `edges` changes per frame on average.

    Where they can be fewer, `fewest` says how many on average: then a look of as many words takes longer.
    """

    period_s: Fraction
    edges: Fraction
    frames: int
    fewest: Fraction
    most: int
    """In any one frame."""


@dataclass(frozen=True, slots=True)
class Plan:
    """A capture of `words` words: `frames` whole frames, and the one in which it begins."""

    rate: Fraction
    rle: bool
    words: int
    frames: int
    seconds: Fraction
    """The longest that it can take to fill the words."""
    each: Fraction
    """Words of a frame, on average."""
    fewest: Fraction
    """The same where as few edges are in it as can be."""
    period_s: Fraction

    def shorter(self, by: int) -> Plan:
        """Return the same plan with `by` fewer whole frames, but at least one."""
        by = min(by, self.frames - 1)
        words = self.words - floor(by * self.each / 4) * 4
        return replace(
            self, words=words, frames=self.frames - by, seconds=words / self.fewest * self.period_s
        )


def plan(memory: int, rate: int, rle: bool, wanted: Wanted, several: bool = False) -> Plan:
    """Return the capture that shows what is wanted or, if `several` are made, as much of it as one can show.

    Raises InputError where the memory is too small for it.
    """
    exact = Fraction(rate)
    if sump.BASE_HZ % rate or sump.BASE_HZ // rate > 1 << 24:
        below = sump.BASE_HZ // ceil(Fraction(sump.BASE_HZ, rate))
        raise InputError(
            "bad-rate",
            f"{rate} samples a second do not divide the analyser's {sump.BASE_HZ}",
            hint=f"as {below}",
        )
    room = min(memory // (sump.WORD_BITS // 8), sump.MOST_READ) // 4 * 4
    first = words_a_frame(exact, rle, wanted.period_s, Fraction(wanted.most)) + SLACK
    each = words_a_frame(exact, rle, wanted.period_s, wanted.edges)
    fits = floor((room - first) / each)
    if fits < 1:
        raise InputError(
            "analyser-memory", _arithmetic(memory, room, exact, rle, wanted), hint=_advice(room, rle, wanted)
        )
    if fits < wanted.frames and not several:
        raise InputError(
            "analyser-memory",
            f"the analyser's memory is too small: {room} words hold {fits} frames of {float(each):.3g} words "
            f"and the one in which it begins, not {wanted.frames}",
            hint=f"at most --seconds {int(1000 * fits * wanted.period_s) / 1000:g} at a time; "
            "with --against, several captures are stitched",
        )
    frames = min(fits, wanted.frames)
    words = min(room, ceil((frames * each + first) / 4) * 4)
    fewest = 2 * wanted.fewest if rle else each
    return Plan(exact, rle, words, frames, words / fewest * wanted.period_s, each, fewest, wanted.period_s)


def words_a_frame(rate: Fraction, rle: bool, period_s: Fraction, edges: Fraction) -> Fraction:
    samples = rate * period_s
    return 2 * edges + 2 * samples / (sump.longest_count() + 1) if rle else Fraction(ceil(samples))


def _arithmetic(memory: int, room: int, rate: Fraction, rle: bool, wanted: Wanted) -> str:
    each = words_a_frame(rate, rle, wanted.period_s, Fraction(wanted.most))
    frame = f"a frame of {float(wanted.period_s * 1000):g} ms"
    how = (
        f"with {wanted.most} edges is {ceil(each)} words with RLE"
        if rle
        else f"at {int(rate)} samples a second is {each} samples of a word each"
    )
    return (
        f"the analyser's memory is too small: {memory} bytes are {room} words, and {frame} {how}; "
        "the frame in which it begins and a whole one must fit"
    )


def _advice(room: int, rle: bool, wanted: Wanted) -> str:
    if not rle:
        slower = floor(room / (2 * wanted.period_s))
        return f"with RLE (--rle), or with at most {slower} samples a second (--rate)"
    return "watch fewer servos at a time, or use an analyser with more memory"
