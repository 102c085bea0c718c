"""simulate, verify, measure, plot and the language commands, on small programs and on the lab exercise."""

import csv
import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from sys import executable
from typing import Any

import pytest

Run = Callable[..., Any]

ROOT = Path(__file__).parent.parent.parent

SQUARE = """\
    list p=16f84
    include <p16f84.inc>
    org 0
    clrf PORTB
    bsf STATUS, RP0
    clrf PORTB          ; TRISB
    bcf STATUS, RP0
again
    bsf PORTB, 0
    nop
    bcf PORTB, 0
    goto again
    end
"""
"""By the data sheet's cycles: RB0 rises in cycle 4, falls in 6, rises again in 9 (GOTO takes two)."""


@pytest.fixture
def square(run: Run, tmp_path: Path) -> Path:
    source = tmp_path / "square.asm"
    source.write_text(SQUARE)
    assert run("assemble", source, "-o", tmp_path / "square.hex").code == 0
    return tmp_path / "square.hex"


def test_what_a_program_is_warned_of_is_in_the_json_too(run: Run, tmp_path: Path) -> None:
    """An erased word is 0x3FFF; 0xFFFF has two bits more than the chip."""
    program = tmp_path / "wide.hex"
    program.write_text(":02000000FFFF00\n:00000001FF\n")
    ran = run("simulate", program, "--cycles", 10, "--json")
    found = json.loads(ran.out)["diagnostics"][0]  # the others are of the run
    assert (found["code"], found["line"]) == ("hex-word", 1)
    assert found["message"] in ran.err


@pytest.mark.parametrize(
    "words",
    [
        ("assemble", "{source}", "-o", "{source}"),
        ("disassemble", "{hex}", "-o", "{hex}"),
        ("simulate", "{hex}", "--edges", "{hex}"),
        ("simulate", "{hex}", "--stimulus", "{other}", "--vcd", "{other}"),
        ("simulate", "{hex}", "--edges", "{new}", "--vcd", "{new}"),
        ("measure", "{hex}", "--schedule", "{hex}"),
        ("plot", "{hex}", "-o", "{hex}"),
        ("plot", "{hex}", "--against", "{other}", "-o", "{other}"),
        ("plot", "{hex}", "--against", "{other}", "-o", "{hex}"),
        ("prove", "{hex}", "--against", "{other}", "--counterexample", "{hex}"),
        ("grade", "{other}", "{hex}", "--csv", "{hex}"),
        ("twin", "{other}", "--hex", "{hex}", "--csv", "{hex}"),
    ],
)
def test_no_output_takes_the_place_of_what_is_read(
    run: Run, square: Path, tmp_path: Path, words: tuple[str, ...]
) -> None:
    """Not even if what is read is not what it should be: nothing is written then."""
    other = tmp_path / "other.toml"
    other.write_text("[other]\n")
    files = {"source": tmp_path / "square.asm", "hex": square, "other": other, "new": tmp_path / "new.vcd"}
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    ran = run(*(word.format_map(files) for word in words))
    assert ran.code == 2
    assert "[output-exists]" in ran.err
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_an_edge_is_at_the_cycle_in_which_the_port_was_written(
    run: Run, square: Path, tmp_path: Path
) -> None:
    assert run("simulate", square, "--cycles", 14, "--edges", tmp_path / "edges.csv").code == 0
    with (tmp_path / "edges.csv").open() as file:
        rows = [tuple(row.values()) for row in csv.DictReader(file)]
    assert rows == [("4", "RB0", "1"), ("6", "RB0", "0"), ("9", "RB0", "1"), ("11", "RB0", "0")]


def test_the_json_of_a_simulation_has_the_machine_in_it(run: Run, square: Path) -> None:
    state = json.loads(run("simulate", square, "--cycles", 14, "--json").out)
    assert (state["cycles"], state["pc"], state["edges"], state["stack_wraps"]) == (14, 4, 4, 0)
    assert len(state["ram"]) == 68
    assert {"w", "status", "resets"} <= set(state)


