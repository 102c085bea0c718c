"""The emulated devices on a stand-in for the chip: Firmata as its protocol.md has it, samples one by one."""

from __future__ import annotations

import errno
import os
import random
import sys
from collections.abc import Callable
from contextlib import nullcontext
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from servogen.bench.analysers.sump import Runs
from servogen.bench.inputs.wiring import input_wiring
from servogen.bench.virtual.analyser import AnalyserOptions, VirtualAnalyser, noisy
from servogen.bench.virtual.board import BoardOptions, VirtualBoard
from servogen.bench.virtual.chip import VirtualChip
from servogen.bench.virtual.terminals import Openings, terminals
from servogen.edges import PINS
from servogen.errors import ToolError
from tests.bench.seven_bits import packed

RA0, RB0, RB1, RB4 = (PINS.index(name) for name in ("RA0", "RB0", "RB1", "RB4"))


class StandIn:
    """A chip of a million cycles a second: what is done to it is listed, and its pins do what is given."""

    def __init__(self, changes: list[tuple[int, int]] | None = None) -> None:
        self.changes = changes or [(0, 0)]
        self.calls: list[tuple[object, ...]] = []
        self.now = 0
        self.cycles_per_second = Fraction(1_000_000)
        self.watched = False
        self.is_slow = False
        self.alarms: list[Any] = []
        self.listeners: list[Callable[[object, int], None]] = []

    @property
    def word(self) -> int:
        return max(change for change in self.changes if change[0] <= self.now)[1]

    def due(self, most: int) -> int:
        return most

    def forget(self) -> None:
        pass

    def look(self, cycles: int) -> tuple[Any, Any]:
        begin, self.now = self.now, self.now + cycles
        inside = [(begin, max(change for change in self.changes if change[0] <= begin)[1])]
        inside += [change for change in self.changes if begin < change[0] <= self.now]
        cycle, level = zip(*inside, strict=True)
        return np.array(cycle, dtype=np.int64), np.array(level, dtype=np.uint32)

    def run(self, cycles: int) -> None:
        end = self.now + cycles
        while (
            due := min((at for each in self.alarms if (at := each.next_at()) is not None), default=end)
        ) < end:
            self.now = max(due, self.now)
            for alarm in self.alarms:
                alarm.ring()
        self.now = end
        for alarm in self.alarms:
            alarm.ring()

    def __getattr__(self, name: str) -> Callable[..., None]:
        if name not in ("drive", "drive_at", "connect", "set_channel", "supply"):
            raise AttributeError(name)
        return lambda *arguments: self.calls.append((name, *arguments))


class Rig:
    """A board, whose client this is: bytes as hexadecimal text."""

    def __init__(self, *texts: str, **options: Any) -> None:
        self.chip = StandIn()
        self.board = VirtualBoard(cast(VirtualChip, self.chip), input_wiring(texts), BoardOptions(**options))
        self.chip.calls.clear()

    def answer(self, text: str) -> str:
        self.board.received(bytes.fromhex(text))
        found = self.board.outgoing.hex(" ")
        self.board.outgoing.clear()
        return found

    def done(self) -> list[tuple[object, ...]]:
        calls = list(self.chip.calls)
        self.chip.calls.clear()
        return calls


def test_each_pin_of_a_mega_says_its_modes() -> None:
    """Input, pull-up (11) and output of one bit; serial (10): its port's number twice, one more for TX."""
    found = Rig().answer("F0 6B F7").split()
    assert (found[:2], found[-1]) == (["f0", "6c"], "f7")
    pins = " ".join(found[2:-1]).split("7f")
    assert pins.pop() == ""
    assert len(pins) == 70
    serial = {19: "02", 18: "03", 17: "04", 16: "05", 15: "06", 14: "07"}
    for number, modes in enumerate(pins):
        expected = "" if number < 2 else "00 01 0b 01 01 01"
        assert modes.strip() == (f"{expected} 0a {serial[number]}" if number in serial else expected), number
    assert " 0a " not in Rig(scheduler=False).answer("F0 6B F7")


