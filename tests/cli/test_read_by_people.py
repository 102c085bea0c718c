"""What commands print without --json: every number and mark of it."""

from __future__ import annotations

import importlib.metadata
import json
import platform
import re
import shutil
from collections.abc import Callable
from math import cos, radians, sin
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from servogen import __version__
from tests.cli.stand_ins import stand_in

Run = Callable[..., Any]


def numbers(text: str) -> list[float]:
    return [float(each) for each in re.findall(r"-?\d+(?:\.\d+)?", text)]


def row(out: str, name: str) -> list[str]:
    """The cells of the table's row that begins with `name`."""
    return next(re.split(r" {2,}", line.strip()) for line in out.splitlines() if line.split()[:1] == [name])


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine with gtkwave, without the other tools, and with two serial ports."""
    monkeypatch.setattr(importlib.metadata, "requires", lambda name: ["numpy<3,>=1.26"])
    paths = {"gtkwave": "/usr/bin/gtkwave"}
    monkeypatch.setattr(shutil, "which", lambda name, *_, **__: paths.get(str(name)))
    ports = [ListPortInfo("/dev/ttyUSB0"), ListPortInfo("/dev/ttyACM0")]
    ports[0].description, ports[1].description = "K150", "analyser"
    stand_in(monkeypatch, list_ports, "comports", lambda: ports)


def test_doctor_prints_versions_tools_and_ports(run: Run, machine: None) -> None:
    ran = run("doctor")
    assert ran.code == 0
    head = ran.out.splitlines()[0]
    assert head == f"servogen {__version__}, Python {platform.python_version()}, {platform.platform()}"
    assert row(ran.out, "numpy") == ["numpy", importlib.metadata.version("numpy")]
    assert row(ran.out, "gtkwave") == ["gtkwave", "shows main.vcd", "/usr/bin/gtkwave"]
    assert row(ran.out, "sigrok-cli") == ["sigrok-cli", "captures with a logic analyser", "missing"]
    assert row(ran.out, "pk2cmd")[1:] == ["programs the chip: PICkit 2 (servogen flash)", "missing"]
    assert row(ran.out, "/dev/ttyUSB0") == ["/dev/ttyUSB0", "K150"]
    assert ran.out.index("/dev/ttyACM0") < ran.out.index("/dev/ttyUSB0")


def test_doctor_says_that_there_are_no_ports(
    run: Run, machine: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(monkeypatch, list_ports, "comports", list)
    assert row(run("doctor").out, "none") == ["none"]


def test_fk_prints_millimetres_and_the_matrix(run: Run) -> None:
    """SCARA, l0 = 600, l1 = 400, l2 = 300, l4 = 150: the tool hangs down, turned by q1 + q2 − q4."""
    ran = run("fk", "scara", 30, 20, 10, 0)
    position, *matrix, configuration = ran.out.splitlines()
    a, b = radians(30), radians(50)
    assert position.startswith("position x ")
    assert position.endswith(" mm")
    expected = [400 * cos(a) + 300 * cos(b), 400 * sin(a) + 300 * sin(b), 600 - 10 - 150]
    assert numbers(position) == pytest.approx(expected, abs=1e-4)
    rotation = [[cos(b), sin(b), 0], [sin(b), -cos(b), 0], [0, 0, -1]]
    assert [numbers(line) for line in matrix] == [pytest.approx(each, abs=1e-5) for each in rotation]
    assert configuration.startswith("configuration vector x ")
    assert numbers(configuration) == pytest.approx([*expected, 0, 0, -1], abs=1e-4)


def test_fk_names_the_joints_beyond_their_limits(run: Run) -> None:
    """q1 turns to 120°, q3 slides to 200 mm."""
    assert run("fk", "scara", 121, 0, 201, 0).out.splitlines()[-1] == "beyond their limits: q1, q3"
    assert "beyond" not in run("fk", "scara", 120, 0, 200, 0).out


def test_fk_of_a_hexapod_prints_each_foot(run: Run) -> None:
    """All joints at 0: a leg hangs straight down, 60 + 80 mm."""
    ran = run("fk", "hexapod", *[0] * 12)
    lines = ran.out.splitlines()
    assert {line.split(":")[0] for line in lines} == {"R1", "R2", "R3", "L1", "L2", "L3"}
    feet = json.loads(run("fk", "hexapod", *[0] * 12, "--json").out)["feet_m"]
    for line in lines:
        name, text = line.split(":")
        assert numbers(text) == pytest.approx([1000 * each for each in feet[name]], abs=1e-4)


def test_jacobian_prints_which_directions_are_lost_where_some_are(run: Run) -> None:
    """A stretched SCARA cannot move along its arm, the x axis; a bent one can move along all four."""
    bent = run("jacobian", "scara", 0, 60, 100, 0).out
    assert "rank 4" in bent
    assert "singular" not in bent
    lines = run("jacobian", "scara", 0, 0, 100, 0).out.splitlines()
    at = lines.index("singular: the tool cannot move along")
    assert [abs(each) for each in numbers(lines[at + 1])] == pytest.approx([1, 0, 0, 0, 0, 0], abs=1e-5)


def test_the_bodies_of_a_robot_are_written_with_what_is_assumed(run: Run, tmp_path: Path) -> None:
    written = run("robots", "hexapod", "--mjcf", tmp_path / "hexapod.xml")
    assert (written.code, written.err) == (0, "")
    *assumed, last, after = written.out.splitlines()
    assert (last, after) == (str(tmp_path / "hexapod.xml"), "next: servogen gait hexapod")
    assert assumed and all(line.startswith("assumed: ") for line in assumed)
    assert "<mujoco" in (tmp_path / "hexapod.xml").read_text()
    for option in ("--mjcf", "--urdf"):
        nameless = run("robots", option, tmp_path / "no.xml")
        assert (nameless.code, (tmp_path / "no.xml").exists()) == (2, False)
        assert "[missing-option]" in nameless.err


def test_ik_prints_joints_in_degrees_and_how_many_more_there_are(run: Run) -> None:
    """The point that fk gives for 30°, 20°, 10 mm; the other solution has the elbow on the other side."""
    a, b = radians(30), radians(50)
    target = (400 * cos(a) + 300 * cos(b), 400 * sin(a) + 300 * sin(b), 440, 0)
    one = run("ik", "scara", *target).out.splitlines()
    both = run("ik", "scara", *target, "--all").out.splitlines()
    assert one[-1] == "and 1 more: --all"
    assert len(both) == 2
    assert one[0] == both[0]
    angles = {tuple(numbers(re.sub(r"q\d", "", line))[:2]) for line in both}
    assert any(each == pytest.approx((30, 20), abs=0.01) for each in angles)
    assert any(each[1] == pytest.approx(-20, abs=0.01) for each in angles)


def test_transform_prints_the_matrix_and_the_moved_point(run: Run) -> None:
    """Rz(90) turns x to y; Tx(50) moves by 50 before."""
    lines = run("transform", "Tx(50) Rz(90)", 1, 2, 3).out.splitlines()
    matrix = [[0, -1, 0, 50], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert [numbers(line) for line in lines[:4]] == [pytest.approx(each, abs=1e-5) for each in matrix]
    assert lines[4].startswith("point")
    assert numbers(lines[4]) == pytest.approx([48, 1, 3])


def test_a_robots_table_is_in_degrees_and_millimetres(run: Run) -> None:
    out = run("robots", "scara").out
    assert row(out, "q1") == ["q1", "turning", "-120°", "120°", "0°"]
    assert row(out, "q3") == ["q3", "sliding", "0 mm", "200 mm", "0 mm"]
    assert row(out, "l1") == ["l1", "400 mm"]
    assert "q2      0°      0 mm   l2     180°" in out


def test_the_tables_of_a_gait_are_its_phases_and_its_joints(run: Run) -> None:
    """A wave of 60 frames of 20 ms: swings of a sixth, one after the other; numbers as in the JSON."""
    out = run("gait", "hexapod", "--gait", "wave").out
    found = json.loads(run("gait", "hexapod", "--gait", "wave", "--json").out)
    assert row(out, "L1")[:3] == ["L1", "1/3", "1/2"]
    assert row(out, "R1")[:3] == ["R1", "5/6", "0"]
    assert len(found["joints"]) == 12
    for joint in found["joints"]:
        name, least, most, limits, peak = row(out, joint["name"])
        assert float(least) == pytest.approx(joint["minimum_deg"], abs=0.006), name
        assert float(most) == pytest.approx(joint["maximum_deg"], abs=0.006)
        assert float(peak) == pytest.approx(joint["peak_speed_deg_s"], abs=0.06)
        assert limits == "-90 to 90"
    frames = found["frames_per_cycle"]
    assert f"a cycle: {frames} frames, {frames * 0.02:g} s" in out
    assert f"the walk: {found['frames']} frames, the last {frames} of them" in out
    margin = re.search(r"stability margin: at least ([\d.]+) mm \(frame (\d+), on ([\w, ]+)\)", out)
    assert margin is not None
    assert float(margin[1]) == pytest.approx(1000 * found["stability"]["minimum_m"], abs=0.006)
    assert int(margin[2]) == found["stability"]["frame"]
    assert margin[3].split(", ") == found["stability"]["feet"]
    spring = re.search(r"springs, or feet, yield by up to ([\d.]+) mm", out)
    assert spring is not None
    assert float(spring[1]) == pytest.approx(1000 * found["spring"]["largest_m"], abs=0.006)
    assert "feet rise 20.0 mm, body 140.0 mm above the ground, 80.0 mm free" in out  # legs of 60 + 80 mm


def test_a_walk_of_some_cycles_is_not_said_to_go_on(run: Run) -> None:
    out = run("gait", "hexapod", "--cycles", 2).out
    assert "start and stop included, and again" in out


def test_a_gait_in_the_air_says_that_no_foot_is_on_the_ground(run: Run) -> None:
    out = run("gait", "hexapod", "--duty", 0.4, "--lifts", "0,0,0,0,0,0", "--allow-falling").out
    assert re.search(r"stability margin: none, no foot is on the ground in frame \d+", out)


SECONDS = """
[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"
[motion]
poses = [{ arm_deg = 0, hold_s = 0.1 }, { arm_deg = 90, hold_s = 0.3 }]
"""


def test_the_page_says_its_times_in_seconds(run: Run, tmp_path: Path) -> None:
    """Frames of 20 ms: 5 + 15 of them, 0.4 s."""
    job, page = tmp_path / "seconds.toml", tmp_path / "page.html"
    job.write_text(SECONDS)
    ran = run("report", job, "--output", page)
    assert ran.code == 0, ran.err
    html = page.read_text()
    assert "<b>20 ms</b><span>period</span>" in html
    assert "<b>0.4 s</b><span>loop, 20 frames</span>" in html
    assert "The motion once, 0.4 s:" in html
    assert "0 cycles from the schedule; " in html


def test_fk_in_symbols_prints_each_link_the_product_and_the_position(run: Run) -> None:
    """θ–r: a turn by q1 about z, then a way of q2."""
    out = run("fk", "theta-r", "--symbolic").out
    headings = [line for line in out.splitlines() if line.endswith(":")]
    assert headings == ["link 1:", "link 2:", "product:", "position:"]
    assert "q2*sin(q1)" in out.split("position:")[1]


PROFILED = """
        LIST    p=16f84
        ORG     0
main:   call    quick
        call    slow
        goto    main
quick:  return
slow:   movlw   8
        movwf   0x0C
again:  decfsz  0x0C, f
        goto    again
        return
        END
"""


def test_a_profile_lists_the_lines_that_take_most_time_first(run: Run, tmp_path: Path) -> None:
    """A round is 2 + 2 (quick) + 2 + 1 + 1 + 23 (decfsz and goto: 8 rounds) + 2 + 2 cycles, 35 together."""
    (tmp_path / "slow.asm").write_text(PROFILED)
    out = run("simulate", tmp_path / "slow.asm", "--cycles", 350, "--profile").out
    lines = [re.split(r" {2,}", line.strip()) for line in out.splitlines() if "slow.asm:" in line]
    spent = {int(place.partition(":")[2]): (int(cycles), int(times)) for place, cycles, _, times in lines}
    first = 4  # the line of main
    expected = {0: (20, 10), 1: (20, 10), 2: (20, 10), 3: (20, 10), 4: (10, 10), 5: (10, 10)}
    expected |= {6: (90, 80), 7: (140, 70), 8: (20, 10)}  # decfsz skips once a round: 7 + 2 cycles
    assert spent == {first + line: each for line, each in expected.items()}
    assert [cycles for cycles, _ in spent.values()] == sorted(
        (each[0] for each in expected.values()), reverse=True
    )
    shares = [float(share) for _, _, share, _ in lines]
    assert shares == [round(cycles / 3.5, 2) for cycles, _ in spent.values()]
    assert "100.0 % of the program's words were executed" in out
    assert "deepest stack 1 of 8, 1 byte of RAM written" in out
    assert "read before" not in out
    (tmp_path / "slow.asm").write_text(PROFILED.replace("movlw   8", "movf    0x0D, w"))
    out = run("simulate", tmp_path / "slow.asm", "--cycles", 350, "--profile").out
    assert "read before they were written: 0x0D\n" in out


PROFILED_C = """
#pragma CLOCK_FREQ 4000000
unsigned char n;
void quick(void) { n = 1; }
void slow(void) { unsigned char i; for (i = 0; i < 50; i++) n += i; }
void main(void) { while (1) { quick(); slow(); quick(); } }
"""


def test_a_profile_lists_the_functions_that_take_most_time_first(run: Run, tmp_path: Path) -> None:
    (tmp_path / "slow.c").write_text(PROFILED_C)
    out = run("simulate", tmp_path / "slow.c", "--cycles", 5000, "--profile").out
    table = out.partition("Functions")[2].partition("Lines")[0]
    rows = [line.split() for line in table.splitlines() if re.search(r"\d", line)]
    cycles = {name: int(count) for name, count, _ in rows}
    assert cycles.keys() == {"slow", "quick", "main", "__start"}
    assert list(cycles.values()) == sorted(cycles.values(), reverse=True)
    assert (next(iter(cycles)), sum(cycles.values())) == ("slow", 5000)
    assert [float(share) for *_, share in rows] == [round(count / 50, 2) for count in cycles.values()]


def test_a_capture_says_what_it_holds_and_what_comes_next(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Three captures of 500 ms each."""
    seen = SimpleNamespace(unseen=0, records=[None] * 3)
    plan = SimpleNamespace(rate=1_000_000, frames=25)
    analyser = SimpleNamespace(name="Logic Sniffer")
    done = SimpleNamespace(
        shortage=None, rate=10**6, seconds=1.5, captures=3, plan=plan, analyser=analyser, seen=seen
    )
    stand_in(monkeypatch, "servogen.workflows.capture", "capture", lambda *_: done)
    stand_in(monkeypatch, "servogen.workflows.capture", "capture_by_sigrok", lambda *_: done)
    schedule = Path(__file__).parents[2] / "firmware" / "lab8-exercise" / "schedule.json"
    target = tmp_path / "seen.vcd"
    next_step = f"next: servogen verify {target} --against {schedule}"
    ran = run("capture", "--output", target, "--port", "/dev/null", "--against", schedule)
    assert ran.code == 0
    assert ran.out.splitlines() == [
        f"{target}: 1.5 s at 1000000 samples a second from Logic Sniffer",
        "stitched from 3 captures, because one holds 25 frames; the time between two is not known",
        next_step,
    ]
    seen.unseen = 2
    loop = run("capture", "--output", target, "--port", "/dev/null", "--against", schedule)
    assert "2 of the loop's different frames were not seen whole in 3 captures" in loop.err
    timed = run("capture", "--output", target, "--port", "/dev/null", "--against", schedule, "--seconds", 1)
    assert timed.err == ""  # no whole loop was asked for
    done.captures = 1
    alone = run("capture", "--output", target, "--port", "/dev/null").out.splitlines()
    what = f"{target}: 1.5 s at 1000000 samples a second from Logic Sniffer"
    assert alone == [what, f"next: servogen measure {target}"]
    sigrok = ("capture", "--output", target, "--sigrok", "fx2lafw", "--against", schedule)
    assert run(*sigrok).out.splitlines() == [f"{target}: 1.5 s at 1000000 samples a second", next_step]


def test_a_pipe_that_nobody_reads_is_exit_code_141(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """128 + SIGPIPE, as of a program that the signal ends."""

    def written(*_: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr("servogen.cli.robot_commands.print", written, raising=False)
    ran = run("fk", "scara", 30, 20, 10, 0)
    assert (ran.code, ran.err) == (141, "")
