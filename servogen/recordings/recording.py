"""`RecordedMotion`: named tracks over time, and their values between the samples.

values │      ●╌╌╌╌●         positions alone: straight from sample to sample
       │  ●╌╌╱      ╲╌╌●     with speeds: the cubic that has them; with accelerations too: the quintic
       └───────────────▶ s
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError, Location

Floats = npt.NDArray[np.float64]

MAX_SAMPLES = 200_000
"""The maximum number of samples of a recording."""

UNITS = ("deg", "rad", "us", "pca9685")
"""Units of a track: degrees, radians (metres of a joint that slides), µs of a pulse, its 4096ths of 20 ms."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordedMotion:
    """`values` (samples, tracks) at rising `times` (samples,) in seconds from 0; speeds and accelerations per
    second if the file states them. `places` has a location for each sample.

    `units` are of `UNITS`, or "" where the file does not state one; `of_joints`: a name is first that of a
    joint of the robot, then that of a servo.
    """

    file: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    times: Floats
    values: Floats
    places: Sequence[Location]
    of_joints: bool = False
    speeds: Floats | None = None
    accelerations: Floats | None = None

    @property
    def duration(self) -> float:
        """Return the time of the last sample in seconds."""
        return float(self.times[-1])

    def at(self, times: Floats) -> Floats:
        """Return the values (n, tracks) at times (n,) within the recording."""
        if len(self.times) == 1:
            return np.repeat(self.values, len(times), axis=0)
        piece = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        h = (self.times[piece + 1] - self.times[piece])[:, None]
        u = np.clip((times[:, None] - self.times[piece][:, None]) / h, 0.0, 1.0)
        start, change = self.values[piece], self.values[piece + 1] - self.values[piece]
        if self.speeds is None:
            return np.asarray(start + u * change)
        v0, v1 = self.speeds[piece] * h, self.speeds[piece + 1] * h
        if self.accelerations is None:
            return np.asarray(start + u * (v0 + u * (3 * change - 2 * v0 - v1 + u * (v0 + v1 - 2 * change))))
        a0, a1 = self.accelerations[piece] * h**2 / 2, self.accelerations[piece + 1] * h**2 / 2
        c3 = 10 * change - 6 * v0 - 4 * v1 - 3 * a0 + a1
        c4 = -15 * change + 8 * v0 + 7 * v1 + 3 * a0 - 2 * a1
        c5 = 6 * change - 3 * v0 - 3 * v1 - a0 + a1
        return np.asarray(start + u * (v0 + u * (a0 + u * (c3 + u * (c4 + u * c5)))))

    def until(self, end_s: float) -> RecordedMotion:
        """Return the recording up to a time, at which it then has its last sample."""
        kept = int(np.searchsorted(self.times, end_s, side="left"))
        if kept >= len(self.times):
            return self
        last = np.array([end_s])

        def cut(values: Floats | None, end: Floats) -> Floats | None:
            return None if values is None else np.vstack((values[:kept], end))

        # A cut inside an interval ends with the speed that it has there, by deviations.
        near = np.array([max(0.0, end_s - 1e-4), end_s])
        slope = np.diff(self.at(near), axis=0) / max(float(near[1] - near[0]), 1e-12)
        return replace(
            self,
            times=np.append(self.times[:kept], last),
            values=np.vstack((self.values[:kept], self.at(last))),
            places=[*self.places[:kept], self.places[kept]],
            speeds=cut(self.speeds, slope),
            accelerations=None,
        )


def recording(
    file: str,
    names: Sequence[str],
    units: Sequence[str],
    samples: Sequence[tuple[float, Sequence[float], Location]],
) -> RecordedMotion:
    """Return a recording of positions alone from (time, values, place); time counts from its first sample.

    Raises InputError for no samples, too many of them, names that repeat, and times that do not rise.
    """
    if not samples or not names:
        raise InputError("bad-recording", "has no samples", Location(file), "a motion has one or more")
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InputError("bad-recording", f"two tracks are called '{name}'", samples[0][2])
    if len(samples) > MAX_SAMPLES:
        raise InputError(
            "file-too-large", f"has {len(samples)} samples", Location(file), f"at most {MAX_SAMPLES}"
        )
    times = np.array([time for time, _, _ in samples])
    late = np.flatnonzero(np.diff(times) <= 0)
    if len(late):
        index = int(late[0])
        raise InputError(
            "time-order",
            f"{times[index + 1]:g} s comes after {times[index]:g} s",
            samples[index + 1][2],
            "each sample is later than the one before it",
        )
    return RecordedMotion(
        file=file,
        names=tuple(names),
        units=tuple(units),
        times=times - times[0],
        values=np.array([list(values) for _, values, _ in samples], float),
        places=[place for _, _, place in samples],
    )
