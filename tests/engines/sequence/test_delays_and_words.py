"""A sequence's delays, edges and words, counted by hand; the text that every engine's C begins with."""

from __future__ import annotations

import pytest

from servogen.engines.c_text import AsmLine, assembly
from servogen.engines.sequence.programs import START, DelayPath, Hold, Overheads
from servogen.engines.sequence.sequencing import sequence
from servogen.engines.sequence.waits import C2C_MAX, CALLS
from servogen.errors import InputError
from servogen.pulse.schedule import Channel, Pulse, PulseSchedule, Run
from servogen.units import Clock, Cycles

CLOCK = Clock(4_000_000)
NONE = Overheads()


def pulse(rise: int, width: int) -> Pulse:
    return Pulse(Cycles(rise), Cycles(width))


def schedule_of(
    lead_in: tuple[Run, ...], loop: tuple[Run, ...], pins: tuple[str, ...] = ("RB0", "RA1")
) -> PulseSchedule:
    channels = tuple(Channel(f"s{n}", pin, "x") for n, pin in enumerate(pins))
    return PulseSchedule(CLOCK, Cycles(20_000), channels, lead_in, loop)


A = (pulse(0, 1000), pulse(2500, 1500))
B = (pulse(0, 1200), None)
OFF = (None, None)


# the program


def test_a_delay_without_time_is_refused_with_the_cycles_that_are_missing() -> None:
    schedule = schedule_of((), (Run(2, A),))
    for path, most, where in (
        (START, 20_000, "from reset to the first edge"),
        (DelayPath("in", 1, 1), 1500, "after cycle 1000 of a frame"),
        (DelayPath("again", 1), 64, "between frames"),
        (DelayPath("after", 0), 64, "between frames"),
    ):
        assert sequence(schedule, Overheads({path: most}))
        with pytest.raises(InputError) as error:
            sequence(schedule, Overheads({path: most + 2}))
        assert (error.value.code, error.value.message) == (
            "edges-too-close",
            f"two edges are too close {where}: the statements between them take 2 cycles too many",
        )
        assert error.value.hint == "lengthen the period, or give the servos slots that are further apart"
    # The frame's last edge may be 64 cycles before the next frame, and no nearer.
    for width, fits in ((20_000 - 64, True), (20_000 - 63, False)):
        near = schedule_of((), (Run(2, (pulse(0, width), None)),))
        if fits:
            assert sequence(near, NONE).positions[0].gap == 0
        else:
            with pytest.raises(InputError, match="between frames"):
                sequence(near, NONE)


def test_a_program_whose_loop_has_no_pulse_ends() -> None:
    program = sequence(schedule_of((Run(2, B),), (Run(1, OFF),)), NONE)
    assert [asked for _, asked in program.walk()] == [20_000, 1200, 18_800, 1200]
    (step,) = program.lead_in
    assert isinstance(step, Hold) and step.after == 0, "no edge follows"


# delays


def test_delays_at_the_limits_of_their_arguments() -> None:
    def text(dialect: str, cycles: int, clock: Clock = CLOCK) -> str:
        return " ".join(str(call) for call in CALLS[dialect](Cycles(cycles), clock))

    most = 50_463_240
    assert text("xc8", most) == f"_delay({most});" and text("xc8", most + 1) == f"_delay({most}); _delay(1);"
    assert text("xc8", 2 * most) == f"_delay({most}); _delay({most});"
    # `wait` of templates/sdcc.j2 takes 14, 18, 22 … cycles, up to 249 998; `wait_long` 200 005 or more.
    assert text("sdcc", 13) == " ".join(["nop();"] * 13) and text("sdcc", 14) == "wait(14);"
    assert text("sdcc", 17) == "wait(14); nop(); nop(); nop();" and text("sdcc", 18) == "wait(18);"
    assert text("sdcc", 250_000) == "wait(249998); nop(); nop();"
    assert text("sdcc", 250_001) == "wait_long(1); wait(49994); nop(); nop();"
    assert text("sdcc", 200_000 * 255 + 5 + 14) == "wait_long(255); wait(14);"
    assert text("sdcc", 200_000 * 256 + 5 + 14) == "wait_long(255); wait(200014);"
    assert text("c2c", 255) == "delay_10us(25); delay_us(5);" and text("c2c", 1) == "delay_us(1);"
    assert text("c2c", 255_000_000) == "delay_s(255);" and C2C_MAX == 255
    assert text("c2c", 256_000_000) == "delay_s(255); delay_s(1);"
    # At 1 MHz a cycle is 4 µs: steps of 1 µs are whole cycles in fours.
    slow = Clock(1_000_000)
    assert text("c2c", 1, slow) == "delay_us(4);" and text("c2c", 250, slow) == "delay_ms(1);"
    assert text("c2c", 5, slow) == "delay_10us(2);"


# what all engines share


def test_assembly_is_code_and_comments() -> None:
    assert list(assembly("    nop   ; wait ; twice\nlabel:\n; alone\n\n")) == [
        AsmLine("    nop   ", "wait ; twice"),
        AsmLine("label:", ""),
        AsmLine("", "alone"),
        AsmLine("", ""),
    ]
