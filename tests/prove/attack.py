"""An attack on `servogen prove`: firmware whose fault shows only under a certain stimulus must not be proven.

    python -m tests.prove.attack --mutants 100 --seed 1

One word of a small player job, or of one of the programs in `attack_programs`, is changed: a bit, a table's
byte, the whole word, or a byte of the EEPROM. The simulator runs the mutant as `verify` does, and then under
random presses of the buttons, noise on the other inputs, random RAM and registers at power-up, each phase of
TMR0, other times of EEPROM writes and of the watchdog, and, for a proof of any EEPROM, other trims. A mutant
that only these show to be wrong is given to `servogen prove`; the reference chip must show the fault, too,
unless it comes late. Where gpsim runs the program (`gpsim_runs`), it is counted whether it shows the fault.
Each program gets the same processor time. If it prints a counterexample, the command that
it prints is executed, and the edges that `servogen simulate` then writes must be wrong. What is expected
comes from the checker's own state machine of the buttons, not from the prover's. Exit code 1 if anything is
proven, a counterexample does not replay, or a judge sees no fault.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import random
import shlex
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise, zip_longest
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

import numpy as np
import numpy.typing as npt

from servogen.checker import NotCovered, Refused, check_certificate, read_certificate
from servogen.checker.plan import OVER, Plan, read_plan
from servogen.cli import main as command_line
from servogen.edges import PINS, EdgeChunk, edge_chunk, join
from servogen.engines.board import board_of
from servogen.pic.device import device
from servogen.pic.image import Image, read_hex, to_hex
from servogen.pic.isa import decode, encode
from servogen.prove import certificate, prove_for_all
from servogen.pulse import PulseSchedule
from servogen.simulator import Levels, Machine, SimulatorOptions, Stimuli, load_stimuli
from servogen.simulator.options import start_value
from servogen.simulator.sources import SignalSource
from servogen.traces import read_edges
from servogen.units import Clock
from tests.checker.plans import after, due, start_stop
from tests.engines.player.player_jobs import built_text, job_text, sweep
from tests.prove.attack_programs import TRIMMED, programs
from tests.prove.gpsim_runs import GPSIM_CASES, gpsim_levels
from tests.simulator.reference import Chip

JOBS = {
    "stop, hold": 'stop_pin = "RB7"\nstop_pulses = "hold"\n',
    "stop, off": 'stop_pin = "RB7"\n',
    "start": 'start_pin = "RA4"\n',
    "start and stop": 'start_pin = "RA4"\nstop_pin = "RB7"\n',
    "no button": "",
}
Levelled = list[tuple[int, int]]
"""(cycle, levels of all pins from then on) at each change."""
ANY_EEPROM = "any EEPROM"
FRAMES = 45
MANY_FRAMES = 300
"""Of the programs without a job, whose frames are short: TMR0 takes all the values that it can have there."""
SETTLED = 1000
"""Cycles of a frame after which the pins change: long before they are read, after its last slot."""
SILENT_PERIODS = 50
"""Within which the first pulse must come."""
ENVIRONMENTS = 16
LONG = 400_000
"""Cycles that the reference chip takes some seconds for."""
NEAR = 24
"""Words before and after an instruction that reads a port."""
READS = {decode(encode(name, f=f, b=b)) for name in ("BTFSC", "BTFSS") for f in (5, 6) for b in range(8)}


@dataclass(frozen=True)
class Target:
    """A job's program, with what it should do."""

    name: str
    image: Image
    schedule: PulseSchedule
    text: bytes
    plan: Plan
    first: int
    """The cycle of the first rise."""
    frames: int = FRAMES
    """That are run to find a fault."""
    trimmed: tuple[int, ...] = ()
    """The pins of the servos whose trims the EEPROM holds, where any content of it is to be proven."""
    known: dict[object, Levelled] = field(default_factory=dict)
    """What is expected, by the levels of the buttons and the trims."""

    @property
    def options(self) -> tuple[str, ...]:
        """Return the options of `servogen prove`."""
        return ("--any-eeprom",) if self.trimmed else ()


