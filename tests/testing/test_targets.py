"""What a target does for a test: begins a run, looks long enough, checks that inputs came in time."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from servogen.bench.inputs.adapter import BoardInput, Close, DrivePin, Send
from servogen.bench.inputs.wiring import InputWiring
from servogen.bench.programmers.table import ProgrammingRequest
from servogen.edges import EdgeTrace, edge_chunk, join
from servogen.errors import InputError, ToolError
from servogen.pic.image import Image, read_hex
from servogen.pulse.schedule import from_json
from servogen.testing import targets
from servogen.testing.targets import (
    Bench,
    BenchRun,
    BenchStart,
    CaptureRequest,
    InputPorts,
    PinCapture,
    Replay,
    SeenPins,
    Simulator,
    begin,
    check,
    check_inputs,
    record,
    uses_eeprom,
)
from servogen.traces import write_edges
from servogen.units import Clock, Cycles
from servogen.workflows.verification import checked_cycles, running

LAB8 = Path(__file__).parents[2] / "firmware" / "lab8-exercise"
MHZ4 = Clock(4_000_000)
RB0 = 5
CONTACT = frozenset({"RB0", "RB4"})


class Adapter:
    """An input adapter that lists what it is asked to do."""

    def __init__(self, scheduler: bool = True) -> None:
        self.board = SimpleNamespace(scheduler=scheduler)
        self.calls: list[tuple[Any, ...]] = []

    def apply(self, inputs: Any) -> None:
        self.calls.append(("apply", *inputs))

    def load(self, inputs: Any, length_ms: int) -> None:
        self.calls.append(("load", list(inputs), length_ms))

    def listen(self, pin: str, baud: int) -> None:
        self.calls.append(("listen", pin, baud))

    def stop(self) -> None:
        self.calls.append(("stop",))

    def release(self) -> None:
        self.calls.append(("release",))

    def start(self) -> None:
        self.calls.append(("start",))


def run(start: BenchStart = BenchStart.CONTINUE, **around: Any) -> BenchRun:
    return BenchRun(MHZ4, 0.0101, {"RB0": 1, "RB1": 0}, {CONTACT: True}, start=start, **around)


LEVELS = (DrivePin("RB0", 1), DrivePin("RB1", 0))


def begun(segment: BenchRun) -> list[tuple[Any, ...]]:
    adapter = Adapter()
    begin(cast(Any, adapter), segment)
    return adapter.calls


def test_a_run_goes_on_with_its_levels_and_contacts() -> None:
    assert begun(run()) == [("stop",), ("apply", *LEVELS, Close(CONTACT, True)), ("load", [], 11)]


def test_a_run_of_whole_milliseconds_is_not_longer() -> None:
    assert begun(BenchRun(MHZ4, 0.011))[-1] == ("load", [], 11)


def test_a_run_that_begins_with_a_reset_holds_mclr_until_then() -> None:
    assert begun(run(BenchStart.RESET)) == [
        ("stop",),
        ("apply", DrivePin("MCLR", 0)),
        ("apply", *LEVELS, Close(CONTACT, True)),
        ("load", [BoardInput(0, DrivePin("MCLR", 1))], 11),
    ]


def test_a_chip_that_is_off_is_fed_through_no_pin(monkeypatch: pytest.MonkeyPatch) -> None:
    naps: list[float] = []
    monkeypatch.setattr(targets, "time", SimpleNamespace(sleep=naps.append))
    assert begun(run(BenchStart.POWER_UP)) == [
        ("stop",),
        ("release",),
        ("apply", DrivePin("VDD", 0)),
        ("load", [BoardInput(0, each) for each in (DrivePin("VDD", 1), *LEVELS)], 11),
    ]
    assert naps == [0.2]


def test_a_line_that_will_send_idles_at_its_first_rate_and_is_not_driven() -> None:
    sends = tuple(BoardInput(ms, Send("RB1", b"A", baud)) for ms, baud in ((1, 2400), (5, 9600)))
    assert begun(run(inputs=sends)) == [
        ("stop",),
        ("apply", LEVELS[0], Close(CONTACT, True)),
        ("listen", "RB1", 2400),
        ("load", [*sends], 11),
    ]


def shown(*changes_ms: tuple[float, int]) -> EdgeTrace:
    """What RB0 was seen to do, after beginning low."""
    rows = [(0, RB0, 0), *((round(1000 * ms), RB0, level) for ms, level in changes_ms)]
    return EdgeTrace(MHZ4, (edge_chunk(*zip(*rows, strict=True)),), Cycles(200_000))


def checked(trace: EdgeTrace, *changes: tuple[int, int | None], before: int | None = 0) -> str:
    """Return the complaint about RB0, which was to change at these milliseconds of 100."""
    inputs = tuple(BoardInput(ms, DrivePin("RB0", level)) for ms, level in changes)
    levels = {} if before is None else {"RB0": before}
    try:
        check_inputs(trace, BenchRun(MHZ4, 0.1, levels, inputs=inputs), 3)
    except ToolError as error:
        assert error.code == "late-input"
        return error.message
    return ""


LATE = "RB0 did not become 1 at 20 ms of the run, nor within 3 ms of it"


@pytest.mark.parametrize(("seen_ms", "complaint"), [(17, ""), (16.99, LATE), (23, ""), (23.01, LATE)])
def test_an_input_may_be_as_early_or_late_as_the_board_is(seen_ms: float, complaint: str) -> None:
    assert checked(shown((seen_ms, 1)), (20, 1)) == complaint
    assert checked(shown((seen_ms, 0)), (20, 1)) == LATE, "the other level"


def test_only_changes_that_must_be_seen_are_looked_for() -> None:
    nothing = shown()
    assert checked(nothing, (20, 1)) == LATE
    assert checked(nothing, (20, 0)) == "", "no change"
    assert checked(nothing, (20, 1), before=None) == "", "nobody knows what it was"
    assert checked(nothing, (20, None)) == "", "let go"
    assert checked(nothing, (3, 1)) == "", "before the capture may have begun"
    assert checked(nothing, (4, 1)).startswith("RB0 did not become 1 at 4 ms")
    assert checked(nothing, (101, 1)) == ""
    assert checked(nothing, (100, 1)).startswith("RB0 did not become 1 at 100 ms")
    assert checked(nothing, (20, 1), (20, 0)) == "", "of one millisecond only the last"
    assert checked(shown((20, 1)), (40, 0), (20, 1)).startswith("RB0 did not become 0 at 40 ms")
    assert checked(shown((20, 1), (40, 0)), (40, 0), (20, 1)) == ""
    other = BenchRun(MHZ4, 0.1, {"MCLR": 0}, inputs=(BoardInput(20, DrivePin("MCLR", 1)),))
    check_inputs(nothing, other, 3)


class Played(Bench):
    """A bench whose analyser holds so many seconds in each capture, with an edge every `every` µs."""

    def hold(self, *seconds: float, every: int = 1000) -> None:
        self.held, self.every, self.asked = list(seconds), every, list[float | None]()

    def _capture_with(self, settings: Any, request: CaptureRequest, seconds: float | None) -> SeenPins:
        self.asked.append(seconds)
        self.settings = settings
        end = round(1e6 * self.held.pop(0))
        times = range(0, end, self.every)
        rows = [(cycle, RB0, number % 2) for number, cycle in enumerate(times)]
        return SeenPins(EdgeTrace(MHZ4, (edge_chunk(*zip(*rows, strict=True)),), Cycles(end)), "bench")


def bench(tmp_path: Path, *held: float, every: int = 1000, **around: Any) -> Played:
    made = Played("/dev/ttyACM0", None, None, None, tmp_path, **around)
    made.hold(*held, every=every)
    return made


def test_a_capture_without_a_schedule_is_repeated_with_more_memory_until_it_is_long_enough(
    tmp_path: Path,
) -> None:
    made = bench(tmp_path, 0.25, 0.499, 0.5)
    made.capture(CaptureRequest(MHZ4, seconds=0.5))
    assert made.asked == pytest.approx([0.5, 0.5 * 1.25 * 2, 0.5 * 1.25 * 2 * 1.25 * 0.5 / 0.499])
    assert not made.settings.triggered
    short = bench(tmp_path, 0.0005, 0.001)
    short.capture(CaptureRequest(MHZ4, seconds=0.001))
    assert short.asked == pytest.approx([0.001, 0.02 * 1.25 * 2]), "no less than a frame"
    full = bench(tmp_path, *[0.1] * 5)
    with pytest.raises(InputError, match="was full after 100 ms, not 500 ms") as error:
        full.capture(CaptureRequest(MHZ4, seconds=0.5))
    assert (error.value.code, len(full.asked)) == ("analyser-memory", 5)


def with_adapter(made: Bench, monkeypatch: pytest.MonkeyPatch, adapter: Adapter) -> Adapter:
    """Return what drives a bench's inputs from now on."""
    monkeypatch.setattr(targets, "opened", lambda ports: nullcontext(adapter))
    made.inputs = InputPorts("/dev/ttyACM1", InputWiring({}))
    made.adapter()
    return adapter


