"""[motion] poses of a job -> `motion.Pose` values: servo angles from `<servo>_deg`, `foot_mm` and `tip_mm`.

In: the checked table, the servos and what they move. Out: one pose each, with every servo's angle in radians.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from servogen.errors import InputError, nearest
from servogen.job.model import MotionTable, PoseTable
from servogen.job.tip import LegTip, Tip
from servogen.motion import Pose
from servogen.motion.follow import Followed, follow
from servogen.motion.paths import Arc, Line, arc
from servogen.motion.trajectory import Floats
from servogen.robot.servo import Servo
from servogen.toml_places import Key
from servogen.tomlfile import Document, exact, shown, unknown_key

ANGLE = "_deg"


def _key_of(servo: Servo) -> str:
    """What a pose calls the servo's angle, or the speed of one that turns for ever."""
    return servo.name + (ANGLE + "_s" if servo.model.continuous else ANGLE)


@dataclass(frozen=True, slots=True)
class _State:
    """After a pose: every servo's angle, and the orientation that was asked of the tip."""

    angles: Mapping[str, float]
    orientation: tuple[float, ...] | None = None


def poses_of(
    document: Document, table: MotionTable, servos: tuple[Servo, ...], tip: Tip | None
) -> tuple[Pose, ...]:
    """All poses; a servo that a pose does not name stays where it was. Raises InputError."""
    reader = _Reader(document, servos, tip)
    states: list[_State] = []
    for index, row in enumerate(table.poses):
        if row.name is not None and row.name in [other.name for other in table.poses[:index]]:
            raise document.error(("motion", "poses", index, "name"), f"two poses have the name '{row.name}'")
        states.append(reader.state(("motion", "poses", index), row, states[-1] if states else _State({})))
    return tuple(
        reader.pose(("motion", "poses", index), row, table, states[index - 1], states[index])
        for index, row in enumerate(table.poses)
    )


