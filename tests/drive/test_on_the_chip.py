"""The stream engine on the simulated chip does what a drive sends: positions become pulse widths."""

import json
import math
import subprocess
from bisect import bisect_left
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from servogen.bench.virtual.chip import VirtualChip
from servogen.bench.virtual.serial_line import LineStimulus
from servogen.drive.commands import QUIT, CommandSource, NoCommands, script
from servogen.drive.controller import job_controller
from servogen.drive.motions import AngleFunction, Limited, Played, Still
from servogen.drive.serial_link import SerialLink, Time
from servogen.drive.session import DriveSession
from servogen.drive.steering import Rates, job_steering
from servogen.drive.sweep import Sweep, positions
from servogen.edges import PINS
from servogen.engines.stream.engine import stream
from servogen.engines.stream.firmware import compiled
from servogen.engines.stream.protocol import travel
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.motion.trajectory import Floats
from servogen.pic.image import Image
from servogen.simulator import SimulatorOptions
from tests.campaigns import sampled
from tests.drive.conftest import Run

EFFECT_S = 0.010
"""A command takes effect in the first frame that starts so long after its stop bit."""

BYTE_S = 10 / 2400
"""The virtual line begins a byte on a grid of its own, at most a byte's time late."""

Start = Callable[..., "subprocess.Popen[str]"]


def job_of(count: int, fail_safe: str = "hold") -> str:
    text = '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
    for index in range(count):
        text += f'[[servo]]\nname = "s{index}"\npin = "RB{index}"\nmodel = "futaba-s3001"\n'
    return text + f'[stream]\nfail_safe = "{fail_safe}"\n[firmware]\nsoft_start_s = 0.1\n'


def moving(count: int) -> str:
    """A motion of all servos, each with angles of its own."""
    first = ", ".join(f"s{index}_deg = {30 + 12 * index}" for index in range(count))
    second = ", ".join(f"s{index}_deg = {140 - 9 * index}" for index in range(count))
    return f"[motion]\nposes = [{{ {first}, move_s = 0.5, hold_s = 0.1 }}, {{ {second}, move_s = 0.5 }}]\n"


@cache
def image_of(text: str) -> Image:
    job = plan_job(loads(text, "job.toml"))
    return compiled(job, stream(job)[1], "c2c").compilation.image


