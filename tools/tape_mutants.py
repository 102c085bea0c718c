"""Does anything notice a wrong byte of a tape, or a wrong word of its reader?

    python tools/tape_mutants.py build/dance --count 300
    python tools/tape_mutants.py build/dance --count 300 --proofs 40

Half of the mutants are a byte of `tape.bin` each, drawn from every class of bytes in turn (identity, kind,
width, sum, end); the other half a word of the reader, one bit changed. Each runs beside the original.

A tape's mutant is found by the reader, which ends in its safe state after nothing but right pulses, or only
by the comparison with the schedule. A word's mutant, of which one bit that its instruction has is changed,
is found if some pin differs in one of five runs: with the tape, with one that has a wrong width, with one of
another identity, with no EEPROM, and with an SDA that stays low. Exit code 1 if a byte is found by neither;
words that change nothing in these runs are listed.

With `--proofs N`, both witnesses of a proof judge the mutants: the checker each, with the certificate of the
right program and tape (`main.cert.xz`, of `servogen build --prove`) whose head is corrected, and the prover N
of them, from the cut points of the right program on. The counts so far are printed after every ten mutants.
Exit code 1 if one of the witnesses takes a mutant for proven that goes wrong in a plain run with the tape.
docs/examples/tape/short.toml has every class of bytes in so few frames that a proof takes seconds:

    servogen build docs/examples/tape/short.toml --prove --output build/short
    python tools/tape_mutants.py build/short --count 300 --proofs 300
"""

from __future__ import annotations

import argparse
import random
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import zip_longest
from pathlib import Path

from servogen.checker import Refused, check_certificate, read_certificate
from servogen.checker.certificate import Certificate, fingerprint
from servogen.edges import EdgeTrace, join
from servogen.engines.board import machine_of
from servogen.engines.tape.content import END, FIRST, FULL, KINDS, SILENT, STEP
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.programs import Program, compile_program, read_schedule
from servogen.prove import Proof, prove_for_all
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.simulator import EEPROM24, SimulatorOptions, on_pins
from servogen.units import Cycles
from servogen.workflows.verification import judge_edges, motion_cycles

READER = ("start", "give", "take", "fail", "seek", "check", "read_record", "step")
MOST_STATES = 10
"""The states of a mutant's proof, as a multiple of those of the right program."""
TOLD_AFTER = 10
"""The mutants between two prints of the counts."""
BEYOND_FRAMES = 40
"""The frames after the motion, so that the way back to the loop is run."""


@dataclass(frozen=True)
class Outcome:
    """The edges of all pins but the bus, and what the EEPROM's data sheet has against a run."""

    edges: bytes
    remarks: tuple[str, ...]


def run(board: Board, image: Image, cycles: int) -> Outcome:
    schedule, options = board
    machine = machine_of(schedule, image, options)
    others = expected(schedule).others
    trace = EdgeTrace(schedule.clock, (machine.run(cycles),), Cycles(cycles)).without(others)
    edges = join(trace.chunks)
    remarks = tuple(remark.message for device in machine.devices for _, remark in device.remarks)
    return Outcome(b"".join(column.tobytes() for column in edges), remarks)


Board = tuple[PulseSchedule, SimulatorOptions]
"""A schedule with its tape, and what else is around the chip."""


def with_content(schedule: PulseSchedule, content: bytes) -> PulseSchedule:
    assert schedule.tape is not None
    return replace(schedule, tape=replace(schedule.tape, content=content))


def classes(data: bytes, servos: int) -> dict[str, list[int]]:
    """Return the addresses of the bytes of each class."""
    found: dict[str, list[int]] = {
        "identity": [0, 1],
        "kind": [],
        "step": [],
        "full": [],
        "sum": [],
        "end": [],
    }
    at = FIRST
    while data[at] != END:
        length, name = {STEP: (servos, "step"), FULL: (2 * servos, "full"), SILENT: (0, "step")}[
            data[at] & KINDS
        ]
        found["kind"].append(at)
        found[name] += range(at + 1, at + 1 + length)
        found["sum"].append(at + 1 + length)
        at += length + 2
    found["end"] = [at, at + 1]
    return found