@dataclass(frozen=True)
class Environment:
    """The levels of the buttons in each frame, noise on other inputs, and the values at power-up."""

    buttons: tuple[int, ...]
    noise: tuple[tuple[int, int, int], ...] = ()
    """(cycle, pin, level), in order."""
    start_seed: int | None = None
    tmr0_phase: int = 0
    times: tuple[int, int] | None = None
    """Of an EEPROM write, as a part of 256 of the longest; of the watchdog in µs; None: the usual ones."""
    eeprom: tuple[int, ...] = ()
    """The first bytes of the EEPROM, where any content is to be proven."""


def target(name: str) -> Target:
    """Return a job of `JOBS`, or a program of `attack_programs`."""
    if name == ANY_EEPROM:
        done = built_text(
            job_text(1, sweep(1, 0.04, limits=(80, 81)), limits=(80, 81), firmware="soft_start_s = 0.04\n"),
            "c2c",
        )
        schedule = done.plan.schedule
        made = _target(name, done.programs[0].image, schedule, int(done.programs[0].verdict.start or 0))
        return replace(made, trimmed=tuple(PINS.index(channel.pin) for channel in schedule.channels))
    if name not in JOBS:
        image, schedule = programs()[name]
        first = Machine(image, schedule.clock).run_to_edge(PINS.index("RB1"), 1, 50 * schedule.period)
        assert first is not None
        made = replace(_target(name, image, schedule, int(first)), frames=MANY_FRAMES)
        return replace(made, trimmed=(PINS.index("RB1"),) if name == TRIMMED else ())
    done = built_text(job_text(3, sweep(3, 0.32), firmware="soft_start_s = 0.16\n" + JOBS[name]), "c2c")
    program = done.programs[0]
    assert program.verdict.start is not None
    return _target(name, program.image, done.plan.schedule, int(program.verdict.start))


def _target(name: str, image: Image, schedule: PulseSchedule, first: int) -> Target:
    text = schedule.json_text().encode()
    return Target(name, image, schedule, text, read_plan(text, "schedule.json"), first)


def as_verified(case: Target) -> Environment:
    """What `verify` runs: start pressed, stop released, nothing on the other pins."""
    level = 0
    for button, pressed in ((start_stop(case.plan).start, True), (start_stop(case.plan).stop, False)):
        if button:
            level |= (button.pressed if pressed else 1 - button.pressed) << button.pin
    return Environment((level,) * case.frames)


def random_environment(case: Target, rng: random.Random) -> Environment:
    """Presses of 1 to 9 frames, and perhaps noise and other values at power-up."""
    levels = [0] * case.frames
    for button in (start_stop(case.plan).start, start_stop(case.plan).stop):
        frame = 0
        level = rng.randrange(2)
        while button and frame < case.frames:
            span = rng.choice((1, 2, 3, 3, 4, 9, 30))
            for each in range(frame, min(frame + span, case.frames)):
                levels[each] |= level << button.pin
            frame += span
            level ^= 1
    free = [pin for pin in range(13) if not (case.plan.channels | case.plan.buttons) >> pin & 1]
    end = case.first + case.frames * case.plan.period
    noise = [(rng.randrange(end), rng.choice(free), rng.randrange(2)) for _ in range(rng.choice((0, 60)))]
    seed = rng.choice((None, rng.randrange(1 << 20)))
    times = rng.choice((None, (rng.randint(1, 256), rng.randint(7000, 33_000))))
    trims = tuple(rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256))) for _ in case.trimmed)
    return Environment(tuple(levels), tuple(sorted(noise)), seed, rng.randrange(4), times, trims)


