"""A schedule's edges, for ever, as a plain program would list them."""

from collections.abc import Iterator
from itertools import islice

import numpy as np
import pytest

from servogen.edges import PINS
from servogen.pulse import Channel, Pulse, PulseSchedule, Run
from servogen.pulse.expected import CHUNK_EDGES, expected
from servogen.units import Clock, Cycles

PERIOD = 20_000


def schedule(lead_in: tuple[Run, ...], loop: tuple[Run, ...], channels: int = 2) -> PulseSchedule:
    names = (("vertical", "RB0"), ("horizontal", "RA1"))[:channels]
    return PulseSchedule(
        Clock(4_000_000),
        Cycles(PERIOD),
        tuple(Channel(name, pin, "mpx-tiny-s") for name, pin in names),
        lead_in,
        loop,
    )


def run(frames: int, *pulses: tuple[int, int] | None) -> Run:
    return Run(frames, tuple(Pulse(Cycles(pair[0]), Cycles(pair[1])) if pair else None for pair in pulses))


def plainly(plan: PulseSchedule) -> Iterator[tuple[int, int, int, int]]:
    """(cycle, pin, level, frame), one edge after the other, from the schedule's frame 0."""

    def turns() -> Iterator[Run]:
        yield from plan.lead_in
        while True:
            yield from plan.loop

    frame = 0
    for step in turns():
        for _ in range(step.frames):
            edges = []
            for channel, pulse in zip(plan.channels, step.pulses, strict=True):
                if pulse:
                    start = frame * plan.period + pulse.rise
                    edges.append((start, PINS.index(channel.pin), 1, frame))
                    edges.append((start + pulse.width, PINS.index(channel.pin), 0, frame))
            yield from sorted(edges)
            frame += 1


def edges(plan: PulseSchedule) -> Iterator[tuple[int, ...]]:
    for chunk in expected(plan).chunks:
        yield from zip(*(column.tolist() for column in chunk), strict=True)


SCHEDULES = {
    "short loop": schedule((), (run(3, (0, 1500), (2000, 1250)), run(2, None, (2000, 1300)))),
    "lead-in": schedule((run(2, (0, 1000), None), run(1, None, None)), (run(1, (0, 1), (0, 2)),)),
    "late first edge": schedule((run(5, None, None),), (run(1, None, (2000, 1250)),)),
    "long runs": schedule((), (run(40_000, (0, 1500), (2000, 1250)), run(9, None, (2000, 1250)))),
}


@pytest.mark.parametrize("name", SCHEDULES)
def test_the_edges_are_those_of_a_plain_count(name: str) -> None:
    plan = SCHEDULES[name]
    # More than two chunks, and two rounds of the longest loop.
    count = 350_000 if name == "long runs" else 150_000
    reference = list(islice(plainly(plan), count))
    zero = reference[0][0]
    wanted = [(cycle - zero, pin, level, frame) for cycle, pin, level, frame in reference]
    assert list(islice(edges(plan), count)) == wanted


@pytest.mark.parametrize("name", SCHEDULES)
def test_no_chunk_is_large(name: str) -> None:
    for chunk in islice(expected(SCHEDULES[name]).chunks, 5):
        assert 0 < len(chunk.cycle) <= CHUNK_EDGES
        assert (chunk.cycle.dtype, chunk.frame.dtype) == (np.int64, np.int64)
        assert (chunk.pin.dtype, chunk.level.dtype) == (np.uint8, np.uint8)


def test_each_reader_begins_at_the_first_edge() -> None:
    wanted = expected(SCHEDULES["lead-in"])
    first, again = (next(iter(wanted.chunks)).cycle[:4].tolist() for _ in range(2))
    assert first == again == [0, 1000, 20_000, 21_000]


def test_a_loop_without_pulses_has_no_edges_after_the_lead_in() -> None:
    ending = schedule((run(3, (0, 1500)),), (run(1, None),), channels=1)
    assert [edge[0] for edge in edges(ending)] == [0, 1500, 20_000, 21_500, 40_000, 41_500]


def test_the_channels_and_the_frames_are_counted() -> None:
    wanted = expected(SCHEDULES["lead-in"])
    assert (wanted.lead_in, wanted.loop, wanted.period) == (3, 1, PERIOD)
    assert [(channel.name, PINS[channel.pin]) for channel in wanted.channels] == [
        ("vertical", "RB0"),
        ("horizontal", "RA1"),
    ]
