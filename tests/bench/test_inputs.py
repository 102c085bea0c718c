"""What drives the chip's inputs on the bench: the Firmata client, the wiring, the emulated board."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction

import pytest

from servogen.bench.inputs import adapter as adapter_module
from servogen.bench.inputs import firmata
from servogen.bench.inputs.adapter import (
    BoardInput,
    DrivePin,
    InputAdapter,
    Send,
    SerialAdapter,
    input_adapter,
    pin_modes,
)
from servogen.bench.inputs.firmata import (
    FirmataCommand,
    Message,
    MessageKind,
    MessageReader,
    Mode,
    SchedulerCommand,
)
from servogen.bench.inputs.wiring import MARK_CHANNEL, input_wiring
from servogen.bench.ports import open_port
from servogen.bench.virtual.board import BoardOptions, VirtualBoard
from servogen.bench.virtual.chip import VirtualChip
from servogen.bench.virtual.serial_line import LineReceiver, LineStimulus, SerialLine
from servogen.edges import PINS
from servogen.errors import InputError, ServogenError
from servogen.pic.assembler import assemble
from servogen.pic.image import Image
from servogen.units import Clock
from tests.bench.conftest import Run, Serve
from tests.simulator.helpers import HEAD, WATCHDOG_OFF

CLOCK = Clock(4_000_000)
CYCLES_PER_MS = 1000
RB0, RB4, RA1 = (PINS.index(name) for name in ("RB0", "RB4", "RA1"))


def program(body: str) -> Image:
    return assemble(f"{HEAD}{WATCHDOG_OFF}{body}\n end\n", "program.asm").image


IDLE = "loop goto loop"
COUNTER = " bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n clrf PORTB\nloop incf PORTB, f\n goto loop"


def edges(chip: VirtualChip, pin: int, cycles: int) -> list[tuple[int, int]]:
    """(cycle from now, level) of each change of a pin or channel while the chip runs."""
    begin = chip.now
    cycle, level = chip.look(cycles)
    bits = (level >> pin & 1).tolist()
    return [
        (at - begin, now)
        for at, before, now in zip(cycle.tolist()[1:], bits, bits[1:], strict=False)
        if now != before
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("RB0", "'RB0' is not the wiring of an input"),
        ("RB9=2", "the chip has no 'RB9'"),
        ("RB0=200", "200 is not a pin or port of a Firmata board"),
        ("RB0=3", "pin 3 of the input board is wired twice"),
        ("RB0-RB0=22", "is not a contact between two of the chip's pins"),
        ("RB0-MCLR=22", "is not a contact between two of the chip's pins"),
        ("MCLR=TX1", "a serial line goes to a pin of a port"),
        ("MARK=-", "MARK must be wired"),
    ],
)
def test_a_wiring_that_cannot_be_is_refused(text: str, message: str) -> None:
    with pytest.raises(InputError) as raised:
        input_wiring([text])
    assert message in str(raised.value)


@pytest.mark.parametrize(
    ("last", "beyond", "number"),
    [("RB0=127", "RB0=128", 128), ("RB0-RB4=127", "RB0-RB4=128", 128), ("RA1=TX7", "RA1=TX8", 8)],
)
def test_a_firmata_board_has_pins_up_to_127_and_ports_up_to_7(last: str, beyond: str, number: int) -> None:
    """A pin is one byte of seven bits (protocol.md), a port three bits (serial-1.0.md)."""
    wiring = input_wiring([last])
    assert number - 1 in (*wiring.outputs, *wiring.lines.values())
    with pytest.raises(InputError) as refused:
        input_wiring([beyond])
    told = refused.value.first
    assert (told.code, told.message) == (
        "out-of-range",
        f"'{beyond}': {number} is not a pin or port of a Firmata board",
    )


def test_the_default_wiring_uses_pins_2_to_16_and_texts_change_it() -> None:
    assert sorted(input_wiring().outputs) == list(range(2, 17))
    wiring = input_wiring(["RB3=-", "rb0-rb4=22", "RA1=TX1", "RB7=5"])
    assert wiring.pins["RB7"] == 5 and "RB3" not in wiring.pins
    assert wiring.contacts == {frozenset(("RB0", "RB4")): 22}
    assert wiring.lines == {"RA1": 1}


def test_messages_are_those_of_the_protocol() -> None:
    """By hand from scheduler.md and serial-1.0.md: 1000 = 7·128 + 104, 2400 = 18·128 + 96."""
    assert firmata.delay_ms(1000) == bytes.fromhex("F0 7B 03 68 07 00 00 00 F7")
    assert firmata.serial_config(1, 2400) == bytes.fromhex("F0 60 11 60 12 00 F7")
    assert firmata.serial_config(2, 57_600) == bytes.fromhex("F0 60 12 00 42 03 F7")  # 3·128² + 66·128
    assert firmata.serial_write(1, b"\xc1") == bytes.fromhex("F0 60 21 41 01 F7")
    assert firmata.pin_mode(2, Mode.OUTPUT) + firmata.pin_value(2, 1) == bytes.fromhex("F4 02 01 F5 02 01")
    # two bytes of a task, FF 81: bits 1111111 1·1000000 10
    assert firmata.load_task(5, b"\xff\x81") == bytes.fromhex("F0 7B 00 05 02 00 F7 F0 7B 02 05 7F 03 02 F7")


def test_no_message_is_longer_than_a_board_keeps() -> None:
    for messages in (firmata.load_task(1, bytes(300)), firmata.serial_write(1, bytes(100))):
        found = list(MessageReader().read(messages))
        assert len(found) > 2
        assert max(len(message.data) for message in found) <= firmata.MAX_SYSEX_DATA


def test_a_reader_finds_messages_in_pieces_and_between_rubbish() -> None:
    reader, found = MessageReader(), []
    stream = b"\x12" + firmata.sysex(FirmataCommand.TEXT, b"ab") + bytes((0xF9, 2, 5)) + bytes((0x91, 0x7F))
    for byte in stream + b"\x01":
        found += reader.read(bytes((byte,)))
    assert [(message.kind, message.data) for message in found] == [
        (MessageKind.SYSEX, bytes((FirmataCommand.TEXT,)) + b"ab"),
        (MessageKind.VERSION, b"\x02\x05"),
        (0x91, b"\x7f\x01"),
    ]
    torn = reader.read(bytes.fromhex("F0 71 80 41 F7"))
    assert not list(torn), "80 is no data, and the end of a command that was dropped is none"


def test_bytes_of_no_message_are_none() -> None:
    """protocol.md has no other first bytes; 0xF7 only ends a command that 0xF0 began."""
    reader, version = MessageReader(), bytes((0xF9, 2, 8))
    begins = (
        0xF0,
        0xF4,
        0xF5,
        0xF9,
        0xFF,
        *(kind | low for kind in (0x90, 0xC0, 0xD0, 0xE0) for low in range(16)),
    )
    for byte in set(range(0x80, 0x100)) - set(begins):
        found = list(reader.read(bytes((byte,)) + version + bytes((byte, 1, 2)) + version))
        assert found == [Message(0xF9, b"\x02\x08")] * 2, hex(byte)


class Rig:
    """A chip and a board, whose client this process is."""

    def __init__(
        self,
        image: Image,
        texts: Sequence[str] = (),
        options: BoardOptions = BoardOptions(),  # noqa: B008 - frozen
    ) -> None:
        self.chip = VirtualChip(image, CLOCK)
        self.wiring = input_wiring(texts)
        self.board = VirtualBoard(self.chip, self.wiring, options)


def until(true: Callable[[], object], seconds: float = 300) -> None:
    """Wait for what another thread does."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


