"""The K150 as P18A has it, and the client of an input board, byte by byte."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from types import SimpleNamespace
from typing import Any, cast

import pytest

from servogen.bench.inputs import adapter as adapters
from servogen.bench.inputs.adapter import (
    BoardFacts,
    BoardInput,
    Close,
    DrivePin,
    InputAdapter,
    Send,
    SerialAdapter,
    identify,
    pin_modes,
)
from servogen.bench.inputs.wiring import input_wiring
from servogen.bench.virtual.k150 import ProgrammerOptions, VirtualProgrammer
from servogen.errors import InputError, ToolError
from servogen.pic.image import Image
from tests.bench.seven_bits import packed

# The programmer


class Socket:
    """A chip in the programmer's socket."""

    def __init__(self, image: Image) -> None:
        self.image = image
        self.loads = 0

    def contents(self) -> Image:
        return self.image

    def load(self, image: Image) -> None:
        self.image, self.loads = image, self.loads + 1


IMAGE = Image({0: 0x2801, 0x3FF: 0x0123}, 0x3FF1, eeprom={0: 0x12, 63: 0x34}, ids={0: 1, 3: 4})


def k150(image: Image = IMAGE, **options: Any) -> tuple[VirtualProgrammer, Socket]:
    chip = Socket(image)
    return VirtualProgrammer(cast(Any, chip), ProgrammerOptions(**options)), chip


def said(programmer: VirtualProgrammer, data: bytes) -> bytes:
    programmer.received(data)
    answer = bytes(programmer.outgoing)
    programmer.outgoing.clear()
    return answer


def test_it_says_what_it_is_and_echoes() -> None:
    programmer, _ = k150()
    assert said(programmer, b"\x01") == b"Q"
    assert said(programmer, b"x") == b""
    assert said(programmer, b"P") == b"P"
    assert said(programmer, b"\x14\x15\x02z") == b"\x03P18Az"  # a K150 is number 3
    assert said(programmer, b"\x12") == b"AY", "a chip is in the socket"
    assert said(programmer, b"\x13") == b"A"
    assert said(programmer, b"\x03" + bytes(10)) == b""
    assert said(programmer, b"\x00") == b"I"
    assert said(programmer, b"\x11\x01\x01") == b"QQ"
    empty, _ = k150(no_chip=True)
    assert said(empty, b"P\x12\x13") == b"PAAY"


def test_it_reads_what_the_chip_has_when_its_voltage_comes_on() -> None:
    programmer, chip = k150()
    assert said(programmer, b"P\x04\x04\x06") == b"PVVV"
    rom = said(programmer, b"\x0b")
    assert (len(rom), rom[:4], rom[-2:]) == (2048, b"\x28\x01\x3f\xff", b"\x01\x23")
    assert said(programmer, b"\x0c") == b"\x12" + 62 * b"\xff" + b"\x34"
    # No device ID, four ID bytes and four zeros, the word, six more fuse words and a calibration word.
    assert said(programmer, b"\x0d") == (
        b"C\xff\x3f" + bytes((1, 0x7F, 0x7F, 4, 0, 0, 0, 0)) + b"\xf1\x3f" + 7 * b"\xff\x3f"
    )
    assert (said(programmer, b"\x0f\x00"), said(programmer, b"\x10")) == (b"N", b"N")
    assert said(programmer, b"\x0e") == b"Y"
    assert (said(programmer, b"\x0f\x00"), said(programmer, b"\x10"), programmer.erased) == (b"Y", b"Y", 1)
    assert said(programmer, b"\x05\x05") == b"vv"
    assert chip.loads == 1
    assert (dict(chip.image.program), chip.image.config, dict(chip.image.eeprom)) == ({}, 0x3FFF, {})
    bare, _ = k150(Image({}))
    assert said(bare, b"P\x04") == b"PV"
    assert said(bare, b"\x0d")[11:13] == b"\xff\x3f"


