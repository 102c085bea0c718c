"""The simulated board on which a schedule's program runs: chip, pull-ups, levels of the inputs."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import partial

from servogen.pic.device import OPEN_DRAIN_PIN
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.simulator import (
    EEPROM24,
    FirstChip,
    Levels,
    Machine,
    PairedMachine,
    SimulatorOptions,
    Stimuli,
    Stimulus,
    on_pins,
)
from servogen.simulator.sources import Periodic, SignalSource, pin_number

WIRE_QUIET_FRAMES, WIRE_HIGH = 13, Fraction(1, 12)
"""The frames in which an ideal wire is low at first, and the part of each later one in which it is high."""


def machine_of(
    schedule: PulseSchedule,
    image: Image,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
    *,
    tracked: bool = False,
) -> Machine:
    """Return the chip with `image` on the board of `schedule`, its inputs at the schedule's levels."""
    return Machine(image, schedule.clock, board_of(schedule, options), inputs_of(schedule), tracked=tracked)


def paired_machine(
    schedules: tuple[PulseSchedule, PulseSchedule],
    images: tuple[Image, Image],
    shown: int = 0,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
    stimulus: Stimulus | None = None,
) -> PairedMachine:
    """Return two chips with the wire between them, of which number `shown`, 0 or 1, is shown.

    `stimulus` is what is done to the pins of the first one, if that is shown.
    """
    first, second = schedules
    assert second.wire is not None
    source, pin = pin_number(second.wire.source), pin_number(second.wire.pin)
    leading = FirstChip(partial(machine_of, first, images[0], options), source, pin)
    applied, other, wire = (
        (stimulus, Machine(images[1], second.clock, board_of(second, options)), (source, pin))
        if shown == 0
        else (leading, leading.powered(), None)
    )
    board, restart = board_of(schedules[shown], options), second.wire.restart
    line = None if restart is None else pin_number(restart)
    return PairedMachine(images[shown], first.clock, board, applied, other, wire, leading, line)


def equal_rates(schedule: PulseSchedule) -> tuple[str, ...]:
    """Return what `paired_machine` leaves out of a second chip, if that has a crystal of its own."""
    ppm = schedule.wire.crystal_ppm if schedule.wire else 0
    return (f"both crystals at equal rates: servogen verify runs them at ±{ppm} ppm",) if ppm else ()


def inputs_of(schedule: PulseSchedule) -> Stimuli | None:
    """Return the levels at which a schedule's inputs are held from power-up on; its wire rises once a frame,
    after `WIRE_QUIET_FRAMES`, as that of another chip does.
    """
    sources: list[SignalSource] = [
        Levels(pin_number(input_.pin), ((0, input_.level),)) for input_ in schedule.inputs
    ]
    if schedule.wire is not None:
        period = Fraction(schedule.period)
        high, start = Fraction(int(WIRE_HIGH * period)), WIRE_QUIET_FRAMES * period
        sources.append(Periodic(pin_number(schedule.wire.pin), period, high, start))
    return Stimuli(sources) if sources else None


def board_of(
    schedule: PulseSchedule,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
) -> SimulatorOptions:
    """Return `options` with the chip of a schedule, its tape, and the pull-up that a servo on RA4 (open
    drain) needs. Raises InputError for a tape that no EEPROM holds.
    """
    if schedule.device is not None:
        options = replace(options, device=schedule.device)
    tape = schedule.tape
    if tape is not None:
        eeprom = on_pins(EEPROM24(tape.content, tape.eeprom), scl=tape.scl, sda=tape.sda)
        if eeprom not in options.devices:
            options = replace(options, devices=(*options.devices, eeprom))
    if any(channel.pin == OPEN_DRAIN_PIN for channel in schedule.channels):
        return replace(options, ra4_pull_up=True)
    return options