def test_a_run_is_looked_at_for_its_time_and_its_inputs_delay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half a second, and twice the memory for its edges: 325 a second at first, of the 1300 of a plan."""
    for scheduler, late in ((True, 0.003), (False, 0.05)):
        made = bench(tmp_path, 0.2)
        adapter = with_adapter(made, monkeypatch, Adapter(scheduler))
        made.play(BenchRun(MHZ4, 0.1))
        assert made.asked == pytest.approx([0.5 + (0.1 + late) * 2 / 4])
        assert adapter.calls == [("stop",), ("apply",), ("load", [], 100)]
        assert made.edges_per_s == pytest.approx(101 / 0.1), "as many as were seen in the run"
        assert made.settings.armed == adapter.start


def test_a_run_that_may_be_repeated_is_until_the_memory_suffices(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = bench(tmp_path, 0.05, 0.1, every=100)
    with_adapter(made, monkeypatch, Adapter())
    made.play(BenchRun(MHZ4, 0.1, repeatable=True))
    assert made.asked == pytest.approx([0.5 + 0.103 * 2 / 4, 0.5 + 0.103 * 2 * 10_000 / 1300])
    once = bench(tmp_path, 0.05)
    with_adapter(once, monkeypatch, Adapter())
    with pytest.raises(InputError, match="was full after 50 ms, not 100 ms"):
        once.play(BenchRun(MHZ4, 0.1))
    tired = bench(tmp_path, *[0.05] * 5)
    with_adapter(tired, monkeypatch, Adapter())
    with pytest.raises(InputError, match="analyser"):
        tired.play(BenchRun(MHZ4, 0.1, repeatable=True))
    assert len(tired.asked) == 5


IMAGE = Image({0: 0x2800}, 0x3FF1)
WRITES = Image({0: 0x0089, 1: 0x2800}, 0x3FF1)  # MOVWF 0x09 in bank 1 is EECON2


def test_a_program_may_write_its_eeprom_if_it_writes_eecon2() -> None:
    """DS35007, table 2-1: EECON2 is 0x89. MOVF EECON2, W reads it; CLRF clears it."""
    assert not uses_eeprom(IMAGE)
    assert uses_eeprom(WRITES)
    assert not uses_eeprom(Image({0: 0x0809}))
    assert uses_eeprom(Image({0: 0x0189}))
    assert not uses_eeprom(Image({0: 0x0088}))


def test_a_chip_is_programmed_once_unless_it_writes_its_eeprom(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flashed: list[Image] = []
    monkeypatch.setattr(targets, "find", lambda name: name)
    monkeypatch.setattr(targets, "flash", lambda tool, order, image: flashed.append(image))
    made = Bench("/dev/ttyACM0", "picpro", "/dev/ttyUSB0", None, tmp_path)
    with pytest.raises(InputError, match="nothing says which chip it is for"):
        made.load(IMAGE)
    made.built_for = "PIC16F84A"
    adapter = with_adapter(made, monkeypatch, Adapter())
    for image in (IMAGE, IMAGE, WRITES, WRITES, IMAGE):
        made.load(image)
    assert flashed == [IMAGE, WRITES, WRITES, IMAGE]
    assert adapter.calls == 4 * [("release",)]
    assert made.on_chip == IMAGE
    with pytest.raises(InputError, match="no configuration word"):
        made.load(Image({0: 0x2800}))
    made.close()
    made.load(WRITES)
    assert len(adapter.calls) == 5, "once more as the bench was closed, and then no more"
    with pytest.raises(InputError, match="no programmer is named"):
        Bench("/dev/ttyACM0", None, None, None, tmp_path).load(IMAGE)
    with pytest.raises(InputError, match="no programmer of this run knows the chip's EEPROM"):
        Bench("/dev/ttyACM0", None, None, None, tmp_path).eeprom()


def test_what_a_test_does_not_say_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="states neither a schedule nor a duration"):
        _ = CaptureRequest(MHZ4).cycles
    assert CaptureRequest(MHZ4, seconds=0.25).cycles == 250_000
    with pytest.raises(InputError, match="there is no program on the simulated chip"):
        Simulator().capture(CaptureRequest(MHZ4, seconds=0.25))
    replay = Replay(tmp_path, "test_a")
    with pytest.raises(InputError, match="there is no recording of this test") as error:
        replay.capture(CaptureRequest(MHZ4))
    assert str(error.value.location) == str(tmp_path / "test_a")


def test_recordings_are_found_by_the_name_of_the_test(tmp_path: Path) -> None:
    text = "cycle,pin,level\n5,RB0,1\n"
    (tmp_path / "test_a.csv").write_text(text)
    (found,) = Replay(tmp_path, "test_a").recordings(MHZ4)
    assert found.source == f"the recording {tmp_path / 'test_a.csv'}"
    assert found.file == tmp_path / "test_a.csv"
    for name in ("test_a-2", "test_a-3", "test_a-5"):
        (tmp_path / f"{name}.csv").write_text(text)
    assert [each.file.stem for each in Replay(tmp_path, "test_a").recordings(MHZ4) if each.file] == [
        "test_a",
        "test_a-2",
        "test_a-3",
    ]
    assert join(found.trace.chunks).cycle.tolist() == [5]
    assert Replay(tmp_path, "test_a").capture(CaptureRequest(MHZ4)) is not None


def test_what_was_seen_is_written_or_copied_with_the_suffix_of_its_file(tmp_path: Path) -> None:
    seen = SeenPins(shown((20, 1)), "the simulated chip")
    written = record(seen, tmp_path / "a.vcd")
    assert written == tmp_path / "a.vcd"
    assert join(Replay(tmp_path, "a").capture(CaptureRequest(MHZ4)).trace.chunks).cycle.tolist() == [
        0,
        20_000,
    ]
    other = tmp_path / "seen.csv"
    other.write_text("cycle,pin,level\n5,RB0,1\n")
    filed = SeenPins(shown((20, 1)), "a recording", file=other)
    for _ in range(2):
        assert record(filed, tmp_path / "b.vcd") == tmp_path / "b.csv"
        assert (tmp_path / "b.csv").read_text() == other.read_text()
        (tmp_path / "b.csv").write_text("of an earlier run")
    assert record(filed, other) == other, "itself"


def test_what_a_recording_does_not_show_is_not_proven(tmp_path: Path) -> None:
    """The program's edges, with every wire, and without that of a pin that should be silent."""
    schedule = from_json((LAB8 / "schedule.json").read_text(), "schedule.json")
    image = read_hex((LAB8 / "main.hex").read_text()).image
    write_edges(running(schedule, image, checked_cycles(schedule)), tmp_path / "edges.vcd")
    text = (tmp_path / "edges.vcd").read_text()
    (code,) = re.findall(r"\$var wire 1 (\S+) RB7 \$end\n", text)
    lacking = re.sub(r"\$var wire 1 \S+ RB7 \$end\n", "", text).replace(f"z{code}\n", "")
    for name, content, missing in (("whole", text, ()), ("lacking", lacking, ("RB7",))):
        (tmp_path / f"{name}.vcd").write_text(content)
        seen = Replay(tmp_path, name).recording(name, schedule.clock)
        found = check(seen, schedule)
        assert (found.agrees, found.passed) == (True, not missing)
        assert seen.hidden == tuple(f"the file has no wire for {pin}" for pin in missing)


