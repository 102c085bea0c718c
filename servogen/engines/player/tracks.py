"""Keyframes in few bytes: channels that do the same, also mirrored or some keyframes later, share a track.

In: keyframes of every part, one byte per channel. Out: the bytes of all tracks, and for every part and
channel where its track begins and by how many keyframes it is ahead.

    L1  a b c d e f        one track  a b c d e f
    L2  d e f a b c        the same, 3 keyframes ahead
    R1  mirrored L2        the same; the channel's sign is -1
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from servogen.engines.player.parts import ALIKE
from servogen.motion.trajectory import Floats

MAX_BYTES = 256
"""The size of a table whose index is one byte."""

MAX_AHEAD = 127


@dataclass(slots=True)
class Pool:
    """The bytes of all tracks so far."""

    data: bytes = b""
    rings: list[tuple[int, int]] = field(default_factory=list)
    """(start, keyframes) of the cyclic tracks."""

    def place(self, keys: bytes, *, ring: bool) -> tuple[int, int]:
        """Return (start, ahead) of a track with these keyframes; new bytes are added only if it is not there
        yet.

        A cyclic track may be found at any of its keyframes.
        """
        start = self.data.find(keys)
        if start >= 0:
            return start, 0
        if ring:
            for start, count in self.rings:
                for ahead in (
                    range(1, min(count, MAX_AHEAD + 1, MAX_BYTES - count)) if count == len(keys) else ()
                ):
                    if keys == self.data[start + ahead : start + count] + self.data[start : start + ahead]:
                        return start, ahead
        start = len(self.data) - self._common(keys)
        self.data = self.data[:start] + keys
        if ring:
            self.rings.append((start, len(keys)))
        return start, 0

    def place_all(self, tracks: set[bytes]) -> None:
        """Place tracks that are not cyclic, each time the one that overlaps the end most."""
        while tracks := {keys for keys in tracks if keys not in self.data}:
            keys = max(tracks, key=lambda keys: (self._common(keys), len(keys), keys))
            self.place(keys, ring=False)

    def _common(self, keys: bytes) -> int:
        """Return by how many keyframes the end of the data and the beginning of a track overlap."""
        at = max(0, len(self.data) - len(keys))
        while (at := self.data.find(keys[:1], at)) >= 0:
            if keys.startswith(self.data[at:]):
                return len(self.data) - at
            at += 1
        return 0


def signs(excursions: Floats, rings: list[tuple[int, int]]) -> tuple[int, ...]:
    """Return the sign of each channel with which most channels do the same at some time of a cycle.

    `excursions` (frames, channels) are from the first pose, `rings` the (first frame, frames) of what
    repeats.
    """
    chosen: list[int] = []
    for channel in range(excursions.shape[1]):
        column = excursions[:, channel]
        votes = sum(
            chosen[other] * _alike(excursions[a : a + n, other], column[a : a + n])
            for other in range(channel)
            for a, n in rings
        )
        if not votes and not rings:
            votes = sum(chosen[other] * _same(excursions[:, other], column) for other in range(channel))
        chosen.append(int(np.sign(votes)) or (1 if column.max() >= -column.min() else -1))
    return tuple(chosen)


def _alike(one: Floats, other: Floats) -> int:
    """Return 1 if `other` is `one` rotated by some frames, -1 if it is mirrored too, else 0."""
    turned = np.stack([np.roll(one, -ahead) for ahead in range(len(one))])
    for sign in (1, -1):
        if (np.abs(turned - sign * other) < ALIKE).all(axis=1).any():
            return sign
    return 0


def _same(one: Floats, other: Floats) -> int:
    return next((sign for sign in (1, -1) if (np.abs(one - sign * other) < ALIKE).all()), 0)
