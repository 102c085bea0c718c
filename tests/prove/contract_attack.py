"""An attack on `servogen prove --contract`: a fault that only inputs or a power-up show must not be proven.

    python -m tests.prove.contract_attack --mutants 300 --seed 7               # prints a line for each
    python -m tests.prove.contract_attack --mutants 300 --seed 7 --first 8120  # goes on after number 8119

One bit of a program that keeps its contract is changed, or one word becomes one of `DISTURBANCES`. A mutant
that still keeps it in a plain run, and breaks it under random inputs, RAM, watchdogs or phases of TMR0, is
given to the prover, and to the checker with the hints of the right program. What is broken is judged here,
from the edges alone: the observers of the prover have no part in it. Exit code 1 if anything is proven, or
accepted.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import count, islice, pairwise, zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory

from servogen.checker import Hints, Refused, check_contract
from servogen.contract import parse_contract
from servogen.edges import PINS
from servogen.pic.image import Image
from servogen.programs import read_program
from servogen.prove.contract import MAX_STATES, ContractProof, prove_contract
from servogen.simulator import Levels, SimulatorOptions, Stimuli
from servogen.simulator.pin_levels import pin_trace
from servogen.units import Clock, Cycles
from tests.prove.test_contract_proofs import ANSWER, BRIDGE, NEVER, POLLED, TICK, WAVE, answer, image
from tests.testing.page import PROGRAMS

CLOCK = Clock(4_000_000)
CI = Path(__file__).parent.parent.parent / "docs" / "examples" / "ci"
Edges = list[tuple[int, int]]
"""(cycle, level) of one pin, alternating, from low on."""
Waves = dict[str, Edges]
DISTURBANCES = (
    *(0x0063, 0x0064),  # SLEEP, CLRWDT
    *(0x0081, 0x0181, 0x0A81, 0x1181, 0x1581),  # MOVWF, CLRF, INCF, BCF 3 and BSF 3 of TMR0, or OPTION_REG
    *(0x110B, 0x150B, 0x138B, 0x178B),  # BCF and BSF of T0IF and of GIE
)
"""What may take a word's place: SLEEP, the watchdog, TMR0 and its prescaler, its flag and interrupt."""
GLITCH = 10
"""Cycles that a pin may be high while it becomes an output (docs/contracts.md)."""


def pulses(pin: str, high: tuple[int, int], period: tuple[int, int]) -> Callable[[Waves], bool]:
    """Return a judge of every whole pulse, in cycles."""

    def kept(waves: Waves) -> bool:
        edges = waves[pin]
        widths = [b - a for (a, level), (b, _) in pairwise(edges) if level]
        rises = [cycle for cycle, level in edges if level]
        return all(high[0] <= each <= high[1] for each in widths) and all(
            period[0] <= b - a <= period[1] for a, b in pairwise(rises)
        )

    return kept


def gaps(pin: str, least: int, most: int) -> Callable[[Waves], bool]:
    """Return a judge of the times between changes, in cycles, and of the last one's to the end."""

    def kept(waves: Waves) -> bool:
        moments = [cycle for cycle, _ in waves[pin]]
        last = waves["end"][0][0] - moments[-1] if moments else 0
        return last <= most and all(least <= b - a <= most for a, b in pairwise(moments))

    return kept


def never(*pairs: tuple[str, str]) -> Callable[[Waves], bool]:
    """Return a judge of pins that must not be high together."""

    def kept(waves: Waves) -> bool:
        for one, two in pairs:
            levels = {one: 0, two: 0}
            moments = sorted((c, pin, level) for pin in (one, two) for c, level in waves[pin])
            for (cycle, pin, level), after in zip_longest(moments, moments[1:]):
                levels[pin] = level
                if all(levels.values()) and (after is None or after[0] > cycle):
                    return False
        return True

    return kept


def answered(waves: Waves) -> bool:
    """Judge ANSWER: RB4 rises 2 to 6 cycles after RB0 falls, and falls only after RB0 rose."""
    end = waves["end"][0][0]
    for cycle, level in waves["RB0"]:
        if level == 0 and 40 < cycle < end - 100:
            rise = next((c for c, up in waves["RB4"] if up and c > cycle), end)
            if not 2 <= rise - cycle <= 6:
                return False
    return True


@dataclass(frozen=True)
class Subject:
    """A program, its contract, and what judges it; inputs change after `hold` cycles or more."""

    name: str
    image: Image
    contract: str
    kept: Callable[[Waves], bool]
    inputs: tuple[str, ...] = ()
    hold: int = 100
    cycles: int = 40_000

    def proof(self, program: Image, max_states: int = MAX_STATES) -> ContractProof:
        """Return the prover's answer for the program, or a mutant of it."""
        clauses = parse_contract(self.contract, f"{self.name}.toml").clauses(CLOCK)
        return prove_contract(program, clauses, CLOCK, max_states=max_states)