def test_seconds_and_cycles_are_one_thing(run: Run, square: Path) -> None:
    one = json.loads(run("simulate", square, "--seconds", 0.25, "--clock-hz", 8_000_000, "--json").out)
    assert one["cycles"] == 500_000
    assert run("simulate", square, "--seconds", 1, "--cycles", 1).code == 2


def test_disassembling_and_assembling_gives_the_same_hex(run: Run, square: Path, tmp_path: Path) -> None:
    assert run("disassemble", square, "-o", tmp_path / "again.asm").code == 0
    assert run("assemble", tmp_path / "again.asm", "-o", tmp_path / "again.hex").code == 0
    assert (tmp_path / "again.hex").read_text() == square.read_text()


def test_c_and_assembly_run_without_a_hex_file(run: Run, square: Path, tmp_path: Path) -> None:
    by_hex = json.loads(run("simulate", square, "--cycles", 100, "--json").out)
    by_source = json.loads(run("simulate", tmp_path / "square.asm", "--cycles", 100, "--json").out)
    assert by_hex == by_source


def test_a_stimulus_reaches_the_pins(run: Run, tmp_path: Path) -> None:
    (tmp_path / "copy.asm").write_text(
        SQUARE.replace("clrf PORTB          ;", "movlw 2\n    movwf PORTB         ;").replace(
            "bsf PORTB, 0\n    nop\n    bcf PORTB, 0",
            "btfsc PORTB, 1\n    bsf PORTB, 0\n    btfss PORTB, 1\n    bcf PORTB, 0",
        )
    )
    (tmp_path / "in.toml").write_text('[[level]]\npin = "RB1"\nat_us = [0, 500]\nlevel = [1, 0]\n')
    edges = tmp_path / "edges.csv"
    ran = run(
        "simulate",
        tmp_path / "copy.asm",
        "--cycles",
        1000,
        "--stimulus",
        tmp_path / "in.toml",
        "--edges",
        edges,
        "--vcd",
        tmp_path / "edges.vcd",
    )
    assert ran.code == 0
    rows = [line.split(",") for line in edges.read_text().split()[1:]]
    assert [row for row in rows if row[1] == "RB1"] == [["500", "RB1", "L"]]
    assert "inRB1" in (tmp_path / "edges.vcd").read_text()
    at = [int(cycle) for cycle, pin, _ in rows if pin == "RB0"]
    assert at[0] < 20 and 500 <= at[1] < 520 and len(at) == 2


def test_a_trace_names_every_instruction_and_its_line(run: Run, square: Path, tmp_path: Path) -> None:
    assert run("simulate", tmp_path / "square.asm", "--cycles", 9, "--trace", tmp_path / "t.txt").code == 0
    lines = (tmp_path / "t.txt").read_text().splitlines()
    assert [line.split()[0] for line in lines] == ["0", "1", "2", "3", "4", "5", "6", "7"]
    assert "square.asm:9" in lines[4]


def test_a_profile_adds_up(run: Run, square: Path, tmp_path: Path) -> None:
    answer = json.loads(run("simulate", tmp_path / "square.asm", "--cycles", 1004, "--profile", "--json").out)
    profile = answer["profile"]
    assert sum(line["cycles"] for line in profile["lines"]) == profile["cycles"] == 1004
    assert profile["coverage"] == 1


def test_verify_takes_every_kind_of_file_that_a_build_makes(run: Run, lab8: Path) -> None:
    for name in ("main.hex", "main.xc8.hex", "main.c2c.c", "main.xc8.c", "edges.csv", "main.vcd"):
        ran = run("verify", lab8 / name, "--against", lab8 / "schedule.json")
        assert ran.code == 0 and ran.out.startswith("exact"), (name, ran)


def test_verify_says_no_to_another_jobs_hex_with_exit_code_1(run: Run, square: Path, lab8: Path) -> None:
    ran = run("verify", square, "--against", lab8 / "schedule.json", "--json")
    assert ran.code == 1
    assert json.loads(ran.out)["exact"] is False


