"""The commands of robots print the specification's worked numbers."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]


def test_scara_forward_kinematics(run: Run) -> None:
    at = json.loads(run("fk", "scara", 30, 60, 200, 0, "--json").out)["position_m"]
    assert at == pytest.approx([0.34641, 0.5, 0.25], abs=5e-6)


def test_scara_inverse_kinematics_lists_every_solution_in_radians_and_metres(run: Run) -> None:
    answer = json.loads(run("ik", "scara", 346.41016, 500, 250, "--all", "--json").out)
    assert [*answer["solutions"][0].items()][:3] == [
        ("q1_deg", pytest.approx(30, abs=1e-4)),
        ("q2_deg", pytest.approx(60, abs=1e-4)),
        ("q3_mm", pytest.approx(200, abs=1e-3)),
    ]
    assert len(answer["solutions"]) == 2


def test_negative_numbers_need_no_dashes(run: Run) -> None:
    positive = run("fk", "scara", 10, 20, 0, 0, "--json")
    negative = run("fk", "scara", -10, -20, 0, 0, "--json")
    assert (positive.code, negative.code) == (0, 0)
    assert json.loads(negative.out)["position_m"][1] == -json.loads(positive.out)["position_m"][1]
    assert run("ik", "rv-m1", 300, -20.5, 300).code == 0
    assert (
        run("equation", 1, -1, 0).code == run("differential", "Rx(90)", "--translation", -1, 2, 3).code == 0
    )
    assert "No such option: -1" in run("robots", -1).err, "its argument is a name"


def test_a_product_of_transforms_moves_a_point(run: Run) -> None:
    answer = json.loads(run("transform", "Ry(30) Tx(50) Rz(60)", 2, 4, 1, "--json").out)
    assert answer["point"] == pytest.approx([41.6673, 3.7321, -22.9019], abs=5e-5)


def test_mobility_of_the_scara(run: Run) -> None:
    answer = json.loads(run("mobility", "scara", "--json").out)
    assert (answer["elements"], answer["mobility"], answer["manoeuvrability"]) == (5, 4, -2)


def test_each_robot_of_the_list_can_be_shown(run: Run) -> None:
    names = [row["name"] for row in json.loads(run("robots", "--json").out)["robots"]]
    assert {"scara", "rv-m1", "irb6400c", "theta-r", "leg", "hexapod", "omni"} <= set(names)
    assert all(run("robots", name).code == 0 for name in names)


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (("fk", "scarra", "1"), "did you mean 'scara'"),
        (("fk", "scara", "1"), "joints"),
        (("ik", "scara", "900", "0", "250"), "nearest"),
        (("transform", "Rq(30)"), "Rq(30)"),
        (("fk", "scara", "one", "2", "3", "4"), "one"),
    ],
)
def test_bad_input_is_told_and_is_exit_code_2(run: Run, command: tuple[str, ...], says: str) -> None:
    ran = run(*command)
    assert ran.code == 2
    assert says in ran.err and "Traceback" not in ran.err


def test_symbols_in_three_styles(run: Run) -> None:
    assert "q2*sin(q1)" in run("fk", "theta-r", "--symbolic").out
    assert "\\sin" in run("fk", "theta-r", "--symbolic", "--style", "latex").out
    assert run("jacobian", "theta-r", "--symbolic", "--frame", "n").code == 0


@pytest.mark.parametrize("command", ["fk", "jacobian"])
def test_without_sympy_symbols_say_what_to_install(
    run: Run, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)
    ran = run(command, "scara", "--symbolic")
    assert ran.code == 3
    assert "pip install 'servogen[symbolic]'" in ran.err and "Traceback" not in ran.err
    assert run(command, "scara", 30, 60, 200, 0).code == 0


def test_an_arm_written_as_urdf_is_the_same_arm_to_every_command(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    assert run("robots", "scara", "--urdf", path).code == 0
    ours, theirs = (json.loads(run("fk", robot, 30, -45, 100, 20, "--json").out) for robot in ("scara", path))
    assert theirs["position_m"] == pytest.approx(ours["position_m"], abs=1e-9)
    for mine, other in zip(ours["rotation"], theirs["rotation"], strict=True):
        assert other == pytest.approx(mine, abs=1e-9)
    assert run("jacobian", path, 30, -45, 100, 20).code == 0


def test_urdf_needs_an_arm_and_a_file_that_is_one(run: Run, tmp_path: Path) -> None:
    assert "which robot" in run("robots", "--urdf", tmp_path / "arm.urdf").err
    assert "6 legs" in run("robots", "hexapod", "--urdf", tmp_path / "arm.urdf").err
    assert run("fk", tmp_path / "none.urdf", 0).code == 2
    (tmp_path / "text.urdf").write_text("hello")
    assert "is not a URDF file" in run("fk", tmp_path / "text.urdf", 0).err


def test_what_each_new_command_prints(run: Run) -> None:
    assert run("mobility", "--elements", 4, "--joint", "turning:4", "--plane").out.startswith(
        "4 elements, joints: 4 turning\nmobility 1, manoeuvrability -5: deficient\n1 closed loop"
    )
    assert "80.6133 mm/s towards 0.0000°, straight" in run("fk", "omni", 100, -100, 0).out
    assert "on a circle of radius 270.0000 mm" in run("fk", "omni", 0, -100, 0).out
    assert "it turns on the spot" in run("fk", "omni", -5, -5, -5).out
    assert "it stands" in run("fk", "omni", 0, 0, 0).out
    assert "55.1329           112912.2" in run("ik", "omni", 1000, 0, 0).out
    assert "inverse" in run("jacobian", "omni").out
    assert "0.3000" in run("statics", "leg", 0, 30, "--force-n", 0, 0, -10).out
    assert "beyond their limits: beta" in run("statics", "leg", 0, 100, "--force-n", 0, 0, 10).out
    assert "axes of T:  d 0.000000  -0.500000  1.000000  δ 0.100000" in (
        run(
            *("differential", "Trans(10,5,0) Rz(90) Rx(90)", "--translation", 1, 0, 0.5),
            *("--rotation-rad", 0, 0.1, 0),
        ).out
    )
    assert (
        "ω 0.0000  0.0000  -15.0000 °/s"
        in run("jacobian", "scara", 30, 60, 100, 20, "--rates", "10 -20, 30 5").out
    )
    assert "q5 90.000°" in run("ik", "rv-m1", 0, 475.7712, 315.6283, 0, 1.648721, 0, "--configuration").out


def test_new_answers_are_json_in_metres_and_radians(run: Run) -> None:
    answers = {
        "closed_loops": ("mobility", "--elements", 4, "--joint", "turning:4", "--plane"),
        "vx_m_s": ("fk", "omni", 100, -100, 0),
        "wheel_speeds_deg_s": ("ik", "omni", 1000, 0, 0),
        "inverse": ("jacobian", "omni"),
        "joints": ("statics", "leg", 0, 30, "--force-n", 0, 0, -10),
        "change": ("differential", "Rx(90)", "--translation", 1, 0, 0),
        "velocity_m_s": ("jacobian", "scara", 0, 0, 0, 0, "--rates", "1 2 3 4"),
        "configuration_vector": ("fk", "rv-m1", 90, 0, 0, 0, 90),
    }
    for key, command in answers.items():
        assert key in json.loads(run(*command, "--json").out)


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (("mobility",), "give a robot, or the elements and joints"),
        (("mobility", "scara", "--plane"), "give a robot, or the elements and joints"),
        (("mobility", "--elements", "5", "--joint", "turning:3"), "do not connect 5 elements"),
        (("mobility", "--elements", "2", "--joint", "turnin"), "did you mean 'turning'"),
        (("fk", "omni", "1"), "omni has 3 wheels, not 1"),
        (("fk", "omni", "--symbolic"), "drives on wheels"),
        (("jacobian", "scara", "0", "0", "0", "0", "--rates", "one"), "'one' is not a number"),
        (("statics", "scara", "0", "0", "0", "0"), "nothing loads scara"),
        (("statics", "scara", "0", "0", "0", "0", "--force-n", "1", "2"), "--force-n"),
        (("differential", "Rq(1)"), "Rq(1)"),
        (
            ("ik", "anthropomorphic", "1", "2", "3", "0", "0", "1", "--configuration"),
            "does not roll the tool",
        ),
    ],
)
def test_bad_input_of_the_new_commands_is_exit_code_2(run: Run, command: tuple[str, ...], says: str) -> None:
    ran = run(*command)
    assert ran.code == 2
    assert says in ran.err and "Traceback" not in ran.err


@pytest.mark.parametrize(
    "command",
    [
        ("fk", "leg", "1e300", 30),
        ("fk", "omni", "1e308", "1e308", "1e308"),
        ("ik", "leg", "1e300", 0, 0),
        ("statics", "leg", 10, 30, "--force-n", 0, 0, "-1e308"),
        ("transform", "Tx(1e308) Tx(1e308)"),
        ("transform", "Tx(1)", "1e10", 0, 0),
    ],
)
def test_a_number_too_large_to_compute_with_is_refused(run: Run, command: tuple[object, ...]) -> None:
    ran = run(*command)
    assert ran.code == 2 and "is not a number from -1e+09 to 1e+09" in ran.err and "Warning" not in ran.err


def test_a_number_at_the_limit_is_computed_with(run: Run) -> None:
    ran = run("transform", "Tx(1e9)", "-1e9", 0, 0, "--json")
    assert ran.code == 0 and json.loads(ran.out)["point"] == [0, 0, 0]


def test_a_wrong_transform_names_its_column_once(run: Run) -> None:
    ran = run("transform", "Rx(1) Rq(30)")
    assert ran.code == 2 and "error: column 7: 'Rq(30)' is not a transform" in ran.err


@pytest.mark.parametrize(
    ("words", "lines"),
    [
        ((1, 0, -0.5), ["x = -60.000000°", "x = 60.000000°", "and these ± every multiple of 360°"]),
        ((1, 0, -2), ["no solution: |c| = 2 is greater than √(a² + b²) = 1"]),
        ((0, 0, 3), ["no solution: a = b = 0, and c is not 0"]),
        ((0, 0, 0), ["a = b = c = 0: every x is a solution"]),
    ],
)
def test_an_equation_is_solved_or_says_why_not(run: Run, words: tuple[float, ...], lines: list[str]) -> None:
    assert run("equation", *words).out.splitlines() == lines
