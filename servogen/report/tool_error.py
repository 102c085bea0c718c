"""The error that whole cycles of pulse width cause at the foot or tool: worst, rms, and where.

In: the `Track`s of a job. Out: an `EndError` of each, and the rows of a table of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from servogen.report.tracks import Kind, Track

SAME_DIGITS = 9
"""Of metres: errors nearer than a nanometre are one, so that the first of them is named on every machine."""


@dataclass(frozen=True, slots=True)
class EndError:
    """Of one foot or tool: metres, the frame in which it is worst, and the same through the Jacobian."""

    name: str
    kind: Kind
    worst_m: float
    rms_m: float
    frame: int
    first_order_worst_m: float
    first_order_rms_m: float

    def to_json(self) -> dict[str, object]:
        """Return the error without the name of the end."""
        return {
            "worst_m": self.worst_m,
            "rms_m": self.rms_m,
            "frame": self.frame,
            "jacobian_worst_m": self.first_order_worst_m,
            "jacobian_rms_m": self.first_order_rms_m,
        }


def errors_of(tracks: Sequence[Track]) -> tuple[EndError, ...]:
    """One a track, in their order; a track without a pulse has no error and is left out."""
    return tuple(_error(track) for track in tracks if not np.isnan(track.error).all())


def worst_of(errors: Sequence[EndError]) -> EndError:
    """The end whose worst error is greatest."""
    return max(errors, key=lambda each: round(each.worst_m, SAME_DIGITS))


def _error(track: Track) -> EndError:
    direct, slope = track.error, track.first_order
    return EndError(
        track.name,
        track.kind,
        float(np.nanmax(direct)),
        _rms(direct),
        int(np.nanargmax(np.round(direct, SAME_DIGITS))),
        float(np.nanmax(slope)),
        _rms(slope),
    )


def _rms(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def error_rows(errors: Sequence[EndError], frame_s: float) -> Iterator[tuple[str, ...]]:
    """Name, worst, rms, its frame and its time, worst and rms through the Jacobian: cells as text."""
    for each in errors:
        yield (
            each.name,
            f"{1000 * each.worst_m:z.4f}",
            f"{1000 * each.rms_m:z.4f}",
            str(each.frame),
            f"{each.frame * frame_s:.6g}",
            f"{1000 * each.first_order_worst_m:z.4f}",
            f"{1000 * each.first_order_rms_m:z.4f}",
        )


ERROR_COLUMNS = ("end", "worst_mm", "rms_mm", "frame", "time_s", "jacobian_worst_mm", "jacobian_rms_mm")
