"""[motion] poses of a job -> `motion.Pose` values: angles from `<servo>_deg`, `<servo>_us`, `foot_mm` and
`tip_mm`.

In: the validated table, the servos and what they move. Out: the poses, each with the angles of all servos in
radians.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from servogen.errors import InputError, Location, did_you_mean
from servogen.job.schema import MotionTable, PoseTable
from servogen.job.tip import Tip
from servogen.motion import Pose
from servogen.motion.follow import SMALL, Branch, ChangesBranch, Followed, LeavesReach, trace
from servogen.motion.paths import Arc, StraightLine, arc
from servogen.motion.poses import QUICKEST
from servogen.motion.trajectory import Floats
from servogen.robot.servo import Servo
from servogen.toml.file import Document, exact, shown, unknown_key
from servogen.toml.locations import Key

ANGLE, WIDTH = "_deg", "_us"

OFF_THE_PATH = 'path = "joint" goes to this pose, but not along the path'
"""The hint for a path that cannot be followed."""

MAX_CHOICES = 32
"""The maximum number of solutions of a pose, nearest first, that are tried as the start of the next paths."""


def _key_of(servo: Servo) -> str:
    """Return the key of a servo's angle in a pose, or of its speed if it is a continuous-rotation servo."""
    return servo.name + (ANGLE + "_s" if servo.model.continuous else ANGLE)


@dataclass(frozen=True, slots=True)
class _State:
    """The state after a pose: every servo's angle, and the orientation requested of the tip."""

    angles: Mapping[str, float]
    orientation: tuple[float, ...] | None = None


def read_poses(
    document: Document, table: MotionTable, servos: tuple[Servo, ...], tip: Tip | None
) -> tuple[Pose, ...]:
    """Return all poses; servos that a pose does not name keep their angle. Raises ServogenError."""
    reader = _Reader(document, servos, tip, table.poses)
    for index, row in enumerate(table.poses):
        if row.name is not None and row.name in [other.name for other in table.poses[:index]]:
            raise document.error(
                "duplicate-name", (*_key(index), "name"), f"two poses have the name '{row.name}'"
            )
    states: list[_State] = []
    paths: list[_FollowedPath | None] = []
    while len(states) < len(table.poses):
        end = len(states) + 1
        while end < len(table.poses) and table.poses[end].path != "joint":
            end += 1
        for state, path in reader.run(len(states), end, states[-1] if states else _State({})):
            states.append(state)
            paths.append(path)
    paths[0] = reader.path(0, states[-1], states[0])
    return tuple(
        reader.pose(index, table, state, path)
        for index, (state, path) in enumerate(zip(states, paths, strict=True))
    )


def _key(index: int) -> Key:
    return "motion", "poses", index