def test_the_state_of_a_pin_is_its_mode_and_level() -> None:
    rig = Rig()
    assert rig.answer("F0 6D 02 F7") == "f0 6e 02 00 00 f7"
    assert rig.answer("F4 02 01 F5 02 01 F0 6D 02 F7") == "f0 6e 02 01 01 f7"
    assert rig.answer("F4 02 0B F0 6D 02 F7") == "f0 6e 02 0b 01 f7"
    refused = " ".join(f"{ord(letter):02x} 00" for letter in "Unknown pin mode")
    assert rig.answer("F4 02 02") == f"f0 71 {refused} f7", "no analog input"
    assert rig.answer("F0 6D 02 F7") == "f0 6e 02 0b 01 f7"
    assert rig.answer("F0 6D 01 F7") == rig.answer("F0 6D 46 F7") == rig.answer("F0 6D F7") == ""
    assert rig.answer("F0 6D 45 F7") == "f0 6e 45 00 00 f7", "pin 69 is the last"
    assert rig.answer("F4 02 01 F0 6D 02 F7") == "f0 6e 02 01 00 f7", "an output begins low"
    assert Rig(scheduler=False).answer("F0 6D 02 F7") == "f0 6e 02 01 00 f7"


def test_levels_go_to_the_pins_that_are_outputs() -> None:
    """Pin 2 is wired to RB0, pin 3 to RB1."""
    rig = Rig()
    rig.answer("F5 02 01")
    assert rig.done() == []
    rig.answer("F4 02 01")
    assert rig.done() == [("drive", RB0, 0)]
    rig.answer("F5 02 01")
    assert rig.done() == [("drive", RB0, 1)]
    rig.answer("F4 03 0B")
    assert rig.done() == [("drive", RB1, 1)]
    rig.answer("F4 03 00 90 0C 00")  # port 0: pins 2 and 3
    assert rig.done() == [("drive", RB1, 2), ("drive", RB0, 1)]
    rig.answer("F4 09 01 90 00 01")  # pin 9 is bit 1 of port 1; pin 7, in the second byte, is an input
    rig.done()
    rig.answer("91 02 00")
    (call,) = rig.done()
    assert (call[0], call[2]) == ("drive", 1)
    standard = Rig(scheduler=False)
    standard.answer("F4 02 00")
    standard.answer("F5 02 01 F4 02 01")
    assert standard.done() == [("drive", RB0, 2), ("drive", RB0, 0)]


def test_a_reset_makes_every_pin_what_it_was_at_the_beginning() -> None:
    """SYSTEM_RESET is FF (protocol.md); StandardFirmata's pins are then outputs that are low."""
    rig = Rig()
    rig.answer("F4 02 01 F5 02 01 F4 16 0B D2 01")
    rig.done()
    assert rig.answer("FF F0 6D 02 F7 F0 6D 16 F7") == "f0 6e 02 00 00 f7 f0 6e 16 00 00 f7"
    assert ("drive", RB0, 2) in rig.done()
    standard = Rig(scheduler=False)
    standard.answer("F5 02 01 F4 03 00")
    standard.done()
    assert standard.answer("FF F0 6D 02 F7 F0 6D 03 F7") == "f0 6e 02 01 00 f7 f0 6e 03 01 00 f7"
    assert {("drive", RB0, 0), ("drive", RB1, 0)} <= set(standard.done())


def test_a_pull_up_holds_a_pin_high_that_nothing_is_wired_to() -> None:
    """Pins 20 and 23 are bits 4 and 7 of port 2, whose eighth bit has a byte of its own (protocol.md)."""
    rig = Rig()
    assert rig.answer("D2 01") == "92 00 00"
    assert rig.answer("F4 14 0B") == "92 10 00"
    assert rig.answer("F4 17 0B") == "92 10 01"
    assert rig.answer("F4 14 00") == "92 00 01"


