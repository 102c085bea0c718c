"""Random presses, noise and start values on a plain chip: each frame is one that the certificate allows.

    python -m tests.prove.random_frames --frames 1000000 --seed 1

The plain simulator runs a player with buttons, whose pins change at random moments. Every edge must be the
one that the checker's own state machine of the buttons gives for the levels that were read; at every cut
point the registers and the RAM must lie within one of the certificate's states with that place in the
schedule.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from servogen.checker import Certificate, layout, read_certificate
from servogen.checker.certificate import FRAME_NUMBER, PLACE
from servogen.checker.plan import OVER, Plan, PlanPosition, read_plan
from servogen.edges import PINS, EdgeChunk, join
from servogen.engines.board import board_of
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.prove import certificate, prove_for_all
from servogen.pulse import PulseSchedule
from servogen.simulator import Machine, SimulatorOptions
from servogen.simulator import layout as at
from servogen.units import Clock
from tests.checker.plans import after, due, start_stop
from tests.engines.player.player_jobs import built_text, job_text, sweep

BUTTONS = 'start_pin = "RA4"\nstop_pin = "RB7"\n'
NOISE = ("RA0", "RA1", "RA2", "RA3")
RUN_FRAMES = 10_000
"""Frames from one power-up to the next."""

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Target:
    """A program with its certificate."""

    image: Image
    schedule: PulseSchedule
    plan: Plan
    claim: Certificate
    by_place: dict[tuple[int, ...], Ints]
    """The certificate's states by cut, time in the frame, position, levels read, and pins that were read."""


@cache
def target(buttons: str = BUTTONS) -> Target:
    done = built_text(job_text(3, sweep(3, 0.24), firmware=f"soft_start_s = 0.16\n{buttons}"), "c2c")
    image, schedule = done.programs[0].image, done.plan.schedule
    text = schedule.json_text().encode()
    claim = read_certificate(
        certificate(prove_for_all(image, schedule), image, schedule, text), "certificate"
    )
    return Target(image, schedule, read_plan(text, "schedule.json"), claim, places(claim))


def places(claim: Certificate) -> dict[tuple[int, ...], Ints]:
    found: dict[tuple[int, ...], list[int]] = {}
    for number, state in enumerate(claim.states.tolist()):
        if state[FRAME_NUMBER] >= 0:
            place = claim.places[state[PLACE]]
            key = state[layout.PC], state[layout.TIME], state[FRAME_NUMBER], *place.memory
            found.setdefault((*key, place.levels, place.sampled), []).append(number)
    return {place: np.array(numbers) for place, numbers in found.items()}