@dataclass(frozen=True, slots=True)
class _Reader:
    """Reads the poses of one motion."""

    document: Document
    servos: tuple[Servo, ...]
    tip: Tip | None
    rows: Sequence[PoseTable]

    def run(self, first: int, end: int, before: _State) -> list[tuple[_State, _FollowedPath | None]]:
        """Return the states of the pose `first` and of the poses before `end`, which paths from it reach.

        The result is the nearest solution of the pose from which all paths can be followed; if there is none,
        the error is that of the nearest solution.
        """
        refused: list[ChangesBranch | LeavesReach] = []
        # The solution nearest to the previous pose may be on a branch that the following paths leave.
        for state in self.states(first, before)[:MAX_CHOICES]:
            states: list[tuple[_State, _FollowedPath | None]] = [(state, None)]
            try:
                for index in range(first + 1, end):
                    states.append(self._state_along_path(index, states[-1][0]))
            except (ChangesBranch, LeavesReach) as error:
                refused.append(error)
            else:
                return states
        raise refused[0]

    def _state_along_path(self, index: int, before: _State) -> tuple[_State, _FollowedPath | None]:
        """Return the state of a pose that is reached along a path, and the path."""
        state = self.states(index, before)[0]
        path = self.path(index, before, state)
        return path.arrival(state) if path else state, path

    def states(self, index: int, before: _State) -> list[_State]:
        """Return the states of a pose, one for each solution, those nearest to the pose before first."""
        key, row = _key(index), self.rows[index]
        if row.through_mm is not None and row.path != "arc":
            raise self.document.error(
                "pose-keys", (*key, "through_mm"), "only an arc goes through a point", 'add path = "arc"'
            )
        named = self._stated_angles(key, row)
        orientation = before.orientation
        if row.orientation_deg is not None:
            if row.tip_mm is None:
                raise self.document.error(
                    "pose-keys",
                    (*key, "orientation_deg"),
                    "an orientation needs a position",
                    "add tip_mm = [x, y, z]",
                )
            orientation = tuple(math.radians(angle) for angle in row.orientation_deg)
        choices = [named]
        for name in ("foot_mm", "tip_mm"):
            point = getattr(row, name)
            if point is None:
                continue
            tip = self._tip((*key, name))
            for servo in tip.servos:
                if servo.name in named:
                    raise self.document.error(
                        "conflicting-keys",
                        (*key, _key_of(servo)),
                        f"the angle of {servo.name} already follows from {name}",
                        "give one of the two",
                    )
            near = np.array([before.angles.get(servo.name, math.pi / 2) for servo in tip.servos])
            turn = None if orientation is None else np.array(orientation)
            place = self.document.place(*key, name)
            solutions = tip.choices(np.array(point) / 1000, turn, near, place).tolist()
            choices = [
                choice | {servo.name: angle for servo, angle in zip(tip.servos, solution, strict=True)}
                for choice in choices
                for solution in solutions
            ]
        for servo in self.servos:
            if servo.name not in {**before.angles, **choices[0]}:
                raise self.document.error(
                    "pose-keys",
                    key,
                    f"the first pose does not state the angle of {servo.name}",
                    f"add {_key_of(servo)} = … (later poses may omit it: the servo then stays)",
                )
        return [_State({**before.angles, **choice}, orientation) for choice in choices]

    def pose(self, index: int, table: MotionTable, state: _State, path: _FollowedPath | None) -> Pose:
        """Return the pose, including the move from the previous one."""
        key, row = _key(index), self.rows[index]
        if row.release and not row.pause_s:
            raise self.document.error(
                "pose-keys",
                (*key, "release"),
                "release = true without a pause",
                "state its length: pause_s = …",
            )
        for name in ("hold_s", "pause_s"):
            if row.via and getattr(row, name):
                raise self.document.error(
                    "pose-keys",
                    (*key, name),
                    "a via pose has no hold and no pause",
                    "remove via = true",
                )
        law = row.law or table.law
        if law == QUICKEST and row.move_s:
            raise self.document.error(
                "pose-keys",
                (*key, "move_s"),
                f'law = "{QUICKEST}" has no time of its own: the joints\' limits decide',
                "remove move_s, or give the pose another law",
            )
        timeless = law is not None or row.via or row.path != "joint"
        move_s = exact(row.move_s) if row.move_s is not None else None if timeless else Fraction(0)
        return Pose(
            self._vector(state),
            move_s,
            exact(row.hold_s),
            exact(row.pause_s),
            row.release,
            law or "linear",
            row.via,
            path,
            self.document.place(*key),
        )

    def _vector(self, state: _State) -> tuple[float, ...]:
        return tuple(state.angles[servo.name] for servo in self.servos)

    def _stated_angles(self, key: Key, row: PoseTable) -> dict[str, float]:
        """Return the angles in radians that a pose states for servos by name."""
        by_key = {_key_of(servo): servo for servo in self.servos}
        by_width = {servo.name + WIDTH: servo for servo in self.servos}
        angles: dict[str, float] = {}
        for word, value in (row.model_extra or {}).items():
            here = (*key, word)
            if word in by_width:
                servo, angle = by_width[word], by_width[word].angle(_number(self.document, here, value))
            elif word in by_key:
                servo, angle = by_key[word], _angle(self.document, here, value)
            else:
                raise self._unknown(here, word, by_key | by_width)
            if servo.name in angles:
                both = f"{_key_of(servo)} and {servo.name}{WIDTH}"
                raise self.document.error("conflicting-keys", here, f"{both} both place {servo.name}")
            servo.check(angle, self.document.place(*here))
            angles[servo.name] = angle
        return angles

    def _unknown(self, key: Key, word: str, by_key: Mapping[str, Servo]) -> InputError:
        name, names = word.removesuffix(ANGLE).removesuffix(WIDTH), [servo.name for servo in self.servos]
        if name != word and name not in names:
            return self.document.error(
                "unknown-servo", key, f"there is no servo '{name}'", did_you_mean(name, names)
            )
        return unknown_key(self.document, key, [*PoseTable.model_fields, *by_key])

    def _tip(self, key: Key) -> Tip:
        """Return the tip that a key positions. Raises InputError if the robot has no tip with that key."""
        if self.tip is None:
            need = "a foot position needs a leg" if key[-1] == "foot_mm" else "a position needs an arm"
            raise self.document.error(
                "missing-robot",
                key,
                need,
                "add the section [leg] with its lengths, or [robot] with a servo for each joint",
            )
        if key[-1] != self.tip.key:
            raise self.document.error(
                "wrong-unit", key, f"the positions of this robot are given by {self.tip.key}"
            )
        return self.tip

    def path(self, index: int, before: _State, state: _State) -> _FollowedPath | None:
        """Return the path from the previous pose; None if the move is through joint space."""
        key, row = _key(index), self.rows[index]
        if row.path == "joint":
            return None
        here = (*key, "path")
        if row.foot_mm is None and row.tip_mm is None:
            raise self.document.error(
                "pose-keys", here, f'path = "{row.path}" needs a position', "give foot_mm or tip_mm"
            )
        tip = self._tip((*key, "foot_mm" if row.foot_mm is not None else "tip_mm"))
        columns = [[job_servo.name for job_servo in self.servos].index(servo.name) for servo in tip.servos]
        start, end = np.array(self._vector(before)), np.array(self._vector(state))
        a, b = tip.where(start[columns][None])[0], tip.where(end[columns][None])[0]
        path: StraightLine | Arc
        if row.path == "line":
            path = StraightLine(_triple(a), _triple(b))
        elif row.through_mm is None:
            raise self.document.error(
                "pose-keys", here, "an arc needs a point to go through", "add through_mm = [x, y, z]"
            )
        else:
            path = arc(a, np.array(row.through_mm) / 1000, b, self.document.place(*key, "through_mm"))
        turn = None
        if before.orientation is not None and state.orientation is not None:
            turn = np.array(before.orientation), np.array(state.orientation)
        return _FollowedPath(
            path=path,
            tip=tip,
            columns=tuple(columns),
            start=start,
            end=end,
            turn=turn,
            place=self.document.place(*here),
        )


