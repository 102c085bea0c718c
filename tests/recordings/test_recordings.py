"""Motions of other programs: what a file says, and where it is wrong."""

import json
from pathlib import Path

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.recordings import read

POINT = {"positions": [1.0], "time_from_start": 0}


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_a_csv_file_has_its_units_in_its_names_and_begins_at_0(tmp_path: Path) -> None:
    file = written(
        tmp_path,
        "a.csv",
        "time_s,arm_deg,grip_us,wrist,x_mm,arm_width_us\n2,10,1500,1,7,8\n2.5,20,1600,2,7,8\n",
    )
    found = read(file)
    assert found.names == ("arm", "grip", "wrist") and found.units == ("deg", "us", "")
    assert found.times.tolist() == [0, 0.5] and found.values.tolist() == [[10, 1500, 1], [20, 1600, 2]]
    assert found.at(np.array([0.25]))[0].tolist() == [15, 1550, 1.5]


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("time_s,a_deg\n0,1\n1,x\n", 3, "a_deg: 'x' is not a number"),
        ("time_s,a_deg\n0,1\n1\n", 3, "has 1 cells, the header has 2"),
        ("time_s,a_deg\n0,1\n1,nan\n", 3, "a_deg: 'nan' is not a number"),
        ("time_s,a_deg\n0,1\n2,1\n1,1\n", 4, "1 s comes after 2 s"),
        ("a_deg\n1\n", 1, "has no column time_s"),
        ("time_s,x_mm\n1,2\n", 1, "has no column of a servo"),
        ("time_s,a_deg,a_deg\n0,1,1\n", 2, "two tracks are called 'a'"),
        ("time_s,a_deg\n", None, "has no samples"),
    ],
)
def test_a_wrong_csv_file_is_told_with_its_line(tmp_path: Path, text: str, line: int, message: str) -> None:
    with pytest.raises(InputError) as error:
        read(written(tmp_path, "a.csv", text))
    assert error.value.message == message
    assert error.value.location is not None and error.value.location.line == line


YAML = """\
header: {stamp: {sec: 0, nanosec: 0}}
joint_names: [j1, j2]
points:
- positions: [0.0, 1.0]
  velocities: [0.0, 0.0]
  time_from_start: {secs: 1, nsecs: 0}
- positions: [8.0, 1.0]
  velocities: [12.0, 0.0]
  time_from_start: {sec: 3, nanosec: 0}
---
"""


def test_a_joint_trajectory_follows_cubics_where_it_states_velocities(tmp_path: Path) -> None:
    found = read(written(tmp_path, "a.yaml", YAML))
    assert found.names == ("j1", "j2") and found.units == ("rad", "rad") and found.of_joints
    # t³ has these positions and velocities at 0 and 2 s.
    times = np.linspace(0, 2, 9)
    np.testing.assert_allclose(found.at(times)[:, 0], times**3, atol=1e-12)


def test_a_joint_trajectory_follows_quintics_where_it_states_accelerations(tmp_path: Path) -> None:
    points = [
        {
            "positions": [time**5],
            "velocities": [5 * time**4],
            "accelerations": [20 * time**3],
            "time_from_start": {"sec": int(time), "nanosec": int(1e9 * (time % 1))},
        }
        for time in (0, 0.5, 2)
    ]
    goal = {"goal": {"trajectory": {"joint_names": ["j"], "points": points}}}
    found = read(written(tmp_path, "a.json", json.dumps(goal)))
    times = np.linspace(0, 2, 17)
    np.testing.assert_allclose(found.at(times)[:, 0], times**5, atol=1e-9)


def test_the_beginning_of_a_recording_ends_as_the_whole_passes_there(tmp_path: Path) -> None:
    whole = read(written(tmp_path, "a.yaml", YAML))
    cut = whole.until(1.5)
    times = np.linspace(0, 1.5, 7)
    assert cut.duration == 1.5
    np.testing.assert_allclose(cut.at(times), whole.at(times), atol=1e-3)


