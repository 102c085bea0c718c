"""The quantifiers of a proof, each of which can be switched off.

In: switches. Out: `Quantifiers`, and the concrete chips among which a counterexample is looked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product

from servogen.pic.device import WATCHDOG_US, device
from servogen.simulator import SimulatorOptions

PHASES = 4
"""The cycles after a write of OPTION_REG in which TMR0 may begin to count: 0 to 3."""
SEEDS = 64
"""Random start values that are tried."""
WRITE_TIMES = 16
"""Durations of an EEPROM write that are tried, and the shortest."""
FILLED = (0xFF, 0x55, 0xAA)
"""Bytes with which the whole RAM is filled first."""
RESETS = 24
"""Cycles in which a reset is tried."""

Start = tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Quantifiers:
    """The quantifiers of a proof; all of them by default."""

    inputs: bool = True
    """Every input pin at any level in any cycle; else the levels of the schedule."""
    tmr0_phase: bool = True
    """TMR0 begins to count 0 to 3 cycles after a write of OPTION_REG."""
    resets: bool = True
    """A reset in any cycle; else there is a power-on reset only."""
    watchdog: bool = True
    """The watchdog's period is anywhere in its range; else what the options say."""
    eeprom_write: bool = True
    """An EEPROM write takes any time up to the data sheet's maximum; else what the options say."""
    any_eeprom: bool = False
    """Any content of the EEPROM, where the program reads trims; else that of the file."""
    start: Start = ()
    """Values at power-up that are known, of `simulator.options.START_VALUES`; all others are anything."""

    @property
    def phases(self) -> int:
        """Return in how many ways TMR0 begins to count after a write of OPTION_REG."""
        return PHASES if self.tmr0_phase else 1

    @property
    def complete(self) -> bool:
        """Return whether a proof is about what a certificate is about."""
        plain = not self.start and not self.any_eeprom
        return plain and self.tmr0_phase and self.resets and self.watchdog and self.eeprom_write

    def text(self, *, held: bool) -> str:
        """Return what is quantified over, if some inputs are `held`; everything else is assumed."""
        parts = ["power-up"] if self.resets and not self.start else []
        parts += [] if held else ["input"]
        parts += ["chip"] if self.watchdog and self.tmr0_phase and self.eeprom_write else []
        if not parts:
            return "one power-up, the inputs and the chip that are assumed"
        return "every " + " and ".join(part for part in (", ".join(parts[:-1]), parts[-1]) if part)

    def assumed_of_chip(self, board: SimulatorOptions, watchdog: bool, write_us: int | None) -> list[str]:
        """Return what is assumed of the times and start values of a chip on a board.

        `watchdog` is whether it is on; `write_us` is the time of an EEPROM write, None without any access.
        """
        assumed = []
        if watchdog:
            period = f"the watchdog's period is {board.watchdog_us / 1000:g} ms"
            fastest = "no chip's watchdog is faster than 7 ms (DS35007, parameter 31)"
            assumed.append(fastest if self.watchdog else period)
        if write_us is not None:
            most = "at most " if self.eeprom_write else ""
            assumed.append(f"an EEPROM write takes {most}{write_us / 1000:g} ms")
        return assumed + [f"at power-up {name} is 0x{value:02X}" for name, value in self.start]


EVERYTHING = Quantifiers()


@dataclass(frozen=True, slots=True)
class ChipTrial:
    """A chip, and when it is reset after power-on, if it is."""

    options: SimulatorOptions
    reset: int | None = None


def trials(
    board: SimulatorOptions, quantifiers: Quantifiers, decided: Mapping[str, int], period: int
) -> Iterator[ChipTrial]:
    """Yield chips that differ in what is quantified over, the likeliest first.

    `decided` has the start values that the search has chosen on its way.
    """

    def chip(start: Start = (), base: SimulatorOptions = board) -> ChipTrial:
        return ChipTrial(replace(base, start=(*start, *quantifiers.start)))

    yield chip()
    chosen = tuple(decided.items())
    if chosen:
        yield chip(chosen)
    for byte in FILLED:
        yield chip((("ram", byte),))
    yield chip(base=replace(board, floating=1))
    if quantifiers.watchdog:
        for watchdog_us in WATCHDOG_US:
            yield chip(base=replace(board, watchdog_us=watchdog_us))
    if quantifiers.eeprom_write:
        longest = device(board.device).max_eeprom_write_us
        for part in range(WRITE_TIMES + 1):
            yield chip(base=replace(board, eeprom_write_us=max(1, longest * part // WRITE_TIMES)))
    if quantifiers.resets:
        # Five resets in each frame; the 7 cycles more each time keep them from always hitting the same
        # instruction.
        moments = [period * n // 5 + 7 * n for n in range(1, RESETS + 1)]
        yield from (ChipTrial(chip(chosen).options, moment) for moment in moments)
    for seed, floating in product(range(SEEDS), (0, 1)):
        yield chip(chosen, replace(board, start_seed=seed, floating=floating))
    for name, byte in product(("ram", "tmr0", "w"), range(0x100)):
        yield chip((*chosen, (name, byte)))