def test_a_torn_edge_file_is_not_proven(run: Run, lab8: Path, tmp_path: Path) -> None:
    rows = (lab8 / "edges.csv").read_text().splitlines(keepends=True)
    (tmp_path / "torn.csv").write_text("".join(rows[:800]))
    ran = run("verify", tmp_path / "torn.csv", "--against", lab8 / "schedule.json")
    assert ran.code == 1 and "missing" in ran.out


def test_an_edge_file_of_one_round_is_held_to_one_round(run: Run, lab8: Path, tmp_path: Path) -> None:
    rows = (lab8 / "edges.csv").read_text().splitlines(keepends=True)
    (tmp_path / "one.csv").write_text("".join(rows[: 1 + 2 * 500]))
    ran = run("verify", tmp_path / "one.csv", "--against", lab8 / "schedule.json")
    assert ran.code == 0 and "500 frames" in ran.out


def test_the_exercise_is_proven_for_all_time(run: Run, lab8: Path) -> None:
    ran = run("verify", lab8 / "main.hex", "--against", lab8 / "schedule.json", "--forever")
    assert ran.code == 0
    assert ran.out.startswith("exact for all time from this start: lead-in ")
    assert "loop 500 frames" in ran.out


def test_edges_cannot_be_proven_for_all_time(run: Run, lab8: Path) -> None:
    ran = run("verify", lab8 / "edges.csv", "--against", lab8 / "schedule.json", "--forever")
    assert ran.code == 2 and "only a program has a state that repeats for all time, not edges" in ran.err


def test_a_repeat_beyond_reach_is_no_proof_and_says_what_was_covered(run: Run, lab8: Path) -> None:
    ran = run("verify", lab8 / "main.hex", "--against", lab8 / "schedule.json", "--forever", "--seconds", 5)
    assert ran.code == 1
    assert "NOT exact for all time" in ran.out and "covered" in ran.out


def test_measuring_the_printed_programs(run: Run) -> None:
    """1 ms and 2 ms and the statements; lab 9: 500 us, 43 ms, and 150 us between its frames."""
    labs = ROOT / "tests" / "labs"
    first = json.loads(run("measure", labs / "servo.c", "--servo", "futaba-s3001", "--json").out)
    widths = [row["cycles"] for row in first["pins"][0]["widths"]]
    assert len(widths) == 2
    assert 1000 <= widths[0] < 1010 and 2000 <= widths[1] < 2010
    second = run("measure", labs / "PICIOR.c", "--servo", "mpx-tiny-s")
    assert "frames differ by 150 µs" in second.out
    assert "outside the servo's 1250 µs to 1750 µs" in second.err
    assert "outside 18 to 20 ms" in second.err


def test_the_printed_programs_are_small(run: Run, tmp_path: Path) -> None:
    for name, most in (("servo.c", 96), ("PICIOR.c", 128)):
        ran = run("compile", ROOT / "tests" / "labs" / name, "-o", tmp_path / "out.hex", "--json")
        assert json.loads(ran.out)["words"] <= most


def test_a_picture_is_drawn_and_another_ending_refused(run: Run, lab8: Path, tmp_path: Path) -> None:
    schedule = lab8 / "schedule.json"
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        assert (
            run("plot", lab8 / "main.hex", "--against", schedule, "-o", tmp_path / folder / "p.png").code == 0
        )
    one, two = ((tmp_path / folder / "p.png").read_bytes() for folder in ("one", "two"))
    assert one.startswith(b"\x89PNG") and one == two
    assert run("plot", lab8 / "main.hex", "--against", schedule, "-o", tmp_path / "p.doc").code == 2


def test_a_picture_of_a_program_needs_no_schedule(run: Run, lab8: Path, tmp_path: Path) -> None:
    printed = ROOT / "tests" / "labs" / "servo.c"
    assert run("plot", printed, "-o", tmp_path / "p.png").code == 0
    assert run("plot", lab8 / "edges.csv", "-o", tmp_path / "q.svg", "--seconds", 1).code == 0
    assert (tmp_path / "p.png").exists() and "RB0" in (tmp_path / "q.svg").read_text()
    still = tmp_path / "still.c"
    still.write_text("#pragma CLOCK_FREQ 4000000\nmain(void) { while (1) ; }\n")
    refused = run("plot", still, "-o", tmp_path / "r.png")
    assert refused.code == 2 and "no pulses to draw" in refused.err
    assert not (tmp_path / "r.png").exists()