ANNOUNCEMENT = bytes((0xF9, 2, 8, 0xF0, 0x79, 2, 8)) + b"".join(
    bytes((ord(letter), 0)) for letter in "ConfigurableFirmata"
)
"""REPORT_VERSION and REPORT_FIRMWARE, without the end of the latter (protocol.md)."""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux has inotify")
def test_opening_the_port_resets_the_board_which_says_what_it_is(serve: Serve) -> None:
    rig = Rig(program(IDLE))
    path = serve({"inputs": rig.board}).paths["inputs"]
    with open_port(path, 57_600) as port:
        assert port.read_whole(len(ANNOUNCEMENT) + 1, 30) == ANNOUNCEMENT + b"\xf7"
        port.write(firmata.pin_mode(2, Mode.OUTPUT) + firmata.pin_value(2, 1))
        until(lambda: rig.chip.word >> RB0 & 1)
    with open_port(path, 57_600) as port:
        port.write(bytes((MessageKind.VERSION,)))  # at once: the announcement still comes before the answer
        assert port.read_whole(len(ANNOUNCEMENT) + 4, 30) == ANNOUNCEMENT + b"\xf7\xf9\x02\x08"
        assert not rig.chip.word >> RB0 & 1


@pytest.mark.parametrize("options", [BoardOptions(silent=True), BoardOptions(garbage=True)])
def test_a_broken_board_does_not_say_what_it_is(options: BoardOptions) -> None:
    board = Rig(program(IDLE), options=options).board
    board.restarted()
    assert not board.outgoing


