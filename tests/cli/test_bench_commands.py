"""What flash, rig and capture print, pass on and refuse, with a bench that is made by hand."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.bench.programmers import flash, table
from servogen.bench.virtual import rig
from servogen.errors import Diagnostic
from servogen.programs import Program
from servogen.simulator.sources import pin_number
from servogen.workflows import capture, flashing
from tests.cli.conftest import Run, wrong
from tests.cli.stand_ins import stand_in

ROOT = Path(__file__).parents[2]
LAB8 = ROOT / "jobs" / "lab8-exercise.toml"


@pytest.fixture
def flashed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """`flash` finds a programmer that verifies; what it is asked."""
    programmer = SimpleNamespace(name="prog", verifies=True)
    seen: dict[str, Any] = {
        "programmer": programmer,
        "outcome": SimpleNamespace(compared=()),
        "warnings": lambda force: (Diagnostic("warning", "w", f"forced {force}"),),
    }

    def check(*given: Any) -> Any:
        seen["check"] = given
        return SimpleNamespace(
            device=SimpleNamespace(name="PIC16F84A"), warnings=lambda force: seen["warnings"](force)
        )

    def find(name: Any) -> Any:
        seen["find"] = name
        return SimpleNamespace(programmer=programmer)

    def flash_it(installed: Any, order: Any, image: Any, timeout: float) -> Any:
        seen["order"], seen["timeout"] = order, timeout
        return seen["outcome"]

    stand_in(monkeypatch, "servogen.cli.files", "read_image", lambda path: SimpleNamespace(words=123))
    stand_in(monkeypatch, "servogen.programs", "read_schedule", lambda path: f"schedule {path}")
    stand_in(monkeypatch, flashing, "check", check)
    stand_in(monkeypatch, flashing, "schedule_beside", lambda file: seen.get("beside"))
    stand_in(monkeypatch, table, "find", find)
    stand_in(
        monkeypatch, flash, "programming_command", lambda installed, order: ("prog", "a b", str(order.port))
    )
    stand_in(monkeypatch, flash, "flash", flash_it)
    return seen


@pytest.mark.parametrize(
    ("compared", "verifies", "how"),
    [
        (("program", "EEPROM"), True, "read back and compared: program, EEPROM"),
        (("program",), False, "read back and compared: program"),
        ((), True, "verified by the programmer, not read back"),
        ((), False, "programmed; this programmer does not show that it compared: capture and verify"),
    ],
)
def test_flash_says_how_the_chip_was_checked(
    run: Run, flashed: dict[str, Any], compared: tuple[str, ...], verifies: bool, how: str
) -> None:
    flashed["outcome"].compared, flashed["programmer"].verifies = compared, verifies
    ran = run("flash", "a.hex")
    what, after = ran.out.splitlines()
    assert (ran.code, what) == (0, f"a.hex: 123 words on the PIC16F84A, {how}")
    assert after == "next: servogen capture --port PORT -o capture.vcd"
    assert "forced False" in ran.err
    shown = json.loads(run("flash", "a.hex", "--json", "--force").out)
    assert wrong("flash", json.dumps(shown)) == []
    assert [each["message"] for each in shown.pop("diagnostics")] == ["forced True"]
    assert shown == {"programmer": "prog", "words": 123, "compared": list(compared)}


def test_flash_waits_two_minutes_and_takes_the_schedule_beside_the_program(
    run: Run, flashed: dict[str, Any]
) -> None:
    """docs/bench.md; another schedule and time may be given."""
    run("flash", "a.hex")
    assert (flashed["timeout"], flashed["find"], flashed["order"].port) == (120.0, None, None)
    assert flashed["check"][2:] == (None, None, None)
    flashed["beside"] = Path("schedule.json")
    ran = run("flash", "a.hex", "--timeout", 5, "--programmer", "x", "-p", "/dev/x", "--device", "PIC16F84")
    after = "next: servogen capture --port PORT -o capture.vcd --against schedule.json"
    assert ran.out.splitlines()[-1] == after
    assert (flashed["timeout"], flashed["find"], flashed["order"].port) == (5.0, "x", "/dev/x")
    assert flashed["check"][2:] == ("PIC16F84", Path("schedule.json"), "schedule schedule.json")
    run("flash", "a.hex", "--against", "other.json")
    assert flashed["check"][3:] == (Path("other.json"), "schedule other.json")


def test_a_dry_run_of_flash_prints_the_command_and_programs_nothing(
    run: Run, flashed: dict[str, Any]
) -> None:
    ran = run("flash", "a.hex", "--dry-run", "-p", "x")
    assert (ran.code, ran.out, "order" in flashed) == (0, "prog 'a b' x\n", False)
    shown = json.loads(run("flash", "a.hex", "--dry-run", "-p", "x", "--json").out)
    assert (shown["command"], shown["programmer"]) == (["prog", "a b", "x"], "prog")
    assert "order" not in flashed


def test_a_job_is_not_flashed(run: Run, flashed: dict[str, Any]) -> None:
    ran = run("flash", "a.toml")
    assert (ran.code, ran.out, "check" in flashed) == (2, "", False)
    assert "build it, then flash its folder: servogen build a.toml" in ran.err


@pytest.fixture
def pair_folder(tmp_path: Path) -> Path:
    """What `build` leaves of a job of two chips, as far as a folder is recognised by it."""
    for name in ("chip1", "chip2"):
        (tmp_path / "pair" / name).mkdir(parents=True)
        for file in ("schedule.json", "main.hex"):
            (tmp_path / "pair" / name / file).write_text("")
    return tmp_path / "pair"


@pytest.mark.parametrize("number", [1, 2])
def test_flash_programs_the_chosen_one_of_two_chips(
    run: Run, flashed: dict[str, Any], pair_folder: Path, number: int
) -> None:
    ran = run("flash", pair_folder, "--chip", number)
    built = pair_folder / f"chip{number}" / "main.hex"
    assert (ran.code, flashed["check"][0], flashed["order"].file) == (0, built, built)
    after = f"flash {pair_folder} --chip 2", f"capture --port PORT -o capture.vcd --against {pair_folder}"
    assert ran.out.splitlines()[-1] == f"next: servogen {after[number - 1]}"


def test_flash_asks_which_of_two_chips_and_no_other_folder_has_one(
    run: Run, flashed: dict[str, Any], pair_folder: Path
) -> None:
    ran = run("flash", pair_folder)
    assert (ran.code, "order" in flashed) == (2, False)
    assert "--chip 1, then, with the other chip in the programmer, --chip 2" in ran.err
    ran = run("flash", pair_folder / "chip1", "--chip", 1)
    assert (ran.code, "order" in flashed) == (2, False) and "omit --chip" in ran.err


@pytest.mark.parametrize("command", ["simulate", "measure", "watch", "disassemble"])
def test_a_command_for_one_program_names_the_two_of_a_pair(run: Run, pair_folder: Path, command: str) -> None:
    ran = run(command, pair_folder)
    assert ran.code == 2
    assert f"name one: {pair_folder / 'chip1'} or {pair_folder / 'chip2'}" in ran.err.replace("\n", " ")


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """`rig` opens this bench, which ends at once; what it is opened with."""
    seen: dict[str, Any] = {}

    class Terminals:
        paths = {"programmer": "/dev/pts/1", "analyser": "/dev/pts/2"}  # noqa: RUF012

        def serve(self, ended: Any) -> None:
            seen["before"] = ended()
            handler: Any = signal.getsignal(signal.SIGTERM)
            handler(signal.SIGTERM, None)
            seen["after"] = ended()

    @contextmanager
    def opened(
        image: Any, clock: Any, board: Any, options: Any, levels: Any, second: Any, debugger: Any
    ) -> Iterator[Terminals]:
        seen.update(image=image, hz=clock.hz, options=options, levels=levels, debugger=debugger)
        yield Terminals()

    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    stand_in(monkeypatch, rig, "rig", opened)
    for name in ("played_program", "read_program"):  # the image is what the program would be of
        stand_in(monkeypatch, "servogen.cli.rig_command", name, Program)
    stand_in(
        monkeypatch, "servogen.cli.rig_command", "_tell_sigrok", lambda stack, port: print(f"sigrok {port}")
    )
    seen["kept"] = kept
    return seen


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """Leave the process's signals as they were."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


