"""A new kind of robot is a module, a line in the registry and catalogue files: nothing else changes.

A rover drives and a dog walks; both are planned, drawn, queried and driven by the commands as they are.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.engines.test_fourth_engine import BEING_WRITTEN

ROOT = Path(__file__).parents[2]
TOYS = Path(__file__).parent / "toys"
LAST_IMPORT, LAST_KIND = "from servogen.kinematics.protocol import RobotKind\n", "            OMNI,\n"

WHEEL = """
[[servo]]
name = "{name}"
pin = "{pin}"
model = "continuous"
"""

ROVER_JOB = (
    """
[chip]
device = "PIC16F84"
clock_hz = 4_000_000

[robot]
name = "rover"

[drive]
wheels = ["left", "right"]
corners_mm = [[0, 0], [200, 0], [200, 200]]
speed_mm_s = 60
"""
    + WHEEL.format(name="left", pin="RB0")
    + WHEEL.format(name="right", pin="RB1")
)

JOINT = """
[[servo]]
name = "{leg}_{joint}"
pin = "{pin}"
model = "futaba-s3001"
joint = "{leg}_{joint}"
zero_deg = {zero}
"""
PINS = [*(f"RB{bit}" for bit in range(8)), *(f"RA{bit}" for bit in range(4))]
ZERO_DEG = {"hip": 0, "thigh": 90, "knee": 160}

DOG_JOB = """
[chip]
device = "PIC16F84"
clock_hz = 4_000_000

[robot]
name = "dog"

[walk]
duty = 0.8
lifts = { HL = 0.0, FL = 0.25, HR = 0.5, FR = 0.75 }
route = [{ left_mm = 30 }]
cycle_s = 2
body_height_mm = 100
allow_falling = true
margin_mm = 0

[frame]
per_slot = 2
""" + "".join(
    JOINT.format(leg=leg, joint=joint, pin=PINS[3 * row + column], zero=ZERO_DEG[joint])
    for row, leg in enumerate(("FL", "FR", "HL", "HR"))
    for column, joint in enumerate(("hip", "thigh", "knee"))
)


COMMANDS = """
import json, os, sys
import servogen.workflows, servogen.drive.controller, servogen.kinematics.registry
import servogen.motion, servogen.simulator
from servogen.cli import main

for line in iter(sys.stdin.readline, ""):
    arguments = json.loads(line)
    child = os.fork()
    if not child:
        for number, name in enumerate(("stdin", "stdout", "stderr")):
            os.dup2(os.open(name, os.O_RDONLY if number == 0 else os.O_WRONLY), number)
        sys.stdin = open(0, closefd=False)
        sys.argv = ["servogen", *arguments]
        code = 1
        try:
            main()
        except SystemExit as ended:
            code = ended.code or 0
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
"""A process that has loaded the library, and runs each command in a copy of itself."""