def test_the_simulated_chip_warns_of_what_no_chip_guarantees() -> None:
    """BTFSC 0x20, 0 tests RAM that was never written; an endless GOTO 1 or GOTO 2 follows."""
    simulator = Simulator()
    simulator.load(Image({0: 0x1820, 1: 0x2801, 2: 0x2802}, 0x3FF1))
    seen = simulator.capture(CaptureRequest(MHZ4, seconds=0.001))
    assert (seen.source, seen.span, seen.trace.end) == ("the simulated chip", 1000, 1000)
    assert "unknown-start" in [warning.code for warning in seen.warnings]


def test_a_capture_is_short_in_messages_and_says_where_it_was_seen() -> None:
    capture = PinCapture(SeenPins(shown(), "the bench"), MHZ4, [])
    assert repr(capture) == "PinCapture(clock=Clock(hz=4000000))"
    assert (capture.source, capture.chip_clock()) == ("the bench", MHZ4)


def test_a_bench_opens_its_inputs_once_and_lets_go_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    adapter, closed = Adapter(), []

    @contextmanager
    def opened_once(ports: object) -> Iterator[Adapter]:
        yield adapter
        closed.append(ports)

    monkeypatch.setattr(targets, "opened", opened_once)
    bare = bench(tmp_path, 0.5)
    assert bare.adapter() is None
    bare.play(BenchRun(MHZ4, 0.5))
    assert bare.asked == [0.5], "without inputs a run is a capture"
    ports = InputPorts("/dev/ttyACM1", InputWiring())
    made = bench(tmp_path, inputs=ports)
    assert [made.adapter() for _ in range(2)] == 2 * [cast(Any, adapter)]
    made.close()
    assert (adapter.calls, closed) == ([("release",)], [ports])
    assert bare.close() is None  # type: ignore[func-returns-value]