def compiled(name: str) -> Image:
    """Return a program of the page about tests."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_text(PROGRAMS[name])
        return read_program(path).image


pulse = '[[pulse]]\npin = "{}"\nhigh_us = [{}, {}]\nperiod_us = [{}, {}]\n'.format
every = '[[every]]\nevent = "{} changes"\ngap_us = [{}]\n'.format


def short_subjects() -> list[Subject]:
    """Return those of a few instructions."""
    bridge = image(BRIDGE.format(first=2, second=4, between=""))
    return [
        Subject("answer", image(ANSWER.format(delay="")), answer(2, 6), answered, ("RB0",), 3000),
        Subject("bridge", bridge, NEVER, never(("RB1", "RB2")), ("RA0",)),
        Subject("wave", image(WAVE.format(turns=10)), pulse("RB3", 32, 32, 336, 336),
                pulses("RB3", (32, 32), (336, 336))),
        Subject("tick", image(TICK.format(reload=9)), pulse("RB0", 249, 251, 498, 502),
                pulses("RB0", (249, 251), (498, 502)), cycles=20_000),
        Subject("polled", image(POLLED), every("RB1", "0, 1028"), gaps("RB1", 0, 1028)),
        Subject("fed", image(FED, "_WDT_ON"), every("RB7", "1000, 11_000"), gaps("RB7", 1000, 11_000),
                ("RA1",), cycles=120_000),
        Subject("asleep", image(ASLEEP, "_WDT_ON"),
                '[[pulse]]\npin = "RB1"\nhigh_us = [17, 17]\nlow_us = [60]\n',
                pulses("RB1", (17, 17), (77, 10**9)), ("RB0",)),
        Subject("two lamps", image(LAMPS), '[[never]]\ncondition = "RB1 high and RB3 high"\n',
                never(("RB1", "RB3")), ("RA1", "RA2")),
    ]  # fmt: skip


def subjects() -> list[Subject]:
    coils = '[[never]]\ncondition = "RB0 high and RB2 high"\n[[never]]\ncondition = "RB1 high and RB3 high"\n'
    lamp = pulse("RB3", 480, 1530, 1880, 2060)
    digits = '[[never]]\ncondition = "RA0 high and RA1 high"\n'
    return [
        *short_subjects(),
        Subject("stepper", compiled("stepper.c"), coils,
                never(("RB0", "RB2"), ("RB1", "RB3")), ("RB7",), 9000, 200_000),
        Subject("pwm", compiled("pwm.c"), pulse("RB3", 495, 505, 1980, 2020),
                pulses("RB3", (495, 505), (1980, 2020))),
        Subject("segments", compiled("seven_segments.c"), digits, never(("RA0", "RA1")),
                cycles=60_000),
        Subject("interrupt", compiled("interrupt.c"), pulse("RB0", 245, 255, 490, 510),
                pulses("RB0", (245, 255), (490, 510)), cycles=20_000),
        Subject("dimmer", read_program(CI / "dimmer.c").image, lamp,
                pulses("RB3", (480, 1530), (1880, 2060)), ("RB0",), 5000, 200_000),
    ]  # fmt: skip


LAMPS = """
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
        clrf    PORTB
        clrf    0x20
loop    btfsc   PORTA, 1
        incf    0x20, f
        btfsc   PORTA, 2
        decf    0x20, f
        movlw   2
        btfsc   0x20, 2
        movlw   8
        movwf   PORTB
        goto    loop
"""


FED = """
        clrf    PORTB
        bsf     STATUS, RP0
        bcf     TRISB, 7
        movlw   0xC9
        movwf   OPTION_REG
        bcf     STATUS, RP0
loop    clrwdt
        movlw   0x80
        xorwf   PORTB, f
        movlw   .13
        btfsc   PORTA, 1
        movlw   .2
        movwf   0x20
        clrf    0x21
work    decfsz  0x21, f
        goto    work
        decfsz  0x20, f
        goto    work
        goto    loop
"""
"""The watchdog is fed after 13 * 770 cycles, or 2 * 770; as PS is 1, it times out after 14 ms or more."""
ASLEEP = """
        clrf    PORTB
        bsf     STATUS, RP0
        bcf     TRISB, 1
        bcf     STATUS, RP0
        movlw   0x10
        movwf   INTCON
loop    clrwdt
        bcf     INTCON, INTF
        sleep
        bsf     PORTB, 1
        movlw   .5
        movwf   0x20
up      decfsz  0x20, f
        goto    up
        bcf     PORTB, 1
        movlw   .20
        movwf   0x20
down    decfsz  0x20, f
        goto    down
        goto    loop