def test_the_clock_of_a_picture_is_said_once(run: Run, lab8: Path, tmp_path: Path) -> None:
    schedule = lab8 / "schedule.json"
    ran = run("plot", lab8 / "main.hex", "--against", schedule, "--clock-hz", 1, "-o", tmp_path / "p.png")
    assert ran.code == 2 and "the clock is that of the schedule" in ran.err


def test_a_proof_of_nothing_is_refused(run: Run, lab8: Path) -> None:
    for seconds in (0, 0.001):
        ran = run("verify", lab8 / "main.hex", "--against", lab8 / "schedule.json", "--seconds", seconds)
        assert ran.code == 2 and "less than one frame" in ran.err


@pytest.mark.parametrize("seconds", ["inf", "nan", "1e300", "-1", "soon"])
def test_a_time_that_is_none_is_refused(run: Run, square: Path, seconds: str) -> None:
    ran = run("simulate", square, "--seconds", seconds)
    assert ran.code == 2 and seconds in ran.err


def test_measuring_c_goes_by_its_own_clock(run: Run, tmp_path: Path) -> None:
    source = tmp_path / "eight.c"
    source.write_text(
        "#pragma CLOCK_FREQ 8000000\n"
        "void main(void) { TRISB = 0; while (1) { PORTB = 1; delay_ms(1); PORTB = 0; delay_ms(18); } }\n"
    )
    answer = json.loads(run("measure", source, "--seconds", 1, "--json").out)
    assert answer["clock_hz"] == 8_000_000
    (width,) = answer["pins"][0]["widths"]
    assert 2000 <= width["cycles"] <= 2002


def test_c_of_another_clock_is_not_held_to_a_schedule(run: Run, lab8: Path, tmp_path: Path) -> None:
    text = (lab8 / "main.c2c.c").read_text()
    (tmp_path / "eight.c").write_text(text.replace("CLOCK_FREQ 4000000", "CLOCK_FREQ 8000000"))
    ran = run("verify", tmp_path / "eight.c", "--against", lab8 / "schedule.json")
    assert ran.code == 2 and "8000000 Hz" in ran.err


@pytest.mark.parametrize(
    "text", ["", "cycle,pin,level\n12,RB0,1\ngarbage\n", "cycle,pin,level\n1,RB0,1\n2,RB", "\0\1\2"]
)
def test_a_defective_edge_file_is_refused_by_measure_and_verify(
    run: Run, lab8: Path, tmp_path: Path, text: str
) -> None:
    (tmp_path / "bad.csv").write_text(text)
    for command in (["measure"], ["verify", "--against", lab8 / "schedule.json"]):
        ran = run(*command, tmp_path / "bad.csv")
        assert ran.code == 2 and "bad.csv" in ran.err, (command, ran)


def test_an_unknown_ending_or_device_is_refused(run: Run, square: Path, lab8: Path, tmp_path: Path) -> None:
    (tmp_path / "x.xyz").write_text("")
    ran = run("verify", tmp_path / "x.xyz", "--against", lab8 / "schedule.json")
    assert ran.code == 2 and ".hex" in ran.err and ".csv" in ran.err
    assert run("simulate", square, "--device", "PIC18F4550").code == 2


RELEASED = """\
[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[[servo]]
name = "arm"
pin = "RA4"
open_drain = true
model = "futaba-s3001"
[motion]
repeat = false
end = "release"
poses = [ { arm_deg = 30, hold_s = 0.2 }, { arm_deg = 60, hold_s = 1 } ]
"""


