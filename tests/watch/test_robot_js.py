"""The page's kinematics in JavaScript equal the library's, for every job that moves a robot."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from servogen.edges import UNDRIVEN, EdgeChunk, EdgeTrace
from servogen.job import load, plan_job
from servogen.job.ends import to_place
from servogen.motion.drive import positions
from servogen.report.robot_model import robot_model
from servogen.report.sticks import stick
from servogen.units import Clock, Cycles
from servogen.watch.session import WatchSession
from servogen.watch.subject import Subject

ROOT = Path(__file__).parent.parent.parent
NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(NODE is None, reason="there is no node here")
SCRIPT = """
import { angleOf, cornersOf, driven, hull, widthOf } from "%s";
const asked = JSON.parse(process.argv[1]), made = {};
made.corners = asked.ends ? asked.ends.map(end => asked.angles.map(angles => cornersOf(end, angles))) : [];
made.angles = (asked.widths || []).map(([servo, width]) => angleOf(asked.servos[servo], width));
made.widths = made.angles.map((angle, row) => widthOf(asked.servos[asked.widths[row][0]], angle));
made.hull = hull(asked.points || []);
let pose = [0, 0, 0];
made.poses = (asked.speeds || []).map(speeds => pose = driven(asked.base, pose, speeds, asked.seconds));
console.log(JSON.stringify(made));
"""


def calculated(**asked: object) -> dict[str, list[object]]:
    assert NODE is not None
    module = (ROOT / "templates" / "watch" / "robot.js").as_uri()
    command = [NODE, "--input-type=module", "-e", SCRIPT % module, json.dumps(asked)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout))


@pytest.mark.parametrize("name", ["hexapod-turn", "scara-pick", "rvm1-program", "lab9-exercise"])
def test_corners_and_angles_are_those_of_the_library(name: str) -> None:
    job = plan_job(load(ROOT / "jobs" / f"{name}.toml"))
    model = robot_model(job)
    dice = np.random.default_rng(1)
    low, high = np.array([servo.limits for servo in job.servos]).T
    angles = low + (high - low) * dice.random((20, len(job.servos)))
    widths = [(index, float(width)) for index in range(len(job.servos)) for width in range(700, 2300, 97)]
    made = calculated(**model, angles=angles.tolist(), widths=widths)
    for end, corners in zip(job.ends, made["corners"], strict=True):
        wanted = to_place(end.place, stick(end.arm, end.joints(angles)))
        assert np.allclose(np.array(corners), wanted, atol=1e-12)
    assert len(made["corners"]) == len(job.ends)
    assert made["angles"] == pytest.approx([job.servos[index].angle(width) for index, width in widths])
    assert made["widths"] == pytest.approx([width for _, width in widths])


def test_a_base_drives_as_planned() -> None:
    job = plan_job(load(ROOT / "jobs" / "omni-square.toml"))
    speeds = np.nan_to_num(job.trajectory.angles)[:200]
    made = calculated(base=robot_model(job)["base"], speeds=speeds.tolist(), seconds=0.02)
    assert job.base is not None
    wanted = positions(job.base, speeds[:, job.wheel_columns], 0.02)[1:]
    assert np.allclose(np.array(made["poses"]), wanted, atol=1e-12)
    assert np.abs(wanted).max() > 0.01


def test_the_hull_of_points_is_their_corners() -> None:
    circle = [[math.cos(angle), math.sin(angle)] for angle in np.linspace(0, 6, 7)]
    inside = [[0.1, 0.2], [-0.3, 0.0], [0.0, 0.0]]
    found = calculated(points=[*inside, *circle])["hull"]
    assert sorted(map(tuple, found)) == sorted(map(tuple, circle))  # type: ignore[arg-type]
    assert calculated(points=[[0, 0], [1, 1]])["hull"] == [[0, 0], [1, 1]]


EDGES = """
import { edgesOf, unpack, unpackPulses } from "%s";
const { pulses, floating, begin, seen } = JSON.parse(process.argv[1]);
const edges = edgesOf(unpackPulses(pulses, begin), unpack(floating, begin), begin, seen);
console.log(JSON.stringify(edges.map(edge => [edge.cycle, edge.pin, edge.level])));
"""


def test_a_window_is_painted_with_the_edges_that_its_pins_had() -> None:
    """From its pulses alone, wherever it cuts them, and with the pins that begin or cease to float in it."""
    rows = [
        (0, 0, 0),
        (10, 0, 1),
        (10, 1, 1),
        (25, 0, 0),
        (30, 1, UNDRIVEN),
        (40, 0, 1),
        (60, 0, 0),
        (70, 1, 1),
    ]
    cycle, pin, level = (np.array(column) for column in zip(*rows, strict=True))
    chunk = EdgeChunk(cycle, pin.astype(np.uint8), level.astype(np.uint8))
    trace = EdgeTrace(Clock(4_000_000), (chunk,), Cycles(100))
    session = WatchSession(Subject(Path("run.vcd"), Clock(4_000_000), trace=trace))
    assert NODE is not None
    module = (ROOT / "templates" / "watch" / "waves.js").as_uri()
    for begin, end in ((0, 100), (11, 35), (20, 45)):
        waves = list(session.handle({"do": "waves", "begin": begin, "end": end}))[-1]
        command = [NODE, "--input-type=module", "-e", EDGES % module, json.dumps(waves)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        painted = {(cycle, pin): level for cycle, pin, level in json.loads(done.stdout)}
        assert painted == {(cycle, pin): level for cycle, pin, level in rows if begin <= cycle < end}


def test_a_time_is_said_as_precisely_as_it_is_shown() -> None:
    assert NODE is not None
    module = (ROOT / "templates" / "watch" / "waves.js").as_uri()
    script = (
        f'import {{ timeText as t }} from "{module}"; console.log(t(1500, 1), t(20000, 1000), t(2.5e6, 1e5))'
    )
    done = subprocess.run(
        [NODE, "--input-type=module", "-e", script], capture_output=True, text=True, check=True
    )
    assert done.stdout == "1500 µs 20 ms 2.5 s\n"