@dataclass(frozen=True)
class Noise:
    """A stimulus: presses of some frames with bounces, and noise on pins that nobody reads."""

    seed: int
    period: int
    frames: int

    def changes(self, clock: Clock) -> Iterator[tuple[int, Ints]]:
        rng = np.random.default_rng(self.seed)
        end = self.period * self.frames
        parts = [np.array([[0, PINS.index(name), 1] for name in ("RA4", "RB7")])]
        for name in ("RA4", "RB7"):
            pin = PINS.index(name)
            spans = rng.integers(1, 12 * self.period, self.frames // 3)
            moments = np.cumsum(spans)
            levels = np.arange(len(moments)) & 1
            bounces = rng.integers(0, 4, len(moments))
            at_bounce = np.repeat(moments, bounces) + rng.integers(0, self.period // 4, bounces.sum())
            for cycles, values in (
                (moments, 1 - levels),
                (at_bounce, rng.integers(0, 2, len(at_bounce))),
                (moments + self.period // 4, levels),
            ):
                parts.append(np.column_stack([cycles, np.full(len(cycles), pin), values]))
        for name in NOISE:
            column = [rng.integers(0, end, self.frames), np.full(self.frames, PINS.index(name))]
            parts.append(np.column_stack([*column, rng.integers(0, 2, self.frames)]))
        every = np.concatenate(parts).astype(np.int64)
        packed = every[:, 0] << at.PACK_CYCLE | every[:, 1] << at.PACK_PIN | every[:, 2]
        yield at.NEVER, np.sort(packed)


@dataclass(frozen=True)
class Reads:
    """Of one button: its pin and the address of the only instruction that reads it."""

    pin: int
    address: int


def reads_of(aim: Target) -> list[Reads | None]:
    found: list[Reads | None] = []
    for button in (start_stop(aim.plan).start, start_stop(aim.plan).stop):
        places = [
            address
            for address, row in ((a, decode(word)) for a, word in aim.image.program.items())
            if row is not None and button is not None and row.instruction.tests_bit
            if row.f in (5, 6) and row.b + (5 if row.f == 6 else 0) == button.pin
        ]
        assert button is None or len(places) == 1
        found.append(None if button is None else Reads(button.pin, places[0]))
    return found


def walk(aim: Target, seed: int, frames: int) -> Iterator[str]:
    """Run from one power-up, and yield what the certificate does not allow."""
    period = aim.plan.period
    board = board_of(aim.schedule, SimulatorOptions(start_seed=seed, tmr0_phase=seed % 4))
    machine = Machine(aim.image, aim.schedule.clock, board, Noise(seed, period, frames))
    readers = reads_of(aim)
    machine.breakpoints = {*aim.claim.cuts, *(each.address for each in readers if each)}
    chunks, rows = zip(*machine.visits(frames * period), strict=True)
    visits = np.concatenate(rows)
    edges = levels_of(join(iter(chunks)))
    begun = int(edges[0][0] - due(aim.plan, aim.plan.first)[0][0])
    count = (int(machine.cycles) - begun) // period - 1
    visits = visits[(visits[:, at.CYCLE] >= begun) & (visits[:, at.CYCLE] < begun + count * period)]
    samples = [sampled(visits, each, begun, period, count) for each in readers]
    if any((when < 0).any() for when, _ in samples):
        yield f"seed {seed}: a button is not read in a frame"
        return
    positions = followed(aim.plan, readers, samples, count)
    yield from wrong_edges(aim.plan, edges, begun, positions, seed)
    yield from uncovered(aim, visits, begun, positions, samples, seed)


def levels_of(chunk: EdgeChunk) -> tuple[Ints, Ints]:
    """(cycles, levels of all pins from then on), undriven pins being low, from the first rise on."""
    rise = int(np.argmax(chunk.level == 1))
    cycle, pin, level = (np.asarray(column[rise:], dtype=np.int64) for column in chunk)
    out = np.cumsum(np.where(level == 1, 1 << pin, -(1 << pin)))
    last = np.append(cycle[1:] != cycle[:-1], True)
    return cycle[last], out[last]


Sample = tuple[Ints, Ints]
"""By frame: the cycle in which a button is first read, and its level then."""


def sampled(visits: Ints, reader: Reads | None, begun: int, period: int, count: int) -> Sample:
    if reader is None:
        return np.zeros(count, dtype=np.int64), np.full(count, -1)
    mine = visits[visits[:, at.PC] & 0x3FF == reader.address]
    frame, first = np.unique((mine[:, at.CYCLE] - begun) // period, return_index=True)
    when, level = np.full(count, -1), np.full(count, -1)
    when[frame] = mine[first, at.CYCLE]
    level[frame] = mine[first, at.PINS] >> reader.pin & 1
    return when, level


def followed(
    plan: Plan, readers: list[Reads | None], samples: list[Sample], count: int
) -> list[PlanPosition]:
    """The position in each frame, as the state machine of the buttons says."""
    levels = np.zeros(count, dtype=np.int64)
    for reader, (_, level) in zip(readers, samples, strict=True):
        levels |= level << reader.pin if reader else 0
    known: dict[tuple[PlanPosition, int], PlanPosition] = {}
    position, found = plan.first, []
    for level in levels.tolist():
        found.append(position)
        following = known.get((position, level))
        if following is None:
            following = known[position, level] = after(plan, position, level) if position != OVER else OVER
        position = following
    return found


def wrong_edges(
    plan: Plan, edges: tuple[Ints, Ints], begun: int, positions: list[PlanPosition], seed: int
) -> Iterator[str]:
    edges_of = {position: due(plan, position) for position in set(positions)}
    lengths = np.array([len(edges_of[position][0]) for position in positions])
    starts = np.repeat(begun + np.arange(len(positions)) * plan.period, lengths)
    cycles = np.concatenate([edges_of[position][0] for position in positions]) + starts
    out = np.concatenate([edges_of[position][1] for position in positions])
    seen = edges[0] < begun + len(positions) * plan.period
    if not np.array_equal(edges[0][seen], cycles) or not np.array_equal(edges[1][seen], out):
        shortest = min(len(cycles), int(seen.sum()))
        same = (edges[0][:shortest] == cycles[:shortest]) & (edges[1][:shortest] == out[:shortest])
        place = shortest if same.all() else int(np.argmin(same))
        cycle = int(edges[0][min(place, len(edges[0]) - 1)])
        yield f"seed {seed}: cycle {cycle}: an edge that the schedule does not have"


def uncovered(
    aim: Target,
    visits: Ints,
    begun: int,
    positions: list[PlanPosition],
    samples: list[Sample],
    seed: int,
) -> Iterator[str]:
    """Yield the states at cuts that lie within none of the certificate."""
    rows = visits[np.isin(visits[:, at.PC] & 0x3FF, list(aim.claim.cuts))]
    bytes_of = rows[:, list(SLOTS.values())].astype(np.uint8)
    since = rows[:, at.CYCLE] - begun
    frame = since // aim.plan.period
    spots = np.array([(position.frame, *position.memory) for position in positions])[frame]
    levels = pins = np.zeros(len(rows), dtype=np.int64)
    for reader, (when, level) in zip(reads_of(aim), samples, strict=True):
        if reader:
            read = when[frame] < rows[:, at.CYCLE]
            levels = levels | np.where(read, level[frame], 0) << reader.pin
            pins = pins | read << reader.pin
    keys = np.column_stack([rows[:, at.PC] & 0x3FF, since % aim.plan.period, spots, levels, pins])
    kinds, which = np.unique(keys, axis=0, return_inverse=True)
    order = np.argsort(which.ravel(), kind="stable")
    for key, members in zip(kinds, np.split(order, np.cumsum(np.bincount(which.ravel()))[:-1]), strict=True):
        mine, its_bytes = rows[members], bytes_of[members]
        covered = np.zeros(len(mine), dtype=bool)
        for number in aim.by_place.get(tuple(key.tolist()), ()):
            covered |= within(aim.claim, int(number), mine, its_bytes)
        for cycle in mine[~covered, at.CYCLE].tolist():
            yield f"seed {seed}: cycle {cycle}: no state of the certificate contains this one"


SLOTS = {
    layout.W: at.W,
    layout.FSR: at.FSR,
    layout.TMR0: at.TMR0,
    layout.EEDATA: at.EEDATA,
    layout.EEADR: at.EEADR,
}
SLOTS |= {slot: slot for slot in range(layout.RAM, layout.RAM_END)}
SLOTS |= {layout.STATUS: at.STATUS, layout.INTCON: at.INTCON, layout.EECON1: at.EECON1}
"""The simulator's slots of the checker's."""
TIMER = list(SLOTS).index(layout.TMR0)
EXACT = {layout.PCLATH: at.PCLATH, layout.OPTION: at.OPTION, layout.DEPTH: at.DEPTH}


def within(
    claim: Certificate, number: int, rows: Ints, bytes_of: npt.NDArray[np.uint8]
) -> npt.NDArray[np.bool_]:
    """Which of the chip's states, whose `SLOTS` are `bytes_of`, lie within a listed one."""
    state = claim.states[number]
    listed = state[list(SLOTS)]
    value, known = (listed & 0xFF).astype(np.uint8), (~(listed >> 8) & 0xFF).astype(np.uint8)
    moving = listed >> 16 == 1
    seen = bytes_of - np.outer(bytes_of[:, TIMER], moving).astype(np.uint8)
    fine = ((seen ^ value) & known == 0).all(axis=1)
    for slot, here in EXACT.items():
        fine &= rows[:, here] == state[slot]
    fine &= rows[:, at.TRIS] == state[layout.TRISA] | state[layout.TRISB] << 5
    a, b = state[layout.PORTA], state[layout.PORTB]
    latch, dark = a & 0x1F | (b & 0xFF) << 5, a >> 8 | b >> 8 << 5
    return fine & ((rows[:, at.LATCH] ^ latch) & ~dark == 0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    aim = target()
    began = time.process_time()
    runs = max(1, asked.frames // RUN_FRAMES)
    wrong = 0
    for number in range(runs):
        for message in walk(aim, asked.seed + number, RUN_FRAMES):
            wrong += 1
            print(message)
    took = time.process_time() - began
    print(f"{runs * RUN_FRAMES} frames after {runs} power-ups, {wrong} outside of the certificate")
    print(
        f"{aim.claim.count} states; {took:.0f} s of processor time, {runs * RUN_FRAMES / took:.0f} frames/s"
    )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
