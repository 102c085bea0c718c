"""What each command does: programs, counters, hand and ports here, positions and movement in `movements`.

In: the `Controller` (memory, ports, flow) and the statement. Out: the controller, changed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from servogen.errors import Caution, InputError
from servogen.motion.movemaster.controller import Action, Controller
from servogen.motion.movemaster.language import POSITIONS
from servogen.motion.movemaster.memory import CLOSED, OPEN
from servogen.motion.movemaster.movements import MOVEMENTS
from servogen.motion.movemaster.parse import Statement


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
    """A jump if the comparison value and the argument stand in this relation."""

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
    """An error ends the run: none is left that could be cleared."""


def _gc(controller: Controller, _: Statement) -> None:
    controller.mover.grip(CLOSED)


def _go(controller: Controller, _: Statement) -> None:
    controller.mover.grip(OPEN)


def _gf(controller: Controller, statement: Statement) -> None:
    controller.stored_hand = CLOSED if statement.whole(0) else OPEN


def _gp(controller: Controller, statement: Statement) -> None:
    controller.mover.grip_tenths = statement.whole(2)
    controller.caution(
        Caution("grip-force", "a servo's hand has no grip force: of GP only the time counts", statement.place)
    )


def _id(controller: Controller, _: Statement) -> None:
    controller.memory.comparison = controller.inputs.value(controller.mover.frame)


def _in(controller: Controller, _: Statement) -> None:
    strobe = controller.inputs.strobe()
    if strobe is None:
        raise InputError(
            "IN waits for a strobe that never comes", hint="each input of the stimulus is one: seconds=value"
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
