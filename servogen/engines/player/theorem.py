"""What the player's kernel guarantees with any compiler, derived from the kernel's words in a program.

In: the listing of a program, whatever compiled the C around the kernel, and its frame layout. Out: the
`Allowance` of the C between two slots: the number of cycles up to which the edges do not depend on it at all,
and the number up to which a late end sets the bit `overrun`. docs/firmware.md states the theorem.

The words of the kernel are executed one by one, with every byte that they read given, for each of the five
phases in which the loop that waits for the timer can meet its tick.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

from servogen.engines.player.layout import MIN_WIDTH, Slot, SlotLayout
from servogen.pic.device import addresses
from servogen.pic.isa import encode
from servogen.pic.known_values import (
    CARRY,
    FSR,
    INDF,
    NOT_FOLLOWED,
    ZERO,
    DecodedWord,
    Known,
    Undefined,
    W,
    execute,
    renumbered,
    step,
    word_of,
)
from servogen.pic.listing import Listing
from servogen.units import Cycles

KERNEL = "pulses"
"""The function of the C that holds the kernel."""
CHECK, POLL, DONE = "pl_check", "pl_poll", "pl_done"
"""Labels: the reading of the timer that detects C that ended late, the wait for the timer, the kernel's
end.
"""
TMR0, PORT = addresses("TMR0", "PORTB")
VARIABLES = (
    *("pulse_a_lo", "pulse_a_hi", "pulse_b_lo", "pulse_b_hi", "mask_a", "mask_b", "both", "port"),
    *("target", "ahead", "overrun"),
)
"""The C's variables that the kernel uses."""
LAST_WORDS = 3
"""The kernel's words behind its end: the watchdog is cleared, `target` goes back to where the lock began."""
POLL_CYCLES = 5
"""The cycles of the loop that waits for the timer: the lock has to remove as many phases."""
APART = 34
"""The maximum difference of two widths to run; beyond it, 8 more cycles are one more turn of a loop."""
MAX_STEPS = 20_000


@dataclass(frozen=True, slots=True)
class Allowance:
    """The cycles of the C from the kernel's end in one slot to its reading of the timer for the next."""

    same_edges: Cycles
    """The maximum number for which every edge is in the same cycle, whatever the C did."""
    late_is_seen: Cycles
    """The maximum number for which the edges are the same or `overrun` is set."""


@dataclass(frozen=True, slots=True)
class _Pulses:
    """One run of the kernel; cycles are counted from the timer's tick at which the slot begins."""

    writes: tuple[tuple[int, int], ...]
    """(cycle, value) of each write to the port that changes it."""
    end: int
    """The cycle in which the kernel is at its end."""


class KernelChanged(Exception):
    """The words are not those of a kernel that removes the phase, so its edges are not fixed."""


def allowances(listing: Listing, layout: SlotLayout) -> tuple[Allowance, Allowance]:
    """Return the allowances between two slots and between two frames, each the smallest of its kind.

    Raises KernelChanged.
    """
    kernel = _kernel_of(listing, layout)
    try:
        spent = _spent_beside_the_pulse(kernel.elsewhere())
    except KernelChanged:
        spent = _spent_beside_the_pulse(kernel)  # says at which address

    def of(slot: Slot, following: Slot) -> Allowance:
        taken = spent + slot.longest
        ticks = following.ticks
        seen = kernel.late_ticks_seen(ticks)
        # The kernel has to read the timer before the tick at which the next slot begins: one cycle less.
        return Allowance(Cycles(ticks * layout.tick - 1 - taken), Cycles(seen * layout.tick - 1 - taken))

    pairs = [of(*pair) for pair in zip(layout.slots, layout.slots[1:], strict=False)]
    frames = of(layout.slots[-1], layout.slots[0])
    return _smallest(pairs or [frames]), frames


def _smallest(allowances: Sequence[Allowance]) -> Allowance:
    return Allowance(
        min(allowance.same_edges for allowance in allowances),
        min(allowance.late_is_seen for allowance in allowances),
    )


