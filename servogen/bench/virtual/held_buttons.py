"""`HeldButtons`: buttons at pins of the virtual chip, pressed and released while it runs.

In: the buttons by name, and the one that is held. Out: the levels of their pins, as a stimulus.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from servogen.simulator.sources import Change
from servogen.units import Clock


@dataclass(slots=True)
class HeldButtons:
    """At most one of `buttons` is held: the one named `held`, from the next multiple of `cycles` on."""

    buttons: Mapping[str, tuple[int, int]]
    """By name: the number of the pin, and its level while the button is pressed."""
    cycles: int
    held: str = ""
    presses: deque[str] = field(default_factory=deque)
    """What is held before that, one name for each multiple of `cycles`."""

    def changes(self, clock: Clock) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        until = 1
        yield until, _packed([Change(0, pin, 1 - level) for pin, level in self.buttons.values()])
        before = ""
        while True:
            now, changes = self.presses.popleft() if self.presses else self.held, []
            if now != before:
                for name in filter(None, (before, now)):
                    pin, level = self.buttons[name]
                    changes.append(Change(until, pin, level if name == now else 1 - level))
            before = now
            until += self.cycles
            yield until, _packed(changes)


def _packed(changes: list[Change]) -> npt.NDArray[np.int64]:
    return np.array([change.packed for change in changes], dtype=np.int64)