def test_inputs_are_reported_when_they_change_until_they_are_not_asked_for() -> None:
    """RB0 is bit 2 of port 0, RB5 is bit 7, whose level has a byte of its own (protocol.md)."""
    rig = Rig(program(IDLE))
    rb1, rb5 = (PINS.index(name) for name in ("RB1", "RB5"))

    def reported(message: bytes = b"") -> str:
        if message:
            rig.board.received(message)
        rig.chip.run(10)
        found = rig.board.outgoing.hex(" ")
        rig.board.outgoing.clear()
        return found

    assert reported(bytes((MessageKind.REPORT_DIGITAL, 1))) == "90 00 00", "the levels now"
    assert reported() == ""
    rig.chip.drive(RB0, 1)
    assert reported() == "90 04 00"
    rig.chip.drive(rb5, 1)
    assert reported() == "90 04 01"
    assert reported(firmata.pin_mode(3, Mode.OUTPUT) + firmata.pin_value(3, 1)) == "", "pin 3 is an output"
    assert rig.chip.word >> rb1 & 1
    assert reported(firmata.pin_mode(2, Mode.OUTPUT)) == "90 00 01", "and pin 2 now as well"
    assert reported(firmata.pin_mode(2, Mode.PULL_UP)) == "90 04 01"
    assert reported(bytes((MessageKind.REPORT_DIGITAL, 0))) == ""
    rig.chip.drive(rb5, 0)
    assert reported() == ""


def test_the_board_answers_what_other_clients_send() -> None:
    """What firmata 2.3.0 (npm) and pyfirmata2 2.5.1 (PyPI) send to drive pin 2 and read pin 22."""
    rig = Rig(program(IDLE))

    def answers(text: str) -> list[Message]:
        rig.board.received(bytes.fromhex(text))
        found = list(MessageReader().read(bytes(rig.board.outgoing)))
        rig.board.outgoing.clear()
        return found

    assert answers("F9") == [Message(MessageKind.VERSION, b"\x02\x08")]
    (firmware,) = answers("F0 79 F7")
    assert firmware.data == ANNOUNCEMENT[4:]
    (capabilities,) = answers("F0 6B F7")
    assert capabilities.data[0] == 0x6C and capabilities.data.count(0x7F) == 70
    (analog,) = answers("F0 69 F7")
    assert analog.data == bytes((0x6A, *70 * [0x7F]))
    assert answers("F4 02 01 90 04 00 F4 16 00 D2 01 F0 7A 13 00 F7") == [Message(0x92, bytes(2))]
    assert rig.chip.word >> RB0 & 1


