"""The simulated board on which a schedule's program runs: chip, pull-ups, levels of the inputs."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from servogen.pic.device import OPEN_DRAIN_PIN
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.simulator import Levels, Machine, SimulatorOptions, Stimuli
from servogen.simulator.sources import Periodic, SignalSource, pin_number

WIRE_QUIET_S, WIRE_HIGH_US = Fraction(1, 4), Fraction(1500)
"""When an ideal wire rises first, and for how long it is high in every frame."""


def machine_of(
    schedule: PulseSchedule,
    image: Image,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
    *,
    tracked: bool = False,
) -> Machine:
    """Return the chip with `image` on the board of `schedule`, its inputs at the schedule's levels."""
    return Machine(image, schedule.clock, board_of(schedule, options), inputs_of(schedule), tracked=tracked)


def inputs_of(schedule: PulseSchedule) -> Stimuli | None:
    """Return the levels at which a schedule's inputs are held from power-up on; its wire rises once a frame,
    after `WIRE_QUIET_S`, as that of another chip does.
    """
    sources: list[SignalSource] = [
        Levels(pin_number(input_.pin), ((0, input_.level),)) for input_ in schedule.inputs
    ]
    if schedule.wire is not None:
        period, high = Fraction(schedule.period), schedule.clock.round_us(WIRE_HIGH_US).cycles
        start = Fraction(schedule.clock.round_seconds(WIRE_QUIET_S))
        sources.append(Periodic(pin_number(schedule.wire.pin), period, Fraction(high), start))
    return Stimuli(sources) if sources else None


def board_of(
    schedule: PulseSchedule,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
) -> SimulatorOptions:
    """Return `options` with the chip of a schedule, and the pull-up that a servo on RA4 (open drain)
    needs.
    """
    if schedule.device is not None:
        options = replace(options, device=schedule.device)
    if any(channel.pin == OPEN_DRAIN_PIN for channel in schedule.channels):
        return replace(options, ra4_pull_up=True)
    return options