def test_a_motion_that_ends_is_proven_from_the_files_that_build_writes(run: Run, tmp_path: Path) -> None:
    (tmp_path / "once.toml").write_text(RELEASED)
    assert run("build", tmp_path / "once.toml", "-o", tmp_path / "once").code == 0
    for name in ("main.hex", "edges.csv", "main.vcd"):
        ran = run("verify", tmp_path / "once" / name, "--against", tmp_path / "once" / "schedule.json")
        assert ran.code == 0, (name, ran.out)
    hex_file = tmp_path / "once" / "main.hex"
    assert "no pin has a pulse" in run("measure", hex_file, "--seconds", 2).out
    assert "RA4: 60 pulses" in run("measure", hex_file, "--seconds", 2, "--ra4-pull-up").out


def test_no_output_is_written_over_an_input_or_another_output(run: Run, square: Path, tmp_path: Path) -> None:
    source = tmp_path / "square.asm"
    for command in (
        ["assemble", source, "-o", source],
        ["disassemble", square, "-o", square],
        ["simulate", source, "--trace", source],
        ["simulate", source, "--edges", tmp_path / "same.vcd", "--vcd", tmp_path / "same.vcd"],
    ):
        before = source.read_bytes(), square.read_bytes()
        ran = run(*command)
        assert ran.code == 2 and "another name" in ran.err, command
        assert (source.read_bytes(), square.read_bytes()) == before


def test_c_includes_what_lies_beside_it(run: Run, tmp_path: Path) -> None:
    (tmp_path / "pins.h").write_text("#define LED RB3\n")
    (tmp_path / "led.c").write_text(
        '#include <xc.h>\n#include "pins.h"\nvoid main(void) { TRISB = 0; LED = 1; }\n'
    )
    assert run("compile", tmp_path / "led.c", "-o", tmp_path / "led.hex").code == 0
    (tmp_path / "pins.h").unlink()
    ran = run("compile", tmp_path / "led.c", "-o", tmp_path / "led.hex")
    assert ran.code == 2 and "pins.h" in ran.err


def test_the_size_of_float_is_an_option(run: Run, tmp_path: Path) -> None:
    source = tmp_path / "f.c"
    source.write_text("#include <xc.h>\nfloat x;\nvoid main(void) { x = 1; while (1); }\n")
    for options, size in (((), 3), (("--float", "32"), 4)):
        ran = run("compile", source, "-o", tmp_path / "f.hex", "--json", *options)
        assert ran.code == 0 and json.loads(ran.out)["ram_bytes"] == size
    ran = run("compile", source, "-o", tmp_path / "no.hex", "--float", "16")
    assert ran.code == 2 and "24 or 32 bits, not 16" in ran.err
    assert not (tmp_path / "no.hex").exists()


def test_a_reader_that_goes_away_is_no_error(tmp_path: Path) -> None:
    """As `servogen --help | head`: quiet, and not the code of a verdict."""
    code = "from servogen.cli import main; main()"
    reading, writing = os.pipe()
    os.close(reading)
    ran = subprocess.run([executable, "-c", code, "--help"], stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert (ran.returncode, ran.stderr) == (141, b"")


def test_measure_of_a_file_of_seconds_ends(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "slow.vcd"
    header = "$timescale 1 s $end\n$var wire 1 ! RB0 $end\n$enddefinitions $end\n"
    file.write_text(header + "#0\n0!\n#5\n1!\n#9\n0!\n#2000000\n")
    ran = run("measure", file)
    assert ran.code == 0 and "RB0: 1 pulse" in ran.out


def test_simulate_and_measure_take_the_same_clock(run: Run, tmp_path: Path) -> None:
    """The command line's, else the C's, else 4 MHz."""
    (tmp_path / "a.c").write_text("#pragma CLOCK_FREQ 8000000\nvoid main(void) { set_tris_b(0xFE); }\n")
    run("compile", tmp_path / "a.c", "-o", tmp_path / "a.hex")
    for arguments, cycles in (
        (["a.c"], 2_000_000),
        (["a.hex"], 1_000_000),
        (["a.hex", "--clock-hz", 4_000], 1000),
    ):
        file, *more = arguments
        measured = json.loads(run("measure", tmp_path / str(file), *more, "--seconds", 1, "--json").out)
        simulated = json.loads(run("simulate", tmp_path / str(file), *more, "--seconds", 1, "--json").out)
        assert (simulated["cycles"], measured["end_cycle"]) == (cycles, cycles)