def answered(board: VirtualBoard, data: bytes) -> list[Message]:
    """Return what the board answers to `data`."""
    board.received(data)
    answers = list(MessageReader().read(bytes(board.outgoing)))
    board.outgoing.clear()
    return answers


def said(message: Message) -> str:
    assert message.data[0] == 0x71, "STRING_DATA (protocol.md)"
    return bytes(
        low | high << 7 for low, high in zip(message.data[1::2], message.data[2::2], strict=True)
    ).decode()


def test_a_mode_that_a_pin_does_not_have_is_refused_and_changes_nothing() -> None:
    """Those are its modes that it states itself: of protocol.md's, PWM is 3, SERIAL 10."""
    for scheduler in (True, False):
        board = Rig(program(IDLE), options=BoardOptions(scheduler=scheduler)).board
        (capabilities,) = answered(board, bytes.fromhex("F0 6B F7"))
        modes = list(pin_modes(capabilities.data[1:]))
        assert set(modes[18]) == {0, 1, 11, *((10,) if scheduler else ())}
        for pin in (1, 2, 18, 69, 70, 127):
            for mode in range(20):
                answered(board, firmata.pin_mode(pin, Mode.OUTPUT))
                before = answered(board, bytes((0xF0, 0x6D, pin, 0xF7)))
                answers = answered(board, bytes((0xF4, pin, mode)))
                allowed = pin < len(modes) and mode in modes[pin]
                assert [said(answer) for answer in answers] == ([] if allowed else ["Unknown pin mode"])
                after = answered(board, bytes((0xF0, 0x6D, pin, 0xF7)))
                assert after == before if not allowed else after[0].data[2] == mode


def test_the_state_of_a_pin_is_what_was_written_to_it_or_whether_its_pull_up_is_on() -> None:
    board = Rig(program(IDLE)).board

    def state(*messages: bytes) -> str:
        (answer,) = answered(board, b"".join((*messages, bytes.fromhex("F0 6D 02 F7"))))
        return answer.data.hex(" ")

    assert state() == "6e 02 00 00"
    assert state(firmata.pin_mode(2, Mode.OUTPUT), firmata.pin_value(2, 1)) == "6e 02 01 01"
    assert state(bytes.fromhex("F5 02 05")) == "6e 02 01 01", "any other value than 0 is high"
    assert state(firmata.pin_mode(2, Mode.INPUT)) == "6e 02 00 00"
    assert state(firmata.pin_mode(2, Mode.PULL_UP)) == "6e 02 0b 01"


def test_a_command_that_the_board_does_not_have_is_refused_with_a_text() -> None:
    """As by ConfigurableFirmata; StandardFirmata says nothing. Commands without an answer are not refused."""
    board = Rig(program(IDLE)).board
    (answer,) = answered(board, bytes.fromhex("F0 76 00 00 F7"))
    assert said(answer) == "Unhandled sysex command: 0x76 (len: 2)"
    assert answered(board, bytes.fromhex("F0 6F 02 00 01 F7 F0 7A 13 00 F7 F0 F7")) == []
    board = Rig(program(IDLE), options=BoardOptions(scheduler=False)).board
    assert answered(board, bytes.fromhex("F0 76 00 00 F7 F0 7B 05 F7 F0 60 11 60 12 00 F7")) == []


def test_a_command_of_a_wrong_length_has_no_effect() -> None:
    """A task exists; rate 0 of a serial port is none. A board that is sent rubbish works on."""
    rig = Rig(program(IDLE), ["RA1=TX1"])
    assert answered(rig.board, firmata.load_task(1, b"\xff" * 4)) == []
    for command in (0x60, 0x6D, 0x7B):
        for size in range(4):
            for first in range(0x80):
                text = bytes((0xF0, command, first, *bytes(size)))
                rig.board.received(text[: 2 + size] + b"\xf7")
    rig.board.received(bytes.fromhex("F0 60 11 00 00 00 F7 F0 60 21 41 01 F7 F0 7B F7 F0 7B 08 01 F7"))
    rig.board.outgoing.clear()
    assert answered(rig.board, bytes.fromhex("F9")) == [Message(MessageKind.VERSION, b"\x02\x08")]


