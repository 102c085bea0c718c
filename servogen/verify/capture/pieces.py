"""Several captures in one file: each is a separate recording, and the time between two is not known.

    piece 1              piece 2
    __┌┐____┌┐____┊  ?  ┊__┌┐____┌┐____┊     what is seen is seen inside a piece; across a seam there is
                                             no period, and each has its own phase

In: a trace and the limits of its pieces; or the verdict on each. Out: a trace of each; or one verdict on all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from math import sqrt

import numpy as np

from servogen.edges import UNDRIVEN, EdgeTrace, edge_chunk, join
from servogen.units import Cycles
from servogen.verify.capture.reasons import with_reasons
from servogen.verify.capture.verdict import CapturedChannel, CapturePiece, CaptureVerdict, Spread
from servogen.verify.coverage import joined
from servogen.verify.verdict import StrayPin


def split(captured: EdgeTrace, pieces: Sequence[tuple[int, int]]) -> Iterator[EdgeTrace]:
    """Yield a trace of each piece, whose time 0 is the beginning of the piece."""
    edges = join(captured.chunks)
    for begin, end in pieces:
        at_begin = int(np.searchsorted(edges.cycle, begin, side="right"))
        until = int(np.searchsorted(edges.cycle, end))
        level = dict(zip(edges.pin[:at_begin].tolist(), edges.level[:at_begin].tolist(), strict=True))
        rows = [(0, pin, value) for pin, value in level.items() if value != UNDRIVEN]
        inside = zip(
            (edges.cycle[at_begin:until] - begin).tolist(),
            edges.pin[at_begin:until].tolist(),
            edges.level[at_begin:until].tolist(),
            strict=True,
        )
        rows += inside
        columns = zip(*rows, strict=True) if rows else ((), (), ())
        yield EdgeTrace(captured.clock, (edge_chunk(*columns),), Cycles(end - begin))


def merged(found: Sequence[CaptureVerdict], begins_us: Sequence[float]) -> CaptureVerdict:
    """Return the verdict on all pieces, from the verdict on each and its beginning."""
    ppm, ppm_error = _clock(found)
    mismatches = [
        replace(each.first_mismatch, time_us=each.first_mismatch.time_us + begin)
        for each, begin in zip(found, begins_us, strict=True)
        if each.first_mismatch
    ]
    pieces = tuple(
        CapturePiece(
            begin, each.duration_us, each.first_frame, each.frames, each.ppm, each.ppm_error, each.paired
        )
        for each, begin in zip(found, begins_us, strict=True)
    )
    return with_reasons(
        replace(
            found[0],
            sample_us=max(each.sample_us for each in found),
            duration_us=sum(each.duration_us for each in found),
            ppm=ppm,
            ppm_error=ppm_error,
            first_frame=None,
            frames=sum(each.frames for each in found),
            channels=tuple(_channel(each) for each in zip(*(each.channels for each in found), strict=True)),
            first_mismatch=mismatches[0] if mismatches else None,
            stray=_stray(found),
            overlap_us=max(each.overlap_us for each in found),
            paired=sum(each.paired for each in found),
            whole=found[0].whole if len(found) == 1 else None,
            coverage=joined(each.coverage for each in found),
            pieces=pieces,
        )
    )


def _clock(found: Iterable[CaptureVerdict]) -> tuple[float | None, float | None]:
    """Return the mean of the clock errors, weighted by their standard errors."""
    known = [(each.ppm, each.ppm_error) for each in found if each.ppm is not None and each.ppm_error]
    if not known:
        return None, None
    total = sum(1 / error**2 for _, error in known)
    return sum(ppm / error**2 for ppm, error in known) / total, sqrt(1 / total)


def _channel(parts: Sequence[CapturedChannel]) -> CapturedChannel:
    """Return one channel over all pieces: counts are sums, means are weighted by the number of pulses."""
    pulses = [part.captured for part in parts]
    periods = [(part.mean_period_us, part.captured) for part in parts if part.mean_period_us is not None]
    return replace(
        parts[0],
        connected=all(part.connected for part in parts),
        scheduled=sum(part.scheduled for part in parts),
        captured=sum(pulses),
        missing=sum(part.missing for part in parts),
        extra=sum(part.extra for part in parts),
        glitches=sum(part.glitches for part in parts),
        width=_spread([part.width for part in parts], pulses),
        period=_spread([part.period for part in parts], pulses),
        edge=_spread([part.edge for part in parts], pulses),
        mean_period_us=_mean(periods) if periods else None,
        jitter_us=sqrt(_mean([(part.jitter_us**2, part.captured) for part in parts])),
    )


def _spread(parts: Sequence[Spread], pulses: Sequence[int]) -> Spread:
    worst = max((part.worst_us for part in parts), key=abs)
    mean = _mean([(part.mean_us, number) for part, number in zip(parts, pulses, strict=True)])
    return Spread(worst, mean, sum(part.wrong for part in parts))


def _mean(values: Iterable[tuple[float, int]]) -> float:
    pairs = list(values)
    return sum(value * weight for value, weight in pairs) / max(1, sum(weight for _, weight in pairs))


def _stray(found: Iterable[CaptureVerdict]) -> tuple[StrayPin, ...]:
    counts: dict[int, StrayPin] = {}
    for each in found:
        for stray in each.stray:
            known = counts.get(stray.pin)
            counts[stray.pin] = replace(known, edges=known.edges + stray.edges) if known else stray
    return tuple(counts[pin] for pin in sorted(counts))