@pytest.mark.parametrize(
    ("options", "word", "byte", "config"),
    [
        ({}, 0x1234, 0x56, 0x0FF1),
        ({"wrong_bit_at": 1}, 0x1235, 0x56, 0x0FF1),
        ({"wrong_bit_at": 1025}, 0x1235, 0x56, 0x0FF1),
        ({"wrong_eeprom_at": 65}, 0x1234, 0x57, 0x0FF1),
        ({"wrong_config": True}, 0x1234, 0x56, 0x0FF0),
    ],
)
def test_it_programs_blocks_of_sixteen_words_pairs_of_bytes_and_the_fuses(
    options: dict[str, Any], word: int, byte: int, config: int
) -> None:
    programmer, chip = k150(Image({}), **options)
    assert said(programmer, b"P\x04") == b"PV"
    assert said(programmer, b"\x07\x00\x11") == b"Y"  # 17 words are two blocks
    block = b"\x28\x01\x12\x34" + 14 * b"\xff\xff"
    assert said(programmer, block[:31]) == b""
    assert said(programmer, block[31:]) == b"Y"
    assert said(programmer, b"\x2a\xaa" + 15 * b"\xff\xff") == b"YP"
    assert said(programmer, b"\x08\x00\x02\x11") == b"Y"
    assert said(programmer, bytes((0x56,))) == b"Y"
    assert said(programmer, b"\x00\x00") == b"P"
    fuses = b"00" + bytes((0x81, 2, 3, 4)) + b"FFFF" + b"\xf1\xcf" + 6 * b"\xff\x3f"
    assert said(programmer, b"\x09" + fuses) == b"Y"
    assert said(programmer, b"\x05") == b"v"
    assert dict(chip.image.program) == {0: 0x2801, 1: word, 16: 0x2AAA}
    assert dict(chip.image.eeprom) == {0: 0x11, 1: byte}
    assert (chip.image.config, dict(chip.image.ids)) == (config, {0: 1, 1: 2, 2: 3, 3: 4})


def test_more_than_the_chip_has_is_not_programmed() -> None:
    programmer, _ = k150()
    assert said(programmer, b"P\x07\x04\x01\x08\x00\x41") == b"PNN"
    assert said(programmer, b"\x07\x04\x00") == b"Y"  # 1024 words
    programmer, _ = k150()
    assert said(programmer, b"P\x08\x00\x40") == b"PY"


def test_after_a_second_of_silence_it_begins_anew() -> None:
    time = [0.0]
    chip = Socket(IMAGE)
    programmer = VirtualProgrammer(cast(Any, chip), now=lambda: time[0])
    assert said(programmer, b"P\x04\x07") == b"PV"
    time[0] = 1.0
    assert said(programmer, b"\x00\x10") == b"Y"
    time[0] = 2.001
    assert said(programmer, b"\x14") == b"", "it is idle, and that is no command"
    assert (programmer.reset, chip.loads) == (True, 1)
    assert said(programmer, b"P\x14") == b"P\x03"


def test_its_faults() -> None:
    silent, garbage = k150(silent=True)[0], k150(garbage=True)[0]
    assert said(silent, b"P") == b""
    assert len(said(garbage, b"Pxy")) == 3
    gone, _ = k150(unplug_after=3)
    assert said(gone, b"P\x14") == b"P\x03"
    assert not gone.gone
    assert said(gone, b"\x14") == b""
    assert gone.gone
    slow, _ = k150()
    slow.received(b"P\x04\x0b\x0b\x0b")
    assert len(slow.outgoing) == 4096


# The client of an input board


class Wire:
    """A port: what was written, and what is answered, piece by piece."""

    path = "/dev/ttyACM3"

    def __init__(self, *answers: bytes) -> None:
        self.answers = list(answers)
        self.written = b""
        self.line = SimpleNamespace(baudrate=0)
        self.bauds: list[int] = []

    def write(self, data: bytes) -> None:
        self.written += data
        self.bauds.append(self.line.baudrate)

    def read(self, most: int, seconds: float) -> bytes:
        return self.answers.pop(0) if self.answers else b""

    def sent(self) -> str:
        data, self.written = self.written.hex(" "), b""
        return data


TEXTS = ("RB0=2", "RB1=3", "RB0-RB4=22", "RB1=TX1", "MARK=23")


def client(*answers: bytes, **around: Any) -> tuple[InputAdapter, Wire]:
    wire = Wire(*answers)
    facts = around.pop("board", BoardFacts("ConfigurableFirmata 2.8", 70, (1, 2, 3), True))
    return InputAdapter(cast(Any, wire), input_wiring(TEXTS), facts, **around), wire