def expected(case: Target, around: Environment) -> Levelled:
    """(cycle since the first rise, levels of all pins), as the state machine of the buttons says."""
    key = around.buttons, around.eeprom
    if key not in case.known:
        case.known[key] = _expected(case, around)
    return case.known[key]


def _expected(case: Target, around: Environment) -> Levelled:
    position, found = case.plan.first, []
    for frame in range(case.frames):
        at, out = due(case.plan, position)
        edges = [(frame * case.plan.period + int(a), int(o)) for a, o in zip(at, out, strict=True)]
        found += trimmed(case, edges, around.eeprom)
        if position != OVER:
            position = after(case.plan, position, around.buttons[frame])
    return [(cycle - found[0][0], out) for cycle, out in found]


def trimmed(case: Target, edges: Levelled, content: tuple[int, ...]) -> Levelled:
    """Return edges whose falls are as much later as the trims say (docs/firmware.md, "Trim")."""
    if not content:
        return edges
    late = {
        pin: (byte ^ 0x80) - 0x80 if byte != 0xFF else 0
        for pin, byte in zip(case.trimmed, content, strict=True)
    }
    moved, out = [], 0
    for cycle, levels in edges:
        for pin in (pin for pin in range(13) if (out ^ levels) >> pin & 1):
            moved.append((cycle if levels >> pin & 1 else cycle + late.get(pin, 0), 1 << pin))
        out = levels
    found: Levelled = []
    for cycle, changes in sorted(moved):
        out ^= changes
        found = [*found[:-1], (cycle, out)] if found and found[-1][0] == cycle else [*found, (cycle, out)]
    return found


def sources(case: Target, around: Environment) -> list[SignalSource]:
    made: list[SignalSource] = []
    for pin in range(13):
        if case.plan.buttons >> pin & 1:
            levels = [around.buttons[0] >> pin & 1, *(each >> pin & 1 for each in around.buttons[1:])]
            times = [0, *(case.first + frame * case.plan.period + SETTLED for frame in range(1, case.frames))]
            made.append(Levels(pin, list(zip(times, levels, strict=True))))
        else:
            changes = [(cycle, level) for cycle, each, level in around.noise if each == pin]
            made += [Levels(pin, changes)] if changes else []
    return made


