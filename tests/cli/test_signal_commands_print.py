"""What verify, measure and plot print, pass on and refuse, of verdicts made by hand."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen import traces, verify
from servogen.errors import Diagnostic
from servogen.pic.image import Image
from servogen.pulse import Channel, Pulse, PulseSchedule, Run
from servogen.report import pulse_plot
from servogen.traces import captures
from servogen.units import Clock, Cycles
from servogen.workflows import measured_schedule, signals, verification
from tests.cli.conftest import Run as Command
from tests.cli.stand_ins import stand_in

SCHEDULE = PulseSchedule(
    Clock(4_000_000),
    Cycles(20_000),
    (Channel("arm", "RB0", ""),),
    (),
    (Run(2, (Pulse(Cycles(0), Cycles(1)),)),),
)
IMAGE = Image({})


def judged(whole: bool = True, partly: bool = True, **others: Any) -> Any:
    """A verdict that is accepted so, with a warning."""
    return SimpleNamespace(
        accepted=lambda partial: partly if partial else whole,
        to_json=lambda: {"exact": whole},
        warnings=(Diagnostic("warning", "w", "a warning"),),
        **others,
    )


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """What the commands ask of the library; seen["verdict"] is its answer."""
    found: dict[str, Any] = {"verdict": judged()}

    def noted(name: str, answer: Callable[[], Any]) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            found[name] = (*given, named) if named else given
            return answer()

        return call

    program = SimpleNamespace(image=IMAGE, listing="listing")
    stand_in(monkeypatch, "servogen.programs", "read_schedule", lambda path: SCHEDULE)
    stand_in(monkeypatch, signals, "program_for", noted("program", lambda: program))
    stand_in(
        monkeypatch,
        verification,
        "judge_image",
        noted("image", lambda: found["verdict"]),
    )
    stand_in(monkeypatch, verification, "judge_file", noted("file", lambda: found["verdict"]))
    stand_in(
        monkeypatch,
        verification,
        "hidden_by",
        lambda file, clock, wires: ("what it hides",) if file.suffix == ".vcd" else (),
    )
    stand_in(monkeypatch, verification, "judge_capture", noted("capture", lambda: found["verdict"]))
    stand_in(monkeypatch, captures, "read_capture", noted("read", lambda: "recorded"))
    stand_in(monkeypatch, captures, "sampled_at", noted("sampled", lambda: "resampled"))
    stand_in(monkeypatch, captures, "is_capture", lambda file: Path(file).suffix == ".sr")
    stand_in(monkeypatch, traces, "read_edges", noted("edges", lambda: "trace"))
    stand_in(monkeypatch, verify, "verdict_lines", lambda verdict: ["line 1", "line 2"])
    stand_in(monkeypatch, verify, "capture_lines", lambda verdict: ["capture 1", "capture 2"])
    forever = SimpleNamespace(
        passed=True, text=lambda: "it repeats", verdict=judged(), to_json=lambda: {"forever": True}
    )
    found["forever_answer"] = forever
    stand_in(monkeypatch, verification, "judge_forever", noted("forever", lambda: forever))
    monkeypatch.chdir(tmp_path)
    return found


@pytest.mark.parametrize(
    ("whole", "partly", "option", "code"),
    [
        (True, True, (), 0),
        (False, True, (), 1),
        (False, True, ("--partial",), 0),
        (False, False, ("--partial",), 1),
    ],
)
@pytest.mark.parametrize(("file", "lines"), [("a.hex", "line"), ("a.csv", "line"), ("a.sr", "capture")])
def test_the_exit_code_of_verify_is_its_verdict(
    run: Command,
    seen: dict[str, Any],
    whole: bool,
    partly: bool,
    option: tuple[str, ...],
    code: int,
    file: str,
    lines: str,
) -> None:
    seen["verdict"] = judged(whole, partly)
    ran = run("verify", file, "--against", "s.json", *option)
    assert (ran.code, ran.out) == (code, f"{lines} 1\n{lines} 2\n")
    shown = run("verify", file, "--against", "s.json", *option, "--json")
    found = json.loads(shown.out)
    assert (shown.code, found["exact"]) == (code, whole)
    assert len(found["diagnostics"]) == (0 if lines == "capture" else 1)


def test_a_program_is_compared_for_the_time_that_is_given(run: Command, seen: dict[str, Any]) -> None:
    """0.1 s are 100,000 cycles of a microsecond; without a time the motion three times."""
    run("verify", "a.hex", "--against", "s.json")
    schedule, image, span, listing, board = seen["image"]
    assert (schedule, image, span, listing, board.device) == (SCHEDULE, IMAGE, None, "listing", "PIC16F84")
    run("verify", "a.hex", "--against", "s.json", "--seconds", 0.1, "--device", "PIC16F84A")
    assert seen["image"][2] == 100_000
    assert seen["image"][4].device == "PIC16F84A"
    run("verify", "a.vcd", "--against", "s.json", "--seconds", 0.1)
    assert seen["file"] == (SCHEDULE, "trace", True, 100_000, ("what it hides",))
    run("verify", "a.csv", "--against", "s.json")
    assert seen["file"] == (SCHEDULE, "trace", False, None, ())


@pytest.mark.parametrize(("seconds", "code"), [(0.02, 0), (0.0199, 2), (0, 2)])
def test_less_than_a_frame_proves_nothing(
    run: Command, seen: dict[str, Any], seconds: float, code: int
) -> None:
    ran = run("verify", "a.hex", "--against", "s.json", "--seconds", seconds)
    assert ran.code == code
    refused = f"--seconds {seconds:g} is less than one frame of 20000 cycles: nothing is compared"
    assert (refused in ran.err) == (code == 2)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("a.sr", "--seconds", 1), "a capture is always compared to its end"),
        (("a.hex", "--rate", 5), "only a capture has a sampling rate"),
        (("a.csv", "--rate", 5), "only a capture has a sampling rate"),
        (("a.csv", "--device", "PIC16F84"), "a.csv"),
        (("a.csv", "--floating", 1), "a.csv"),
        (("a.sr", "--power-up"), "a.sr"),
    ],
)
def test_options_that_a_file_cannot_have_are_refused(
    run: Command, seen: dict[str, Any], words: tuple[object, ...], message: str
) -> None:
    ran = run("verify", *words, "--against", "s.json")
    assert (ran.code, ran.out) == (2, "")
    assert message in ran.err
    assert not {"image", "file", "capture", "forever"} & seen.keys()


def test_a_capture_is_resampled_only_if_a_rate_is_given(run: Command, seen: dict[str, Any]) -> None:
    run("verify", "a.sr", "--against", "s.json")
    assert seen["capture"] == (SCHEDULE, "recorded")
    run("verify", "a.sr", "--against", "s.json", "--rate", 5000)
    assert (seen["capture"], seen["sampled"]) == ((SCHEDULE, "resampled"), ("recorded", 5000))


@pytest.mark.parametrize(("exact", "code"), [(True, 0), (False, 1)])
def test_a_repeat_is_looked_for_in_three_hours_or_the_time_given(
    run: Command, seen: dict[str, Any], exact: bool, code: int
) -> None:
    """Three hours are 10,800 s of a million cycles."""
    seen["forever_answer"].passed = exact
    ran = run("verify", "a.hex", "--against", "s.json", "--forever")
    assert (ran.code, ran.out) == (code, "it repeats\nline 1\nline 2\n")
    schedule, image, limit, listing, board = seen["forever"]
    assert (schedule, image, limit, listing) == (SCHEDULE, IMAGE, 10_800_000_000, "listing")
    assert board.device == "PIC16F84"
    shown = run("verify", "a.hex", "--against", "s.json", "--forever", "--seconds", 0.5, "--json")
    assert (shown.code, json.loads(shown.out)["forever"]) == (code, True)
    assert len(json.loads(shown.out)["diagnostics"]) == 1
    assert seen["forever"][2] == 500_000


@pytest.fixture
def measuring(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """`measure` and `plot` see this trace."""
    found: dict[str, Any] = {"warnings": (Diagnostic("warning", "w", "odd"),)}
    trace = SimpleNamespace(end=Cycles(777))
    trace.stored = lambda: found.setdefault("stored", SimpleNamespace(end=trace.end))

    def edges(*given: Any) -> Any:
        found["asked"] = given
        return trace

    def read(file: Path, device: str | None) -> Any:
        found["read"] = (file, device)
        return SimpleNamespace(device=found.get("built_for"))

    def scheduled(*given: Any) -> Any:
        found["scheduled"] = given
        return trace

    def written(trace: Any, file: str, servos: Any, device: Any) -> Any:
        found["written"] = (trace is found.get("stored"), file, dict(servos), device)
        return SimpleNamespace(json_text=lambda: "{}\n")

    def drawn(trace: Any, span: Any, output: Path, title: str, schedule: Any) -> None:
        found["drawn"] = (span, output, title, schedule)

    stand_in(monkeypatch, signals, "unscheduled_edges", edges)
    stand_in(monkeypatch, signals, "scheduled_edges", scheduled)
    stand_in(monkeypatch, signals, "measured_warnings", lambda measurement, models: found["warnings"])
    stand_in(monkeypatch, verify, "measure", lambda trace: SimpleNamespace(to_json=lambda: {"pins": 1}))
    stand_in(monkeypatch, verify, "measurement_lines", lambda measurement: ["line 1", "line 2"])
    stand_in(monkeypatch, measured_schedule, "measured_schedule", written)
    stand_in(monkeypatch, pulse_plot, "pulse_plot", drawn)
    stand_in(monkeypatch, "servogen.programs", "read_schedule", lambda path: SCHEDULE)
    stand_in(monkeypatch, "servogen.cli.files", "read_program", read)
    stand_in(monkeypatch, verification, "motion_cycles", lambda schedule: Cycles(40_000))
    monkeypatch.chdir(tmp_path)
    return found


def test_measure_prints_its_lines_then_its_file_then_its_warnings(
    run: Command, measuring: dict[str, Any]
) -> None:
    ran = run("measure", "a.hex")
    assert (ran.code, ran.out) == (0, "line 1\nline 2\n")
    assert ran.err.startswith("1 warning:\n")
    file, program, seconds, clock_hz, board, *_ = measuring["asked"]
    assert (file, seconds, clock_hz, board.device) == (Path("a.hex"), None, None, "PIC16F84")
    assert (program is not None, measuring["read"]) == (True, (Path("a.hex"), None))
    assert "written" not in measuring
    ran = run(
        "measure", "a.hex", "--schedule", "s.json", "--servo", "RB0=futaba-s3001", "--device", "PIC16F84A"
    )
    shown = "line 1\nline 2\nnext: servogen prove a.hex --against s.json\n"
    assert (ran.out, Path("s.json").read_text()) == (shown, "{}\n")
    assert measuring["written"] == (True, "a.hex", {"RB0": "futaba-s3001"}, "PIC16F84A")
    assert (measuring["asked"][4].device, measuring["read"][1]) == ("PIC16F84A", "PIC16F84A")
    shown = run("measure", "a.hex", "--seconds", 2, "--clock-hz", 8_000_000, "--json")
    found = json.loads(shown.out)
    assert (found["pins"], shown.err, len(found["diagnostics"])) == (1, "", 1)
    assert measuring["asked"][2:4] == (2.0, 8_000_000)


def test_a_program_that_was_built_for_a_chip_is_measured_on_it_unless_another_is_named(
    run: Command, measuring: dict[str, Any]
) -> None:
    """And the schedule of its pulses is one for that chip."""
    measuring["built_for"] = "PIC16F84A"
    for command in (("measure",), ("plot", "-o", "a.png")):
        for words, chip in (((), "PIC16F84A"), (("--device", "PIC16F84"), "PIC16F84")):
            assert run(*command, "a.hex", *words).code == 0
            assert measuring["asked"][4].device == chip
    assert run("measure", "a.hex", "--schedule", "s.json").code == 0
    assert measuring["written"][3] == "PIC16F84A"
    assert run("measure", "a.csv", "--schedule", "s.json").code == 0
    assert (measuring["asked"][1], measuring["written"][3]) == (None, None)


@pytest.mark.parametrize("command", [("measure",), ("plot", "-o", "a.png")])
@pytest.mark.parametrize("option", [("--device", "PIC16F84"), ("--floating", 1)])
def test_edges_have_no_chip(
    run: Command, measuring: dict[str, Any], command: tuple[str, ...], option: tuple[object, ...]
) -> None:
    ran = run(*command, "a.csv", *option)
    assert (ran.code, "asked" in measuring, "drawn" in measuring) == (2, False, False)
    assert run(*command, "a.csv").code == 0


def test_plot_draws_the_trace_or_the_motion_once(run: Command, measuring: dict[str, Any]) -> None:
    ran = run("plot", "folder/a.hex", "-o", "a.png")
    assert (ran.code, ran.out) == (0, "a.png: pulses of folder/a.hex\nnext: servogen measure folder/a.hex\n")
    title = "folder/a.hex: pulses from the first edge on"
    assert measuring["drawn"] == (777, Path("a.png"), title, None)
    run("plot", "x/folder/a.hex", "-o", "a.png", "--against", "s.json")
    assert measuring["drawn"] == (40_000, Path("a.png"), title, SCHEDULE)
    file, schedule, span, board, *_ = measuring["scheduled"]
    assert (file, schedule, span) == (Path("x/folder/a.hex"), SCHEDULE, 40_000)
    assert board.device == "PIC16F84"
    run("plot", "a.hex", "-o", "a.png", "--against", "s.json", "--seconds", 0.5)
    assert measuring["drawn"][:3] == (500_000, Path("a.png"), "a.hex: pulses from the first edge on")
    both = run("plot", "a.hex", "-o", "a.png", "--against", "s.json", "--clock-hz", 4_000_000)
    assert (both.code, "the clock is that of the schedule" in both.err) == (2, True)
    assert run("plot", "a.hex", "-o", "a.png", "--clock-hz", 8_000_000).code == 0
    assert measuring["asked"][3] == 8_000_000