"""
"""INT ends SLEEP, or the watchdog. High: 1 + 1 + 3 * 5 - 1 + 1 cycles; low: 61 or more."""


def waves(subject: Subject, program: Image, rng: random.Random | None) -> Waves:
    """Run a program: plainly, or with random inputs, start values and phase."""
    options, sources = SimulatorOptions(), []
    if rng is not None:
        seed = rng.choice((None, rng.randrange(1 << 20)))
        watchdog_us = rng.choice((7000, 33_000, rng.randrange(7000, 33_000)))
        options = replace(options, start_seed=seed, tmr0_phase=rng.randrange(4), watchdog_us=watchdog_us)
        for pin in subject.inputs:
            cycle, level, changes = 0, rng.randrange(2), []
            while cycle < subject.cycles:
                changes.append((Cycles(cycle), level))
                cycle += subject.hold + rng.randrange(subject.hold * rng.choice((1, 3, 9)))
                level ^= 1
            sources.append(Levels(PINS.index(pin), changes))
    trace = pin_trace(program, CLOCK, Cycles(subject.cycles), options, Stimuli(sources) if sources else None)
    found: Waves = {pin: [] for pin in PINS} | {"end": [(subject.cycles, 0)]}
    for chunk in trace.chunks:
        for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):
            edges = found[PINS[pin]]
            if (level == 1) == bool(edges and edges[-1][1]):
                continue
            if (
                PINS[pin] not in subject.inputs
                and level != 1
                and edges
                and cycle - edges[-1][0] <= GLITCH
                and cycle < 60
            ):
                edges.pop()
            else:
                edges.append((cycle, int(level == 1)))
    return found


def mutant(program: Image, rng: random.Random) -> tuple[int, Image]:
    address = rng.choice(sorted(program.program))
    word = rng.choice((program.program[address] ^ 1 << rng.randrange(14), rng.choice(DISTURBANCES)))
    return address, replace(program, program=program.program | {address: word})


def hidden_faults(
    chosen: list[Subject], seed: int, first: int = 0
) -> Iterator[tuple[int, Subject, str, Image]]:
    """Return mutants whose fault a plain run does not show: number, program, what was changed, and mutant."""
    for number in count(first):
        subject, rng = chosen[number % len(chosen)], random.Random(f"{seed} {number}")
        address, changed = mutant(subject.image, rng)
        if subject.kept(waves(subject, changed, None)) and not all(
            subject.kept(waves(subject, changed, rng)) for _ in range(4)
        ):
            yield number, subject, f"{address:#x} = {changed.program[address]:#06x}", changed


def accepted(subject: Subject, program: Image, proof: ContractProof) -> bool:
    """Return whether the checker sees that a program keeps its contract, with the hints of a proof."""
    try:
        check_contract(program, subject.contract, CLOCK, Hints(proof.cuts, proof.inputs))
    except Refused:
        return False
    return True


def give_up(seconds: int) -> None:
    """Raise TimeoutError after so many seconds of processor time; never with 0."""

    def late(*_: object) -> None:
        raise TimeoutError(f"more than {seconds} s")

    signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)


def answer_of(
    subject: Subject, changed: Image, right: ContractProof, seconds: int, max_states: int
) -> list[str]:
    """Return the words of the prover and of the checker for a mutant, each within a time."""
    words = []
    give_up(seconds)
    try:
        proof = subject.proof(changed, max_states)
        words.append(
            "PROVEN" if proof.proven else "counterexample" if proof.counterexample else "not decided"
        )
        if proof.proven and accepted(subject, changed, proof):
            words.append("CHECKED")
    except TimeoutError:
        words.append("too long")
    give_up(seconds)
    try:
        words.append("ACCEPTED" if accepted(subject, changed, right) else "refused")
    except TimeoutError:
        words.append("the checker takes too long")
    give_up(0)
    return words


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=100, help="hidden faults to give to the prover")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="the number of the first mutant")
    parser.add_argument("--max-states", type=int, default=4000)
    parser.add_argument("--seconds", type=int, default=20, help="of processor time, for each answer")
    given = parser.parse_args()
    found, every, right = Counter[str](), subjects(), {}
    for subject in every:
        proof = right[subject.name] = subject.proof(subject.image)
        assert proof.proven, (subject.name, proof.reason)
        assert all(subject.kept(waves(subject, subject.image, random.Random(n))) for n in range(4))
        word = "checked" if accepted(subject, subject.image, proof) else "one engine"
        print(f"{subject.name}: proven, {word}", flush=True)
    for number, subject, what, changed in islice(
        hidden_faults(every, given.seed, given.first), given.mutants
    ):
        words = answer_of(subject, changed, right[subject.name], given.seconds, given.max_states)
        found.update(words)
        print(f"{number} {subject.name} {what}: {', '.join(words)}; {dict(found)}", flush=True)
    return int(found["PROVEN"] + found["CHECKED"] + found["ACCEPTED"] > 0)


if __name__ == "__main__":
    sys.exit(main())