@dataclass(eq=False)
class _FollowedPath:
    """A path of the tip; servos that do not move the tip go straight from start to end."""

    path: StraightLine | Arc
    tip: Tip
    columns: tuple[int, ...]
    start: Floats
    end: Floats
    turn: tuple[Floats, Floats] | None
    place: Location

    def __call__(self, shares: Floats) -> Followed:
        """Return the servos' angles at shares of the path. Raises ChangesBranch."""
        columns, branch = list(self.columns), self._branch
        if np.abs(branch.end - self.end[columns]).max() > SMALL:
            here, there = self._angles_text(branch.end), self._angles_text(self.end[columns])
            point = _triple(self.path.point(np.array([1.0]))[0])
            raise ChangesBranch(1.0, point, (here, there), self.place, OFF_THE_PATH)
        followed = branch.followed(shares, self.tip.where)
        angles = self.start + shares[:, None] * (self.end - self.start)
        angles[:, columns] = followed.angles
        return replace(followed, angles=angles)

    def arrival(self, state: _State) -> _State:
        """Return the state of the pose at the end of the path, on the branch that the path follows."""
        columns, arrived = list(self.columns), self._branch.end
        if np.abs(arrived - self.end[columns]).max() > SMALL:
            self.end[columns] = arrived
            reached = {
                servo.name: angle for servo, angle in zip(self.tip.servos, arrived.tolist(), strict=True)
            }
            return replace(state, angles={**state.angles, **reached})
        return state

    @cached_property
    def _branch(self) -> Branch:
        start = self.start[list(self.columns)]
        return trace(self.path, self._solutions, start, self._angles_text, self.place, OFF_THE_PATH)

    def _solutions(self, shares: Floats, near: Floats) -> Floats:
        return self.tip.solutions(self.path.point(shares), shares, self.turn, near)

    def _angles_text(self, angles: Floats) -> str:
        named = zip(self.tip.servos, np.degrees(angles).tolist(), strict=True)
        return ", ".join(f"{servo.name} {angle:z.1f}°" for servo, angle in named)


def _angle(document: Document, key: Key, value: object) -> float:
    """Return a number of degrees in radians. Raises InputError unless it is finite."""
    return math.radians(_number(document, key, value, "an angle", 90))


def _number(document: Document, key: Key, value: object, what: str = "a width", such: int = 1500) -> float:
    """Return a finite number. Raises InputError, which says `what` it is not and one `such`."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if math.isfinite(number):
            return number
    raise document.error(
        "bad-angle", key, f"{shown(value)} is not {what}", f"a finite number: {key[-1]} = {such}"
    )


def _triple(point: Floats) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z