def test_a_pin_becomes_an_output_once_and_its_level_is_sent_when_it_changes() -> None:
    made, wire = client()
    for action, sent in (
        (DrivePin("RB0", 1), "f4 02 01 f5 02 01"),
        (DrivePin("RB0", 1), ""),
        (DrivePin("RB0", 0), "f5 02 00"),
        (DrivePin("RB0", None), "f4 02 00"),
        (DrivePin("RB0", None), ""),
        (DrivePin("RB0", 0), "f4 02 01 f5 02 00"),
        (Close(frozenset({"RB0", "RB4"}), True), "f4 16 01 f5 16 01"),
        (Close(frozenset({"RB0", "RB4"}), False), "f5 16 00"),
    ):
        made.apply([cast(Any, action)])
        assert wire.sent() == sent, action
    for wrong, text in (
        (DrivePin("RB9", 1), "RB9 is not wired to the input board"),
        (Close(frozenset({"RB4", "RB1"}), True), "the input board has no contact RB1-RB4"),
        (Send("RB0", b"A", 9600), "no serial port of the input board is wired to RB0"),
    ):
        with pytest.raises(InputError, match=text):
            made.apply([cast(Any, wrong)])


def test_a_line_is_opened_at_its_rate_and_closed_where_its_pin_is_driven() -> None:
    """9600 = 0x00 | 0x4B << 7."""
    made, wire = client()
    made.apply([Send("RB1", b"A", 9600)])
    assert wire.sent() == "f4 03 00 f0 60 11 00 4b 00 f7 f0 60 21 41 00 f7"
    made.apply([Send("RB1", b"\xff", 9600)])
    assert wire.sent() == "f0 60 21 7f 01 f7"
    made.listen("RB1", 2400)
    assert wire.sent() == "f0 60 11 60 12 00 f7"
    made.apply([DrivePin("RB1", 1), DrivePin("RB1", 0)])
    assert wire.sent() == "f0 60 51 f7 f4 03 01 f5 03 01 f5 03 00"


def test_everything_is_let_go_but_the_mark() -> None:
    made, wire = client()
    made.apply([DrivePin("RB0", 1), Send("RB1", b"A", 9600)])
    wire.sent()
    made.release()
    sent = wire.sent()
    assert sent.startswith("f0 7b 07 f7 f4 17 01 f5 17 00 f0 60 51 f7 ")
    pins = sorted(made.wiring.outputs - {23})
    assert sent.endswith(" ".join(f"f4 {pin:02x} 00" for pin in pins))
    host, line = client(board=BoardFacts("StandardFirmata 2.5", 70, (), False))
    host.stop()
    assert line.sent() == "f4 17 01 f5 17 00"


def state(size: int, stored: int) -> bytes:
    data = bytes(4) + size.to_bytes(2, "little") + stored.to_bytes(2, "little")
    return bytes.fromhex(f"f0 7b 0a 01 {packed(data)} f7")


def test_a_run_is_stored_with_its_delays_and_started_with_its_filler() -> None:
    """MARK rises, 5 ms later RB0 rises, and 2 ms later it falls."""
    inputs = [BoardInput(7, DrivePin("RB0", 0)), BoardInput(5, DrivePin("RB0", 1))]
    delays = [f"f0 7b 03 {packed(ms.to_bytes(4, 'little'))} f7" for ms in (5, 2)]
    messages = bytes.fromhex(f"f4 17 01 f5 17 01 {delays[0]} f4 02 01 f5 02 01 {delays[1]} f5 02 00")
    made, wire = client(state(len(messages), len(messages)))
    made.load(inputs, 12)
    sent = wire.sent()
    assert sent.startswith("f0 7b 07 f7 ")
    assert f"f0 7b 00 01 {len(messages):02x} 00 f7" in sent
    assert packed(messages) in sent
    assert sent.endswith("f0 7b 06 01 f7")
    made.start()
    # After the 5 ms that loading may take; what fills the analyser's memory begins when the run is over.
    run, filler = (packed(ms.to_bytes(4, "little")) for ms in (5, 5 + 12))
    assert wire.sent() == f"f0 7b 04 01 {run} f7 f0 7b 04 02 {filler} f7"
    for answer in (state(len(messages), len(messages) - 1), state(len(messages) + 1, len(messages) + 1), b""):
        other, _ = client(answer)
        with pytest.raises(ToolError, match="did not store the run"):
            other.load(inputs, 12)