def test_contacts_mclr_supply_and_the_mark_have_their_own_effects() -> None:
    rig = Rig("VDD=17", "RB0-RB4=22", "MARK=23")
    mclr = rig.board.wiring.pins["MCLR"]
    pair = frozenset({RB0, RB4})
    rig.answer(f"F4 16 01 F5 16 01 F5 16 00 F4 17 01 F5 17 01 F4 11 01 F5 11 01 F4 {mclr:02x} 01")
    calls = rig.done()
    assert [call for call in calls if call[0] == "connect"] == [
        ("connect", pair, False),
        ("connect", pair, True),
        ("connect", pair, False),
    ]
    assert [call[2] for call in calls if call[0] == "set_channel"] == [False, True]
    assert [call for call in calls if call[0] == "supply"] == [("supply", False), ("supply", True)]
    assert [call[2] for call in calls if call[0] == "drive"] == [0]
    rig.answer(f"F4 {mclr:02x} 00 F4 11 00")
    assert [call[-1] for call in rig.done()] == [1, True], "let go, the chip runs and has its supply"


def test_a_serial_line_sends_start_bit_data_and_stop_bit_at_its_rate() -> None:
    """RB1 on port 1 at 10000 baud, 100 cycles a bit: 10000 = 0x10 | 0x4E << 7."""
    rig = Rig("RB1=TX1")
    rig.answer("F0 60 21 41 00 F7")
    assert rig.done() == [], "before it is configured nothing is sent"
    rig.answer("F0 60 11 10 4E 00 F7")
    assert rig.done() == [("drive", RB1, 1)]
    rig.chip.now = 50
    rig.answer("F0 60 21 41 00 7F 01 F7")
    bits = [0, 1, 0, 0, 0, 0, 0, 1, 0, 1, 0, *8 * [1], 1]  # 0x41, then 0xFF
    assert rig.done() == [("drive_at", 50 + 100 * n, RB1, bit) for n, bit in enumerate(bits)]
    rig.answer("F0 60 21 00 00 F7")
    assert rig.done()[0] == ("drive_at", 2050, RB1, 0), "after the bytes before"
    rig.chip.now = 9000
    rig.answer("F0 60 21 00 00 F7")
    assert rig.done()[0][1] == 9000
    rig.answer("F0 60 51 F7")
    assert rig.done() == [("drive", RB1, 2)]
    rig.answer("F0 60 21 41 00 F7 F0 60 14 10 4E 00 F7 F0 60 24 41 00 F7")
    assert rig.done() == []
    # 57600 baud need the third seven bits: 0x00, 0x42, 0x03.
    rig.answer("F0 60 11 00 42 03 F7")
    rig.done()
    rig.chip.now = 20_000
    rig.answer("F0 60 21 55 00 F7")
    assert [call[1] for call in rig.done()] == [20_000 + round(n * 1e6 / 57_600) for n in range(10)]


def stored(messages: str, number: int = 1, ms: int = 0) -> str:
    """Return the commands that create, fill and schedule a task."""
    data = bytes.fromhex(messages)
    size = f"{len(data) & 0x7F:02x} {len(data) >> 7:02x}"
    return (
        f"F0 7B 00 {number:02x} {size} F7 F0 7B 02 {number:02x} {packed(data)} F7 "
        f"F0 7B 04 {number:02x} {packed(ms.to_bytes(4, 'little'))} F7"
    )


def delay(ms: int) -> str:
    return f"F0 7B 03 {packed(ms.to_bytes(4, 'little'))} F7"


def played(rig: Rig, cycles: int) -> list[tuple[int, object]]:
    """Return (cycle, level of RB0) of what is played within so many cycles."""
    found = []
    for _ in range(cycles):
        rig.chip.run(1)
        found += [(rig.chip.now, call[2]) for call in rig.done() if call[:2] == ("drive", RB0)]
    return found