@pytest.mark.parametrize(
    ("document", "key", "message"),
    [
        ({"joint_names": ["a"], "points": [POINT, {"positions": [1, 2]}]}, "points[1].time_from_start",
            "None is not"),
        ({"joint_names": ["a"], "points": [{**POINT, "positions": [1, 2]}]}, "points[0].positions",
            "it has 2"),
        ({"joint_names": ["a"], "points": [{**POINT, "positions": ["x"]}]}, "points[0].positions[0]",
            "'x' is not"),
        ({"trajectory": {"joint_names": [1], "points": []}}, "trajectory.joint_names", "a list of names"),
        ({"joint_names": ["a"], "points": 3}, "points", "a list of points"),
        ({"names": []}, "joint_names", "has no joint_names"),
        ([1, 2], "joint_names", "has no joint_names"),
    ],
)  # fmt: skip
def test_a_wrong_message_is_told_with_its_key(
    tmp_path: Path, document: object, key: str, message: str
) -> None:
    with pytest.raises(InputError, match=message.replace("[", r"\[")) as error:
        read(written(tmp_path, "a.json", json.dumps(document)))
    assert error.value.location is not None and error.value.location.key == key


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("a.json", '{"fps": 30,\n "positions": [}', 2),
        ("a.json", "[" * 100_000, None),
        ("a.json", '{"joint_names": NaN}', None),
        ("a.yaml", "joint_names: [a\npoints: 3\n: :", 2),
        ("a.yaml", "[" * 3000, None),
        ("a.yaml", "x: !!python/object/apply:os.system ['true']", 1),
    ],
)
def test_what_is_no_json_or_yaml_is_told_with_its_line(
    tmp_path: Path, name: str, text: str, line: int | None
) -> None:
    with pytest.raises(InputError) as error:
        read(written(tmp_path, name, text))
    assert error.value.code in ("json-syntax", "yaml-syntax")
    assert line is None or (error.value.location is not None and error.value.location.line == line)


BY_FRAME = {"fps": 25, "positions": [{"0": 375, "7": 400}, {"7": 410}, {"0": 380}]}
BY_SERVO = {"fps": 25, "servos": {"0": {"name": "Bone", "positions": [375, 375, 380]}}}
COMMANDS = """\
const byte FPS = 25;
const byte PROGMEM ANIMATION_DATA[LENGTH] = {
    0x3c, 0x00, 0x01, 0x77, 0x3e, 0x3c, 0x07, 0x01, 0x90, 0x3e, 0x0a,
    0x3c, 0x07, 0x01, 0x9a, 0x3e, 0x0a,
    0x3c, 0x00, 0x01, 0x7c, 0x3e, 0x0a,
};
"""
ARRAYS = """\
/* FPS: 25 */
const int Bone[3] PROGMEM = {
  375, 375,
  380, };
const int Arm[3] = {400, 410, 410};
"""


def test_exports_of_blender_in_every_format_have_the_same_positions(tmp_path: Path) -> None:
    both = [[375, 400], [375, 410], [380, 410]]
    for name, text, names, values in (
        ("a.json", json.dumps(BY_FRAME), ("0", "7"), both),
        ("b.json", json.dumps(BY_SERVO), ("Bone",), [[375], [375], [380]]),
        ("a.h", COMMANDS, ("0", "7"), both),
        ("b.h", ARRAYS, ("Bone", "Arm"), both),
    ):
        found = read(written(tmp_path, name, text))
        assert (found.names, found.values.tolist()) == (names, values)
        np.testing.assert_allclose(found.times, [0, 0.04, 0.08])


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (COMMANDS.replace("0x9a, 0x3e", "0x9a, 0x3f"), 4, "begins no command"),
        (COMMANDS.replace("0x7c, 0x3e, 0x0a,", "0x7c,"), 5, "begins no command"),
        (ARRAYS.replace(" 380", " x"), 4, "'x' is no position"),
        (ARRAYS.replace("FPS", "fps"), None, "has no FPS"),
        ("FPS = 25;", None, "has no array of positions"),
    ],
)
def test_a_wrong_header_is_told_with_its_line(
    tmp_path: Path, text: str, line: int | None, message: str
) -> None:
    with pytest.raises(InputError, match=message) as error:
        read(written(tmp_path, "a.h", text))
    assert error.value.location is not None and error.value.location.line == line


def test_a_suffix_that_no_reader_has_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"motions are not read from \.bag"):
        read(written(tmp_path, "a.bag", ""))