@dataclass
class OnChip:
    """The chip as a robot: its time goes on while the drive waits, and its pins are noted."""

    job: PlannedJob
    image: Image
    faults: list[tuple[float, float]] = field(default_factory=list)
    pulses: dict[int, list[tuple[float, int]]] = field(default_factory=dict)
    """(moment of the rise, width in cycles) of each pin's pulses."""

    def __post_init__(self) -> None:
        assert self.job.stream is not None
        pin = PINS.index(self.job.stream.receive_pin)
        self.stimulus = LineStimulus(pin, self.job.stream.baud)
        self.chip = VirtualChip(self.image, self.job.clock, SimulatorOptions(), Fraction(0), self.stimulus)
        self.chip.watched = True
        self.chip.run(int(0.5 * self.chip.cycles_per_second))

    def time(self) -> Time:
        return Time(lambda: self.chip.now / float(self.chip.cycles_per_second), self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.chip.run(math.ceil(seconds * float(self.chip.cycles_per_second)))

    def write(self, data: bytes) -> None:
        self.stimulus.waiting.extend(data)

    @contextmanager
    def open(self) -> Iterator["OnChip"]:
        yield self

    def seen(self, pin: str) -> tuple[list[float], list[int]]:
        """Moments of the rises (s) and widths (cycles) of a pin's pulses, since the chip began."""
        if not self.pulses:
            cycle, level = self.chip.look(1)
            for number in range(len(PINS)):
                high = (level >> np.uint32(number) & np.uint32(1)).astype(int)
                edges = np.flatnonzero(np.diff(high, prepend=0))
                rises, falls = cycle[edges[high[edges] == 1]], cycle[edges[high[edges] == 0]]
                self.pulses[number] = [
                    (rise / float(self.chip.cycles_per_second), fall - rise)
                    for rise, fall in zip(rises.tolist(), falls.tolist(), strict=False)
                ]
        own = self.pulses[PINS.index(pin)]
        return [rise for rise, _ in own], [width for _, width in own]


def driven(
    robot: OnChip,
    motion: AngleFunction,
    stop: Floats | None = None,
    arrive_s: float = 1.0,
    source: CommandSource | None = None,
    on_command: Callable[[str], None] = lambda command: None,
) -> list[dict[str, object]]:
    log: list[dict[str, object]] = []
    baud, controller = job_controller(robot.job, None, None, 0)
    time = robot.time()
    began = time.now()
    with SerialLink(robot.open, baud, time, 0.0) as line:
        DriveSession(
            controller, line, time, log.append, stop, source or NoCommands(), on_command, arrive_s
        ).run(motion)
    time.sleep(0.1)
    return [{**entry, "s": float(str(entry["s"])) + began} for entry in log]


@pytest.mark.parametrize("count", sampled([3, 8]))
def test_every_position_is_a_pulse_width_in_the_first_frame_after_it(count: int) -> None:
    text = job_of(count)
    robot = OnChip(plan_job(loads(text + moving(count), "job.toml")), image_of(text))
    log = driven(robot, Limited(Played(robot.job.trajectory), 2.0), arrive_s=0.0)
    frame_s = float(robot.job.clock.seconds(stream(robot.job)[1].plan.schedule.period))
    checked = 0
    for index, servo in enumerate(robot.job.servos):
        rises, widths = robot.seen(servo.pin)
        sent = [(float(str(e["s"])), int(str(e["position"]))) for e in log if e.get("number") == index]
        assert np.ptp(np.diff(rises)) < 1e-9, "no pulse ever came early or late"
        for (moment, position), (after, _) in zip(sent, [*sent[1:], (math.inf, 0)], strict=True):
            first = bisect_left(rises, moment + EFFECT_S + BYTE_S + frame_s)  # a later slot of that frame
            if first < len(rises) and rises[first] < after:
                assert widths[first] == travel(servo, robot.job.clock).width(position), (moment, position)
                checked += 1
    assert checked > 30


def test_a_widths_history_is_the_motion_a_command_and_a_frame_later() -> None:
    """Seen from the outside: the angle that a pulse means was the motion's a little earlier."""
    text = job_of(3)
    robot = OnChip(plan_job(loads(text + moving(3), "job.toml")), image_of(text))
    log = driven(robot, Limited(Played(robot.job.trajectory), 2.0), arrive_s=0.0)
    began = float(str(log[0]["s"])) - 3 * BYTE_S
    made = robot.job.trajectory
    for index, servo in enumerate(robot.job.servos):
        rises, widths = robot.seen(servo.pin)
        for rise, width in zip(rises, widths, strict=True):
            if not began + 0.2 < rise < began + 2.0:
                continue
            frames = [
                int((rise - began - late) / 0.02) % len(made.angles) for late in np.arange(0, 0.12, 0.005)
            ]
            wanted = [servo.width_us(float(made.angles[frame, index])) for frame in frames]
            step = (servo.widths_us[1] - servo.widths_us[0]) / 254
            assert min(wanted) - step <= width <= max(wanted) + step


def test_the_first_pose_is_gone_to_together_and_the_stop_pose_comes_at_once() -> None:
    text = job_of(3)
    robot = OnChip(plan_job(loads(text, "job.toml")), image_of(text))
    stop = np.array([servo.neutral for servo in robot.job.servos])
    log = driven(robot, Limited(Still(np.radians([30.0, 150.0, 60.0])), 0.3), stop)
    assert log[-1]["event"] == "stopped"
    goes = next(float(str(entry["s"])) for entry in log if entry.get("frames"))
    for servo, end in zip(robot.job.servos, (1166, 1833, 1333), strict=True):
        rises, widths = robot.seen(servo.pin)
        begin, middle, there = (bisect_left(rises, goes + late) for late in (-0.03, 0.52, 1.08))
        assert widths[begin] == 1500
        assert widths[middle] == pytest.approx((1500 + end) / 2, abs=20), "half way in half the time"
        assert widths[there] == pytest.approx(end, abs=4)
        assert np.abs(np.diff(widths[begin:there])).max() <= abs(end - 1500) / 40, "by small steps"
        assert widths[-1] == 1500


@pytest.mark.campaign
def test_a_calibrations_widths_stand_on_the_pin_however_long_the_answer_takes() -> None:
    """The chip's fail-safe would take the servo to neutral while somebody reads the angle."""
    text = job_of(1, "neutral").replace("[stream]", "[stream]\nsilence_s = 1.0")
    robot = OnChip(plan_job(loads(text, "job.toml")), image_of(text))
    baud, controller = job_controller(robot.job, None, None, 0)
    channel, time = controller.channels[0], robot.time()
    asked: list[tuple[float, float, float]] = []
    with SerialLink(robot.open, baud, time, 0.0) as line:
        sweep = Sweep(controller, 0, line, time, channel.position(channel.servo.neutral))
        for position in positions(channel, None, None, 3):
            sweep.go(position)
            began = time.now()
            sweep.wait_for(lambda began=began: "90" if time.now() - began > 3 else None)  # type: ignore[misc]
            asked.append((began, time.now(), channel.widths_us[position]))
    moments, widths = robot.seen("RB0")
    for began, ended, wanted in asked:
        shown = [width for at, width in zip(moments, widths, strict=True) if began <= at < ended]
        assert len(shown) > 140
        assert all(abs(width - wanted) <= 1 for width in shown), wanted  # a cycle is a microsecond


@pytest.fixture
def rig(start: Start, tmp_path: Path) -> dict[str, str]:
    """The ports of a rig with the stream firmware on its chip."""
    path = tmp_path / "arm.toml"
    path.write_text(job_of(2))
    process = start("rig", path, "--json")
    assert process.stdout is not None
    ports: dict[str, str] = json.loads(process.stdout.readline())
    return {**ports, "job": str(path)}


@pytest.mark.campaign
def test_from_the_command_line_to_the_pins_of_a_rig(run: Run, rig: dict[str, str], tmp_path: Path) -> None:
    done = run("drive", rig["job"], "--port", rig["serial"], "--pose", "s0=45,s1=120")
    assert done.code == 0, done.err
    seen, job = tmp_path / "seen.vcd", plan_job(loads(job_of(2), "job.toml"))
    wanted = {}
    for servo, degrees in zip(job.servos, (45, 120), strict=True):
        made = travel(servo, job.clock)
        wanted[servo.pin] = made.width(made.nearest(servo.width_us(math.radians(degrees))))
    for _ in range(100):  # a slow machine's chip has not heard yet what is on the line
        assert run("capture", "--port", rig["analyser"], "-o", seen, "--seconds", 0.3).code == 0
        measured = json.loads(run("measure", seen, "--json").out)
        widths = {pin["pin"]: [each["cycles"] for each in pin["widths"]] for pin in measured["pins"]}
        if all(abs(width - wanted[pin]) <= 1 for pin in wanted for width in widths[pin]):
            return
    raise AssertionError(widths)


LEGS = {"FL": (90, 50), "FR": (90, -50), "RL": (-90, 50), "RR": (-90, -50)}
"""A four-legged robot: where its legs are mounted, mm; eight servos, as many as one chip has."""


def four_legs(folder: Path) -> Path:
    """A stream job of a robot that crawls, one foot in the air at a time."""
    robot = 'name = "four"\ntitle = "four legs"\nkind = "hexapod"\nleg = "pantograph"\n'
    robot += 'dimensions = "example"\nsource = "a test"\ncentre_of_mass_mm = [0, 0, 0]\n'
    servos, pin = "", iter(range(8))
    for leg, (x, y) in LEGS.items():
        right = str(y < 0).lower()
        robot += f'[[mount]]\nname = "{leg}"\nx_mm = {x}\ny_mm = {y}\nmirrored = {right}\n'
        for joint in ("alpha", "beta"):
            servos += f'[[servo]]\nname = "{leg}-{joint}"\npin = "RB{next(pin)}"\nmodel = "mpx-tiny-s"\n'
            servos += f'joint = "{leg}_{joint}"\nreverse = {right}\n'
    (folder / "four.toml").write_text(robot)
    path = folder / "crawl.toml"
    path.write_text(
        f'[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n[robot]\nname = "four.toml"\n{servos}'
        "[walk]\nduty = 0.75\nlifts = { FL = 0.0, RR = 0.25, FR = 0.5, RL = 0.75 }\nallow_falling = true\n"
        'route = [{ forward_mm = 30 }]\ncycle_s = 2.4\n[stream]\nfail_safe = "hold"\n'
    )
    return path


@pytest.mark.campaign
def test_a_gait_under_orders_is_walked_by_the_chip(tmp_path: Path) -> None:
    job = plan_job(load(four_legs(tmp_path)))
    robot = OnChip(job, compiled(job, stream(job)[1], "c2c").compilation.image)
    steering, told = job_steering(job, Rates(30, 6)), job_steering(job, Rates(30, 6))
    words = script("forward\nwait 4\nleft\nwait 9\nstop\nwait 6\n")
    log = driven(robot, steering, arrive_s=0.0, source=words, on_command=steering.command)
    orders = {float(str(entry["s"])): str(entry["command"]) for entry in log if "command" in entry}
    began = min(orders)
    planned = []
    for frame in range(int(20 / 0.02)):
        while orders and min(orders) <= began + frame * 0.02:
            word = orders.pop(min(orders))
            if word != QUIT:
                told.command(word)
        planned.append(told.at(frame * 0.02))
    angles = np.array(planned)
    assert np.degrees(np.ptp(angles, axis=0)).min() > 10, "every joint has moved"
    for index, servo in enumerate(job.servos):
        rises, widths = robot.seen(servo.pin)
        wanted = np.array([servo.width_us(angle) for angle in angles[:, index].tolist()])
        step = (servo.widths_us[1] - servo.widths_us[0]) / 254
        for rise, width in zip(rises, widths, strict=True):
            frame = int((rise - began) / 0.02)
            if 15 <= frame < 19 / 0.02:
                lately = wanted[frame - 10 : frame + 2]  # a pose of eight takes 100 ms, and two frames more
                assert lately.min() - step - 1 <= width <= lately.max() + step + 1, (servo.name, frame)