def test_a_bench_without_options_is_exact_and_has_the_documented_parts(
    run: Run, bench: dict[str, Any]
) -> None:
    """docs/bench.md: 24 KiB and 100 MHz of the Logic Sniffer, no noise; 2400 baud at RB7, idle high."""
    ran = run("rig", LAB8)
    assert ran.code == 0
    names = ["programmer: /dev/pts/1", "analyser: /dev/pts/2", "sigrok /dev/pts/2", "end it with Ctrl-C"]
    assert ran.out.splitlines() == names
    options = bench["options"]
    assert (options.ppm, options.real_time, options.inverted) == (0, False, False)
    assert (options.serial_pin, options.serial_out, options.baud) == (pin_number("RB7"), None, 2400)
    analyser = options.analyser
    assert (analyser.memory, analyser.fastest, analyser.glitches_per_s) == (24 * 1024, 100_000_000, 0)
    assert options.board.scheduler is True
    assert (bench["image"].job.name, bench["hz"]) == (LAB8.stem, 4_000_000)
    assert (bench["before"], bench["after"]) == (False, True)  # a signal ends it


def test_the_options_of_a_bench_reach_it(run: Run, bench: dict[str, Any]) -> None:
    words = ("--crystal-ppm", 12.5, "--memory", 64, "--rate", 1000, "--noise", 3, "--real-time", "--inverted")
    words += (
        "--serial-pin",
        "RA4",
        "--serial-out",
        "RA0",
        "--baud",
        1200,
        "--no-scheduler",
        "--hex",
        "x.hex",
    )
    ran = run("rig", LAB8, *words, "--fault", "programmer:silent", "--json")
    shown = json.loads(ran.out)
    assert shown == {"diagnostics": [], "programmer": "/dev/pts/1", "analyser": "/dev/pts/2"}
    options = bench["options"]
    assert (options.ppm, options.real_time, options.inverted) == (Fraction(25, 2), True, True)
    assert (options.serial_pin, options.serial_out) == (pin_number("RA4"), pin_number("RA0"))
    assert options.baud == 1200
    assert (options.analyser.memory, options.analyser.fastest) == (64, 1000)
    assert options.analyser.glitches_per_s == 3
    assert options.board.scheduler is False
    assert options.programmer != rig.RigOptions().programmer
    assert bench["image"] == Path("x.hex")


