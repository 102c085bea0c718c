"""Where a program keeps the variables of the specification: a `StreamChip` as bytes, and bytes as one.

In: a program's names, and bytes by address. Out: the chip that they are, the bytes of a chip, and the
invariant that holds of both between two steps of main.
"""

from __future__ import annotations

from collections.abc import Callable

from servogen.engines.inputs.serial import HOLD
from servogen.engines.stream.streaming import Streaming
from servogen.prove.stream.bits import Bits, Truth, all_of, byte, choose
from servogen.prove.stream.chip import BROKEN, SENDING, StreamChip
from servogen.prove.stream.execution import EEPROM
from servogen.prove.stream.names import Names

STARTING, GATHERING = 6, 7
"""Of `slot`: two flags above the slot's number."""


def read_chip(names: Names, read: Callable[[int], Bits]) -> StreamChip:
    """Return the chip's variables; `read` reads the byte at an address."""
    servos, coarse = range(names.servos), names.streamed.coarse

    def widths(name: str) -> list[Bits]:
        return [read(names.at(f"{name}_high", n)).concat(read(names.at(f"{name}_low", n))) for n in servos]

    def positions(name: str) -> list[Bits]:
        return [read(names.at(name, n)).zero_extend(16) for n in servos]

    def members(name: str) -> list[Truth]:
        together = read(names.at(name))
        return [together.bit(names.group_bit(n)) for n in servos]

    slot, left = read(names.at("slot")), read(names.at("left"))
    return StreamChip(
        names.streamed,
        widths=positions("place") if coarse else widths("width"),
        goals=positions("goal") if coarse else widths("goal"),
        speeds=[read(names.at("speed", n)) for n in servos],
        trims=[read(EEPROM + n) for n in servos],
        waiting=[slot.bit(GATHERING) for _ in servos] if coarse else members("waiting"),
        group=[~left.equals(0) for _ in servos] if coarse else members("group"),
        frames_left=left,
        starting=slot.bit(STARTING),
        gathering=slot.bit(GATHERING),
        silence=byte(0) if names.streamed.stream.fail_safe == HOLD else read(names.at("silence")),
    )


def chip_bytes(names: Names, chip: StreamChip, slot: Bits) -> dict[int, Bits]:
    """Return the bytes of a chip's variables, by address."""
    content = {}
    coarse = names.streamed.coarse
    for n in range(names.servos):
        if coarse:
            content[names.at("place", n)] = chip.widths[n][0:8]
            content[names.at("goal", n)] = chip.goals[n][0:8]
        else:
            for name, pair in (("width", chip.widths[n]), ("goal", chip.goals[n])):
                content[names.at(f"{name}_low", n)] = pair[0:8]
                content[names.at(f"{name}_high", n)] = pair[8:16]
        content[names.at("speed", n)] = chip.speeds[n]
        content[EEPROM + n] = chip.trims[n]
    groups = {} if coarse else {"group": chip.group, "waiting": chip.waiting}
    for name, members in groups.items():
        together = byte(0)
        for n, member in enumerate(members):
            together = together | choose(member, byte(1 << names.group_bit(n)), byte(0))
        content[names.at(name)] = together
    content[names.at("left")] = chip.frames_left
    if names.streamed.stream.fail_safe != HOLD:
        content[names.at("silence")] = chip.silence
    flags = choose(chip.starting, byte(1 << STARTING), byte(0))
    flags = flags | choose(chip.gathering, byte(1 << GATHERING), byte(0))
    content[names.at("slot")] = slot | flags
    return content


def invariant(names: Names, chip: StreamChip, read: Callable[[int], Bits]) -> Truth:
    """Return what holds between two steps of main: of a chip's variables, and of the bits in the bytes of the
    groups that belong to no servo.
    """
    if names.streamed.coarse:
        return chip.valid()
    everybody = sum(1 << names.group_bit(n) for n in range(names.servos))
    unused_bits = [read(names.at(name)) & (0xFF ^ everybody) for name in ("group", "waiting")]
    return chip.valid() & all_of(bits.equals(0) for bits in unused_bits)


def receiver_counts(streamed: Streaming) -> list[int]:
    """Return what rx_bits can be."""
    sending = [1 << SENDING | bits for bits in range(1, 11)] if streamed.stream.transmit_pin else []
    return [*range(11), *sending, 1 << BROKEN]