@pytest.mark.parametrize(("pins", "most"), [(30, 400), (31, 4000)])
def test_a_run_may_fill_what_a_small_or_a_large_board_has(pins: int, most: int) -> None:
    """The mark and the first level take 6 bytes each, a byte on a line that is opened 16, each change 3."""
    for changes, fits in (((most - 28) // 3, True), ((most - 28) // 3 + 1, False)):
        made, _ = client(board=BoardFacts("ConfigurableFirmata 2.8", pins, (1,), True))
        inputs = [BoardInput(0, Send("RB1", b"A", 9600))]
        inputs += [BoardInput(0, DrivePin("RB0", number % 2)) for number in range(changes + 1)]
        refusal = f"take {most + 3} bytes, of which {most} fit into the input board"
        expected = (ToolError, "did not store the run") if fits else (InputError, refusal)
        with pytest.raises(expected[0], match=expected[1]):
            made.load(inputs, 10)


def test_without_a_scheduler_this_process_keeps_the_times() -> None:
    time = [100.0]
    naps: list[float] = []

    def sleep(seconds: float) -> None:
        naps.append(seconds)
        time[0] += seconds

    adapter_line = Wire()
    serial = SerialAdapter(cast(Any, adapter_line), "RB6")
    made, wire = client(
        board=BoardFacts("StandardFirmata 2.5", 20, (), False),
        serial=serial,
        now=lambda: time[0],
        sleep=sleep,
    )
    made.load([BoardInput(30, Send("RB6", b"hi", 4800)), BoardInput(10, DrivePin("RB0", 1))], 50)
    assert wire.sent() == ""
    made.start()
    assert naps == pytest.approx([0, 0.010, 0.020, 0.020])
    sent = wire.sent()
    assert sent.startswith("f4 17 01 f5 17 01 f4 02 01 f5 02 01 f5 17 00 f5 17 01 f5 17 00")
    assert (adapter_line.written, adapter_line.bauds) == (b"hi", [4800])
    made.listen("RB6", 4800)
    assert wire.sent() == f"f4 {made.wiring.pins['RB6']:02x} 00"


def board_answers(modes: str, last: bytes) -> Sequence[bytes]:
    name = b"".join(bytes((letter, 0)) for letter in b"ConfigurableFirmata")
    return (
        b"\xf9\x02",
        b"\x08" + b"\xf0\x79\x02\x08" + name + b"\xf7",
        bytes.fromhex(f"f0 6c {modes} f7"),
        last,
    )


@pytest.mark.parametrize(
    ("last", "scheduler"),
    [(b"\xf0\x7b\x09\xf7", True), (b"\xf0\x71?\x00\xf7", False), (b"", False), (b"\xf9\x02\x08", False)],
)
def test_a_board_is_what_it_says_of_itself(last: bytes, scheduler: bool) -> None:
    """Of its four pins the third sends on serial port 1 (resolution 3), the fourth receives on it (2)."""
    wire = Wire(*board_answers("7f 00 01 01 01 7f 0a 03 7f 00 01 0a 02 7f", last))
    assert identify(cast(Any, wire)) == BoardFacts("ConfigurableFirmata 2.8", 4, (1,), scheduler)
    assert wire.sent() == "f0 79 f7 f0 6b f7 f0 7b 05 f7"
    assert wire.bauds[0] == 57_600
    modes = list(pin_modes(bytes.fromhex("7f 00 01 01 01 7f 0a 03 7f")))
    assert modes == [{}, {0: 1, 1: 1}, {10: 3}]
    assert list(pin_modes(b"\x00")) == []


@pytest.mark.parametrize(
    ("answers", "code"), [((), "no-answer"), ((b"hello", b"\xf9\x02\x08"), "wrong-device")]
)
def test_what_is_not_a_board_is_said(
    answers: Sequence[bytes], code: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = count()
    monkeypatch.setattr(adapters, "time", SimpleNamespace(monotonic=lambda: 0.1 * next(steps)))
    with pytest.raises(ToolError) as error:
        identify(cast(Any, Wire(*answers)))
    assert error.value.code == code
    with pytest.raises(ToolError, match="does not report what its pins can do"):
        identify(cast(Any, Wire(*board_answers("", b"")[:2])))