def test_a_bench_says_where_an_editor_attaches_to_its_chip(run: Run, bench: dict[str, Any]) -> None:
    pytest.importorskip("websockets", reason="the server is of the extra watch")
    shown = json.loads(run("rig", LAB8, "--hex", ROOT / "firmware" / LAB8.stem, "--debug", "--json").out)
    assert shown["debugger"].startswith("http://127.0.0.1:")
    assert bench["debugger"] is not None


def test_a_server_that_cannot_begin_says_so(
    run: Run, bench: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    server = pytest.importorskip("servogen.watch.server", reason="the server is of the extra watch")

    async def refused(*given: object) -> None:
        raise OSError("no more files")

    monkeypatch.setattr(server.WatchServer, "run", refused)
    ran = run("rig", LAB8, "--hex", ROOT / "firmware" / LAB8.stem, "--debug")
    assert ran.code == 3 and "no port can be opened: no more files [port-in-use]" in ran.err


def test_the_serial_line_of_a_bench_is_the_jobs(run: Run, bench: dict[str, Any], tmp_path: Path) -> None:
    """A stream's pins and rate; of a walk on command its pin."""
    text = LAB8.read_text().split("[motion]")[0]
    stream = '[stream]\nbaud = 1200\nreceive_pin = "RB6"\ntransmit_pin = "RA2"\n'
    (tmp_path / "stream.toml").write_text(text.replace('pin = "RB0"', 'pin = "RB0"') + stream)
    run("rig", tmp_path / "stream.toml")
    options = bench["options"]
    assert (options.serial_pin, options.serial_out) == (pin_number("RB6"), pin_number("RA2"))
    assert options.baud == 1200


@pytest.fixture
def captured(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    seen: dict[str, Any] = {}
    recorded = SimpleNamespace(
        shortage=None,
        rate=7,
        seconds=1.5,
        captures=1,
        plan=SimpleNamespace(rate=Fraction(2_000_000), frames=1),
        analyser=SimpleNamespace(name="Sniffer"),
        seen=SimpleNamespace(unseen=0, records=[None]),
        to_json=lambda: {"seconds": 1.5},
    )
    seen["recorded"] = recorded

    def by_port(
        output: Path, port: str, schedule: Any, seconds: Any, looking: Any, progress: Any, second: Any
    ) -> Any:
        assert second is None
        seen["asked"] = (output, port, schedule, seconds)
        seen["looking"] = looking
        return recorded

    def by_sigrok(output: Path, driver: str, schedule: Any, seconds: Any, looking: Any) -> Any:
        seen["asked"] = (output, driver, schedule, seconds)
        return recorded

    stand_in(monkeypatch, capture, "capture", by_port)
    stand_in(monkeypatch, capture, "capture_by_sigrok", by_sigrok)
    stand_in(monkeypatch, "servogen.programs", "read_schedule", lambda path: f"schedule {path}")
    return seen


MEASURE = "next: servogen measure a.vcd"


def test_a_capture_without_options_has_the_documented_defaults(run: Run, captured: dict[str, Any]) -> None:
    """docs/bench.md: a million samples a second, compressed, several captures joined."""
    ran = run("capture", "-o", "a.vcd", "-p", "x")
    assert (ran.code, ran.out) == (0, f"a.vcd: 1.5 s at 2000000 samples a second from Sniffer\n{MEASURE}\n")
    assert captured["asked"] == (Path("a.vcd"), "x", None, None)
    looking = captured["looking"]
    assert (looking.rate, looking.rle, looking.memory) == (1_000_000, True, None)
    assert (looking.trigger, looking.wire, looking.stitch) == (None, (), True)


def test_the_options_of_a_capture_reach_it(run: Run, captured: dict[str, Any]) -> None:
    words = ("--rate", 500, "--no-rle", "--memory", 99, "--trigger", "RB1", "--wire", "0=RB3", "--no-stitch")
    ran = run("capture", "-o", "a.vcd", "-p", "x", *words, "--against", "s.json", "--seconds", 2.5)
    assert ran.out.splitlines()[1:] == ["next: servogen verify a.vcd --against s.json"]
    assert captured["asked"] == (Path("a.vcd"), "x", "schedule s.json", 2.5)
    looking = captured["looking"]
    assert (looking.rate, looking.rle, looking.memory, looking.trigger) == (500, False, 99, "RB1")
    assert (list(looking.wire), looking.stitch) == (["0=RB3"], False)


@pytest.mark.parametrize("way", [("-p", "x"), ("--sigrok", "fx2lafw")])
def test_a_capture_as_json_is_alone(run: Run, captured: dict[str, Any], way: tuple[str, str]) -> None:
    shown = run("capture", "-o", "a.vcd", *way, "--against", "s.json", "--json")
    assert json.loads(shown.out) == {"diagnostics": [], "seconds": 1.5}
    assert captured["asked"] == (Path("a.vcd"), way[1], "schedule s.json", None)
    plain = run("capture", "-o", "a.vcd", "--sigrok", "fx2lafw", "--rate", 7).out
    assert plain == f"a.vcd: 1.5 s at 7 samples a second\n{MEASURE}\n"


@pytest.mark.parametrize(
    ("unseen", "words", "warned"), [(0, (), False), (2, (), True), (2, ("--seconds", 1), False)]
)
def test_frames_that_a_loop_did_not_show_are_warned_of(
    run: Run, captured: dict[str, Any], unseen: int, words: tuple[object, ...], warned: bool
) -> None:
    captured["recorded"].seen.unseen = unseen
    ran = run("capture", "-o", "a.vcd", "-p", "x", *words)
    text = "2 of the loop's different frames were not seen whole in 1 captures"
    assert (text in ran.err, ran.code) == (warned, 0)


def test_several_captures_say_how_much_one_holds(run: Run, captured: dict[str, Any]) -> None:
    captured["recorded"].captures = 2
    ran = run("capture", "-o", "a.vcd", "-p", "x")
    stitched = "stitched from 2 captures, because one holds 1 frame; the time between two is not known"
    assert ran.out.splitlines()[1:] == [stitched, MEASURE]


def test_a_capture_needs_an_analyser(run: Run, captured: dict[str, Any]) -> None:
    ran = run("capture", "-o", "a.vcd")
    assert (ran.code, "no analyser is given" in ran.err, "asked" in captured) == (2, True, False)
