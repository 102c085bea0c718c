"""The order of positions: visits go in; where in a round they begin and what is wrong comes out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from servogen.grade.lab import Lab, Way
from servogen.grade.visits import Told, Visit
from servogen.robot.servo import Servo
from servogen.robot.servo_models import names as model_names
from servogen.robot.servo_models import servo_model

ARROW = " → "
SHOWN_ROUNDS = 2


@dataclass(frozen=True, slots=True)
class Order:
    """Which position each visit should be; `right` are the numbers of the visits that are it."""

    asked: tuple[int, ...]
    right: tuple[int, ...]


def order(found: Sequence[Visit], way: Way) -> Order:
    """A round may begin at any of its positions: the beginning that makes most visits right is taken."""
    size = len(way.positions)
    tries = []
    for first in range(size):
        asked = tuple((first + index) % size for index in range(len(found)))
        right = tuple(index for index, visit in enumerate(found) if asked[index] in visit.places)
        tries.append(Order(asked, right))
    return max(tries, key=lambda each: len(each.right))


def order_reasons(found: Sequence[Visit], found_order: Order, lab: Lab, way: Way) -> Iterator[str]:
    """What is not the task's order, or not its positions."""
    right = set(found_order.right)
    wrong = [index for index in range(len(found)) if index not in right]
    strange = [index for index in wrong if not found[index].places]
    if len(strange) == len(wrong) and len(wrong) < len(found):
        asked: dict[int, int] = {}
        for index in strange:
            asked.setdefault(found_order.asked[index], index)
        for position, index in sorted(asked.items()):
            name = way.positions[position].name
            yield f"where {name} is asked for, {_strange(found[index], lab, way, position)}"
    elif wrong:
        positions = [position.name for position in way.positions]
        yield f"the order is {sequence(found, way)}; asked for is {ARROW.join(positions)}, again and again"
        seen: set[tuple[float, ...]] = set()
        for index in strange:
            if found[index].told[0].widths_us not in seen and len(seen) < len(way.positions):
                yield f"no position of the task: {_strange(found[index], lab, way, None)}"
            seen.add(found[index].told[0].widths_us)


def sequence(found: Sequence[Visit], way: Way) -> str:
    """The first visits, by name."""
    most = SHOWN_ROUNDS * len(way.positions)
    words = [_name(visit, way) for visit in found[:most]]
    return ARROW.join([*words, *(["…"] if len(found) > most else [])])


def _name(visit: Visit, way: Way) -> str:
    if visit.places:
        return way.positions[min(visit.places)].name
    return " and ".join(f"{width:g} µs" for width in visit.told[0].widths_us)


def _strange(visit: Visit, lab: Lab, way: Way, position: int | None) -> str:
    """What the servos are told there; only those whose angle is wrong, where it is known what is asked."""
    told = visit.told[0]
    positions = way.positions if position is None else (way.positions[position],)
    words = []
    for number, each in enumerate(lab.servos):
        ranges = [each.ranges[number] for each in positions]
        if not any(low <= told.angles[number] <= high for low, high in ranges):
            words.append(_told_words(each.servo, told, number, ranges))
    together = [_told_words(each.servo, told, number, ()) for number, each in enumerate(lab.servos)]
    return ", and ".join(words or together)


def _told_words(servo: Servo, told: Told, number: int, asked: Sequence[tuple[float, float]]) -> str:
    width, angle = told.widths_us[number], told.angles[number]
    low, high = servo.widths_us
    text = f"'{servo.name}' gets pulses of {width:g} µs, which is {math.degrees(angle):.1f}°"
    if not servo.allows(angle):
        takes = f"the {servo.model.title} takes {low:g} to {high:g} µs"
        return f"'{servo.name}' gets pulses of {width:g} µs; {takes}"
    for name in model_names():
        model = servo_model(name)
        if model.name == servo.model.name or model.continuous:
            continue
        if any(least <= model.calibration.angle(width) <= most for least, most in asked):
            return f"{text} on the {servo.model.title} (the width is that of the {model.title})"
    return text
