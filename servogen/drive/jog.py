"""Jogging: moving one servo at a time in steps, in addition to going to the job's poses.

In: a `Poser`, commands. Out: `Jog`, an endless motion, and its state in one line: the selected servo, its
goal, the pulse for the goal, and the step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from servogen.drive.commands import COARSER, FINER, LESS, MORE, NEXT, PREVIOUS
from servogen.errors import InputError, did_you_mean
from servogen.job import PlannedJob
from servogen.motion.trajectory import Floats

STEPS_DEG = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
FIRST_STEP = STEPS_DEG.index(1.0)
"""The steps that can be chosen, and the one at the beginning."""


class Poser(Protocol):
    """Goes to poses and angles."""

    @property
    def commands(self) -> tuple[str, ...]:
        """Return the names of poses, and `stop`."""

    @property
    def goal(self) -> Floats:
        """Return the target angles of the servos (servos,) in radians."""

    def command(self, command: str) -> None:
        """Go to a pose or to `servo=degrees,…`, or stop. Raises InputError."""

    def at(self, seconds: float) -> Floats | None:
        """Return the angles of the servos (servos,) in radians at a moment."""


@dataclass(slots=True)
class Jog:
    """Takes the commands of `poser`, names of servos, and steps of the selected servo."""

    job: PlannedJob
    poser: Poser
    selected: int = 0
    step: int = FIRST_STEP
    _at_limit: bool = False

    @property
    def commands(self) -> tuple[str, ...]:
        """Return the poses, the servos' names, and the commands that select and move a servo."""
        names = (servo.name for servo in self.job.servos)
        return (*self.poser.commands, *names, NEXT, PREVIOUS, MORE, LESS, FINER, COARSER)

    def command(self, command: str) -> None:
        """Carry out a command. Raises InputError for an unknown one."""
        names = [servo.name for servo in self.job.servos]
        self._at_limit = False
        if command in self.poser.commands or "=" in command:
            self.poser.command(command)
        elif command in (NEXT, PREVIOUS):
            self.selected = (self.selected + (1 if command == NEXT else -1)) % len(names)
        elif command in (FINER, COARSER):
            self.step = min(max(self.step + (1 if command == COARSER else -1), 0), len(STEPS_DEG) - 1)
        elif command in (MORE, LESS):
            self._move(STEPS_DEG[self.step] * (1 if command == MORE else -1))
        elif command in names:
            self.selected = names.index(command)
        else:
            hint = did_you_mean(command, self.commands)
            raise InputError("bad-command", f"unknown command '{command}'", hint=hint)

    def at(self, seconds: float) -> Floats | None:
        """Return the angle of every servo (servos,) in radians."""
        return self.poser.at(seconds)

    def state(self) -> str:
        """Return the selected servo, its goal with its pulse, and the step."""
        servo = self.job.servos[self.selected]
        unit = "°/s" if servo.model.continuous else "°"
        angle = float(self.poser.goal[self.selected])
        limit = ", at its limit" if self._at_limit else ""
        return (
            f"{servo.name}: {math.degrees(angle):z.1f}{unit}, {servo.width_us(angle):.0f} µs{limit}; "
            f"step {STEPS_DEG[self.step]:g}{unit}"
        )

    def _move(self, degrees: float) -> None:
        """Move the selected servo by `degrees`, but not beyond its limits."""
        servo = self.job.servos[self.selected]
        goal = math.degrees(float(self.poser.goal[self.selected])) + degrees
        try:
            self.poser.command(f"{servo.name}={goal:.6f}")
        except InputError as error:
            if error.code != "servo-limit":
                raise
            self._at_limit = True
