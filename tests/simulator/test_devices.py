"""Devices on the pins: what they see, what the chip sees of them, and time travel; the 24LC256 by its data
sheet, beside a plain reference, gpsim's module and sigrok's decoder.
"""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from servogen.edges import EdgeTrace
from servogen.errors import InputError
from servogen.pic.image import to_hex
from servogen.simulator import EEPROM24, Machine, SimulatorOptions, on_pins
from servogen.simulator.eeprom24 import PARTS, RunningEEPROM
from servogen.testing.chip import Board, Chip
from servogen.units import Clock, Cycles
from tests.simulator.helpers import CLOCK, image, ram
from tests.simulator.i2c import FIRST, Probe, program, sigrok_words

BYTES = bytes(random.Random(1).randbytes(32768))
READ_3 = ("start", 0xA0, 0x7F, 0xFE, "start", 0xA1, "take", "yes", "take", "yes", "take", "no", "stop")
WRITE_3 = ("start", 0xA0, 0x01, 0x3F, 1, 2, 3, "stop")
"""Three bytes from the last one of a page on: the others are the page's first ones."""


def on_bus(steps: tuple[str | int, ...], *devices: Any, clock: Clock = CLOCK) -> Machine:
    placed = tuple(on_pins(device, scl="RA0", sda="RA1") for device in devices)
    return Machine(program(steps), clock, SimulatorOptions(devices=placed), tracked=True)


def taken(chip: Machine, count: int) -> list[int]:
    return [ram(chip, FIRST + n) for n in range(count)]


def bytes_of(seen: list[tuple[int, int]], begin: int) -> list[tuple[int, int, bool]]:
    """Return the bytes on the wires: (the cycle of the eighth clock's fall, byte, acknowledged)."""
    found, bits, fell = [], [], 0
    for (_, before), (at, now) in pairwise(seen):
        if at <= begin:
            continue
        if (before, now) == (3, 1):
            bits = []
        if now & 1 and not before & 1:
            bits.append(now >> 1)
        if before & 1 and not now & 1 and len(bits) == 8:
            fell = at
        if before & 1 and not now & 1 and len(bits) == 9:
            found.append((fell, int("".join(map(str, bits[:8])), 2), not bits[8]))
            bits = []
    return found


def test_a_device_sees_an_edge_in_its_cycle_and_the_next_instruction_sees_its_answer() -> None:
    """SDA falls while SCL is high: a start. The write of cycle c is a level from c + 1 on."""
    probe = Probe()
    chip = on_bus(("start",), probe)
    edges = chip.run(40)
    names = {0: "scl 0 sda 0", 1: "scl 1 sda 0", 2: "scl 0 sda 1", 3: "scl 1 sda 1"}
    assert [names[levels] for _, levels in probe.seen] == ["scl 1 sda 0", "scl 0 sda 0"]
    rows = list(zip(*(column.tolist() for column in edges), strict=True))
    (falls, _), (low, _) = probe.seen
    assert rows == [(0, 0, 1), (0, 1, 1), (falls - 1, 1, 0), (low - 1, 0, 0)]
    assert chip.chip_dependent == ()

    class Echo(Probe):
        def react(self, cycle: int, levels: int) -> int:
            return 0 if levels & 1 else 2  # SDA is low while SCL is

    source = " bcf PORTA, 0\n bsf STATUS, RP0\n movlw 0x1E\n movwf TRISA\n bcf STATUS, RP0\n movf PORTA, w\n"
    source += " movwf 0x20\n bsf PORTA, 0\n movf PORTA, w\n movwf 0x21\n bcf PORTA, 0\n movf PORTA, w\n"
    made = image(f"{source} movwf 0x22\nw goto w\n")
    placed = on_pins(Echo(), scl="RA0", sda="RA1")
    chip = Machine(made, CLOCK, SimulatorOptions(devices=(placed,)))
    edges = chip.run(30)
    assert taken(chip, 3) == [0, 3, 0]
    # The program never drives SDA: its edges are what the device makes of the wire, in the cycles of SCL's.
    scl, sda = (
        [column[edges.pin == pin].tolist() for column in (edges.cycle, edges.level)] for pin in (0, 1)
    )
    assert scl == sda and sda[1] == [1, 0, 1, 0]