def tasks(board: VirtualBoard) -> bytes:
    """Return the numbers of the stored tasks."""
    (answer,) = answered(board, bytes.fromhex("F0 7B 05 F7"))
    assert answer.data[:2] == bytes.fromhex("7B 09")
    return answer.data[2:]


def test_a_task_that_is_deleted_is_not_played() -> None:
    """scheduler.md: 01 deletes, 06 asks for one task, whose answer holds no data where there is none."""
    rig = Rig(program(IDLE))
    pulse = firmata.pin_value(2, 1) + firmata.delay_ms(1) + firmata.pin_value(2, 0)
    rig.board.received(firmata.pin_mode(2, Mode.OUTPUT))
    for number in (1, 2):
        rig.board.received(firmata.load_task(number, pulse) + firmata.schedule_task(number, 5 * number))
    assert tasks(rig.board) == b"\1\2"
    assert answered(rig.board, bytes.fromhex("F0 7B 01 01 F7 F0 7B 01 09 F7")) == [], "9 is none"
    assert tasks(rig.board) == b"\2"
    assert answered(rig.board, bytes.fromhex("F0 7B 06 01 F7")) == [Message(0xF0, bytes.fromhex("7B 0A 01"))]
    seen = edges(rig.chip, RB0, 20 * CYCLES_PER_MS)
    assert [(round(at / CYCLES_PER_MS), level) for at, level in seen] == [(11, 1), (12, 0)]
    assert tasks(rig.board) == b""
    rig.board.received(firmata.load_task(3, b"") + firmata.schedule_task(3, 1))
    assert tasks(rig.board) == b"\3"
    rig.chip.run(3 * CYCLES_PER_MS)
    assert tasks(rig.board) == b"", "a task without messages ends at once"


def test_what_is_known_of_a_task_is_its_time_its_length_and_how_far_it_is() -> None:
    """scheduler.md: time_ms (4 bytes), length (2), position (2), messages; of an error as well."""
    rig = Rig(program(IDLE))

    def known(answers: list[Message], kind: int) -> tuple[int, int, int, bytes]:
        (answer,) = answers
        assert answer.data[:3] == bytes((0x7B, kind, 1))
        data = firmata.unpacked(answer.data[3:])
        numbers = (int.from_bytes(data[a:b], "little") for a, b in ((0, 4), (4, 6), (6, 8)))
        time_ms, length, position = numbers
        return time_ms, length, position, data[8:]

    query = bytes.fromhex("F0 7B 06 01 F7")
    messages = firmata.delay_ms(3) + firmata.pin_value(2, 1)
    rig.board.received(firmata.task(SchedulerCommand.CREATE, bytes((1, len(messages) + 2, 0))))
    rig.board.received(firmata.task(SchedulerCommand.ADD, b"\1" + firmata.packed(messages)))
    size = len(messages)
    assert known(answered(rig.board, query), 0x0A) == (0, size + 2, size, messages)
    again = firmata.task(SchedulerCommand.CREATE, bytes((1, 5, 0)))
    assert known(answered(rig.board, again), 0x08) == (0, size + 2, size, messages), "it exists"
    rig.board.received(firmata.schedule_task(1, 4))
    assert known(answered(rig.board, query), 0x0A) == (4, size + 2, 0, messages)
    rig.chip.run(5 * CYCLES_PER_MS + 10)
    assert known(answered(rig.board, query), 0x0A) == (7, size + 2, len(firmata.delay_ms(3)), messages)