def tape_mutants(data: bytes, servos: int, count: int, rng: random.Random) -> Iterator[tuple[str, bytes]]:
    kinds = classes(data, servos)
    for number in range(count):
        name = list(kinds)[number % len(kinds)]
        at = rng.choice(kinds[name])
        yield name, data[:at] + bytes([data[at] ^ rng.randrange(1, 256)]) + data[at + 1 :]


def judge_tape(schedule: PulseSchedule, image: Image, data: bytes, lost: int) -> str:
    """Return how a wrong tape is found: "reader", "comparison" or "NOT FOUND"."""
    wrong = with_content(schedule, data)
    span = Cycles(motion_cycles(schedule) + BEYOND_FRAMES * schedule.period)
    machine = machine_of(wrong, image, tracked=True)
    cycles = schedule.run_cycles(span)
    trace = EdgeTrace(schedule.clock, (machine.run(cycles),), Cycles(cycles))
    if judge_edges(schedule, trace, span).passed:
        return "NOT FOUND"
    told = machine.ram[lost - 0x0C]
    # Of a motion that is released the pulses so far are the plan's: a difference is a pulse that is missing.
    edges = join(trace.without(expected(schedule).others).chunks)
    if told and len(edges.cycle):
        end = Cycles(int(edges.cycle[edges.level == 0].max()) + 1)
        whole = EdgeTrace(schedule.clock, (machine_of(schedule, image).run(cycles),), Cycles(cycles))
        right = join(whole.without(expected(schedule).others).until(end).chunks)
        mine = join(EdgeTrace(schedule.clock, (edges,), Cycles(cycles)).until(end).chunks)
        same = len(right.cycle) == len(mine.cycle) and all(
            (one == other).all() for one, other in zip(right, mine, strict=True)
        )
        return "reader" if same else "comparison"
    return "reader" if told else "comparison"


def word_mutants(program: Program, count: int, rng: random.Random) -> Iterator[tuple[int, Image]]:
    assert program.listing is not None
    starts = sorted(function.start for function in program.listing.functions)
    words = sorted(program.image.program)
    spans = []
    for function in program.listing.functions:
        if function.name in READER:
            after = [start for start in starts if start > function.start]
            end = after[0] if after else words[-1] + 1
            spans += [address for address in words if function.start <= address < end]
    while count:
        address = rng.choice(spans)
        changed = dict(program.image.program)
        changed[address] ^= 1 << rng.randrange(14)
        if named(changed[address]) != named(program.image.program[address]):
            count -= 1
            yield address, replace(program.image, program=changed)


def witnessed(schedule: PulseSchedule, image: Image, claim: Certificate, right: Proof | None) -> str:
    """Return what the checker says of a mutant with a forged certificate, and the prover, if the proof of the
    right program is given.
    """
    assert schedule.tape is not None
    content = schedule.tape.content
    forged = replace(claim, image=fingerprint(image), tape=sha256(content).hexdigest())
    try:
        check_certificate(forged, image, schedule.json_text().encode(), "schedule.json", tape=content)
        answer = "ACCEPTED"
    except Refused:
        answer = "refused"
    if right:
        proof = prove_for_all(image, schedule, max_states=MOST_STATES * right.states, cuts=right.cuts)
        shown = "counterexample" if proof.counterexample else "not decided"
        answer += f", {'PROVEN' if proof.proven else shown}"
    return answer


