"""The chips on which a graded program is powered up, and which of their differences matters.

In: a program's image. Out: chips as lists of `ChipDifference`s from the first one. Each chip's bits are those
that are undefined at power-up (RAM, registers, latches) and the levels of the pins that nothing drives:

    the first    0 0 0 0 0 0 0 0        typical watchdog and EEPROM, the EEPROM of the HEX file
    the second   1 1 1 1 1 1 1 1        longest watchdog, slowest EEPROM
    the third    0 1 1 0 1 0 0 0        shortest watchdog
    the fourth   1 0 0 1 0 1 1 1        its opposite
    the others   those of the first, with the EEPROM that the run before has left
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from random import Random

from servogen.edges import HIGH, PINS
from servogen.pic.device import CONFIG_WATCHDOG_ON, DEVICES, WATCHDOG_US
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.simulator import LevelChange, Machine, SimulatorOptions
from servogen.simulator.options import START_VALUES
from servogen.units import Clock

BOARD = SimulatorOptions(ra4_pull_up=True)
"""The lab's board, and the first chip on it."""

SHORTEST_US, LONGEST_US = WATCHDOG_US
SLOWEST_EEPROM_US = max(device.max_eeprom_write_us for device in DEVICES)

SHOWN_CONDITIONS = 3
"""The greatest number of conditions that one sentence names."""

FLAGS = ("C", "DC", "Z")
NAMED = {
    "flags": [f"{flag} is 1" for flag in FLAGS],
    "latches": [f"the latch of {pin} is 1" for pin in PINS],
    "rb-old": [f"RB{number} is first compared with 1" for number in range(4, 8)],
    "wrerr": ["WRERR is 1"],
    "rbif": ["RBIF is 1"],
}
"""The conditions of the start values whose bits have names."""


@dataclass(frozen=True, slots=True)
class ChipDifference:
    """One difference from the first chip; `condition` completes "if …"."""

    condition: str
    start: tuple[str, int] | None = None
    """A bit of one of `START_VALUES` that is 1: its name and mask."""
    high: int | None = None
    """An undriven pin that is high."""
    watchdog_us: int | None = None
    eeprom_write_us: int | None = None
    eeprom: Mapping[int, int] | None = None


Chip = tuple[ChipDifference, ...]


def machine(image: Image, clock: Clock, chip: Sequence[ChipDifference], *, tracked: bool = False) -> Machine:
    """Return the chip, powered up on the lab's board."""
    start: dict[str, int] = {}
    options, changes = BOARD, []
    for each in chip:
        if each.start:
            name, mask = each.start
            start[name] = start.get(name, 0) | mask
        if each.high is not None:
            changes.append(LevelChange(0, each.high, HIGH))
        if each.watchdog_us:
            options = replace(options, watchdog_us=each.watchdog_us)
        if each.eeprom_write_us:
            options = replace(options, eeprom_write_us=each.eeprom_write_us)
        if each.eeprom is not None:
            image = replace(image, eeprom=dict(each.eeprom))
    powered = Machine(image, clock, replace(options, start=tuple(start.items())), tracked=tracked)
    powered.apply(changes)
    return powered


def other_chips(image: Image) -> list[Chip]:
    """Return the chips beside the first one that differ in what the program finds at power-up."""
    bits = [*_start_bits(), *_pins()]
    random = Random(1)
    some = [random.random() < 0.5 for _ in bits]
    slow, quick = _watchdogs() if image.chip_config & CONFIG_WATCHDOG_ON else ((), ())
    slowest = ChipDifference(
        f"a write to the EEPROM takes {SLOWEST_EEPROM_US / 1000:g} ms", eeprom_write_us=SLOWEST_EEPROM_US
    )
    return [
        (*slow, slowest, *bits),
        (*quick, *(bit for bit, drawn in zip(bits, some, strict=True) if drawn)),
        tuple(bit for bit, drawn in zip(bits, some, strict=True) if not drawn),
    ]


