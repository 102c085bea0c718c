"""The reasons against a capture, as sentences: of one, and of several in one file.

In: a `CaptureVerdict` with all findings. Out: the same with its reasons; without any it is proven.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from servogen.edges import PINS
from servogen.units import counted
from servogen.verify.capture.verdict import CapturedChannel, CapturePiece, CaptureVerdict
from servogen.verify.reasons import unseen_reason

FEWEST = 2
"""Pulses in their places that a judgement on one capture needs."""

CLOCK_PPM = 5.0
"""Pieces of one capture may differ so much in the clock that each finds, beside four standard errors."""


def with_reasons(found: CaptureVerdict) -> CaptureVerdict:
    """Return the verdict: proven if nothing speaks against it and every different frame was seen."""
    why = tuple(_reasons(found))
    unseen = () if why or found.coverage.complete else (unseen_reason(found.coverage),)
    return replace(found, proven=not why and not unseen, reasons=why or unseen, unseen=unseen)


def _reasons(found: CaptureVerdict) -> Iterator[str]:
    if found.pieces:
        for number, piece in enumerate(found.pieces, 1):
            if not piece.paired:
                yield f"piece {number} holds none of the schedule's pulses"
    elif found.paired < FEWEST:
        yield "the capture holds too few of the schedule's pulses to be judged"
    if found.first_mismatch:
        first = found.first_mismatch
        yield f"first at {first.time_us / 1e6:z.6f} s{_of_piece(found)}, {first.diagnostic.message}"
    for channel in found.channels:
        yield from _channel_reasons(channel)
    if found.overlap_us:
        yield f"pulses overlap where the schedule has none together, for at most {found.overlap_us:z.2f} µs"
    for stray in found.stray:
        name = PINS[stray.pin]
        yield f"{name}, which the schedule does not drive, changes {counted(stray.edges, 'time')}"
    if found.ppm is None or found.ppm_error is None:
        return
    allowed = found.tolerances.crystal_ppm
    if abs(found.ppm) > allowed + 2 * found.ppm_error:
        yield f"the chip's clock is off by {found.ppm:+z.1f} ppm, allowed ±{allowed:g} ppm"
    for number, piece in enumerate(found.pieces, 1):
        if _differs(piece, found.ppm):
            yield (
                f"by piece {number} alone the chip's clock is off by {piece.ppm:+z.1f} ppm, "
                f"by all {found.ppm:+z.1f} ppm: its periods are not those of the others"
            )


def _of_piece(found: CaptureVerdict) -> str:
    """Return which piece the first mismatch is in."""
    if not found.pieces or found.first_mismatch is None:
        return ""
    time = found.first_mismatch.time_us
    return f" (piece {sum(piece.begin_us <= time for piece in found.pieces)})"


def _differs(piece: CapturePiece, ppm: float) -> bool:
    if piece.ppm is None or piece.ppm_error is None:
        return False
    return abs(piece.ppm - ppm) > CLOCK_PPM + 4 * piece.ppm_error


def _channel_reasons(channel: CapturedChannel) -> list[str]:
    """Return the problems of the channel as a whole."""
    who = f"{PINS[channel.pin]} ({channel.name})"
    if not channel.connected:
        return [f"{who} was not captured: no wire of the capture is {PINS[channel.pin]}"]
    counts = (
        (channel.missing, "missing pulse"),
        (channel.extra, "extra pulse"),
        (channel.glitches, "glitch"),
    )
    facts = [counted(number, noun) for number, noun in counts if number]
    for spread, noun in ((channel.width, "width"), (channel.period, "period"), (channel.edge, "edge")):
        if spread.wrong and not (noun == "edge" and facts):
            facts.append(f"{counted(spread.wrong, f'wrong {noun}')}, worst {spread.worst_us:+z.2f} µs")
    return [f"{who}: {', '.join(facts)}"] if facts else []