def _kernel_of(listing: Listing, layout: SlotLayout) -> _Kernel:
    words = listing.words
    start = next(function.start for function in listing.functions if function.name == KERNEL)
    check, poll, done = (listing.label(label) for label in (CHECK, POLL, DONE))
    return _Kernel(
        tuple(words[address] for address in range(start, done + LAST_WORDS)),
        tuple(listing.variable(name) for name in VARIABLES),
        *(start, check, poll, done, layout.tick, layout.stagger),
    )


@cache
def _spent_beside_the_pulse(kernel: _Kernel) -> int:
    return kernel.spent_beside_the_pulse()


@dataclass(frozen=True, slots=True)
class _Kernel:
    """The kernel's words, from `start` on, and the addresses of `VARIABLES` and labels."""

    words: tuple[int, ...]
    places: tuple[int, ...]
    start: int
    check: int
    poll: int
    done: int
    tick: int
    stagger: int

    def elsewhere(self) -> _Kernel:
        """Return the same kernel at address 0, with its variables in the order in which its words name them.

        It does the same: no word that is followed reads where a pointer points, or computes an address.
        """
        try:
            words, places = renumbered(self.words, self.places)
        except Undefined:
            return self
        decoded = [word_of(word) for word in words]
        relative = tuple(
            encode("GOTO", k=each.k - self.start & 0x7FF) if each.flow == "jump" else word
            for each, word in zip(decoded, words, strict=True)
        )
        check, poll, done = (label - self.start for label in (self.check, self.poll, self.done))
        return replace(self, words=relative, places=places, start=0, check=check, poll=poll, done=done)

    @property
    def _ram(self) -> Mapping[str, int]:
        return dict(zip(VARIABLES, self.places, strict=True))

    def _word(self, address: int) -> DecodedWord:
        if not 0 <= address - self.start < len(self.words):
            raise KernelChanged(f"0x{address:03X} is not of the kernel")
        return word_of(self.words[address - self.start])

    def spent_beside_the_pulse(self) -> int:
        """Return the maximum cycles from the slot's beginning to the kernel's end, without the longest pulse.

        Raises KernelChanged if an edge depends on when the C had finished.
        """
        maximum = 0
        for apart in range(APART):
            # The remainder modulo 8 of the shorter pulse, and the phase, take every value.
            shorter = MIN_WIDTH + apart % 8
            arrivals = range(POLL_CYCLES) if apart < 8 else [apart % POLL_CYCLES]
            for one, other in ((shorter, shorter + apart), (shorter + apart, shorter)):
                outcomes = {self._run(one, other, arrival) for arrival in arrivals}
                if len(outcomes) != 1:
                    raise KernelChanged(f"widths {one} and {other}: the edges depend on the time of the C")
                (pulses,) = outcomes
                self._compare(pulses, one, other)
                # The layout's longest pulse includes the stagger.
                maximum = max(maximum, pulses.end - max(one, other + self.stagger))
        return maximum

    def late_ticks_seen(self, ahead: int) -> int:
        """Return the first number of ticks since the previous slot, from `ahead` on, whose lateness the
        kernel does not detect. Raises KernelChanged if it takes an earlier end for a late one.
        """
        for ticks in range(256):
            late = self._is_late(ticks, ahead)
            if ticks < ahead and late:
                raise KernelChanged(f"{ticks} of {ahead} ticks are taken for too many")
            if ticks >= ahead and not late:
                return ticks
        return 256

    def _is_late(self, ticks: int, ahead: int) -> bool:
        """Return whether the kernel sets `overrun` if it reads the timer `ticks` ticks after the last
        slot.
        """
        # Any target: the kernel uses only differences, modulo 256.
        target = 200
        overrun = self._ram["overrun"]
        known: Known = {
            self._ram["target"]: target,
            self._ram["ahead"]: ahead,
            overrun: 0,
            CARRY: 0,
            W: target,
        }
        address = self.check
        while address != self.poll:
            word = self._word(address)
            if word.flow == "next" and word.has_f and word.f == TMR0:
                self._look(word, known, target - ahead + ticks & 0xFF, address)
                address += 1
            else:
                address, _ = self._execute(word, known, address, "next", "skip")
        return bool(known[overrun] & 1)

    def _compare(self, pulses: _Pulses, one: int, other: int) -> None:
        """Compare the pulses with the requested widths. Raises KernelChanged if they differ."""
        for pin, width in ((1, one), (2, other)):
            rise = next((cycle for cycle, value in pulses.writes if value & pin), None)
            falls = [cycle for cycle, value in pulses.writes if not value & pin]
            lasts = None if rise is None else next((fall - rise for fall in falls if fall > rise), None)
            if lasts != width:
                raise KernelChanged(f"a pulse of {width} cycles lasts {lasts}")

    def _run(self, one: int, other: int, arrival: int) -> _Pulses:
        """Run the kernel for two widths; it reads the timer `arrival` cycles before the latest moment."""
        tick = self.tick
        target, ahead, ram = 200, 100, self._ram
        known: Known = {W: 0, CARRY: 0, ZERO: 0, FSR: 0}
        for name, value in {
            "pulse_a_lo": one & 0xFF, "pulse_a_hi": one >> 8, "pulse_b_lo": other & 0xFF,
            "pulse_b_hi": other >> 8, "mask_a": 1, "mask_b": 2, "both": 3, "port": PORT, "target": target,
            "ahead": ahead,
        }.items():  # fmt: skip
            known[ram[name]] = value
        begin = 1 << 16
        """The cycle, counted from the kernel's first instruction, of the tick that it waits for."""
        address, now, level = self.start, 0, 0
        writes: list[tuple[int, int]] = []
        for _ in range(MAX_STEPS):
            if address == self.check:
                begin = now + 1 + arrival
            if address == self.done:
                self._check_end(known, target)
                return _Pulses(tuple(writes), now - begin)
            word = self._word(address)
            following, cycles = address + 1, 1
            if word.flow == "next" and word.has_f and word.f == TMR0:
                self._look(word, known, (target + (now - begin) // tick) & 0xFF, address)
            elif word.f == INDF and word.writes_f and "f" not in word.reads and known.get(FSR) == PORT:
                value = 0 if word.name == "CLRF" else known[W]
                if value != level:
                    writes.append((now - begin, value))
                level = value
                if "Z" in word.flags:
                    known[ZERO] = int(value == 0)
            else:
                following, cycles = self._execute(word, known, address, "next", "skip", "jump")
            address, now = following, now + cycles
        raise KernelChanged("it does not end")

    def _check_end(self, known: Known, target: int) -> None:
        """Check that the kernel's last words restore `target` and leave `overrun` alone. Raises
        KernelChanged.
        """
        wanted = {self._ram["target"]: target, self._ram["overrun"]: 1}
        known[self._ram["overrun"]] = 1
        for address in range(self.done, self.done + LAST_WORDS):
            self._execute(self._word(address), known, address, "next")
        if any(known.get(place) != value for place, value in wanted.items()):
            raise KernelChanged("the end changes what the next slot needs")

    def _execute(self, word: DecodedWord, known: Known, address: int, *flows: str) -> tuple[int, int]:
        """Execute an instruction of one of these flows that writes W or RAM, or selects bank 0; return where
        execution continues, and the cycles. Raises KernelChanged for another one, or if a skip is not known.
        """
        stray = word.flow not in flows or word.name in NOT_FOLLOWED or (word.has_f and word.f == INDF)
        if stray or (word.writes_f and word.place is None and not word.selects_bank_0):
            raise KernelChanged(f"{word.name} at 0x{address:03X} is not followed")
        following, *other = step(address, (), word, known)
        if other:
            raise KernelChanged(f"0x{address:03X} tests what is not the kernel's")
        return following[0], following[2]

    def _look(self, word: DecodedWord, known: Known, timer: int, address: int) -> None:
        """Execute an instruction that reads the timer into W."""
        execute(word, known, operand=timer)
        if not word.writes_w or W not in known:
            raise KernelChanged(f"0x{address:03X} writes the timer")