def compared_values(image: Image, addresses: Sequence[int]) -> Iterator[Chip]:
    """Yield chips in which one of these bytes of RAM holds a value that the program may compare it with: a
    literal of its instructions, the next one, the one before or the negative."""
    decoded = (decode(word) for word in image.program.values())
    literals = {each.k for each in decoded if each and not each.instruction.has_target}
    values = {(value + step) & 0xFF for k in literals for value in (k, -k) for step in (-1, 0, 1)}
    for address in addresses:
        for value in sorted(values):
            yield tuple(_ram_bit(address, bit) for bit in range(8) if value >> bit & 1)


def condition(chip: Sequence[ChipDifference]) -> str:
    """Return what completes "if …"; several bits of a byte of RAM are told as its value."""
    bytes_of: dict[str, int] = {}
    for each in chip:
        name, mask = each.start or ("", 0)
        bytes_of[name] = bytes_of.get(name, 0) | mask
    words = dict.fromkeys(
        f"RAM {each.start[0]} is 0x{value:02X} at power-up"
        if each.start
        and each.start[0].startswith("0x")
        and (value := bytes_of[each.start[0]]).bit_count() > 1
        else each.condition
        for each in chip
    )
    if len(words) > SHOWN_CONDITIONS:
        return "what is undefined at power-up has other values"
    return " and ".join(words)


def powered_again(before: Machine) -> Chip | None:
    """Return the first chip with the EEPROM that a run has left; None if it is that of the start."""
    left, found = before.contents().eeprom, before.image.eeprom
    changed = {address: value for address, value in left.items() if value != found.get(address, 0xFF)}
    if not changed:
        return None
    shown = ", ".join(f"0x{value:02X} at 0x{address:02X}" for address, value in list(changed.items())[:3])
    more = ", …" if len(changed) > 3 else ""
    return (ChipDifference(f"the EEPROM holds what the run before has left ({shown}{more})", eeprom=left),)


def cause(chip: Chip, fails: Callable[[Sequence[ChipDifference]], bool]) -> Chip:
    """Return a few of a failing chip's differences that are enough to make the program fail.

    Each is the last one of the shortest beginning of the list that still fails; to find it takes about ten
    calls of `fails`.
    """
    needed: list[ChipDifference] = []
    rest = list(chip)
    while not needed or not fails(needed):
        passing, failing = 0, len(rest)
        while failing - passing > 1:
            middle = (passing + failing) // 2
            if fails([*needed, *rest[:middle]]):
                failing = middle
            else:
                passing = middle
        needed.append(rest[failing - 1])
        rest = rest[: failing - 1]
    return tuple(needed)


def _start_bits() -> Iterator[ChipDifference]:
    for name, greatest in START_VALUES.items():
        if name == "ram":
            continue
        for bit in range(greatest.bit_length()):
            if name.startswith("0x"):
                yield _ram_bit(int(name, 16), bit)
            else:
                told = NAMED[name][bit] if name in NAMED else f"bit {bit} of {name.upper()} is 1"
                yield ChipDifference(f"{told} at power-up", start=(name, 1 << bit))


def _ram_bit(address: int, bit: int) -> ChipDifference:
    name = f"0x{address:02X}"
    return ChipDifference(f"bit {bit} of RAM {name} is 1 at power-up", start=(name, 1 << bit))


def _pins() -> Iterator[ChipDifference]:
    """Yield each pin that nothing drives; RA4 is pulled up on the board."""
    for number, pin in enumerate(PINS):
        if pin != "RA4":
            yield ChipDifference(f"{pin}, an input that nothing drives, is high", high=number)


def _watchdogs() -> tuple[Chip, Chip]:
    slow, quick = (
        (ChipDifference(f"the chip's watchdog times out after {time / 1000:g} ms", watchdog_us=time),)
        for time in (LONGEST_US, SHORTEST_US)
    )
    return slow, quick
