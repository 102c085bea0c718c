"""python -m tests.pic.analysis.containment [COUNT] [FIRST]: compare runs with the states of the analysis.

Random programs run on the reference chip under random levels of the pins and with random RAM at power-up;
before every instruction, some abstract state of its address must contain the chip's registers and RAM. Prints
how many programs were decided, and how many instructions were compared.
"""

from __future__ import annotations

import random
import sys
from dataclasses import dataclass, field
from unittest import mock

from servogen.pic.analysis import paths
from servogen.pic.analysis.paths import PathExplorer
from servogen.pic.analysis.state import AbstractState
from servogen.pic.device import ERASED_WORD
from servogen.pic.image import Image
from servogen.pic.known_values import word_of
from tests.pic.analysis.programs import assembled, random_player
from tests.pic.analysis.test_state import misfits
from tests.simulator.reference import Chip

MAX_STEPS = 150_000
"""The number of instructions that are followed again: a program that needs more is not decided."""


@dataclass
class Run:
    """What was compared for one program."""

    decided: bool
    refined: bool
    """Whether states were kept apart."""
    compared: int = 0
    outside: list[str] = field(default_factory=list)
    """Where the chip was in a state that the analysis does not allow."""


class _Recording(PathExplorer):
    """An explorer that keeps every state before an instruction."""

    def __init__(self, *args: object, **named: object) -> None:
        super().__init__(*args, **named)  # type: ignore[arg-type]
        self.states: dict[int, list[AbstractState]] = {}
        last.append(self)

    def _step(self, at: int, stack: tuple[int, ...], state: AbstractState):  # type: ignore[no-untyped-def]
        self.states.setdefault(at, []).append(state.copy())
        return super()._step(at, stack, state)


last: list[_Recording] = []


def compared(text: str, seed: int, steps: int) -> Run:
    """Run a program for some instructions, and compare each of its states with those of the analysis."""
    image = assembled(text).image
    last.clear()
    limits = {"MAX_JUMP_STEPS": MAX_STEPS, "MAX_REFINED_STEPS": MAX_STEPS}
    with mock.patch.multiple(paths, PathExplorer=_Recording, **limits):
        answer = paths.explore(image.program)
    answering = next(explorer for explorer in last if explorer.paths is answer)
    run = Run(not answer.tables and not answer.beyond and not answer.lost, len(last) > 1)
    chip = _powered_up(image, seed, steps)
    for _ in range(steps):
        if (
            word_of(image.program.get(chip.pc, ERASED_WORD)).name == "RETLW"
        ):  # a table is one step of the analysis
            chip.run(chip.now + 1)
            continue
        states = answering.states.get(chip.pc, [])
        fitting = next((state for state in states if not misfits(state, chip)), None)
        if fitting is None:
            if run.decided:
                run.outside.append(f"seed {seed}: cycle {chip.now}, 0x{chip.pc:03X}, {len(states)} states")
            break
        states.remove(fitting)
        states.insert(0, fitting)
        run.compared += 1
        chip.run(chip.now + 1)
    return run


def _powered_up(image: Image, seed: int, steps: int) -> Chip:
    rng = random.Random(seed)
    levels = [(rng.randrange(2 * steps), rng.randrange(5, 13), rng.randrange(2)) for _ in range(steps // 4)]
    chip = Chip(image, stimuli=sorted(levels))
    chip.ram = [rng.randrange(256) for _ in chip.ram]
    chip.w, chip.fsr = rng.randrange(256), rng.randrange(0x0C, 0x50)
    chip.run(chip.now + 1)
    return chip


def main() -> int:
    count, first = (int(number) for number in (*sys.argv[1:], *("100", "0")[len(sys.argv) - 1 :]))
    runs = [compared(random_player(seed), seed, 600) for seed in range(first, first + count)]
    outside = [text for run in runs for text in run.outside]
    print(
        f"{len(runs)} programs, {sum(run.decided for run in runs)} decided, "
        f"{sum(run.refined for run in runs)} with states kept apart; {sum(run.compared for run in runs)} "
        f"instructions compared, {len(outside)} outside"
    )
    print("\n".join(outside))
    return int(bool(outside))


if __name__ == "__main__":
    sys.exit(main())