@pytest.mark.parametrize(("late", "second"), [(0, 5000), (2, 7000)])
def test_a_run_begins_in_the_millisecond_after_its_own_and_its_delays_add_up(late: int, second: int) -> None:
    rig = Rig(late_ms=late)
    rig.answer("F4 02 01")
    rig.done()
    assert rig.answer(stored(f"F5 02 01 {delay(3)} F5 02 00", ms=1)) == ""
    assert rig.board.working
    assert rig.board.next_at() == 2000
    assert played(rig, 9000) == [(2000, 1), (second, 0)]
    assert not rig.board.working
    assert rig.answer("F0 7B 05 F7") == "f0 7b 09 f7", "it is gone"


def test_a_run_that_ends_with_a_delay_is_repeated() -> None:
    rig = Rig()
    rig.answer("F4 02 01")
    rig.done()
    rig.answer(stored(f"F5 02 01 {delay(1)} F5 02 00 {delay(2)}"))
    assert played(rig, 8000) == [(1000, 1), (2000, 0), (4000, 1), (5000, 0), (7000, 1), (8000, 0)]
    assert rig.answer("F0 7B 07 F7 F0 7B 05 F7") == "f0 7b 09 f7"
    assert played(rig, 5000) == []


def test_stored_runs_are_listed_and_shown_and_have_5000_bytes() -> None:
    rig = Rig()
    rig.answer("F0 7B 00 01 03 00 F7 F0 7B 00 02 04 00 F7")
    assert rig.answer("F0 7B 05 F7") == "f0 7b 09 01 02 f7"
    there = packed(bytes(4) + bytes((3, 0, 0, 0)))
    assert rig.answer("F0 7B 00 01 01 00 F7") == f"f0 7b 08 01 {there} f7", "there is one already"
    for command in ("02 03 00", "04 03 00 00 00 00 00"):
        assert rig.answer(f"F0 7B {command} F7") == "f0 7b 08 03 f7", "there is none"
    assert rig.answer("F0 7B 06 03 F7") == "f0 7b 0a 03 f7", "nothing is known of it"
    rig.answer(f"F0 7B 02 01 {packed(bytes((0xF5, 2, 1)))} F7 F0 7B 02 01 {packed(bytes(1))} F7")
    state = bytes(4) + bytes((3, 0, 3, 0)) + bytes((0xF5, 2, 1))  # time, size, position, messages
    assert rig.answer("F0 7B 06 01 F7") == f"f0 7b 0a 01 {packed(state)} f7"
    rig.answer("F0 7B 07 F7")
    # 5000 = 0x08 | 0x27 << 7
    rig.answer("F0 7B 00 01 00 27 F7 F0 7B 00 02 09 00 F7")  # 4992 and 9
    assert rig.answer("F0 7B 05 F7") == "f0 7b 09 01 f7"
    rig.answer("F0 7B 00 02 08 00 F7")
    assert rig.answer("F0 7B 05 F7") == "f0 7b 09 01 02 f7"
    assert Rig(scheduler=False).answer("F0 7B 00 01 03 00 F7 F0 7B 05 F7") == ""


def test_a_board_that_is_unplugged_obeys_nothing_from_that_byte_on() -> None:
    rig = Rig(unplug_after=4)
    assert rig.answer("F9 F4 02") == "f9 02 08"
    assert not rig.board.gone
    assert rig.answer("F9") == ""
    assert rig.board.gone
    silent, garbage = Rig(silent=True), Rig(garbage=True)
    assert (silent.answer("F9"), garbage.answer("F9 81 7F")) == ("", "79 01 7f")
    assert (silent.done(), garbage.done()) == ([], [])
    assert Rig(scheduler=False).board.name == "StandardFirmata"


# The analyser

CHANNELS = [*range(5, 13), *range(5)]  # RB0 to RB7, then RA0 to RA4


def long(command: int, value: int) -> bytes:
    return bytes([command]) + value.to_bytes(4, "little")


def on_channels(word: int) -> int:
    return sum((word >> pin & 1) << channel for channel, pin in enumerate(CHANNELS))