def test_bytes_are_read_over_the_end_and_from_the_beginning_on() -> None:
    """DS20001203 section 8.3: the counter rolls over from 7FFFh to 0."""
    chip = on_bus(READ_3, EEPROM24(BYTES))
    chip.run(3000)
    assert taken(chip, 3) == [BYTES[0x7FFE], BYTES[0x7FFF], BYTES[0]]
    assert chip.chip_dependent == ()


def test_a_page_is_written_within_itself_and_acknowledged_after_5_ms() -> None:
    """Sections 6.2 and 7.0: from the stop on no control byte is acknowledged for 5 ms."""
    steps = (*WRITE_3, "start", 0xA0, "note", "poll", "start", 0xA0, "note", "stop")
    chip = on_bus(steps, EEPROM24(BYTES), probe := Probe())
    chip.run(2000)
    device = chip.devices[0]
    assert isinstance(device, RunningEEPROM)
    changed = {n: byte for n, (byte, old) in enumerate(zip(device.memory, BYTES, strict=True)) if byte != old}
    assert changed == {0x13F: 1, 0x100: 2, 0x101: 3}
    assert taken(chip, 1) == [2]  # not acknowledged
    chip.run(8000)
    assert taken(chip, 2) == [2, 0]
    stop = next(at for (_, before), (at, now) in pairwise(probe.seen) if (before, now) == (1, 3))
    tried = bytes_of(probe.seen, stop)
    assert {byte for _, byte, _ in tried} == {0xA0}
    assert all(acknowledged == (end > stop + 5000) for end, _, acknowledged in tried)
    assert tried[-1][0] > stop + 5000 > tried[-3][0]


@pytest.mark.parametrize("device", [EEPROM24(BYTES, address=1), EEPROM24(BYTES[:8192], "24LC64", 7)])
def test_an_eeprom_with_other_address_pins_does_not_answer(device: EEPROM24) -> None:
    chip = on_bus(("start", 0xA0, "note", "stop", "start", 0xA0 | device.address << 1, "note"), device)
    chip.run(1000)
    assert taken(chip, 2) == [2, 0]


def test_two_eeproms_on_one_bus_answer_to_their_own_addresses() -> None:
    steps = [("start", 0xA0 | n << 1, 0, 5, "start", 0xA1 | n << 1, "take", "no", "stop") for n in (0, 1)]
    chip = on_bus(
        (*steps[0], *steps[1]), EEPROM24(bytes(range(9))), EEPROM24(bytes(range(50, 60)), address=1)
    )
    chip.run(3000)
    assert taken(chip, 2) == [5, 55]


def test_a_protected_eeprom_acknowledges_and_keeps_its_bytes() -> None:
    chip = on_bus((*WRITE_3, "start", 0xA0, "note"), EEPROM24(BYTES, protected=True))
    chip.run(3000)
    (device,) = chip.devices
    assert isinstance(device, RunningEEPROM) and device.memory == BYTES
    assert taken(chip, 1) == [0]


def test_an_edge_that_the_data_sheet_does_not_allow_is_a_warning_that_ends_exactness() -> None:
    """Parameter TLOW: 1300 ns. At 20 MHz three cycles of 200 ns are 600."""
    chip = on_bus(READ_3, EEPROM24(BYTES), clock=Clock(20_000_000))
    chip.run(3000)
    said = [warning.message for warning in chip.chip_dependent if warning.code == "device-timing"]
    assert any(text.startswith("TLOW: SCL is low for ") for text in said)
    assert any(text.startswith("THIGH: SCL is high for 400 ns, and the EEPROM needs 600") for text in said)


def test_a_snapshot_has_the_devices() -> None:
    chip = on_bus((*WRITE_3, "poll", "stop", *READ_3), EEPROM24(BYTES))
    chip.run(700)
    middle = chip.snapshot()
    ends = []
    for _ in range(2):
        chip.run(9000)
        ends.append((chip.fingerprint(), taken(chip, 3)))
        chip.restore(middle)
    other = on_bus((*WRITE_3, "poll", "stop", *READ_3), EEPROM24(BYTES))
    other.restore(middle)
    other.run(9000)
    assert ends[0] == ends[1] == (other.fingerprint(), taken(other, 3))
    assert not Machine.repeats(middle, middle)


