"""A line that commands a walk, as the specification hears it: "Walk on command" in docs/firmware.md.

In: a `CommandRule`, and the frames of its directions as numbers. Out: what is heard of the line, level by
level, and the frame that follows a frame.
"""

from __future__ import annotations

from servogen.pulse.schedule import CommandRule, PulseSchedule

AT_REST = 0
"""Heard: the line has been at rest for so long that a code may begin."""
OFF_REST, ON_REST = 64, 128
"""Heard: so many levels more that are equal, and no code. Between: a 1, and the levels since a start."""


class Commands:
    """Follows a line. Directions are numbered from 1 on; 0 is the stance."""

    def __init__(self, schedule: PulseSchedule, rule: CommandRule) -> None:
        self.rule = rule
        self._codes = {direction.code: number + 1 for number, direction in enumerate(rule.directions)}
        at = schedule.lead_in_frames
        self._first: list[tuple[int, int, int]] = [(at, at, at)]
        self._after: dict[int, int] = {at - 1: 0, at + schedule.loop_frames - 1: 0}
        """The last frame of each part, and the direction whose start or cycle it is; 0: the robot stands."""
        at += schedule.loop_frames
        for number, direction in enumerate(rule.directions):
            firsts = []
            for runs, then in (
                (direction.start, number + 1),
                (direction.cycle, number + 1),
                (direction.stop, 0),
            ):
                firsts.append(at)
                at += sum(run.frames for run in runs)
                self._after[at - 1] = then
            self._first.append((firsts[0], firsts[1], firsts[2]))

    @property
    def at_power_up(self) -> int:
        """Return what is heard before the first frame: one level that is not at rest."""
        return OFF_REST + 1

    def following(self, frame: int, wanted: int) -> int:
        """Return the frame after `frame` if `wanted` is commanded."""
        direction = self._after.get(frame)
        if direction is None:
            return frame + 1
        if direction == 0:
            return self._first[wanted][0]
        return self._first[direction][1 if wanted == direction else 2]

    def heard(self, before: int, level: int) -> tuple[int, int | None]:
        """Return what is heard after another level, and the direction that it commands, 0 to stop."""
        rest = self.rule.line.level
        if before == AT_REST:
            return (AT_REST if level == rest else 1), None
        if before >= OFF_REST:
            latest, run = (rest, before - ON_REST) if before >= ON_REST else (1 - rest, before - OFF_REST)
            return self._run(level, run + 1 if level == latest else 1)
        levels = f"{before:b}"[1:] + str(level)
        if any(code.startswith(levels) and code != levels for code in self._codes):
            return before << 1 | level, None
        since = f"{1 - rest}{levels}"
        heard, stop = self._run(level, len(since) - len(since.rstrip(str(level))))
        return heard, self._codes.get(levels, stop)

    def _run(self, level: int, run: int) -> tuple[int, int | None]:
        if level == self.rule.line.level:
            return (AT_REST if run >= self.rule.rest_frames else ON_REST + run), None
        most = self.rule.stop_frames
        return OFF_REST + min(run, most - 1), 0 if run >= most else None