def test_messages_for_a_task_that_does_not_exist_are_an_error() -> None:
    """FirmataScheduler takes one byte of them; a command without any has no effect."""
    board = Rig(program(IDLE)).board
    assert answered(board, bytes.fromhex("F0 7B 02 09 00 F7")) == answered(
        board, bytes.fromhex("F0 7B 02 09 00 00 F7")
    )
    (answer,) = answered(board, bytes.fromhex("F0 7B 02 09 00 F7"))
    assert answer.data[:3] == bytes.fromhex("7B 08 09")
    assert answered(board, bytes.fromhex("F0 7B 02 09 F7")) == []


def test_the_client_stores_a_run_on_the_board_and_starts_it(serve: Serve) -> None:
    rig = Rig(program(IDLE))
    with input_adapter(serve({"inputs": rig.board}).paths["inputs"], rig.wiring) as adapter:
        assert adapter.board.scheduler and adapter.board.serial_ports == (1, 2, 3)
        adapter.load([BoardInput(20, DrivePin("RB0", 1)), BoardInput(35, DrivePin("RB1", 1))], 50)
        assert not rig.chip.word
        adapter.start()
        until(lambda: rig.chip.word >> RB0 & 3 == 3)


def test_what_is_played_is_at_the_asked_milliseconds() -> None:
    """Without a port: what the client sends goes to the board, and the chip runs."""
    rig = Rig(program(IDLE), ["RA1=TX1"])

    class Wire:
        path = "here"

        def write(self, data: bytes) -> None:
            rig.board.received(data)

        def read(self, most: int, seconds: float) -> bytes:
            data = bytes(rig.board.outgoing)
            rig.board.outgoing.clear()
            return data

    port = Wire()
    board = adapter_module.BoardFacts("board", 70, (1, 2, 3), scheduler=True)
    adapter = InputAdapter(port, rig.wiring, board)  # type: ignore[arg-type]
    adapter.release()
    adapter.apply([DrivePin("RB0", 1)])
    adapter.listen("RA1", 2400)
    inputs = [
        BoardInput(35, DrivePin("RB0", 1)),
        BoardInput(20, DrivePin("RB0", 0)),
        BoardInput(40, Send("RA1", b"U", 2400)),
    ]
    adapter.load(inputs, 60)
    adapter.start()
    begin = rig.chip.now
    cycle, level = rig.chip.look(80 * CYCLES_PER_MS)
    changes = {
        pin: [
            (at - begin, now >> pin & 1)
            for at, before, now in zip(cycle.tolist()[1:], level.tolist(), level.tolist()[1:], strict=False)
            if (before ^ now) >> pin & 1
        ]
        for pin in (RB0, RA1, MARK_CHANNEL)
    }
    mark = changes[MARK_CHANNEL][0][0]
    assert [(at - mark, now) for at, now in changes[RB0]] == [(20_000, 0), (35_000, 1)]
    # 'U' is 0x55, whose bits alternate: ten of 416.67 cycles; an input is taken after an instruction
    assert [at - mark for at, _ in changes[RA1]] == pytest.approx(
        [40_000 + n * 1_000_000 / 2400 for n in range(10)], abs=3
    )
    after = [at - mark for at, _ in changes[MARK_CHANNEL][1:]]
    assert after[0] == 60_000 and after[1] == 61_000, "so that the analyser's memory is full soon"


def test_a_contact_connects_two_pins_while_it_is_closed() -> None:
    """RB0 counts at 250 kHz / 2, RB4 is an input that follows it."""
    body = COUNTER.replace(" clrf TRISB", " movlw 0xF0\n movwf TRISB")
    rig = Rig(program(body), ["RB0-RB4=22"])
    rig.chip.run(100)
    assert edges(rig.chip, RB4, 200) == []
    rig.board.received(firmata.pin_mode(22, Mode.OUTPUT) + firmata.pin_value(22, 1))
    followed = edges(rig.chip, RB4, 200)
    assert len(followed) > 50
    rig.board.received(firmata.pin_value(22, 0))
    assert len(edges(rig.chip, RB4, 200)) <= 1


