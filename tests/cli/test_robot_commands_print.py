"""What the commands of robots print of an answer: every line, with its numbers in degrees and millimetres."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from servogen.cli import show
from servogen.kinematics import queries
from tests.cli.stand_ins import stand_in

Run = Callable[..., Any]
Answer = Callable[[str, dict[str, Any]], list[tuple[Any, ...]]]


@pytest.fixture
def answer(monkeypatch: pytest.MonkeyPatch) -> Answer:
    """`answer(name, value)`: the function of queries gives this value; returns what it is asked."""

    def give(name: str, value: dict[str, Any]) -> list[tuple[Any, ...]]:
        asked: list[tuple[Any, ...]] = []

        def reply(*args: Any, **named: Any) -> dict[str, Any]:
            asked.append((*args, named) if named else args)
            return value

        stand_in(monkeypatch, queries, name, reply)
        return asked

    return give


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """The tables that are printed: title, columns and rows."""
    shown: list[tuple[Any, ...]] = []
    stand_in(monkeypatch, "servogen.cli.show", "table", lambda *given: shown.append(given))
    return shown


UNIT = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]
UNIT_TEXT = [
    "   1.00000     0.00000     0.00000",
    "   0.00000     1.00000     0.00000",
    "   0.00000     0.00000    -1.00000",
]


def test_fk_prints_position_rotation_configuration_and_joints_beyond(run: Run, answer: Answer) -> None:
    value = {
        "position_m": [0.1, -0.2, 0.3],
        "rotation": UNIT,
        "configuration_vector": [0.1, -0.2, 0.3, 0.0, 0.5, -1.25],
        "beyond_limits": ["q1", "q4"],
    }
    asked = answer("fk_answer", value)
    assert run("fk", "any", 1, 2).out.splitlines() == [
        "position x 100.0000  y -200.0000  z 300.0000 mm",
        *UNIT_TEXT,
        "configuration vector x 100.0000  y -200.0000  z 300.0000 mm  0.000000  0.500000  -1.250000",
        "beyond their limits: q1, q4",
    ]
    run("fk", "any")
    assert asked == [("any", [1.0, 2.0]), ("any", ())]
    assert json.loads(run("fk", "any", "--json").out) == {"diagnostics": [], **value}


def test_fk_prints_the_feet_of_a_walking_robot(run: Run, answer: Answer) -> None:
    answer(
        "fk_answer", {"feet_m": {"L1": [0.001, 0.002, -0.003], "R1": [0.0, 0.0, -0.0]}, "beyond_limits": []}
    )
    assert run("fk", "any").out.splitlines() == [
        "L1: x 1.0000  y 2.0000  z -3.0000 mm",
        "R1: x 0.0000  y 0.0000  z 0.0000 mm",
    ]


@pytest.mark.parametrize(
    ("direction", "radius", "speed", "line"),
    [
        (None, None, 0.0, "it stands"),
        (None, 0.0, 0.0, "it turns on the spot"),
        (-90, None, 0.25, "250.0000 mm/s towards 270.0000°, straight"),
        (30, 0.125, 0.1, "100.0000 mm/s towards 30.0000°, on a circle of radius 125.0000 mm"),
    ],
)
def test_fk_of_a_base_prints_its_speed_and_path(
    run: Run, answer: Answer, direction: float | None, radius: float | None, speed: float, line: str
) -> None:
    value = {"vx_m_s": 0.1, "vy_m_s": -0.05, "turn_deg_s": 45}
    value |= {"direction_deg": direction, "radius_m": radius, "speed_m_s": speed}  # type: ignore[dict-item]
    answer("fk_answer", value)
    assert run("fk", "any").out.splitlines() == ["vx 100.0000 mm/s  vy -50.0000 mm/s  Ω 45.0000 °/s", line]


def test_fk_in_symbols_numbers_the_links_from_one(run: Run, answer: Answer) -> None:
    value = {"links": ["A", "B"], "product": "P", "position": "T"}
    asked = answer("fk_symbolic", value)
    assert run("fk", "any", "--symbolic").out == "link 1:\nA\n\nlink 2:\nB\n\nproduct:\nP\n\nposition:\nT\n"
    shown = run("fk", "any", "--symbolic", "--style", "latex", "--json").out
    assert json.loads(shown) == {"diagnostics": [], **value}
    assert len(shown.splitlines()) == 1
    assert asked == [("any", "text"), ("any", "latex")]


@pytest.mark.parametrize(
    ("values", "lines"),
    [
        ({}, []),
        ({"missed_m": 1e-9}, []),  # rounding noise
        ({"missed_m": 1.1e-9}, ["for the nearest reachable point, 0.000001 mm away"]),
        (
            {"found": 3, "missed_m": 0.0125},
            ["for the nearest reachable point, 12.500000 mm away", "and 2 more: --all"],
        ),
        (
            {"found": 2, "complete": False},
            ["and 1 more: --all", "found by a numerical search: there may be more solutions"],
        ),
        (
            {"free": ["q4", "q6"], "complete": False},
            ["q4 and q6 can move while the tool stays there: there are infinitely many solutions"],
        ),
    ],
)
def test_ik_prints_solutions_the_miss_and_how_many_are_hidden(
    run: Run, answer: Answer, values: dict[str, Any], lines: list[str]
) -> None:
    plain = {
        "solutions": [{"q1_deg": 28.64789, "q2_deg": 0, "q3_mm": 0, "q4_deg": 0}],
        "missed_m": 0.0,
        "found": 1,
        "free": [],
        "complete": True,
    }
    asked = answer("ik_answer", plain | values)
    first, *others = run("ik", "scara", 1, 2, 3).out.splitlines()
    assert first.split()[:2] == ["q1", "28.648°"]
    assert others == lines
    run("ik", "scara", 1, 2, 3, "--all", "--json")
    assert asked == [("scara", [1, 2, 3], False), ("scara", [1, 2, 3], True)]


def test_ik_of_a_configuration_vector_asks_for_it(run: Run, answer: Answer) -> None:
    value: dict[str, Any] = {"solutions": [], "missed_m": 0.0, "found": 0, "free": [], "complete": True}
    asked = answer("configuration_answer", value)
    assert run("ik", "scara", 1, 2, "--configuration").out == ""
    assert asked == [("scara", [1, 2], False)]
    assert json.loads(run("ik", "scara", 1, "--configuration", "--json").out) == {"diagnostics": [], **value}


def test_ik_of_a_base_numbers_its_wheels_and_omits_what_is_not_known(
    run: Run, answer: Answer, tables: list[tuple[Any, ...]]
) -> None:
    speeds = {"wheel_speeds_deg_s": [90, -180]}
    answer("ik_answer", speeds)
    assert run("ik", "omni", 1, 2, 3).out == ""
    whole = {"rim_speeds_m_s": [0.1, 0.2], "motor_turns_per_s": [1.5, -2], "encoder_counts_per_s": [7, 8.26]}
    answer("ik_answer", speeds | whole)
    run("ik", "omni", 1, 2, 3)
    columns = ("wheel", "°/s", "rim mm/s", "motor turns/s", "encoder counts/s")
    rows = [(1, "90.0000", "100.0000", "1.5000", "7.0"), (2, "-180.0000", "200.0000", "-2.0000", "8.3")]
    assert tables == [("Wheels", columns[:2], [row[:2] for row in rows]), ("Wheels", columns, rows)]


JACOBIAN: dict[str, Any] = {
    "jacobian": UNIT,
    "manipulability": 0.123456789,
    "rank": 2,
    "singular": False,
    "lost_directions": [[0.0, 0.0, 1.0]],
}


def test_jacobian_prints_the_matrix_the_measure_and_what_is_lost(run: Run, answer: Answer) -> None:
    asked = answer("jacobian_answer", JACOBIAN)
    measure = "manipulability 0.123457, rank 2"
    assert run("jacobian", "any", 1, 2).out.splitlines() == [*UNIT_TEXT, measure]
    answer("jacobian_answer", JACOBIAN | {"singular": True})
    assert run("jacobian", "any").out.splitlines() == [
        *UNIT_TEXT,
        measure,
        "singular: the tool cannot move along",
        "   0.00000     0.00000     1.00000",
    ]
    assert asked == [("any", [1, 2], 0, [], None)]
    assert json.loads(run("jacobian", "any", "--json").out) == {
        "diagnostics": [],
        **JACOBIAN,
        "singular": True,
    }


def test_jacobian_prints_velocities_in_millimetres_and_degrees(run: Run, answer: Answer) -> None:
    moving = {"velocity_m_s": [0.1, 0, -0.02], "angular_velocity_deg_s": [180, 0, -90]}
    asked = answer("jacobian_answer", JACOBIAN | moving)
    lines = run("jacobian", "any", "--rates", "10, -5 2.5", "--frame", "n").out.splitlines()
    assert lines[3:5] == ["v 100.0000  0.0000  -20.0000 mm/s", "ω 180.0000  0.0000  -90.0000 °/s"]
    run("jacobian", "any", "--frame", "12")
    assert asked == [("any", (), "n", [10, -5, 2.5], None), ("any", (), 12, [], None)]


def test_jacobian_of_a_base_prints_the_inverse_and_no_measure(run: Run, answer: Answer) -> None:
    answer("jacobian_answer", {"jacobian": UNIT[:1], "inverse": UNIT[2:]})
    assert run("jacobian", "any").out.splitlines() == [UNIT_TEXT[0], "inverse", UNIT_TEXT[2]]


def test_jacobian_in_symbols_is_its_text_or_json(run: Run, answer: Answer) -> None:
    asked = answer("jacobian_symbolic", {"jacobian": "J"})
    assert run("jacobian", "any", "--symbolic").out == "J\n"
    assert json.loads(run("jacobian", "any", "--symbolic", "--frame", "3", "--style", "c", "--json").out) == {
        "diagnostics": [],
        "jacobian": "J",
    }
    assert asked == [("any", 0, "text"), ("any", 3, "c")]


def test_statics_has_torques_and_forces(run: Run, answer: Answer, tables: list[tuple[Any, ...]]) -> None:
    value = {
        "joints": [
            {"name": "q1", "load_nm": 1.5, "weight_nm": -0.25, "motor_nm": 1.25},
            {"name": "q3", "load_n": 10.0, "weight_n": 0.0, "motor_n": 10.0},
        ],
        "beyond_limits": ["q3"],
    }
    asked = answer("statics_answer", value)
    ran = run("statics", "any", 1, "--force-n", 1, 2, 3, "--moment-nm", 4, 5, 6, "--leg", "L1")
    assert ran.out == "beyond their limits: q3\n"
    rows = [("q1", "1.5000", "-0.2500", "1.2500", "N·m"), ("q3", "10.0000", "0.0000", "10.0000", "N")]
    assert tables == [("Joint loads", ("joint", "load", "own weight", "motor gives", "unit"), rows)]
    run("statics", "any", "--json")
    nothing = (0.0, 0.0, 0.0)
    assert asked == [("any", [1], (1, 2, 3), (4, 5, 6), "L1"), ("any", (), nothing, nothing, None)]
    assert len(tables) == 1


MOBILITY = {
    "elements": 4,
    "mobility": 1,
    "manoeuvrability": -2,
    "verdict": "moves",
    "joints": ["a", "b", "a"],
}


def test_mobility_counts_the_kinds_of_joints(run: Run, answer: Answer) -> None:
    asked = answer("mobility_answer", {**MOBILITY, "note": ""})
    lines = ["4 elements, joints: 2 a, 1 b", "mobility 1, manoeuvrability -2: moves"]
    assert run("mobility", "scara").out.splitlines() == lines
    mechanism = answer("mechanism_answer", {**MOBILITY, "joints": [], "note": "so it is"})
    assert run("mobility", "--elements", 4).out.splitlines() == [
        "4 elements, joints: none",
        lines[1],
        "so it is",
    ]
    run("mobility", "--elements", 4, "--joint", "turning:4", "--plane", "--json")
    assert asked == [("scara",)]
    assert mechanism == [(4, (), {"plane": False}), (4, ["turning:4"], {"plane": True})]


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("scara", "--elements", 4),
        ("scara", "--joint", "turning"),
        ("scara", "--plane"),
        ("--joint", "turning"),
        ("--plane",),
    ],
)
def test_mobility_takes_a_robot_or_a_mechanism(run: Run, words: tuple[object, ...]) -> None:
    ran = run("mobility", *words)
    assert (ran.code, ran.out) == (2, "")
    assert "give a robot, or the elements and joints of a mechanism" in ran.err


def test_transform_prints_a_matrix_and_perhaps_a_point(run: Run, answer: Answer) -> None:
    asked = answer("transform_answer", {"matrix": UNIT})
    assert run("transform", "T").out.splitlines() == UNIT_TEXT
    answer("transform_answer", {"matrix": UNIT[:1], "point": [1.23456, -2, 0]})
    assert run("transform", "T", 1, 2, 3).out.splitlines() == [UNIT_TEXT[0], "point  1.2346  -2.0000  0.0000"]
    assert asked == [("T", ())]


def test_orientation_prints_all_other_forms(run: Run, answer: Answer, tables: list[tuple[Any, ...]]) -> None:
    angles = {"ZYX": [90, 0, -180], "ZYZ": [0, 45, 0]}
    second = {"ZYX": [0, 180, 0], "ZYZ": [180, 0, 0]}
    value = {"axis": [0, 0.6, -0.8], "angle_deg": 60, "quaternion": [1, 0, 0, -0.5], "matrix": UNIT}
    asked = answer("orientation_answer", {"angles_deg": angles, "second_deg": second, **value})
    assert run("orientation", "rpy", 1, 2, 3).out.splitlines() == [
        "axis        0.000000  0.600000  -0.800000",
        "angle       60.0000°",
        "quaternion  1.000000  0.000000  0.000000  -0.500000",
        *UNIT_TEXT,
    ]
    rows = [
        ("zyx (rpy)", "  90.0000     0.0000  -180.0000", "   0.0000   180.0000     0.0000"),
        ("zyz", "   0.0000    45.0000     0.0000", " 180.0000     0.0000     0.0000"),
    ]
    assert tables == [("Angles, degrees", ("order", "angles", "second solution"), rows)]
    assert asked == [("rpy", [1, 2, 3])]


def test_differential_prints_three_matrices_and_both_motions(run: Run, answer: Answer) -> None:
    def motion(scale: float) -> dict[str, list[float]]:
        return {"translation": [scale, 0, 0], "rotation_rad": [0, 0, -scale]}

    value = {
        "matrix": UNIT[:1],
        "delta": UNIT[1:2],
        "change": UNIT[2:],
        "fixed": motion(0.5),
        "moving": motion(2),
    }
    asked = answer("differential_answer", value)
    words = ("--translation", 1, 2, 3, "--rotation-rad", 4, 5, 6, "--moving")
    assert run("differential", "T", *words).out.splitlines() == [
        *("T", UNIT_TEXT[0], "Δ", UNIT_TEXT[1], "dT = Δ T", UNIT_TEXT[2]),
        "fixed axes: d 0.500000  0.000000  0.000000  δ 0.000000  0.000000  -0.500000 rad",
        "axes of T:  d 2.000000  0.000000  0.000000  δ 0.000000  0.000000  -2.000000 rad",
    ]
    run("differential", "T")
    nothing = (0.0, 0.0, 0.0)
    assert asked == [
        ("T", (1, 2, 3), (4, 5, 6), {"moving": True}),
        ("T", nothing, nothing, {"moving": False}),
    ]


def test_the_list_of_robots_is_a_table_or_json(
    run: Run, answer: Answer, tables: list[tuple[Any, ...]]
) -> None:
    entries: Any = [{"name": "a", "kind": "arm", "joints": 4, "title": "A"}]
    answer("robot_list", entries)
    assert run("robots").out == ""
    assert tables == [("Robots", ("name", "kind", "joints", "title"), [("a", "arm", 4, "A")])]
    assert json.loads(run("robots", "--json").out) == {"diagnostics": [], "robots": entries}
    assert len(tables) == 1


JOINTS = [
    {"name": "q1", "kind": "turning", "lower_deg": -90, "upper_deg": 180, "home_deg": 0.0},
    {"name": "q2", "kind": "sliding", "lower_m": 0.0, "upper_m": 0.2, "home_m": 0.0125},
]
ROWS = [
    {"joint": "q1", "theta_deg": 90, "d": "l0", "a": "0", "alpha_deg": -180},
    {"joint": None, "theta_deg": 0.0, "d": "0", "a": "l1", "alpha_deg": 0.0},
]
ARM = {"joints": JOINTS, "rows": ROWS, "convention": "modified", "lengths_m": {"l0": 0.6, "l1": 0.0125}}


def test_the_details_of_an_arm_are_in_degrees_and_millimetres(
    run: Run, answer: Answer, tables: list[tuple[Any, ...]]
) -> None:
    head = {
        "name": "a",
        "title": "An arm",
        "kind": "arm",
        "dimensions": "measured",
        "source": "a book",
        "mass": 2.5,
    }
    answer("robot_details", head | ARM)
    assert run("robots", "a").out.splitlines() == [
        "a: An arm (arm)",
        "dimensions: measured; source: a book",
        "mass: 2.5",
    ]
    assert tables == [
        (
            "Joints",
            ("name", "kind", "from", "to", "home"),
            [("q1", "turning", "-90°", "180°", "0°"), ("q2", "sliding", "0 mm", "200 mm", "12.5 mm")],
        ),
        (
            "DH rows (modified)",
            ("joint", "theta", "d", "a", "alpha"),
            [("q1", "90°", "l0", "0", "-180°"), ("fixed", "0°", "0", "l1", "0°")],
        ),
        ("Lengths", ("name", "value"), [("l0", "600 mm"), ("l1", "12.5 mm")]),
    ]
    tables.clear()
    answer("robot_details", head | {"title": "", "source": ""} | ARM | {"lengths_m": {}})
    assert run("robots", "a").out.splitlines()[:2] == ["a (arm)", "dimensions: measured"]
    assert [title for title, *_ in tables] == ["Joints", "DH rows (modified)"]


def test_the_details_of_a_walking_robot_and_of_a_base(
    run: Run, answer: Answer, tables: list[tuple[Any, ...]]
) -> None:
    head = {"name": "a", "title": "", "kind": "k", "dimensions": "d", "source": ""}
    mounts = [{"name": "L1", "position_m": [0.09, 0.06, 0], "heading_deg": 90}]
    answer("robot_details", head | {"leg": ARM, "mounts": mounts})
    run("robots", "a")
    assert [title for title, *_ in tables] == ["Joints", "DH rows (modified)", "Lengths", "Mounts"]
    place = ("L1", "x 90.0000  y 60.0000  z 0.0000 mm", "90°")
    assert tables[-1] == ("Mounts", ("leg", "position", "heading"), [place])
    tables.clear()
    rows = [
        {"wheels": ["1", "2"], "motion": "straight", "direction_deg": 30, "turning": 0, "size": None},
        {"wheels": ["3"], "motion": "circle", "direction_deg": None, "turning": 1, "size": "small",
         "radius_in_wheel_distances": 2},
        {"wheels": ["1", "3"], "motion": "turn", "direction_deg": 0, "turning": -1, "size": None},
    ]  # fmt: skip
    answer("robot_details", head | {"table": rows})
    run("robots", "a")
    columns = ("wheels", "motion", "direction °", "turns", "circle, radius")
    assert tables == [
        (
            "Wheels at equal speed",
            columns,
            [
                ("1, 2", "straight", 30, "–", "–"),
                ("3", "circle", "–", "counter-clockwise", "small, 2 l"),
                ("1, 3", "turn", 0, "clockwise", "–"),
            ],
        )
    ]


def test_a_table_has_its_title_columns_and_rows(capsys: pytest.CaptureFixture[str]) -> None:
    show.table("Title", ("name", "n"), [("a", "-1.5"), ("bc", "10")])
    assert [line.rstrip() for line in capsys.readouterr().out.splitlines() if line.strip(" ─")] == [
        "Title",
        "  name      n",
        "  a      -1.5",
        "  bc       10",
    ]


def test_a_robot_is_shown_as_text_or_json(run: Run, answer: Answer) -> None:
    details = {"name": "a", "title": "", "kind": "k", "dimensions": "d", "source": ""}
    asked = answer("robot_details", details)
    assert run("robots", "a").out.splitlines() == ["a (k)", "dimensions: d"]
    assert json.loads(run("robots", "a", "--json").out) == {"diagnostics": [], **details}
    assert asked == [("a",), ("a",)]


@pytest.mark.parametrize("option", ["--urdf", "--mjcf"])
def test_a_robot_is_written_to_a_file_whose_name_is_printed(run: Run, tmp_path: Path, option: str) -> None:
    path = tmp_path / "robot.xml"
    nameless = run("robots", option, path)
    assert (nameless.code, nameless.out, path.exists()) == (2, "", False)
    assert "which robot should be written?" in nameless.err
    written = run("robots", "scara", option, path)
    assert written.code == 0 and str(path) in written.out
    assert path.read_text().startswith("<")
