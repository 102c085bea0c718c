"""Orders: the words that a person types or keys stand for, and what takes them.

In: nothing. Out: `WAYS`, `Rates`, and the protocol `Steering`, a `Motion` without an end that takes orders.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from servogen.errors import InputError, nearest
from servogen.motion.trajectory import Floats

STOP = "stop"
WAYS: Mapping[str, tuple[int, int, int]] = {
    "forward": (1, 0, 0),
    "back": (-1, 0, 0),
    "left": (0, 0, 1),
    "right": (0, 0, -1),
    "sideways-left": (0, 1, 0),
    "sideways-right": (0, -1, 0),
}
"""Orders and what the body does: along x, along y, about z."""


@dataclass(frozen=True, slots=True)
class Rates:
    """How far a walking robot goes in a cycle, how fast a base goes in a second. None: as in the job."""

    way_mm: float | None = None
    turn_deg: float | None = None


class Steering(Protocol):
    """A `Motion` without an end that takes orders; `words` are those it knows."""

    @property
    def words(self) -> tuple[str, ...]: ...

    def order(self, word: str) -> None:
        """Raises InputError for a word that is none."""

    def at(self, seconds: float) -> Floats | None: ...


def unknown(word: str, words: Iterable[str]) -> InputError:
    return InputError(f"'{word}' is no order", hint=nearest(word, words))