def test_a_short_circuit_pulls_what_it_is_connected_to_low() -> None:
    """RB0 drives 1 and RB1 drives 0; RB4, which the board holds high, touches both, and RB5 does not."""
    body = " movlw 0xFC\n bsf STATUS, RP0\n movwf TRISB\n bcf STATUS, RP0\n bsf PORTB, 0\n bcf PORTB, 1\n"
    rig = Rig(program(body + IDLE))
    rig.chip.run(100)
    rb1, rb5 = (PINS.index(name) for name in ("RB1", "RB5"))
    rig.chip.drive(RB4, 1)
    rig.chip.drive(rb5, 1)

    def levels() -> list[int]:
        return [rig.chip.word >> pin & 1 for pin in (RB0, rb1, RB4, rb5)]

    assert levels() == [1, 0, 1, 1]
    wires = [frozenset((RB0, RB4)), frozenset((rb1, RB4))]
    rig.chip.connect(wires[0], True)
    assert levels() == [1, 0, 1, 1]
    rig.chip.connect(wires[1], True)
    assert levels() == [1, 0, 0, 1]
    rig.chip.connect(wires[1], False)
    assert levels() == [1, 0, 1, 1]


def test_mclr_holds_the_chip_in_reset_and_vdd_switches_it_off() -> None:
    rig = Rig(program(COUNTER), ["VDD=17"])
    mclr, vdd = rig.wiring.pins["MCLR"], rig.wiring.pins["VDD"]
    assert len(edges(rig.chip, RB0, 1000)) > 100
    for pin in (mclr, vdd):
        rig.board.received(firmata.pin_mode(pin, Mode.OUTPUT) + firmata.pin_value(pin, 0))
        edges(rig.chip, RB0, 100)
        assert edges(rig.chip, RB0, 1000) == []
        rig.board.received(firmata.pin_value(pin, 1))
        assert len(edges(rig.chip, RB0, 1000)) > 100


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (BoardOptions(silent=True), "no-answer"),
        (BoardOptions(garbage=True), "wrong-device"),
        (BoardOptions(unplug_after=5), "port-lost"),
    ],
)
def test_a_board_that_does_not_answer_is_an_error_of_the_bench(
    serve: Serve, options: BoardOptions, code: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adapter_module, "START_S", 0.3)
    monkeypatch.setattr(adapter_module, "ANSWER_S", 0.1)
    rig = Rig(program(IDLE), options=options)
    path = serve({"inputs": rig.board}).paths["inputs"]
    with pytest.raises(ServogenError) as raised, input_adapter(path, rig.wiring):
        pass
    assert raised.value.diagnostics[0].code == code
    assert raised.value.exit_code == 3


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["RB0=80"], "the input board has 70 pins, and pin 80 is wired"),
        (["RA1=TX5"], "the input board has no serial port TX5"),
    ],
)
def test_a_wiring_that_the_board_does_not_have_is_refused(
    serve: Serve, texts: Sequence[str], message: str
) -> None:
    rig = Rig(program(IDLE))
    path = serve({"inputs": rig.board}).paths["inputs"]
    with pytest.raises(InputError) as raised, input_adapter(path, input_wiring(texts)):
        pass
    assert message in str(raised.value)


@pytest.mark.parametrize(("pins", "fit"), [(20, 400), (30, 400), (70, 4000)], ids=["Uno", "Leonardo", "Mega"])
def test_too_long_a_run_is_refused_with_what_to_do(serve: Serve, pins: int, fit: int) -> None:
    """The pins are those of Firmata's Boards.h; an Uno has 2 KB of memory, a Leonardo 2.5, a Mega 8."""
    rig = Rig(program(IDLE))
    with input_adapter(serve({"inputs": rig.board}).paths["inputs"], rig.wiring) as adapter:
        adapter.board = replace(adapter.board, pins=pins)
        many = [BoardInput(ms, DrivePin("RB0", ms % 2)) for ms in range(1000)]
        with pytest.raises(InputError) as raised:
            adapter.load(many, 1000)
    assert f"of which {fit} fit into the input board" in str(raised.value)