def attack(
    schedule: PulseSchedule,
    program: Image,
    mutants: Sequence[tuple[str, PulseSchedule, Image]],
    claim: Certificate,
    proofs: int,
) -> int:
    """Print what both witnesses say of mutants; return how many they take for proven that go wrong."""
    span = Cycles(motion_cycles(schedule) + BEYOND_FRAMES * schedule.period)
    cycles = schedule.run_cycles(span)
    counts: Counter[tuple[str, str, str]] = Counter()
    right = prove_for_all(program, schedule) if proofs else None
    for number, (name, board, image) in enumerate(mutants):
        trace = EdgeTrace(schedule.clock, (machine_of(board, image).run(cycles),), Cycles(cycles))
        how = "right in a run" if judge_edges(schedule, trace, span).passed else "wrong"
        # Evenly among all of them.
        asked = number * proofs // len(mutants) != (number + 1) * proofs // len(mutants)
        counts[name, how, witnessed(board, image, claim, right if asked else None)] += 1
        if (number + 1) % TOLD_AFTER == 0 or number + 1 == len(mutants):
            print(f"{number + 1} of {len(mutants)} mutants", flush=True)
            for (each, ran, answer), count in sorted(counts.items()):
                print(f"{each:14} {ran:14} {answer:24} {count:4}", flush=True)
    return sum(count for (_, how, answer), count in counts.items() if how == "wrong" and not answer.islower())


def named(word: int) -> str:
    """Return a word as an instruction."""
    decoded = decode(word)
    if decoded is None:
        return f"no instruction, {word:04X}"
    return f"{decoded.instruction.mnemonic} f={decoded.f:02X} d={decoded.d} b={decoded.b} k={decoded.k:03X}"


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help='a build of a job with on_error = "release"')
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--proofs", type=int, metavar="N", help="judge by the checker, and N by the prover")
    given = parser.parse_args()
    schedule = read_schedule(given.folder / "schedule.json")
    program = compile_program(given.folder / "main.c2c.c", schedule.device)
    if schedule.tape is None or program.listing is None:
        parser.error(f"{given.folder} is no build of a tape")
    data, servos, rng = schedule.tape.content, len(schedule.channels), random.Random(given.seed)
    if given.proofs is not None:
        file = given.folder / "main.cert.xz"
        if not file.exists():
            parser.error(f"{file} is missing: build the job with --prove")
        claim = read_certificate(file.read_bytes(), str(file))
        tapes = tape_mutants(data, servos, given.count - given.count // 2, rng)
        words = word_mutants(program, given.count // 2, rng)
        wrong = [(name, with_content(schedule, mutant), program.image) for name, mutant in tapes]
        others = [("reader's word", schedule, image) for _, image in words]
        # In turn, so that the counts so far are of both.
        mutants = [each for pair in zip_longest(wrong, others) for each in pair if each]
        return int(attack(schedule, program.image, mutants, claim, given.proofs) > 0)
    lost = program.listing.variable("lost")
    assert lost is not None
    counts: Counter[tuple[str, str]] = Counter()
    for name, mutant in tape_mutants(data, servos, given.count - given.count // 2, rng):
        counts[name, judge_tape(schedule, program.image, mutant, lost)] += 1
    cycles = schedule.run_cycles(motion_cycles(schedule) + BEYOND_FRAMES * schedule.period)
    width = FIRST + 1 + 2 * servos // 2
    tape, alone, plain = schedule.tape, replace(schedule, tape=None), SimulatorOptions()
    other = on_pins(EEPROM24(address=7), scl=tape.scl, sda=tape.sda)
    boards = [
        (schedule, plain),
        (with_content(schedule, data[:width] + bytes([data[width] ^ 4]) + data[width + 1 :]), plain),
        (with_content(schedule, bytes([data[0] ^ 1]) + data[1:]), plain),
        (alone, SimulatorOptions(devices=(other,))),
        (alone, plain),  # without a resistor SDA reads as 0
    ]
    right = [run(board, program.image, cycles) for board in boards]
    survivors = []
    for address, image in word_mutants(program, given.count // 2, rng):
        found = any(run(board, image, cycles) != wanted for board, wanted in zip(boards, right, strict=True))
        counts["reader's word", "run" if found else "NOT FOUND"] += 1
        if not found:
            survivors.append((address, program.image.program[address], image.program[address]))
    for (name, how), number in sorted(counts.items()):
        print(f"{name:14} {how:12} {number:4}")
    for address, word, other in survivors:
        print(f"0x{address:03X}: {named(word)} as {named(other)}: the same pins")
    return int(any(how == "NOT FOUND" and name != "reader's word" for name, how in counts))


if __name__ == "__main__":
    sys.exit(main())
