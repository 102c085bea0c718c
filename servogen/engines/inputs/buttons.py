"""A start button and an emergency stop, which the player reads once per frame, after the last slot.

In: the pins and their levels while pressed. Out: the schedule and the trajectory if the start button is
pressed at power-up; if it is pressed later, the first frame's pulses are repeated for longer.

    power-up                     start                       stop
    ├ the first frame, again and again ┤├ the motion …             ├ no pulses, or the same again and again
      a button counts once it has been seen pressed in three consecutive frames
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from servogen.errors import Location
from servogen.motion.trajectory import JointTrajectory
from servogen.pulse.schedule import ButtonRule, Input, PulseSchedule, Run

PRESSED_FRAMES = 3
"""The number of frames in which a button must be seen pressed: 60 ms, while contacts bounce for some ms."""


@dataclass(frozen=True, slots=True)
class ButtonPin:
    """A button's pin and its level while pressed: 0 for a button to ground, which needs a pull-up
    resistor.
    """

    pin: str
    level: int
    place: Location | None = None

    def text(self) -> str:
        """Return the wiring of the pin."""
        rails = ("ground", "VDD")
        pull = ("pull-up to VDD", "pull-down to ground")
        return f"button to {rails[self.level]}, 10 kOhm {pull[self.level]}"


@dataclass(frozen=True, slots=True)
class ControlButtons:
    """A start button and an emergency stop, which switches the pulses off if `off` and else holds them."""

    kind: ClassVar[str] = "buttons"

    start: ButtonPin | None = None
    stop: ButtonPin | None = None
    off: bool = True

    @property
    def any(self) -> bool:
        """Return whether there is a button."""
        return self.start is not None or self.stop is not None

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Return the levels for which the motion runs from power-up on."""
        start = [Input(self.start.pin, self.start.level)] if self.start else []
        stop = [Input(self.stop.pin, 1 - self.stop.level)] if self.stop else []
        return (*start, *stop)

    @property
    def rule(self) -> ButtonRule | None:
        """Return the rule about the buttons for the schedule; None without buttons."""
        start, stop = (
            Input(button.pin, button.level) if button else None for button in (self.start, self.stop)
        )
        return ButtonRule(start, stop, self.off, PRESSED_FRAMES) if self.any else None

    @property
    def waiting(self) -> int:
        """Return how often the first frame is repeated if start is pressed at power-up."""
        return PRESSED_FRAMES - 1 if self.start else 0

    def text(self) -> Iterator[str]:
        """Yield the effects of the buttons, for the person who wires them."""
        seen = f"pressed for {PRESSED_FRAMES} frames"
        if self.start:
            yield f"{self.start.pin}: start, {seen}: {self.start.text()}."
            yield "Until then: the first frame's pulses."
        if self.stop:
            outcome = "no more pulses" if self.off else "the same pulses again and again"
            again = "reset" if not self.start else "start begins anew" if self.off else "start goes on"
            yield f"{self.stop.pin}: stop, {seen}: {self.stop.text()}. Then {outcome}, until {again}."


def with_wait(schedule: PulseSchedule, frames: int) -> PulseSchedule:
    """Return the schedule with `frames` additional repetitions of its first frame."""
    first = (*schedule.lead_in, *schedule.loop)[0]
    if not frames:
        return schedule
    if not schedule.lead_in:
        return replace(schedule, lead_in=(Run(frames, first.pulses),))
    longer = Run(first.frames + frames, first.pulses)
    return replace(schedule, lead_in=(longer, *schedule.lead_in[1:]))


def motion_with_wait(trajectory: JointTrajectory, frames: int) -> JointTrajectory:
    """Return the trajectory with `frames` additional repetitions of its first frame."""
    return replace(
        trajectory,
        angles=np.vstack((np.tile(trajectory.angles[0], (frames, 1)), trajectory.angles)),
        loop_start=trajectory.loop_start + frames,
    )
