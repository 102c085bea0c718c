"""The commands for positions and movement, one function per mnemonic.

In: the `Controller` (arm, memory) and the statement. Out: the controller, changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fractions import Fraction

import numpy as np

from servogen.errors import Diagnostic, InputError
from servogen.movemaster.interpreter import Action, Controller
from servogen.movemaster.language import POSITIONS
from servogen.movemaster.memory import CLOSED, OPEN, Pose, Position
from servogen.movemaster.parser import Statement


def _pose(statement: Statement, first: int) -> Pose:
    return Pose(*(statement.decimal(first + index) for index in range(5)))


def _grip(controller: Controller, statement: Statement, index: int, stored: str) -> None:
    """Set the hand before the arm moves: to the state in the statement, else to the stored one."""
    state = statement.arguments[index] if statement.has(index) else stored
    controller.mover.grip(CLOSED if state == CLOSED else OPEN)


def _go_to_position(controller: Controller, number: int) -> None:
    position = controller.memory.position(number)
    controller.mover.grip(position.hand)
    controller.mover.go(position.pose, f"position {number}")
    controller.current = number


def _dp(controller: Controller, _: Statement) -> None:
    _go_to_position(controller, controller.memory.neighbour(controller.current, -1))


def _ip(controller: Controller, _: Statement) -> None:
    _go_to_position(controller, controller.memory.neighbour(controller.current, 1))


def _dw(controller: Controller, statement: Statement) -> None:
    by = Pose(statement.decimal(0), statement.decimal(1), statement.decimal(2), 0.0, 0.0)
    controller.mover.go(controller.mover.pose.plus(by), "the point")


def _he(controller: Controller, statement: Statement) -> None:
    mover = controller.mover
    controller.memory.positions[statement.whole(0)] = Position(mover.pose, mover.hand_state)


def _ho(controller: Controller, _: Statement) -> None:
    controller.reference = controller.mover.pose


def _og(controller: Controller, statement: Statement) -> None:
    if controller.reference is None:
        _nt(controller, statement)
    else:
        controller.mover.go(controller.reference, "the reference position")


def _nt(controller: Controller, _: Statement) -> None:
    controller.mover.go_joints(np.array(controller.mover.manipulator.arm.home))


def _ma(controller: Controller, statement: Statement) -> None:
    first, second = statement.whole(0), statement.whole(1)
    position, by = controller.memory.position(first), controller.memory.position(second)
    _grip(controller, statement, 2, position.hand)
    controller.mover.go(position.pose.plus(by.pose), f"position {first} displaced by {second}")


def _mc(controller: Controller, statement: Statement) -> None:
    numbers = controller.memory.between(statement.whole(0), statement.whole(1))
    poses = [(controller.memory.positions[number].pose, f"position {number}") for number in numbers]
    controller.mover.through(poses)
    controller.current = numbers[-1]


def _mj(controller: Controller, statement: Statement) -> None:
    joints = controller.mover.manipulator.arm.joints
    given = [statement.decimal(index) for index in range(5)]
    if any(given[len(joints) :]) or len(joints) > 5:
        raise InputError(
            "wrong-count",
            f"MJ turns five joints, {controller.mover.manipulator.arm.name} has {len(joints)}",
            hint="waist, shoulder, elbow, pitch, roll: 0 for what is not there",
        )
    factors = [math.radians(1) if joint.turning else 0.001 for joint in joints]
    by = [value * factor for value, factor in zip(given, factors, strict=False)]
    controller.mover.turn_joints(np.array(by))


def _mo(controller: Controller, statement: Statement) -> None:
    number = statement.whole(0)
    position = controller.memory.position(number)
    _grip(controller, statement, 1, position.hand)
    controller.mover.go(position.pose, f"position {number}")
    controller.current = number


def _mp(controller: Controller, statement: Statement) -> None:
    controller.mover.go(_pose(statement, 0), "the pose")


def _ms(controller: Controller, statement: Statement) -> None:
    number = statement.whole(0)
    position = controller.memory.position(number)
    _grip(controller, statement, 2, position.hand)
    controller.mover.line(position.pose, statement.whole(1), f"position {number}")
    controller.current = number


def _mt(controller: Controller, statement: Statement) -> None:
    number, distance = statement.whole(0), statement.decimal(1)
    position = controller.memory.position(number)
    x, y, z = (distance * controller.mover.manipulator.approach(position.pose)).tolist()
    _grip(controller, statement, 2, position.hand)
    target = position.pose.plus(Pose(x, y, z, 0.0, 0.0))
    controller.mover.go(target, f"the point {distance:g} mm from position {number}")


def _pa(controller: Controller, statement: Statement) -> None:
    controller.memory.pallets[statement.whole(0)] = (statement.whole(1), statement.whole(2))


def _pc(controller: Controller, statement: Statement) -> None:
    first = statement.whole(0)
    last = statement.whole(1) if statement.has(1) else first
    if first == 0:
        if statement.has(1):
            raise InputError(
                "program-argument", "PC 0 clears all positions: a second number has no meaning", hint="PC 0"
            )
        first, last = POSITIONS
    if last < first:
        raise InputError("program-argument", f"PC {first}, {last}: the second number is the higher one")
    controller.memory.clear(first, last)


def _pd(controller: Controller, statement: Statement) -> None:
    controller.memory.positions[statement.whole(0)] = Position(_pose(statement, 1), controller.stored_hand)


def _pl(controller: Controller, statement: Statement) -> None:
    positions = controller.memory.positions
    positions[statement.whole(0)] = controller.memory.position(statement.whole(1))


def _pt(controller: Controller, statement: Statement) -> None:
    pallet = statement.whole(0)
    controller.memory.positions[pallet] = controller.memory.grid_point(pallet)


def _px(controller: Controller, statement: Statement) -> None:
    one, two = statement.whole(0), statement.whole(1)
    first, second = controller.memory.position(one), controller.memory.position(two)
    controller.memory.positions[one], controller.memory.positions[two] = second, first


def _sf(controller: Controller, statement: Statement) -> None:
    controller.memory.shift(statement.whole(0), statement.whole(1))


def _sp(controller: Controller, statement: Statement) -> None:
    controller.mover.speed = statement.whole(0)


def _ti(controller: Controller, statement: Statement) -> None:
    controller.mover.wait_s(Fraction(statement.whole(0), 10))


def _tl(controller: Controller, statement: Statement) -> None:
    controller.mover.set_tool_mm(statement.decimal(0))


MOVEMENTS: Mapping[str, Action] = {
    "DP": _dp, "IP": _ip, "DW": _dw, "HE": _he, "HO": _ho, "OG": _og, "NT": _nt, "MA": _ma, "MC": _mc,
    "MJ": _mj, "MO": _mo, "MP": _mp, "MS": _ms, "MT": _mt, "PA": _pa, "PC": _pc, "PD": _pd, "PL": _pl,
    "PT": _pt, "PX": _px, "SF": _sf, "SP": _sp, "TI": _ti, "TL": _tl,
}  # fmt: skip
"""The action of each row of the language that is about positions and movement."""


def _cp(controller: Controller, statement: Statement) -> None:
    controller.memory.comparison = controller.memory.counters.get(statement.whole(0), 0)


def _dc(controller: Controller, statement: Statement) -> None:
    controller.memory.count(statement.whole(0), -1)


def _ic(controller: Controller, statement: Statement) -> None:
    controller.memory.count(statement.whole(0), 1)


def _sc(controller: Controller, statement: Statement) -> None:
    controller.memory.counters[statement.whole(0)] = statement.whole(1) if statement.has(1) else 0


def _ed(controller: Controller, _: Statement) -> None:
    controller.flow.end()


def _gt(controller: Controller, statement: Statement) -> None:
    controller.flow.go_to(statement.whole(0))


def _gs(controller: Controller, statement: Statement) -> None:
    controller.flow.call(statement.whole(0))


def _rt(controller: Controller, _: Statement) -> None:
    controller.flow.give_back()


def _rc(controller: Controller, statement: Statement) -> None:
    controller.flow.open_loop(statement, statement.whole(0))


def _nx(controller: Controller, _: Statement) -> None:
    controller.flow.close_loop()


def _jump_if(holds: Callable[[int, int], bool]) -> Action:
    """Return an action that jumps if the comparison value and the argument have this relation."""

    def action(controller: Controller, statement: Statement) -> None:
        if holds(controller.memory.comparison, statement.whole(0)):
            controller.flow.go_to(statement.whole(1))

    return action


def _tb(controller: Controller, statement: Statement) -> None:
    bit = statement.bit(0)
    if bool(controller.memory.comparison >> bit.number & 1) == bit.on:
        controller.flow.go_to(statement.whole(1))


def _rn(controller: Controller, statement: Statement) -> None:
    controller.run_program(statement.whole(0), statement.whole(1) if statement.has(1) else None)


def _nw(controller: Controller, _: Statement) -> None:
    controller.program.clear()
    controller.memory.clear(*POSITIONS)


def _rs(_controller: Controller, _: Statement) -> None:
    """Do nothing: an error ends the run, so that there is never one to clear."""


def _gc(controller: Controller, _: Statement) -> None:
    controller.mover.grip(CLOSED)


def _go(controller: Controller, _: Statement) -> None:
    controller.mover.grip(OPEN)


def _gf(controller: Controller, statement: Statement) -> None:
    controller.stored_hand = CLOSED if statement.whole(0) else OPEN


def _gp(controller: Controller, statement: Statement) -> None:
    controller.mover.grip_tenths = statement.whole(2)
    controller.warn(
        Diagnostic(
            "warning",
            "grip-force",
            "a servo's hand has no grip force: of GP only the time counts",
            statement.place,
        )
    )


def _id(controller: Controller, _: Statement) -> None:
    controller.memory.comparison = controller.inputs.value(controller.mover.frame)


def _in(controller: Controller, _: Statement) -> None:
    strobe = controller.inputs.strobe()
    if strobe is None:
        raise InputError(
            "program-argument",
            "IN waits for a strobe that never comes",
            hint="each input of the stimulus is one: seconds=value",
        )
    frame, controller.memory.comparison = strobe
    controller.mover.stand(max(0, frame - controller.mover.frame))


def _ob(controller: Controller, statement: Statement) -> None:
    bit = statement.bit(0)
    mask = 1 << bit.number
    controller.write(controller.output | mask if bit.on else controller.output & ~mask, strobe=False)


def _od(controller: Controller, statement: Statement) -> None:
    controller.write(statement.whole(0), strobe=False)


def _ot(controller: Controller, statement: Statement) -> None:
    controller.write(statement.whole(0), strobe=True)


ACTIONS: Mapping[str, Action] = {
    **MOVEMENTS,
    "CP": _cp, "DC": _dc, "ED": _ed, "EQ": _jump_if(lambda value, other: value == other), "GS": _gs,
    "GT": _gt, "IC": _ic, "LG": _jump_if(lambda value, other: value > other), "NE": _jump_if(lambda
    value, other: value != other), "NW": _nw, "NX": _nx, "RC": _rc, "RN": _rn, "RT": _rt, "SC": _sc,
    "SM": _jump_if(lambda value, other: value < other), "GC": _gc, "GF": _gf, "GO": _go, "GP": _gp,
    "ID": _id, "IN": _in, "OB": _ob, "OD": _od, "OT": _ot, "TB": _tb, "RS": _rs,
}  # fmt: skip
"""The action of each row of the language."""
