"""Whatever is written, a program runs to an end or is refused at a place; and what runs keeps its limits."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.movemaster import Budget, ProgramRun, manipulator, parse, run
from servogen.movemaster.language import COMMANDS, ArgumentKind, Command, Parameter, Where
from servogen.units import Clock, Cycles

SETUP = (
    "PD 1, 250, 200, 350, -60, 20\nPD 2, 100, 300, 250, -90, 90\nPD 3, 10, -5, 8, 1, 1\n"
    "PD 10, 0, 300, 200, -90, 90\nPL 11, 10\nPL 12, 10\nPL 13, 10\nPA 1, 2, 2\nSC 11, 1\nSC 12, 2\n"
)
ROBOT = manipulator(arm("rv-m1"))


def _argument(parameter: Parameter) -> st.SearchStrategy[str]:
    if parameter.kind is ArgumentKind.HAND:
        return st.sampled_from(["O", "C"])
    if parameter.kind is ArgumentKind.BIT:
        return st.sampled_from(["+0", "-0", "+3", "-7"])
    if parameter.kind is ArgumentKind.DECIMAL:
        return st.integers(-40 if parameter.low < 0 else 0, 40).map(str)
    if parameter.high == 2048:
        return st.integers(1, 8).map(lambda line: str(10 * line))
    return st.integers(int(max(parameter.low, -3)), int(min(parameter.high, 13))).map(str)


def _line(command: Command) -> st.SearchStrategy[str]:
    arguments = st.tuples(*(_argument(each) for each in command.parameters))
    return arguments.map(lambda given: f"{command.mnemonic} {', '.join(given)}")


_IN_PROGRAM = [command for command in COMMANDS.values() if command.where is not Where.DIRECT]
_PROGRAM = st.lists(st.sampled_from(_IN_PROGRAM).flatmap(_line), min_size=8, max_size=8)


def _run(lines: list[str], repeat: bool) -> ProgramRun:
    text = SETUP + "".join(f"{10 * index} {line}\n" for index, line in enumerate(lines, 1))
    budget = Budget(200, Fraction(60))
    return run(parse(text, "a.rvm"), ROBOT, Cycles(20_000), Clock(4_000_000), repeat=repeat, budget=budget)


def _up_to(examples: int) -> settings:
    return settings(max_examples=examples, suppress_health_check=list(HealthCheck))


@_up_to(40)
@given(_PROGRAM, st.booleans())
def test_a_program_runs_or_is_refused_with_a_place(lines: list[str], repeat: bool) -> None:
    _runs_or_is_refused(lines, repeat)


@pytest.mark.campaign
@_up_to(250)
@given(_PROGRAM, st.booleans())
def test_many_programs_run_or_are_refused_with_a_place(lines: list[str], repeat: bool) -> None:
    _runs_or_is_refused(lines, repeat)


def _runs_or_is_refused(lines: list[str], repeat: bool) -> None:
    try:
        made = _run(lines, repeat).trajectory
    except InputError as error:
        assert error.location is not None, error
        return
    assert 0 <= made.loop_start < len(made.angles)
    tops = np.array(ROBOT.speeds) * (1 + 1e-9) * 0.02
    assert (np.abs(np.diff(made.angles, axis=0)) <= tops).all()
    if repeat:
        loop = made.angles[made.loop_start :]
        assert (np.abs(loop[0] - loop[-1]) <= tops).all()