def chip_of(case: Target, image: Image, around: Environment) -> tuple[Image, Clock, SimulatorOptions]:
    """Return the chip, and what it holds."""
    board = board_of(case.schedule)
    options = replace(board, start_seed=around.start_seed, tmr0_phase=around.tmr0_phase)
    if around.times is not None:
        part, watchdog = around.times
        longest = device(board.device).max_eeprom_write_us
        options = replace(options, eeprom_write_us=max(4, longest * part // 256), watchdog_us=watchdog)
    content = dict(enumerate(around.eeprom))
    return replace(image, eeprom=image.eeprom | content), case.schedule.clock, options


def observed(case: Target, image: Image, around: Environment, frames: int) -> Levelled:
    """What the simulator does, in the same form."""
    machine = Machine(*chip_of(case, image, around), Stimuli(sources(case, around)))
    chunk = machine.run(case.first + frames * case.plan.period)
    begun = next((cycle for cycle, out in levels_of(chunk) if out), None)
    if begun is None:  # the first pulse may come within 50 periods
        begun = case.first + (SILENT_PERIODS - frames) * case.plan.period
    if begun > case.first:  # a later start is not a fault
        chunk = join(iter([chunk, machine.run(begun - case.first)]))
    found = levels_of(chunk)
    return [(cycle - found[0][0], out) for cycle, out in found]


def levels_of(chunk: EdgeChunk) -> Levelled:
    """(cycle, levels of all pins from then on), undriven pins being low, at each change."""
    out, found = 0, []
    cycles = chunk.cycle.tolist()
    following_cycles = [*cycles, -1][1:] if cycles else []
    edges = zip(cycles, chunk.pin.tolist(), chunk.level.tolist(), following_cycles, strict=True)
    for cycle, pin, level, following in edges:
        out = out & ~(1 << pin) | (level == 1) << pin
        if following != cycle and out != (found[-1][1] if found else 0):
            found.append((cycle, out))
    return found


def is_right(case: Target, image: Image, around: Environment, frames: int | None = None) -> bool:
    frames = case.frames if frames is None else frames
    end = (frames - 1) * case.plan.period
    wanted = [edge for edge in expected(case, around) if edge[0] < end]
    return [edge for edge in observed(case, image, around, frames) if edge[0] < end] == wanted


def as_second_chip(case: Target, image: Image, around: Environment, end: int) -> Levelled:
    """What the reference chip does (`tests.simulator.reference`), which shares no code with the prover."""
    program, clock, options = chip_of(case, image, around)
    start = Machine(program, clock, options).state()
    chip = Chip(
        program,
        watchdog_cycles=int(clock.round_us(options.watchdog_us).cycles),
        eeprom_cycles=int(clock.round_us(options.eeprom_us).cycles),
        ra4_pull_up=options.ra4_pull_up,
        tmr0_phase=options.tmr0_phase,
        stimuli=[
            each[:3] for part in Stimuli(sources(case, around)).changes(clock) for each in rows(part[1])
        ],
    )
    named = start.registers
    chip.w, chip.status, chip.ram, chip.tmr0 = start.w, start.status, [*start.ram], named["TMR0"]
    chip.intcon = named["INTCON"]
    chip.fsr, chip.eedata, chip.eeadr, chip.eecon1 = (
        named[name] for name in ("FSR", "EEDATA", "EEADR", "EECON1")
    )
    chip.latch = [(named["LATA"] | named["LATB"] << 5) >> pin & 1 for pin in range(13)]
    chip.run(end)
    columns = np.array(chip.edges, dtype=np.int64).reshape(-1, 3).T
    return levels_of(edge_chunk(*columns))


def rows(packed: npt.NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """Return changes of levels from their packed form: (cycle, pin, level)."""
    return [(each >> 8, each >> 2 & 0x3F, each & 3) for each in packed.tolist()]


Judge = Callable[[Target, Image, Environment, int], Levelled]


def as_gpsim(case: Target, image: Image, around: Environment, end: int) -> Levelled:
    """What gpsim does."""
    program, clock, options = chip_of(case, image, around)
    start = Machine(program, clock, options).state()
    changes = [each[:3] for part in Stimuli(sources(case, around)).changes(clock) for each in rows(part[1])]
    return gpsim_levels(program, start, changes, end)


def confirmed(case: Target, image: Image, around: Environment, judge: Judge) -> bool | None:
    """Return whether a judge sees a fault, too; None if that would take long."""
    wanted, seen = expected(case, around), observed(case, image, around, case.frames)
    fault = min(
        cycle for edge in zip_longest(wanted, seen) if edge[0] != edge[1] for cycle, _ in filter(None, edge)
    )
    end = case.first + fault + 2 * case.plan.period
    if end > LONG:
        return None
    found = judge(case, image, around, end)
    begun = next((cycle for cycle, out in found if out), 0)
    edges = [(cycle - begun, out) for cycle, out in found]
    return not begun or [edge for edge in edges if edge[0] <= fault] != [
        edge for edge in wanted if edge[0] <= fault
    ]


def mutants(case: Target, rng: random.Random) -> Iterator[tuple[str, Image]]:
    """Endless, none twice: one word changed, of every second one a word near an instruction that reads a
    port.
    """
    done = set()
    everywhere = list(case.image.program)
    reads = [each for each in everywhere if decode(case.image.program[each]) in READS]
    near = [each for each in everywhere if any(abs(each - read) <= NEAR for read in reads)]
    cells = [cell for cell, byte in case.image.eeprom.items() if byte != 0xFF and not case.trimmed]
    while True:
        if cells and rng.random() < 0.3:
            cell, byte = rng.choice(cells), rng.randrange(256)
            if byte != case.image.eeprom[cell] and (cell, byte) not in done:
                done.add((cell, byte))
                changed = replace(case.image, eeprom={**case.image.eeprom, cell: byte})
                yield f"EEPROM {cell}: {case.image.eeprom[cell]:02X} -> {byte:02X}", changed
            continue
        address = rng.choice(near if near and rng.random() < 0.5 else everywhere)
        word = case.image.program[address]
        row = decode(word)
        kind = rng.random()
        if row is not None and row.instruction.mnemonic == "RETLW" and kind < 0.5:
            new = word & ~0xFF | rng.randrange(256)
        elif kind < 0.85:
            new = word ^ 1 << rng.randrange(14)
        else:
            new = rng.randrange(1 << 14)
        if decode(new) != row and (address, new) not in done:
            done.add((address, new))
            what = f"0x{address:03X}: {word:04X} -> {new:04X}"
            yield what, replace(case.image, program={**case.image.program, address: new})


def hidden(case: Target, image: Image, rng: random.Random) -> Environment | None:
    """The stimulus that shows a fault which `verify` would not see; None if there is no such fault."""
    if not is_right(case, image, as_verified(case), 3) or not is_right(case, image, as_verified(case)):
        return None
    for _ in range(ENVIRONMENTS):
        around = random_environment(case, rng)
        if not is_right(case, image, around):
            return around
    return None


def attack(names: list[str], count: int, seed: int, max_states: int) -> tuple[Counter[str], list[str]]:
    """Counts of mutants tried, hidden faults and the prover's answers to them; the wrong answers."""
    rngs = {name: random.Random(f"{seed} {name}") for name in names}
    cases = [target(name) for name in names]
    for case in cases:
        for around in (as_verified(case), *(random_environment(case, rngs[case.name]) for _ in range(10))):
            assert is_right(case, case.image, around), (case.name, around)
    streams = {case.name: mutants(case, rngs[case.name]) for case in cases}
    spent = dict.fromkeys(names, 0.0)
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    while counts["hidden faults"] < count:
        case = min(cases, key=lambda case: spent[case.name])
        what, image = next(streams[case.name])
        began = time.process_time()
        counts["mutants"] += 1
        around = hidden(case, image, rngs[case.name])
        if around is not None:
            counts["hidden faults"] += 1
            blind = judged_by_others(case, image, around, counts)
            with TemporaryDirectory() as folder:
                answer = answered(case, image, Path(folder), max_states) + blind
            counts.update((answer, f"{case.name}: {answer}"))
            print(
                f"{counts['hidden faults']} of {counts['mutants']}: {case.name}, {what}: {answer}", flush=True
            )
            if answer not in (REPLAYED, UNDECIDED, UNTRIMMED):
                wrong.append(f"{case.name}, {what}: {answer}")
        spent[case.name] += time.process_time() - began
    return counts, wrong


def judged_by_others(case: Target, image: Image, around: Environment, counts: Counter[str]) -> str:
    """Count the judges that see a fault; return if the reference chip sees none."""
    judges = {"the reference chip": as_second_chip}
    if case.name in GPSIM_CASES and which("gpsim"):
        judges["gpsim"] = as_gpsim
    seen = {name: confirmed(case, image, around, judge) for name, judge in judges.items()}
    counts.update(
        f"{'' if fault else 'not '}shown by {name}" for name, fault in seen.items() if fault is not None
    )
    return "" if seen["the reference chip"] is not False else ", and the reference chip sees no fault"


REPLAYED, NOT_REPLAYED, UNDECIDED = "counterexample, replayed", "counterexample, not replayed", "not decided"


UNTRIMMED = "proven, and the trims that it names are others, or none"
"""Of a program that ignores a byte of the EEPROM: the answer lists whose trim each byte is."""


def answered(case: Target, image: Image, folder: Path, max_states: int) -> str:
    """Return the answer of `servogen prove`, whose counterexample `servogen simulate` repeats."""
    program, schedule = folder / "mutant.hex", folder / "schedule.json"
    program.write_text(to_hex(image))
    schedule.write_bytes(case.text)
    with contextlib.chdir(folder):
        answer = json.loads(
            servogen(
                *("prove", program, "--against", schedule, "--max-states", max_states, "--json"),
                *case.options,
            )
        )
        if answer["counterexample"] is None:
            said = " ".join(answer["assumptions"])
            due = (f"{byte} of {PINS[pin]}" for byte, pin in enumerate(case.trimmed))
            other = bool(case.trimmed) and not all(each in said for each in due)
            return UNTRIMMED if other else str(answer["answer"])
        words = shlex.split(answer["counterexample"]["command"])
        servogen(*words[1:])
        clock = Clock(int(words[words.index("--clock-hz") + 1]))
        trace = read_edges(folder / "counterexample.csv", clock)
        chunk = join(trace.chunks)
        machine = repeated(case, image, words, clock)
        content = read_hex(Path(words[2]).read_text(), words[2]).image.eeprom if case.trimmed else {}
        trims = tuple(content.get(byte, 0xFF) for byte in range(len(case.trimmed)))
        fault = judged(case, image, chunk, machine, answer["counterexample"]["cycle"], trims)
    return REPLAYED if fault else NOT_REPLAYED


def servogen(*words: object) -> str:
    """Run a command in this process, and return what it prints."""
    printed, before = io.StringIO(), sys.argv
    sys.argv = ["servogen", *map(str, words)]
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
            command_line()
    except SystemExit as ended:
        assert ended.code in (0, 1), sys.argv
    finally:
        sys.argv = before
    return printed.getvalue()


def repeated(case: Target, image: Image, words: list[str], clock: Clock) -> Machine:
    """Return the machine that a `servogen simulate` command runs, to see what the program reads."""
    values: dict[str, object] = {}
    starts = []
    for name, value in pairwise(words):
        if name == "--start":
            starts.append(start_value(value))
        elif name.startswith("--") and name[2:].replace("-", "_") in OPTIONS:
            field = name[2:].replace("-", "_")
            values[field] = {"device": str, "ra4_pull_up": lambda _: True}.get(field, int)(value)
    stimuli = (
        load_stimuli(Path(words[words.index("--stimulus") + 1]), clock) if "--stimulus" in words else None
    )
    return Machine(image, clock, SimulatorOptions(**values, start=tuple(starts)), stimuli)  # type: ignore[arg-type]


OPTIONS = {"device", "watchdog_us", "eeprom_write_us", "floating", "start_seed", "tmr0_phase", "ra4_pull_up"}


def readings(case: Target, image: Image, machine: Machine, end: int) -> list[tuple[int, int, int]]:
    """Return what the program reads of the buttons: (cycle, which, their levels)."""
    if not case.plan.buttons:
        return []
    places = {}
    for address, word in image.program.items():
        row = decode(word)
        if row is not None and "f" in row.instruction.reads and row.f in (5, 6):
            shift, bits = (0, 0x1F) if row.f == 5 else (5, 0xFF)
            places[address] = (1 << row.b if row.instruction.tests_bit else bits) << shift & case.plan.buttons
    machine.breakpoints = {address for address, which in places.items() if which}
    found = []
    while machine.cycles < end:
        machine.run(end - machine.cycles)
        if machine.cycles < end:
            state = machine.state().registers
            found.append(
                (int(machine.cycles), places[machine.pc & 0x3FF], state["PORTA"] | state["PORTB"] << 5)
            )
    return found


def judged(
    case: Target,
    image: Image,
    chunk: EdgeChunk,
    machine: Machine,
    fault: int,
    trims: tuple[int, ...] = (),
) -> bool:
    """Return whether edges, the last ones around cycle `fault`, are not those of the plan.

    A frame's sample of a button is the first reading in it; a frame in which a button is not read says
    nothing of those that follow it.
    """
    plan, end = case.plan, fault + 2 * case.plan.period
    seen = levels_of(chunk)
    begun = next((cycle for cycle, out in seen if out), None)
    if begun is None:
        return fault >= SILENT_PERIODS * plan.period
    reads = readings(case, image, machine, end)
    position = plan.first
    frame = begun - int(due(plan, position)[0][0])
    while frame + plan.period <= end:
        at, out = due(plan, position)
        wanted = [(frame + int(cycle), int(level)) for cycle, level in zip(at, out, strict=True)]
        wanted = trimmed(case, wanted, trims)
        if [edge for edge in seen if frame <= edge[0] < frame + plan.period] != wanted:
            return True
        here = [read for read in reads if frame <= read[0] < frame + plan.period]
        levels = 0
        for bit in (1 << pin for pin in range(13)):
            first = next((level for _, which, level in here if which & bit), None)
            if plan.buttons & bit and first is None:
                return False
            levels |= bit & (first or 0)
        position = after(plan, position, levels) if position != OVER else OVER
        frame += plan.period
    return False


def survivors(names: list[str], count: int, seed: int, max_states: int) -> tuple[Counter[str], list[str]]:
    """Counts of the answers to `count` mutants that no stimulus has shown to be wrong; the wrong proofs.

    If one is proven, the checker must accept it, or not cover it, and more stimuli must find nothing.
    """
    rng = random.Random(seed)
    cases = [target(name) for name in names]
    streams = [mutants(case, rng) for case in cases]
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    while counts["survivors"] < count:
        turn = counts["mutants"] % len(cases)
        case, (what, image) = cases[turn], next(streams[turn])
        counts["mutants"] += 1
        if not is_right(case, image, as_verified(case), 3) or not is_right(case, image, as_verified(case)):
            continue
        if any(not is_right(case, image, random_environment(case, rng)) for _ in range(4)):
            continue
        counts["survivors"] += 1
        proof = prove_for_all(image, case.schedule, options=board_of(case.schedule), max_states=max_states)
        counts["proven" if proof.proven else "not proven"] += 1
        if not proof.proven:
            continue
        opinion = second_opinion(case, image, proof)
        right = all(is_right(case, image, random_environment(case, rng)) for _ in range(40))
        print(f"{counts['survivors']}: {case.name}, {what}: {opinion}, right: {right}", flush=True)
        counts[opinion] += 1
        if not opinion.startswith((AGREED, OUTSIDE)) or not right:
            wrong.append(f"{case.name}, {what}: {opinion}, right: {right}")
    return counts, wrong


AGREED = "proven, and the checker agrees"
OUTSIDE = "proven, and the checker does not cover"


def second_opinion(case: Target, image: Image, proof: object) -> str:
    """What the checker says of the certificate of a proof."""
    try:
        claim = read_certificate(certificate(proof, image, case.schedule, case.text), "certificate")
        check_certificate(claim, image, case.text, "schedule.json")
    except NotCovered as outside:
        return f"{OUTSIDE} {outside.what}"
    except Refused as refused:
        return f"proven; the checker refuses: {refused}"
    return AGREED


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    everything = [*JOBS, ANY_EEPROM, *programs()]
    parser.add_argument("--jobs", nargs="*", choices=everything, default=everything)
    parser.add_argument("--max-states", type=int, default=20_000)
    parser.add_argument(
        "--survivors", action="store_true", help="mutants without a fault, if they are proven"
    )
    wanted = parser.parse_args()
    began = time.monotonic()
    work = survivors if wanted.survivors else attack
    counts, wrong = work(wanted.jobs, wanted.mutants, wanted.seed, wanted.max_states)
    print(dict(counts), f"{time.monotonic() - began:.0f} s", *wrong, sep="\n")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