def test_a_capture_against_a_schedule_is_made_once_and_triggered(tmp_path: Path) -> None:
    made = bench(tmp_path, 0.1)
    schedule = cast(Any, object())
    made.capture(CaptureRequest(MHZ4, schedule, 0.5))
    assert (made.asked, made.settings.triggered) == ([0.5], True)


def test_the_eeprom_is_read_of_the_image_on_the_chip_while_no_input_is_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []

    def read_eeprom(tool: str, order: ProgrammingRequest, image: Image) -> bytes:
        asked.extend((tool, order.file.name, order.device.name, order.port, image, list(adapter.calls)))
        return b"\x12"

    monkeypatch.setattr(targets, "find", lambda name: name)
    monkeypatch.setattr(targets, "read_eeprom", read_eeprom)
    made = Bench("/dev/ttyACM0", "picpro", "/dev/ttyUSB0", "PIC16F84", tmp_path, on_chip=IMAGE)
    made.built_for = "PIC16F84A"  # --servogen-device comes first
    adapter = with_adapter(made, monkeypatch, Adapter())
    assert made.eeprom() == b"\x12"
    assert asked == ["picpro", "eeprom.hex", "PIC16F84", "/dev/ttyUSB0", IMAGE, [("release",)]]
    made.close()
    assert made.eeprom() == b"\x12"
    assert len(adapter.calls) == 2, "nothing to let go of once the bench was closed"