def drawn(seed: int, until: int) -> list[tuple[int, int]]:
    """Return random levels: the first one low, with changes 1 to 40 cycles apart."""
    dice = random.Random(seed)
    changes, now = [(0, 0)], 0
    while now < until:
        now += dice.randrange(1, 40)
        changes.append((now, dice.randrange(1 << len(PINS))))
    return changes


def samples(changes: list[tuple[int, int]], rate: Fraction, count: int) -> list[int]:
    """Return what the pins are at each sample's time, by looking."""
    found, place = [], 0
    for number in range(count):
        time = number * 1_000_000 / rate
        while place + 1 < len(changes) and changes[place + 1][0] <= time:
            place += 1
        found.append(on_channels(changes[place][1]))
    return found


@pytest.mark.parametrize("divider", [99, 149, 332, 49])
@pytest.mark.parametrize(("fours", "after"), [(8, 8), (8, 5)])
@pytest.mark.parametrize("flags", [0x30, 0x38, 0x34, 0x20])
def test_the_analyser_sends_its_samples_around_the_trigger(
    divider: int, fours: int, after: int, flags: int
) -> None:
    """Stage 0 waits for RB0 low, stage 1 for RB0 high; bits 2 to 5 of the flags switch groups off."""
    changes = drawn(divider + after, 2000)
    chip = StandIn(changes)
    analyser = VirtualAnalyser(cast(VirtualChip, chip))
    analyser.received(long(0x80, divider) + long(0x81, fours - 1 | after - 1 << 16) + long(0x82, flags))
    analyser.received(long(0xC0, 1) + long(0xC1, 0) + long(0xC2, 0))
    analyser.received(long(0xC4, 1) + long(0xC5, 1) + long(0xC6, 1 << 27 | 1 << 16) + b"\x01")
    assert analyser.working
    while analyser.working:
        analyser.work()
    seen = samples(changes, Fraction(100_000_000, divider + 1), 900)
    low = next(number for number, word in enumerate(seen) if not word & 1)
    trigger = next(number for number, word in enumerate(seen) if number >= low and word & 1)
    first = max(0, trigger - 4 * (fours - after))
    words = [*seen[first:trigger], *seen[trigger : trigger + 4 * after]]
    groups = [group for group in range(4) if not flags >> 2 + group & 1]
    sent = b"".join(bytes(word >> 8 * group & 0xFF for group in groups) for word in reversed(words))
    assert bytes(analyser.outgoing) == sent


def test_without_settings_the_analyser_has_the_protocols_defaults() -> None:
    """All four groups, 100 MHz, four words; no trigger to wait for."""
    analyser = VirtualAnalyser(cast(VirtualChip, StandIn([(0, 1 << RA0 | 1 << RB0)])))
    analyser.received(b"\x01")
    while analyser.working:
        analyser.work()
    assert bytes(analyser.outgoing) == 4 * bytes((0x01, 0x01, 0, 0))


def test_the_analyser_says_what_it_is_unless_it_is_faulty() -> None:
    def said(**options: Any) -> bytes:
        analyser = VirtualAnalyser(cast(VirtualChip, StandIn()), AnalyserOptions(**options))
        analyser.received(b"\x02\x04")
        return bytes(analyser.outgoing)

    assert said() == (
        b"1SLO\x01servogen virtual analyser\0\x20\0\0\0\x10\x21\0\0\x60\0\x23\x05\xf5\xe1\0\x40\x10\0"
    )
    assert said(metadata=False) == b"1SLO"
    assert b"\x21\0\0\x08\0\x23\0\0\x03\xe8" in said(memory=2048, fastest=1000)
    assert said(silent=True) == b""
    noise = said(garbage=True)
    assert len(noise) == 128
    assert noise == said(garbage=True) != said(garbage=True, seed=2)


