"""`servogen verify` of files: what they show, whether they were sampled often enough, and to their end.

The pulses are made here from lab 8's task (three positions of RB0: 1167, 1500 and 1833 µs, 10 s) as an
analyser of any rate sees them; nothing is compared with what servogen simulates.
"""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from servogen.programs import read_schedule
from tests.campaigns import sampled

Run = Callable[..., Any]

ROOT = Path(__file__).parents[2]
LAB8 = ROOT / "firmware" / "lab8-exercise"
SCHEDULE = LAB8 / "schedule.json"
PERIOD = 20_000
AGREES = "agrees as far as it was seen"
EXACT = "exact as far as it was seen"

Pulses = list[tuple[float, float]]
"""(rise, fall) in µs."""


def lab8(frames: int = 1000, phase_us: float = 3456.7) -> Pulses:
    """The loop's pulses from its first frame on, `phase_us` after the capture's beginning."""
    loop = [run.pulses[0] for run in read_schedule(SCHEDULE).loop for _ in range(run.frames)]
    made = []
    for frame in range(frames):
        pulse = loop[frame % len(loop)]
        assert pulse is not None
        rise = phase_us + frame * PERIOD
        made.append((rise, rise + pulse.width))
    return made


def samples(pulses: Pulses, rate: int) -> list[tuple[int, int]]:
    """(sample, level) of the changes that an analyser sees: each at the first sample behind the edge."""
    found: list[tuple[int, int]] = []
    for rise, fall in pulses:
        one, other = (int(-(-us * rate // 1_000_000)) for us in (rise, fall))
        found += [(one, 1), (other, 0)] if one < other else []
    return found


def sr(path: Path, pulses: Pulses, seconds: float, rate: int) -> Path:
    level = np.zeros(int(seconds * rate), dtype=np.uint8)
    for (rise, _), (fall, _) in zip(*(iter(samples(pulses, rate)),) * 2, strict=True):
        level[rise:fall] = 1
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("version", "2")
        archive.writestr(
            "metadata", f"[device 1]\nsamplerate={rate} Hz\nunitsize=1\nprobe1=RB0\ncapturefile=logic-1\n"
        )
        archive.writestr("logic-1-1", level.tobytes())
    return path


def _vcd(path: Path, pulses: Pulses, seconds: float, rate: int, comment: str) -> Path:
    """Times in nanoseconds, rounded, as sigrok writes them."""
    lines = [f"$comment {comment} $end", "$timescale 1 ns $end", "$var wire 1 ! RB0 $end"]
    lines += ["$enddefinitions $end", "#0", "0!"]
    for sample, level in samples(pulses, rate):
        if sample < seconds * rate:
            lines += [f"#{round(sample * 1e9 / rate)}", f"{level}!"]
    path.write_text("\n".join([*lines, f"#{round(seconds * 1e9)}", ""]))
    return path


def vcd(path: Path, pulses: Pulses, seconds: float, rate: int) -> Path:
    hz = f"{rate / 1e6:g} MHz" if rate >= 1e6 else f"{rate / 1e3:g} kHz"
    return _vcd(path.with_suffix(".vcd"), pulses, seconds, rate, f"Acquisition with 1/8 channels at {hz}")


def silent_vcd(path: Path, pulses: Pulses, seconds: float, rate: int) -> Path:
    return _vcd(path.with_suffix(".vcd"), pulses, seconds, rate, "of a program that tells no rate")


def csv(path: Path, pulses: Pulses, seconds: float, rate: int) -> Path:
    rows = ["Time [s],RB0", "0.000000000,0"]
    rows += [f"{n / rate:.9f},{level}" for n, level in samples(pulses, rate) if n < seconds * rate]
    (path := path.with_suffix(".csv")).write_text("\n".join([*rows, ""]))
    return path


Writer = Callable[[Path, Pulses, float, int], Path]
FORMATS: list[Writer] = [sr, vcd, silent_vcd, csv]
formats = pytest.mark.parametrize("write", FORMATS, ids=lambda each: each.__name__)


@formats
def test_a_loop_of_which_one_position_was_seen_is_not_proven(run: Run, tmp_path: Path, write: Writer) -> None:
    file = write(tmp_path / "cut.sr", lab8(9), 0.07, 1_000_000)
    ran = run("verify", file, "--against", SCHEDULE)
    assert (ran.code, ran.err) == (1, "")
    assert ran.out.startswith(f"{AGREES}: 1 of 3 different frames; ")
    assert "- 2 different frames of the schedule were not seen whole" in ran.out
    ran = run("verify", file, "--against", SCHEDULE, "--partial")
    assert ran.code == 0
    data = json.loads(run("verify", file, "--against", SCHEDULE, "--json").out)
    assert (data["agrees"], data["verdict"]) == (False, AGREES)
    assert (data["different_frames_seen"], data["different_frames"]) == (1, 3)


@formats
def test_the_whole_loop_is_proven(run: Run, tmp_path: Path, write: Writer) -> None:
    file = write(tmp_path / "whole.sr", lab8(), 10.05, 1_000_000)
    ran = run("verify", file, "--against", SCHEDULE)
    assert ran.code == 0, ran.out
    assert ran.out.startswith("agrees: ")
    assert "of the loop's 3 different frames 3 were seen whole" in ran.out


@formats
def test_what_was_seen_and_is_wrong_is_wrong_however_little_it_was(
    run: Run, tmp_path: Path, write: Writer
) -> None:
    wrong = [(rise, fall + 43) for rise, fall in lab8(9)]  # 1210 µs where 1167 are scheduled
    file = write(tmp_path / "cut.sr", wrong, 0.07, 1_000_000)
    ran = run("verify", file, "--against", SCHEDULE, "--partial")
    assert ran.code == 1
    assert ran.out.startswith("does NOT agree: ")


@formats
@pytest.mark.parametrize("rate", sampled([1000, 3000, 20_000, 96_000], 2))
@pytest.mark.parametrize("width", [600, 1000, 1500, 1900])
def test_too_slow_a_capture_is_refused_with_the_rate_that_is_needed(
    run: Run, tmp_path: Path, write: Writer, rate: int, width: int
) -> None:
    pulses = [(rise, rise + width) for rise, _ in lab8(60)]
    file = write(tmp_path / "slow.sr", pulses, 1.1, rate)
    ran = run("verify", file, "--against", SCHEDULE)
    assert (ran.code, ran.out) == (2, "")
    assert f"{file}: " in ran.err
    assert "at least 100 kHz is needed" in ran.err
    if write in (sr, vcd):
        assert f"sampled every {1e6 / rate:g} µs ({rate / 1000:g} kHz)" in ran.err


@pytest.mark.parametrize("write", [sr, vcd], ids=["sr", "vcd"])
def test_the_slowest_rate_that_is_allowed(run: Run, tmp_path: Path, write: Writer) -> None:
    """Ten microseconds are the shortest pulse or gap that counts."""
    file = write(tmp_path / "slow.sr", lab8(), 10.05, 100_000)
    ran = run("verify", file, "--against", SCHEDULE)
    assert ran.code == 0, ran.out
    assert "a sample every 10 µs" in ran.out
    file = write(tmp_path / "slower.sr", lab8(), 10.05, 99_999)
    assert run("verify", file, "--against", SCHEDULE).code == 2


def test_a_time_step_that_is_too_long_is_too_slow_whatever_the_file_says(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "a.vcd"
    head = "$comment Acquisition with 1/8 channels at 1 MHz $end\n$timescale 1 ms $end\n"
    head += "$var wire 1 ! RB0 $end\n$enddefinitions $end\n#0\n0!\n"
    file.write_text(head + "".join(f"#{n * 20 + 3}\n1!\n#{n * 20 + 4}\n0!\n" for n in range(99)))
    ran = run("verify", file, "--against", SCHEDULE)
    assert ran.code == 2
    assert "sampled every 1000 µs (1 kHz), too slow to show anything: at least 100 kHz" in ran.err


@pytest.mark.parametrize("write", [silent_vcd, csv], ids=["vcd", "csv"])
def test_a_rate_that_the_file_does_not_tell_can_be_said(run: Run, tmp_path: Path, write: Writer) -> None:
    """Pulses that happen to begin and end at multiples of 500 µs look as if sampled at 2 kHz."""
    text = json.loads(SCHEDULE.read_text())
    round_widths = [(500.0 + n * PERIOD, 2000.0 + n * PERIOD) for n in range(60)]
    for each in text["loop"]:
        each["pulses"] = [[0, 1500]]
    schedule = tmp_path / "schedule.json"
    schedule.write_text(json.dumps(text))
    file = write(tmp_path / "round.sr", round_widths, 1.1, 24_000_000)
    ran = run("verify", file, "--against", schedule)
    assert ran.code == 2
    assert "all its edges are on a grid of every 500 µs (2 kHz): at least 100 kHz is needed" in ran.err
    assert "state the rate: --rate" in ran.err
    ran = run("verify", file, "--against", schedule, "--rate", 24_000_000)
    assert ran.code == 0, ran.out
    assert "a sample every 0.0416667 µs" in ran.out
    assert run("verify", file, "--against", schedule, "--rate", 2000).code == 2


@pytest.mark.parametrize(("step", "code"), [("1 us", 0), ("1 ns", 2)])
def test_a_time_step_is_believed_that_an_analyser_may_sample_with(
    run: Run, tmp_path: Path, step: str, code: int
) -> None:
    """All edges at multiples of 500 µs: each is where it is scheduled; a nanosecond is a unit."""
    text = json.loads(SCHEDULE.read_text())
    for each in text["loop"]:
        each["pulses"] = [[0, 1500]]
    (schedule := tmp_path / "schedule.json").write_text(json.dumps(text))
    unit = 1 if step == "1 us" else 1000
    text = f"$timescale {step} $end\n$var wire 1 ! RB0 $end\n$enddefinitions $end\n#0\n0!\n"
    text += "".join(
        f"#{rise * unit}\n1!\n#{(rise + 1500) * unit}\n0!\n" for rise in range(500, 900_000, 20_000)
    )
    (file := tmp_path / "a.vcd").write_text(f"{text}#{900_000 * unit}\n")
    assert run("verify", file, "--against", schedule).code == code


def test_an_ideal_vcd_on_the_grid_of_a_slow_rate_agrees(run: Run, tmp_path: Path) -> None:
    """The widths of lab 8, 1167, 1500 and 1667 µs, are 7, 9 and 10 samples of 6 kHz, rounded to its 1 µs."""
    width = {**dict.fromkeys(range(100), 1167), **dict.fromkeys(range(100, 350), 1500)}
    rises = [(5000 + 20_000 * frame, width.get(frame % 500, 1667)) for frame in range(510)]

    def written(extra: int) -> Path:
        text = "$timescale 1 us $end\n$var wire 1 ! RB0 $end\n$enddefinitions $end\n#0\n0!\n"
        text += "".join(f"#{rise}\n1!\n#{rise + high + extra}\n0!\n" for rise, high in rises)
        (file := tmp_path / f"{extra}.vcd").write_text(f"{text}#{5000 + 20_000 * 510}\n")
        return file

    ran = run("verify", written(0), "--against", SCHEDULE)
    assert (ran.code, ran.err) == (0, "")
    ran = run("verify", written(2), "--against", SCHEDULE)
    assert (ran.code, ran.err) == (1, "")


def test_a_rate_is_not_said_twice(run: Run, tmp_path: Path) -> None:
    file = vcd(tmp_path / "a.vcd", lab8(9), 0.07, 1_000_000)
    ran = run("verify", file, "--against", SCHEDULE, "--rate", 1_000_000)
    assert ran.code == 2
    assert "contains its sampling rate, 1e+06 Hz" in ran.err
    ran = run("verify", LAB8 / "main.hex", "--against", SCHEDULE, "--rate", 1_000_000)
    assert ran.code == 2
    assert "only a capture has a sampling rate" in ran.err
    ran = run("verify", file, "--against", SCHEDULE, "--seconds", 1)
    assert ran.code == 2
    assert "a capture is always compared to its end" in ran.err


def test_a_report_says_how_much_of_the_loop_its_capture_shows(run: Run, tmp_path: Path) -> None:
    job, page = ROOT / "jobs" / "lab8-exercise.toml", tmp_path / "page.html"
    cut = sr(tmp_path / "cut.sr", lab8(9), 0.07, 1_000_000)
    ran = run("report", job, "-o", page, "--capture", cut)
    assert ran.code == 1
    assert f"{cut}: {AGREES}: 1 of 3 different frames; " in ran.out
    assert f'<span class="badge open">{AGREES}</span>' in page.read_text()
    assert "every edge exact" not in page.read_text()
    ran = run("report", job, "-o", page, "--capture", cut, "--partial", "--json")
    assert ran.code == 0
    data = json.loads(ran.out)
    assert (data["capture"]["agrees"], data["capture"]["verdict"]) == (False, AGREES)
    whole = sr(tmp_path / "whole.sr", lab8(), 10.05, 1_000_000)
    ran = run("report", job, "-o", page, "--capture", whole)
    assert ran.code == 0, ran.out
    slow = sr(tmp_path / "slow.sr", lab8(60), 1.1, 1000)
    page.unlink()
    ran = run("report", job, "-o", page, "--capture", slow)
    assert ran.code == 2
    assert not page.exists()


# Files of edges: what servogen simulate writes, checked to the last edge.

Edge = tuple[int, str, int]


def edges(frames: int, wrong: Callable[[int], int] = lambda frame: 0) -> list[Edge]:
    rows = []
    for frame, (rise, fall) in enumerate(lab8(frames, 20_000)):
        rows += [(int(rise), "RB0", 1), (int(fall) + wrong(frame), "RB0", 0)]
    return rows


def edge_csv(path: Path, rows: list[Edge]) -> Path:
    (path := path.with_suffix(".csv")).write_text(
        "cycle,pin,level\n" + "".join(f"{cycle},{pin},{level}\n" for cycle, pin, level in rows)
    )
    return path


def edge_jsonl(path: Path, rows: list[Edge]) -> Path:
    (path := path.with_suffix(".jsonl")).write_text(
        "".join(json.dumps({"cycle": c, "pin": pin, "level": level}) + "\n" for c, pin, level in rows)
    )
    return path


def edge_vcd(path: Path, rows: list[Edge], quiet: int = 0) -> Path:
    """As `servogen simulate --vcd` writes it, to the end of the last edge's frame and `quiet` frames more."""
    from servogen.edges import PINS, EdgeTrace, edge_chunk
    from servogen.traces import write_edges
    from servogen.units import Clock, Cycles

    columns = zip(*((cycle, PINS.index(pin), level) for cycle, pin, level in rows), strict=True)
    end = Cycles((-(-(rows[-1][0] + 1) // PERIOD) + quiet) * PERIOD)
    path = path.with_suffix(".vcd")
    write_edges(EdgeTrace(Clock(4_000_000), (edge_chunk(*columns),), end), path)
    return path


EdgeWriter = Callable[..., Path]
edge_formats = pytest.mark.parametrize(
    "write", [edge_csv, edge_jsonl, edge_vcd], ids=lambda each: each.__name__
)


@edge_formats
@pytest.mark.parametrize("last", [1499, 1500, 1999])
def test_a_file_of_edges_is_checked_to_its_end(
    run: Run, tmp_path: Path, write: EdgeWriter, last: int
) -> None:
    """Three loops, all that was looked at once, are 1500 frames; one edge of a later frame is late."""
    right = run("verify", write(tmp_path / "right", edges(2000)), "--against", SCHEDULE)
    assert right.code == 0, right.out
    assert "2000 frames (4 repeats of the loop)" in right.out
    wrong = write(tmp_path / "wrong", edges(2000, lambda frame: 5 * (frame == last)))
    ran = run("verify", wrong, "--against", SCHEDULE, "--partial")
    assert ran.code == 1
    assert f"frame {last} (frame {last % 500} of repeat {last // 500} of the loop)" in ran.out


@edge_formats
@pytest.mark.parametrize("at", [20_000 + 1500 * PERIOD + 9000, 20_000 + 1999 * PERIOD + 15_000])
def test_a_pin_that_is_not_scheduled_counts_to_the_end(
    run: Run, tmp_path: Path, write: EdgeWriter, at: int
) -> None:
    rows = sorted([*edges(2000), (at, "RB7", 1)])
    ran = run("verify", write(tmp_path / "stray", rows), "--against", SCHEDULE)
    assert ran.code == 1
    assert f"RB7, which the schedule does not drive, changes 1 time, first at cycle {at}" in ran.out


@edge_formats
def test_pulses_that_go_on_after_a_motion_that_runs_once_count(
    run: Run, tmp_path: Path, write: EdgeWriter
) -> None:
    text = json.loads(SCHEDULE.read_text())
    once = {**text, "lead_in": text["loop"], "loop": [{**text["loop"][0], "frames": 1, "pulses": [None]}]}
    (schedule := tmp_path / "once.json").write_text(json.dumps(once))
    more = {"quiet": 1} if write is edge_vcd else {}  # the last frame of all, without a pulse
    right = run("verify", write(tmp_path / "right", edges(500), **more), "--against", schedule)
    assert right.code == 0, right.out
    again = [(cycle + 1200 * PERIOD, pin, level) for cycle, pin, level in edges(1)]
    ran = run("verify", write(tmp_path / "again", [*edges(500), *again]), "--against", schedule)
    assert ran.code == 1
    assert f"cycle {20_000 + 1200 * PERIOD}" in ran.out


@edge_formats
def test_a_file_with_less_than_the_motion_is_exact_as_far_as_it_goes(
    run: Run, tmp_path: Path, write: EdgeWriter
) -> None:
    file = write(tmp_path / "short", edges(90))
    ran = run("verify", file, "--against", SCHEDULE)
    assert ran.code == 1
    assert ran.out.startswith(f"{EXACT}: 1 of 3 different frames; ")
    assert run("verify", file, "--against", SCHEDULE, "--partial").code == 0
    all_kinds = run("verify", write(tmp_path / "kinds", edges(499)), "--against", SCHEDULE)
    assert all_kinds.code == 1
    assert all_kinds.out.startswith(f"{EXACT}: 3 of 3 different frames; ")
    assert "of the motion's 500 frames the last 1 is missing" in all_kinds.out


@pytest.mark.parametrize("write", [edge_csv, edge_jsonl], ids=["csv", "jsonl"])
def test_a_file_that_ends_within_a_frame_is_not_proven(run: Run, tmp_path: Path, write: EdgeWriter) -> None:
    """Whether its program stopped or the file was cut, nobody can tell."""
    ran = run("verify", write(tmp_path / "torn", edges(1700)[:-1]), "--against", SCHEDULE)
    assert ran.code == 1
    assert ran.out.startswith(f"{EXACT}: 3 of 3 different frames; ")


def test_a_shorter_time_that_is_asked_for_is_not_the_whole(run: Run, tmp_path: Path) -> None:
    file = edge_csv(tmp_path / "edges", edges(2000, lambda frame: 5 * (frame == 1200)))
    ran = run("verify", file, "--against", SCHEDULE, "--seconds", 12)
    assert ran.code == 1
    assert ran.out.startswith(f"{EXACT}: 3 of 3 different frames; ")
    assert "the recording continues for 27.9817 s, which were not compared" in ran.out
    assert run("verify", file, "--against", SCHEDULE, "--seconds", 12, "--partial").code == 0
    program = LAB8 / "main.hex"
    ran = run("verify", program, "--against", SCHEDULE, "--seconds", 1)
    assert ran.code == 1
    assert ran.out.startswith(f"{EXACT}: 1 of 3 different frames; ")
    assert run("verify", program, "--against", SCHEDULE, "--seconds", 1, "--partial").code == 0
    assert run("verify", program, "--against", SCHEDULE, "--seconds", 10).code == 0


@pytest.mark.parametrize("options", [[], ["--forever", "--seconds", "5"]])
def test_inputs_that_are_held_while_a_program_runs_are_named(run: Run, options: list[str]) -> None:
    """What the program does at other levels was not seen."""
    folder = ROOT / "firmware" / "hexapod-command"
    asked = ("verify", folder / "main.hex", "--against", folder / "schedule.json", *options)
    text = "commands were not judged: RA4 was held at 1; `servogen prove` covers every level"
    trims = "trims were not judged: the EEPROM held what the file says"
    lines = run(*asked).out.splitlines()
    assert lines[-2] == text and lines[-1].startswith(trims)
    answer = json.loads(run(*asked, "--json").out)
    assert answer["held"] == {"RA4": 1} and [each[:8] for each in answer["not_judged"]] == [
        text[:8],
        trims[:8],
    ]
    plain = ("verify", LAB8 / "main.hex", "--against", SCHEDULE, "--seconds", "1")
    assert "held" not in run(*plain).out
    plain_answer = json.loads(run(*plain, "--json").out)
    assert (plain_answer["held"], plain_answer["not_judged"]) == ({}, [])


def with_button(tmp_path: Path, **rule: object) -> Path:
    """The exercise's schedule with a stop button at RB7, which its program does not have."""
    stop = {"pin": "RB7", "level": rule.pop("level", 0)}
    buttons = {"start": None, "stop": stop, "pulses": "hold", "pressed_frames": 3, **rule}
    inputs = [{"pin": "RB7", "level": 1 - int(str(stop["level"]))}]
    file = tmp_path / "buttons.json"
    file.write_text(json.dumps({**json.loads(SCHEDULE.read_text()), "inputs": inputs, "buttons": buttons}))
    return file


@pytest.mark.parametrize("rule", [{}, {"pressed_frames": 2}, {"pulses": "off"}, {"level": 1}])
def test_a_verdict_on_one_run_says_that_buttons_were_not_judged(
    run: Run, tmp_path: Path, rule: dict[str, object]
) -> None:
    """Whatever the schedule says of a press, one run without any is the same."""
    level = 1 - int(str(rule.get("level", 0)))
    schedule = with_button(tmp_path, **rule)
    ran = run("verify", LAB8 / "main.hex", "--against", schedule)
    assert (ran.code, ran.out[:7]) == (0, "exact: ")
    assert f"buttons were not judged: RB7 was held at {level}; `servogen prove` covers every level" in ran.out


def test_a_verdict_on_a_recording_says_that_buttons_were_not_judged(run: Run, tmp_path: Path) -> None:
    schedule = with_button(tmp_path)
    for file in (edge_csv(tmp_path / "edges", edges(1500)), sr(tmp_path / "run.sr", lab8(20), 0.5, 200_000)):
        ran = run("verify", file, "--against", schedule, "--partial")
        assert "buttons were not judged: edges do not show what came in" in ran.out, ran
        shown = json.loads(run("verify", file, "--against", schedule, "--json").out)
        assert shown["not_judged"] == ["buttons were not judged: edges do not show what came in"]


@pytest.mark.parametrize(
    "against", [SCHEDULE, LAB8, ROOT / "jobs" / "lab8-exercise.toml"], ids=lambda path: path.name
)
def test_a_program_is_compared_with_a_schedule_a_build_or_a_job(run: Run, against: Path) -> None:
    ran = run("verify", LAB8 / "main.hex", "--against", against, "--json")
    assert (ran.code, json.loads(ran.out)["exact"]) == (0, True)
    other = ROOT / "firmware" / "lab9-exercise" / "main.hex"
    assert run("verify", other, "--against", against).code == 1