@dataclass(frozen=True, slots=True)
class _Reader:
    document: Document
    servos: tuple[Servo, ...]
    tip: Tip | None

    def state(self, key: Key, row: PoseTable, before: _State) -> _State:
        """The angles of a pose."""
        named = self._named(key, row)
        orientation = before.orientation
        if row.orientation_deg is not None:
            if row.tip_mm is None:
                raise self.document.error(
                    (*key, "orientation_deg"), "an orientation needs a position", "add tip_mm = [x, y, z]"
                )
            orientation = tuple(math.radians(angle) for angle in row.orientation_deg)
        for name in ("foot_mm", "tip_mm"):
            point = getattr(row, name)
            if point is None:
                continue
            tip = self._tip((*key, name))
            for servo in tip.servos:
                if servo.name in named:
                    raise self.document.error(
                        (*key, _key_of(servo)),
                        f"{servo.name}'s angle follows from {name} already",
                        "give one of the two",
                    )
            near = np.array([before.angles.get(servo.name, math.pi / 2) for servo in tip.servos])
            turn = None if orientation is None else np.array(orientation)
            place = self.document.place(*key, name)
            found = tip.angles(np.array(point) / 1000, turn, near, place).tolist()
            named |= {servo.name: angle for servo, angle in zip(tip.servos, found, strict=True)}
        angles = {**before.angles, **named}
        for servo in self.servos:
            if servo.name not in angles:
                raise self.document.error(
                    key,
                    f"the first pose does not say where {servo.name} is",
                    f"add {_key_of(servo)} = … (later poses may leave it away: it stays)",
                )
        return _State(angles, orientation)

    def pose(self, key: Key, row: PoseTable, table: MotionTable, before: _State, state: _State) -> Pose:
        """The pose, with how the servos get there from the one before."""
        if row.release and not row.pause_s:
            raise self.document.error(
                (*key, "release"), "release = true without a pause", "say how long: pause_s = …"
            )
        for name in ("hold_s", "pause_s"):
            if row.via and getattr(row, name):
                raise self.document.error(
                    (*key, name), "a pose that is passed has no hold and no pause", "take via = true away"
                )
        law = row.law or table.law
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
            self._way(key, row, before, state),
            self.document.place(*key),
        )

    def _vector(self, state: _State) -> tuple[float, ...]:
        return tuple(state.angles[servo.name] for servo in self.servos)

    def _named(self, key: Key, row: PoseTable) -> dict[str, float]:
        """The angles that a pose gives for servos by name."""
        by_key = {_key_of(servo): servo for servo in self.servos}
        angles: dict[str, float] = {}
        for word, value in (row.model_extra or {}).items():
            here = (*key, word)
            if word not in by_key:
                raise self._unknown(here, word, by_key)
            servo, angle = by_key[word], _angle(self.document, here, value)
            servo.width_us(angle, self.document.place(*here))
            angles[servo.name] = angle
        return angles

    def _unknown(self, key: Key, word: str, by_key: Mapping[str, Servo]) -> InputError:
        name, names = word.removesuffix(ANGLE), [servo.name for servo in self.servos]
        if name != word and name not in names:
            return self.document.error(key, f"there is no servo '{name}'", nearest(name, names))
        return unknown_key(self.document, key, [*PoseTable.model_fields, *by_key])

    def _tip(self, key: Key) -> Tip:
        wanted = "foot_mm" if isinstance(self.tip, LegTip) else "tip_mm"
        if self.tip is None:
            need = "a foot position needs a leg" if key[-1] == "foot_mm" else "a position needs an arm"
            raise self.document.error(
                key, need, "add the section [leg] with its lengths, or [robot] with a servo for each joint"
            )
        if key[-1] != wanted:
            raise self.document.error(key, f"this robot's positions are called {wanted}")
        return self.tip

    def _way(self, key: Key, row: PoseTable, before: _State, state: _State) -> _Way | None:
        if row.through_mm is not None and row.path != "arc":
            raise self.document.error(
                (*key, "through_mm"), "only an arc goes through a point", 'add path = "arc"'
            )
        if row.path == "joint":
            return None
        here = (*key, "path")
        if row.foot_mm is None and row.tip_mm is None:
            raise self.document.error(here, f'path = "{row.path}" needs a position', "give foot_mm or tip_mm")
        tip = self._tip((*key, "foot_mm" if row.foot_mm is not None else "tip_mm"))
        columns = [[each.name for each in self.servos].index(servo.name) for servo in tip.servos]
        start, end = np.array(self._vector(before)), np.array(self._vector(state))
        a, b = tip.where(start[columns][None])[0], tip.where(end[columns][None])[0]
        path: Line | Arc
        if row.path == "line":
            path = Line(_triple(a), _triple(b))
        elif row.through_mm is None:
            raise self.document.error(
                here, "an arc needs a point to go through", "add through_mm = [x, y, z]"
            )
        else:
            path = arc(a, np.array(row.through_mm) / 1000, b, self.document.place(*key, "through_mm"))
        turns = None
        if before.orientation is not None and state.orientation is not None:
            turns = np.array([before.orientation, state.orientation])
        return _Way(path, tip, tuple(columns), start, end, turns, self.document, key)


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """A path of the tip; servos that do not move it, and the orientation, go straight from start to end."""

    path: Line | Arc
    tip: Tip
    columns: tuple[int, ...]
    start: Floats
    end: Floats
    turns: Floats | None
    document: Document
    key: Key

    def __call__(self, shares: Floats) -> Followed:
        turns = None
        if self.turns is not None:
            turns = self.turns[0] + shares[:, None] * (self.turns[1] - self.turns[0])
        columns = list(self.columns)
        made = follow(
            self.path,
            shares,
            lambda points: self.tip.solutions(points, turns),
            self.tip.where,
            self.start[columns],
            self.document.place(*self.key, "path"),
        )
        angles = self.start + shares[:, None] * (self.end - self.start)
        angles[:, columns] = made.angles
        return Followed(shares, angles, made.chord_error_m)


def _angle(document: Document, key: Key, value: object) -> float:
    """Radians of a finite number of degrees."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            degrees = float(value)
        except OverflowError:
            degrees = math.inf
        if math.isfinite(degrees):
            return math.radians(degrees)
    raise document.error(key, f"{shown(value)} is not an angle", f"a finite number: {key[-1]} = 90")


def _triple(point: Floats) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z