@cache
def commands(folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", COMMANDS],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A copy of servogen with the toys' modules, their lines in the registry and their catalogue files."""
    folder = tmp_path_factory.mktemp("kinds")
    shutil.copytree(ROOT / "servogen", folder / "servogen", ignore=BEING_WRITTEN)
    shutil.copytree(ROOT / "templates", folder / "templates")
    kinematics = folder / "servogen" / "kinematics"
    for module in TOYS.glob("*.py"):
        shutil.copy(module, kinematics)
    for entry in TOYS.glob("*.toml"):
        shutil.copy(entry, folder / "servogen" / "robot" / "catalogue" / "robots")
    registry = kinematics / "registry.py"
    text = registry.read_text()
    assert text.count(LAST_IMPORT) == text.count(LAST_KIND) == 1
    for module, kind in (("rover", "ROVER"), ("dog", "DOG")):
        text = text.replace(LAST_IMPORT, f"{LAST_IMPORT}from servogen.kinematics.{module} import {kind}\n")
        text = text.replace(LAST_KIND, f"{LAST_KIND}            {kind},\n")
    registry.write_text(text)
    (folder / "rover-job.toml").write_text(ROVER_JOB)
    (folder / "dog-job.toml").write_text(DOG_JOB)
    with commands(folder) as process:
        yield folder
        assert process.stdin
        process.stdin.close()
    commands.cache_clear()


def ran(folder: Path, *arguments: str, text: str = "", status: int = 0) -> str:
    process = commands(folder)
    assert process.stdin and process.stdout
    for name, given in (("stdin", text), ("stdout", ""), ("stderr", "")):
        (folder / name).write_text(given)
    process.stdin.write(json.dumps(arguments) + "\n")
    process.stdin.flush()
    code = process.stdout.readline().strip()
    out, err = ((folder / name).read_text() for name in ("stdout", "stderr"))
    assert code == str(status), out + err
    return err if status else out


def answer(folder: Path, *arguments: str) -> Any:
    return json.loads(ran(folder, *arguments, "--json"))


def lines(text: str) -> Iterator[dict[str, Any]]:
    return (json.loads(line) for line in text.splitlines() if line.startswith("{"))


def test_their_facts_and_mobility_are_shown(folder: Path) -> None:
    listed = {robot["name"]: (robot["kind"], robot["joints"]) for robot in answer(folder, "robots")["robots"]}
    assert listed["rover"] == ("rover", 2)
    assert listed["dog"] == ("dog", 12)
    assert answer(folder, "robots", "rover")["track_m"] == 0.12
    assert "track_m" in ran(folder, "robots", "rover")
    assert answer(folder, "mobility", "dog")["mobility"] == 12


def test_a_dogs_feet_are_where_its_angles_put_them(folder: Path) -> None:
    feet = answer(folder, "fk", "dog", *["90", "0", "-90"] * 4)["feet_m"]
    # out to the side by u + t = 130 mm, down by s = 90 mm; the hips are at (±100, ±50) mm
    assert feet["FL"] == pytest.approx([0.1, 0.18, -0.09])
    assert feet["HR"] == pytest.approx([-0.1, -0.18, -0.09])
    assert "'rover' drives on wheels" in ran(folder, "statics", "rover", "1", "2", status=2)
    assert "use 'dog-leg'" in ran(folder, "ik", "dog", "1", "2", "3", status=2)


def test_a_rovers_contour_is_planned_drawn_and_proven(folder: Path) -> None:
    planned = ran(folder, "plan", "rover-job.toml", "--csv", "rover.csv")
    # 90° to the left at the first corner, 135° to go back along the diagonal, and 135° to the first heading
    routine = [
        line.split(": ")[1].split(",")[0] for line in planned.splitlines() if line.startswith("stretch")
    ]
    assert routine == [
        "200 mm ahead", "turn by 90°", "200 mm ahead", "turn by 135°", "283 mm ahead", "turn by 135°",
    ]  # fmt: skip
    header, *rows = (folder / "rover.csv").read_text().splitlines()
    column = {name: index for index, name in enumerate(header.split(","))}
    x, y = (np.array([float(row.split(",")[column[name]]) for row in rows]) for name in ("x_mm", "y_mm"))
    for corner in ((200, 0), (200, 200), (0, 0)):
        assert np.hypot(x - corner[0], y - corner[1]).min() < 1e-6
    ran(folder, "build", "rover-job.toml", "--output", "out")
    report = (folder / "out" / "report.txt").read_text()
    assert "exact: compared" in report
    assert "at the base of the plan" in report
    # 200 mm at up to 60 mm/s are 167 frames of 20 ms; 59.88 mm/s on wheels of 30 mm are 114.36°/s, and the
    # servo's width is 1500 µs at rest and 200 µs more at 300°/s: 1576.2 µs, in whole cycles 1576, both wheels
    edges = [line.split(",") for line in (folder / "out" / "edges.csv").read_text().splitlines()[1:]]
    first = {pin: [int(edge[0]) for edge in edges if pin in edge][:2] for pin in ("RB0", "RB1")}
    speed = 0.2 / (math.ceil(0.2 / 0.06 / 0.02) * 0.02) / 0.03
    expected = round(1500 + math.degrees(speed) * 200 / 300)
    assert expected == 1576
    assert [fall - rise for rise, fall in first.values()] == [expected, expected]


def test_a_rover_is_driven_and_not_sideways(folder: Path) -> None:
    command = ("drive", "rover-job.toml", "--range-us", "1000,2000", "--keys", "--dry-run", "--json")
    options = ("--step-mm", "60", "--turn-deg", "60")
    log = list(lines(ran(folder, *command, *options, text="forward\nwait 1\nleft\nwait 1\nquit\n")))
    sent = {"forward": {}, "left": {}}  # type: dict[str, dict[str, float]]
    order = ""
    for entry in log:
        order = entry.get("command", order)
        if "servo" in entry and order in sent:
            sent[order][entry["servo"]] = entry["width_us"]
    # 60 mm/s: 2 rad/s of each wheel; 60°/s: the wheels 60 mm from the middle at ∓62.8 mm/s, ∓2.09 rad/s
    ahead, spin = math.degrees(2) * 2 / 3, math.degrees(math.radians(60) * 0.06 / 0.03) * 2 / 3
    step = 1000 / 254
    assert sent["forward"] == pytest.approx({"left": 1500 + ahead, "right": 1500 + ahead}, abs=step)
    assert sent["left"] == pytest.approx({"left": 1500 - spin, "right": 1500 + spin}, abs=step)
    assert "sideways-left" in ran(folder, *command, text="sideways-left\n", status=2)


def test_a_dog_walks_sideways_and_its_feet_do_not_slip(folder: Path) -> None:
    walk = answer(
        folder, "gait", "dog", "--duty", "0.8", "--lifts", "HL=0,FL=0.25,HR=0.5,FR=0.75",
        "--stride-mm", "30", "--direction-deg", "90", "--cycle-s", "2", "--body-height-mm", "100",
        "--allow-falling", "--margin-mm", "0",
    )  # fmt: skip
    assert walk["spring"]["largest_m"] < 1e-12, "legs of three joints reach every foothold exactly"
    # the highest of the 20 frames of a swing may be half a frame off the top, 16 (1/4 - 1/40²)² = 0.995 of it
    assert 0.995 * 0.02 <= walk["lift_m"] <= 0.02
    ran(folder, "plan", "dog-job.toml", "--csv", "dog.csv")
    header, *rows = (folder / "dog.csv").read_text().splitlines()
    names = header.split(",")
    table = np.array([[float(cell) if cell else np.nan for cell in row.split(",")] for row in rows])
    table = table[-100:]  # a steady cycle of 2 s
    for leg in ("FL", "FR", "HL", "HR"):
        x, y, z = (table[:, names.index(f"{leg}_{axis}_mm")] for axis in "xyz")
        down = z < -99.9
        assert (np.ptp(z[down]), np.ptp(x[down])) == pytest.approx((0, 0), abs=0.11)
        # the body goes 30 mm to the left in 100 frames of 20 ms: a standing foot goes as much to the right
        standing = down[:-1] & down[1:]
        assert np.diff(y)[standing] == pytest.approx(np.full(standing.sum(), -0.3), abs=1e-3)


@pytest.mark.campaign
def test_a_dogs_walk_is_filmed(folder: Path) -> None:
    (folder / "quick.toml").write_text(DOG_JOB.replace("cycle_s = 2", "cycle_s = 0.4"))
    ran(folder, "plan", "quick.toml", "--animate", "dog.gif")
    assert (folder / "dog.gif").read_bytes().startswith(b"GIF8")


def test_a_dog_is_driven_sideways(folder: Path) -> None:
    command = ("drive", "dog-job.toml", "--range-us", "500,2500", "--keys", "--dry-run", "--json")
    text = "sideways-left\nwait 2\nquit\n"
    assert any("servo" in entry for entry in lines(ran(folder, *command, "--step-mm", "20", text=text)))


def test_without_its_line_there_is_no_such_kind(tmp_path: Path) -> None:
    shutil.copy(TOYS / "rover.toml", tmp_path)
    command = [sys.executable, "-m", "servogen", "robots", str(tmp_path / "rover.toml")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert '"rover" is not allowed here' in done.stderr
    assert "allowed: arm, hexapod, omni" in done.stderr


def test_a_key_of_another_kind_is_refused(folder: Path) -> None:
    (folder / "mixed.toml").write_text((TOYS / "rover.toml").read_text() + 'leg = "dog-leg"\n')
    assert "'leg' belongs in a file of" in ran(folder, "robots", "mixed.toml", status=2)


def test_wheels_are_counted_by_the_kind(folder: Path) -> None:
    (folder / "three.toml").write_text(ROVER_JOB.replace('["left", "right"]', '["left", "right", "left"]'))
    assert "rover has 2 wheels, not 3" in ran(folder, "plan", "three.toml", status=2)