def test_a_task_that_ends_with_a_delay_is_repeated_from_its_first_message() -> None:
    """RB0 is high for 2 of 5 ms, again and again; a task begins a millisecond later (scheduler.md)."""
    rig = Rig(program(IDLE))
    high, low = firmata.pin_value(2, 1), firmata.pin_value(2, 0)
    messages = high + firmata.delay_ms(2) + low + firmata.delay_ms(3)
    rig.board.received(firmata.pin_mode(2, Mode.OUTPUT) + firmata.load_task(1, messages))
    rig.board.received(firmata.schedule_task(1, 4))
    seen = edges(rig.chip, RB0, 16 * CYCLES_PER_MS)
    ms = [(round(at / CYCLES_PER_MS), level) for at, level in seen]
    assert ms == [(5, 1), (7, 0), (10, 1), (12, 0), (15, 1)]


def test_without_a_scheduler_this_process_plays_the_run_in_order(serve: Serve) -> None:
    rig = Rig(program(IDLE), options=BoardOptions(scheduler=False))
    now = 0.0

    def sleep(seconds: float) -> None:
        nonlocal now
        now += seconds

    with input_adapter(serve({"inputs": rig.board}).paths["inputs"], rig.wiring) as adapter:
        assert not adapter.board.scheduler
        adapter.now, adapter.sleep = lambda: now, sleep
        adapter.apply([DrivePin("RB0", 1)])
        adapter.load([BoardInput(30, DrivePin("RB0", 1)), BoardInput(20, DrivePin("RB0", 0))], 40)
        adapter.start()
        assert now == pytest.approx(0.040)
        until(lambda: rig.chip.word >> RB0 & 1)


def test_a_serial_adapter_sends_at_its_moment_and_the_chip_answers(serve: Serve) -> None:
    """The adapter's line goes to RA1; the chip, which copies RA1 to RB5, sends the same back."""
    body = (
        " bsf STATUS, RP0\n movlw 0xDF\n movwf TRISB\n bcf STATUS, RP0\n"
        "loop btfss PORTA, 1\n bcf PORTB, 5\n btfsc PORTA, 1\n bsf PORTB, 5\n goto loop"
    )
    stimulus = LineStimulus(RA1, 2400)
    chip = VirtualChip(program(body), CLOCK, stimulus=stimulus)
    receiver = LineReceiver(PINS.index("RB5"), Fraction(CLOCK.cycles_per_second, 2400))
    chip.run(10 * CYCLES_PER_MS)  # RB5 idles
    wiring = input_wiring()
    devices = {"inputs": VirtualBoard(chip, wiring), "line": SerialLine(chip, stimulus, receiver)}
    paths = serve(devices).paths
    with open_port(paths["line"], 9600) as line:
        serial = SerialAdapter(line, "RA1")
        with input_adapter(paths["inputs"], wiring, serial) as adapter:
            adapter.listen("RA1", 2400)
            adapter.load(
                [BoardInput(0, Send("RA1", b"servo", 2400)), BoardInput(5, Send("RA1", b"!", 2400))], 10
            )
            adapter.start()
            assert line.line.baudrate == 2400
            assert line.read_whole(6, 30) == b"servo!"


def test_the_doctor_shows_the_board(serve: Serve, run: Run) -> None:
    path = serve({"inputs": Rig(program(IDLE)).board}).paths["inputs"]
    done = run("doctor", "--inputs", path)
    assert done.code == 0, done.err
    assert "ConfigurableFirmata 2.8" in done.out and "by its own clock" in done.out


def test_the_doctor_says_that_nothing_is_at_a_port(run: Run) -> None:
    done = run("doctor", "--inputs", "/dev/nowhere")
    assert done.code == 3
    assert "there is no such port" in done.err