@pytest.mark.parametrize(
    ("options", "sent", "gone"),
    [
        ({}, 16, False),
        ({"stop_after": 5}, 5, False),
        ({"unplug_after": 7}, 7, True),
        ({"stop_after": 9, "unplug_after": 7}, 7, True),
    ],
)
def test_a_capture_may_stop_short(options: dict[str, int], sent: int, gone: bool) -> None:
    analyser = VirtualAnalyser(cast(VirtualChip, StandIn()), AnalyserOptions(**options))  # type: ignore[arg-type]
    analyser.received(b"\x01")
    while analyser.working:
        analyser.work()
    assert (len(analyser.outgoing), analyser.gone) == (sent, gone)
    analyser.received(b"\x00")
    assert (len(analyser.outgoing), analyser.reset) == (0, True)


def test_a_reset_ends_a_capture_that_waits_for_its_trigger() -> None:
    chip = StandIn()
    analyser = VirtualAnalyser(cast(VirtualChip, chip))
    analyser.received(long(0xC0, 1) + long(0xC1, 1) + long(0xC2, 1 << 27) + b"\x01")
    assert (analyser.working, chip.watched) == (True, True)
    analyser.received(b"\x00")
    assert (analyser.working, chip.watched) == (False, False)


def test_a_trigger_that_never_comes_is_given_up_after_half_an_hour() -> None:
    chip = StandIn()
    analyser = VirtualAnalyser(cast(VirtualChip, chip))
    analyser.received(
        long(0x80, (1 << 24) - 1) + long(0xC0, 1) + long(0xC1, 1) + long(0xC2, 1 << 27) + b"\x01"
    )
    while analyser.working:
        assert chip.now <= 1800 * 1_000_000
        analyser.work()
    assert chip.now > 1800 * 1_000_000
    assert analyser.outgoing == b""


@pytest.mark.parametrize("seed", range(4))
def test_noise_flips_one_channel_of_as_many_samples_as_it_should(seed: int) -> None:
    """Nine of ten samples from the fourth on: all but the last, whose run would have no end."""
    runs = Runs(np.array([5, 9], dtype=np.uint32), np.array([0, 6], dtype=np.int64), 13)
    plain = np.repeat(runs.value, [6, 7])
    found = noisy(runs, 3, 0.9, random.Random(seed))
    assert found.end == 13
    samples = np.repeat(found.value, np.diff([*found.start, 13]))
    flipped = [int(one ^ other).bit_count() for one, other in zip(samples, plain, strict=True)]
    assert flipped == [0] * 3 + [1] * 9 + [0]
    assert max(one ^ other for one, other in zip(samples, plain, strict=True)) < 1 << len(PINS)
    assert noisy(runs, 3, 0.0, random.Random(seed)) is runs


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux has inotify")
def test_a_terminal_that_cannot_be_watched_is_said(tmp_path: Path) -> None:
    openings = Openings()
    try:
        with pytest.raises(ToolError, match="inotify: No such file or directory") as refused:
            openings.watch(str(tmp_path / "none"))
    finally:
        openings.close()
    assert refused.value.code == "tool-failed"


class Silence:
    """A device of which it is known what it received."""

    gone = reset = working = False

    def __init__(self) -> None:
        self.outgoing = bytearray()
        self.heard = b""

    def received(self, data: bytes) -> None:
        self.heard += data

    def work(self) -> None:
        pass


@pytest.mark.parametrize("code", [errno.EIO, errno.EAGAIN, errno.ENOMEM])
def test_a_terminal_may_have_nothing_to_read_but_no_other_fault(
    code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Linux answers EIO where no client has it open."""
    device, turns, read = Silence(), iter([False, True]), os.read

    def failing(handle: int, most: int) -> bytes:
        if not os.isatty(handle):  # inotify
            return read(handle, most)
        raise OSError(code, os.strerror(code))

    with (
        terminals({"device": device}) as opened,
        Path(opened.paths["device"]).open("wb", buffering=0) as client,
    ):
        client.write(b"x")
        with monkeypatch.context() as patched:
            patched.setattr(os, "read", failing)
            with nullcontext() if code != errno.ENOMEM else pytest.raises(OSError, match=os.strerror(code)):
                opened.serve(lambda: next(turns))
        assert device.heard == b""
        turns = iter([False, True])
        opened.serve(lambda: next(turns))
        assert device.heard == b"x"