def test_a_test_attaches_an_eeprom_and_reads_what_the_firmware_wrote() -> None:
    chip = Chip(Board("i2c", program(WRITE_3), CLOCK))
    chip.attach(EEPROM24(part="24LC64"), scl="RA0", sda="ra1")
    chip.run_ms(2)
    assert chip.devices[0].memory[0x120:0x122] == b"\x02\x03"  # type: ignore[attr-defined]  # pages of 32
    with pytest.raises(InputError, match="attach a device before the first run"):
        chip.attach(EEPROM24(), scl="RA2", sda="RA3")
    chip.power_cycle()
    assert chip.cycle == 0 and chip.devices[0].memory[0x13F] == 1  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: EEPROM24(part="24LC16"), "'24LC16' is no such EEPROM"),
        (lambda: EEPROM24(address=8), "address = 8 is not between 0 and 7"),
        (lambda: EEPROM24(bytes(8193), "24LC64"), "8193 bytes do not fit the 8192 of a 24LC64"),
        (lambda: on_pins(EEPROM24(), scl="RA0"), "no pin is given for sda"),
        (lambda: on_pins(EEPROM24(), scl="RA0", sda="RC1"), "sda: there is no pin 'RC1'"),
        (lambda: on_pins(EEPROM24(), scl="RA0", sda="RA0"), "two lines are on one pin"),
        (lambda: on_pins(EEPROM24(), scl="RA0", sdo="RA1"), "the device has no line 'sdo'"),
    ],
)
def test_what_cannot_be_is_refused(make: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        make()


# Against a second opinion


class Reference:
    """The data sheet's sections 5 to 8, byte by byte: what a bus of start, bytes and stop does."""

    def __init__(self, content: bytes, size: int, page: int, address: int) -> None:
        self.memory, self.page, self.select = bytearray(content), page, 0xA0 | address << 1
        self.size, self.pointer, self.ready_at = size, 0, 0.0

    def written(self, sent: list[int], now: float, stopped: bool) -> list[bool]:
        """Return the acknowledges of what is sent after a start."""
        if sent[0] != self.select or now < self.ready_at:
            return [False] * len(sent)
        data = sent[3:]
        if len(sent) > 1:
            self.pointer = self.pointer & 0xFF if len(sent) == 2 else 0
            self.pointer = (sent[1] << 8 | (sent[2] if len(sent) > 2 else 0)) % self.size
        first = self.pointer // self.page * self.page
        for n, byte in enumerate(data):
            if stopped:
                self.memory[first + (self.pointer - first + n) % self.page] = byte
        self.pointer = first + (self.pointer - first + len(data)) % self.page
        if data and stopped:
            self.ready_at = now + 5000
        return [True] * len(sent)

    def read(self, count: int, now: float) -> list[int] | None:
        if now < self.ready_at:
            return None
        got = [self.memory[(self.pointer + n) % self.size] for n in range(count)]
        self.pointer = (self.pointer + count) % self.size
        return got


class Bus:
    """The wires, as a master moves them: 5 cycles between two changes."""

    def __init__(self, device: RunningEEPROM) -> None:
        self.device, self.now, self.scl, self.sda, self.pulled = device, 0, 1, 1, 0

    def set(self, scl: int, sda: int) -> int:
        self.now += 5
        self.scl, self.sda = scl, sda
        for _ in range(3):
            self.pulled = self.device.react(self.now, scl | (sda and not self.pulled & 2) << 1)
        return int(sda and not self.pulled & 2)

    def start(self) -> None:
        self.set(self.scl, 1)
        self.set(1, 1)
        self.set(1, 0)
        self.set(0, 0)

    def stop(self) -> None:
        self.set(0, 0)
        self.set(1, 0)
        self.set(1, 1)

    def bit(self, level: int) -> int:
        self.set(0, level)
        seen = self.set(1, level)
        self.set(0, level)
        return seen

    def send(self, byte: int) -> bool:
        for n in range(8):
            self.bit(byte >> 7 - n & 1)
        return not self.bit(1)

    def take(self, more: bool) -> int:
        byte = sum(self.bit(1) << 7 - n for n in range(8))
        self.bit(not more)
        return byte


@pytest.mark.parametrize("part", sorted(PARTS))
def test_random_transactions_do_what_a_plain_reading_of_the_data_sheet_says(part: str) -> None:
    rng = random.Random(part)
    size, page = PARTS[part]
    content = rng.randbytes(size)
    running = EEPROM24(content, part, 5).power_up(CLOCK)
    bus, plain = Bus(running), Reference(content, size, page, 5)
    for _ in range(150):
        if rng.random() < 0.5:
            bus.now += rng.choice((10, 3000, 5001))
        bus.start()
        sent = [rng.choice((0xAA,) * 9 + (0xA8, 0x2A)), rng.choice((0x00, 0xFF, rng.randrange(256)))]
        sent += [rng.choice((0x00, 0x1F, 0x3F, 0xFF, rng.randrange(256)))]
        sent += rng.randbytes(rng.choice((0, 0, 1, 3, 40, 140)))
        stopped = rng.random() < 0.8
        begin = bus.now
        answers = [bus.send(byte) for byte in sent]
        if stopped:
            bus.stop()
        # A write may become ready in the midst of a transaction: what counts is the end of the control byte.
        decided = begin + 5 * (3 * 8)
        assert answers == plain.written(sent, decided, stopped)
        plain.ready_at = bus.now + 5000 if plain.ready_at == decided + 5000 else plain.ready_at
        if rng.random() < 0.6:
            bus.start()
            begin = bus.now
            count = rng.randrange(1, 6)
            wanted = plain.read(count, begin + 5 * 24)
            assert bus.send(0xAB) == (wanted is not None)
            if wanted is not None:
                assert [bus.take(n < count - 1) for n in range(count)] == wanted
            bus.stop()
    assert running.memory == bytes(plain.memory) and not running.remarks


@pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")
def test_sigrok_decodes_the_wires_of_a_run_as_what_the_program_asked_for(tmp_path: Path) -> None:
    chip = on_bus((*READ_3, *WRITE_3, "start", 0xA0, "stop"), EEPROM24(BYTES))
    words = sigrok_words(EdgeTrace(CLOCK, (chip.run(4000),), Cycles(4000)), tmp_path)
    ends = [f"{BYTES[n]:02X}" for n in (0x7FFE, 0x7FFF, 0)]
    address = ["Start", "Write", "Address write: 50", "ACK"]
    assert words == [
        *address, "Data write: 7F", "ACK", "Data write: FE", "ACK",
        "Start repeat", "Read", "Address read: 50", "ACK",
        f"Data read: {ends[0]}", "ACK", f"Data read: {ends[1]}", "ACK",
        f"Data read: {ends[2]}", "NACK", "Stop",
        *address, "Data write: 01", "ACK", "Data write: 3F", "ACK",
        "Data write: 01", "ACK", "Data write: 02", "ACK", "Data write: 03", "ACK", "Stop",
        *address[:-1], "NACK", "Stop",
    ]  # fmt: skip


@pytest.mark.skipif(not shutil.which("gpsim"), reason="gpsim is not installed")
def test_gpsims_eeprom_answers_the_same(tmp_path: Path) -> None:
    """gpsim 0.31 takes no time to write and knows no repeated start: neither is asked for here."""
    steps = ("start", 0xB0, "note", "stop", *WRITE_3, "poll", "stop")
    for at, last in ((0x013F, 0), (0x0100, 1)):
        more = ("take", "yes") * last
        steps += (
            "start", 0xA0, at >> 8, at & 0xFF, "note", "stop", "start", 0xA1, *more, "take", "no", "stop",
        )  # fmt: skip
    made = program(steps)
    chip = on_bus(steps, EEPROM24())
    chip.run(12_000)
    answers = [2, 0, 1, 0, 2, 3]
    assert taken(chip, 6) == answers
    (tmp_path / "i2c.hex").write_text(to_hex(made))
    (tmp_path / "run.stc").write_text(
        "processor p16f84\nload i2c.hex\nfrequency 4000000\n"
        "module library libgpsim_modules\nmodule load e24xx256 ee\nmodule load pullup pu\n"
        "node scl\nattach scl porta0 ee.SCL\nnode sda\nattach sda porta1 ee.SDA pu.pin\n"
        "break c 12000\nrun\ndump r\nquit\n"
    )
    command = ("gpsim", "-i", "-c", "run.stc")
    said = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL
    )
    row = re.search(r"^0020:((?: +[0-9a-f]{2}){6})", said.stdout, re.MULTILINE)
    assert row is not None, said.stdout
    assert [int(byte, 16) for byte in row[1].split()] == answers
