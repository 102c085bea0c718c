"""Servos that turn a joint together with another one, such as the second servo of a shoulder.

In: the tables of the servos. Out: `Follower`: the servo that it follows, and the angle between the two. The
motion is planned for the servos that follow none; `followed` gives the others their angles.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from servogen.errors import Diagnostic, did_you_mean
from servogen.job.schema import ServoTable
from servogen.motion.trajectory import Floats
from servogen.robot.binding import Binding
from servogen.robot.servo import TOLERANCE_RAD, Servo
from servogen.toml.file import Document


@dataclass(frozen=True, slots=True)
class Follower:
    """The servo `name` is `offset` radians ahead of the servo `leader`, in every frame."""

    name: str
    leader: str
    offset: float

    def binding(self, leader: Binding) -> Binding:
        """Return the joint that the leader turns, as this servo turns it."""
        return replace(leader, servo=self.name, zero=leader.zero + self.offset)


def read_followers(document: Document, rows: Sequence[ServoTable]) -> tuple[Follower, ...]:
    """Return the servos that follow another one. Raises InputError."""
    by_name = {row.name: row for row in rows}
    followers = []
    for index, row in enumerate(rows):
        if row.follows is None:
            continue
        key, leader = ("servo", index, "follows"), by_name.get(row.follows)
        if leader is None:
            raise document.error(
                "unknown-servo", key, f"there is no servo '{row.follows}'", did_you_mean(row.follows, by_name)
            )
        if leader.follows is not None:
            raise document.error(
                "joint-binding",
                key,
                f"{row.name} follows {leader.name}, which itself follows {leader.follows}",
                f'write follows = "{leader.follows}"' if leader.follows != row.name else None,
            )
        for name in ("joint", "ratio", "deg_per_mm", "min_deg", "max_deg"):
            if name in row.model_fields_set:
                raise document.error(
                    "conflicting-keys",
                    ("servo", index, name),
                    f"{row.name} follows {leader.name}: {name} is that of {leader.name}",
                    f"remove {name}",
                )
        zero = row.zero_deg if "zero_deg" in row.model_fields_set else leader.zero_deg
        followers.append(Follower(row.name, leader.name, math.radians(zero - leader.zero_deg)))
    return tuple(followers)


def within_each_other(
    document: Document, servos: Sequence[Servo], followers: Sequence[Follower]
) -> tuple[Servo, ...]:
    """Return the servos; one that others follow goes only where they can. Raises InputError."""
    by_name = {servo.name: servo for servo in servos}
    for follower in followers:
        servo, leader = by_name[follower.name], by_name[follower.leader]
        place = ("servo", list(by_name).index(servo.name), "follows")
        if servo.model.continuous != leader.model.continuous:
            raise document.error(
                "wrong-servo-kind",
                place,
                f"{servo.name} cannot follow {leader.name}: one of the two turns continuously",
            )
        low, high = (end - follower.offset for end in servo.limits)
        inner = max(low, leader.limits[0]), min(high, leader.limits[1])
        if inner[1] < inner[0] + TOLERANCE_RAD:
            shown = (leader.model.shown(end) for end in (*leader.limits, low, high))
            text = "{} to {}, and {} to {} where the other can go".format(*shown)
            raise document.error(
                "servo-range",
                place,
                f"{servo.name} cannot follow {leader.name}: its travel is {text}",
                "change zero_deg to how the servo is mounted",
            )
        if max(inner[0] - leader.limits[0], leader.limits[1] - inner[1]) > TOLERANCE_RAD:
            by_name[leader.name] = replace(
                leader, limits=inner, limited_by=f"{servo.name}, which follows it, goes no further"
            )
    return tuple(by_name.values())


def at_their_leaders(servos: Sequence[Servo], followers: Sequence[Follower]) -> tuple[Servo, ...]:
    """Return the servos; those that follow have the limits and the neutral pose of the other one."""
    by_name = {servo.name: servo for servo in servos}
    for follower in followers:
        leader = by_name[follower.leader]
        by_name[follower.name] = replace(
            by_name[follower.name],
            limits=(leader.limits[0] + follower.offset, leader.limits[1] + follower.offset),
            limited_by=f"it follows {leader.name}",
            rest=leader.neutral + follower.offset,
        )
    return tuple(by_name.values())


def unlike_mirrors(servos: Sequence[Servo], followers: Sequence[Follower]) -> Iterator[Diagnostic]:
    """Yield a warning for servos on one joint of which none is mirrored: two that face each other would work
    against each other.
    """
    by_name = {servo.name: servo for servo in servos}
    for leader, group in groupby(sorted(followers, key=lambda each: each.leader), lambda each: each.leader):
        names = [follower.name for follower in group]
        if by_name[leader].model.continuous:
            continue
        if {by_name[name].reverse for name in names} == {by_name[leader].reverse}:
            yield Diagnostic(
                "warning",
                "not-mirrored",
                f"{' and '.join(names)} and {leader} turn the same joint the same way",
                by_name[names[0]].place,
                "of two servos that face each other one has reverse = true; others are right as they are",
            )


def followed(angles: Floats, servos: Sequence[Servo], followers: Sequence[Follower]) -> Floats:
    """Return the angles (…, servos) of all servos from those (…, leaders) of the servos that follow none."""
    by_name = {each.name: each for each in followers}
    leaders = [servo.name for servo in servos if servo.name not in by_name]
    columns = [
        angles[..., leaders.index(by_name[name].leader)] + by_name[name].offset
        if name in by_name
        else angles[..., leaders.index(name)]
        for name in (servo.name for servo in servos)
    ]
    return np.stack(columns, axis=-1)
