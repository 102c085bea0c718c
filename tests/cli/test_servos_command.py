"""`servogen servos`: the catalogue, and every figure of a servo with where it comes from."""

import json
from pathlib import Path

from tests.cli.conftest import Run

OWN = """\
title = "Mine"
source = "seller: a shop"
speed_deg_s = 400
torque_ncm = 20
points = [{ angle_deg = 0, width_us = 600 }, { angle_deg = 170, width_us = 2400 }]

[motor]
start_ms = 20
assumed = ["torque_ncm"]

[sources]
points = "measured"
"""


def test_the_list_has_names_and_numbers(run: Run) -> None:
    ran = run("servos", "--json")
    found = {row["name"]: row for row in json.loads(ran.out)["servos"]}
    assert found["mg996r"] == {
        "name": "mg996r",
        "supply_v": 4.8,
        "speed_deg_s": 352.9,  # 60° in 0.17 s
        "torque_ncm": 92.18,  # 9.4 kgf·cm
        "mass_g": 55.0,
        "title": "Tower Pro MG996R",
    }
    assert "Tower Pro MG996R" in run("servos").out


def test_a_servo_is_found_in_any_spelling_with_whose_figures_it_has(run: Run) -> None:
    shown = json.loads(run("servos", "Tower Pro SG90", "--json").out)
    origins = {figure["key"]: figure["origin"] for figure in shown["figures"]}
    assert shown["name"] == "sg90"
    assert (origins["torque_ncm"], origins["points"], origins["dead_band_us"]) == (
        "maker",
        "assumed",
        "maker",
    )


def test_a_file_says_where_its_figures_are_from(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "own.toml"
    file.write_text(OWN, "utf-8")
    shown = json.loads(run("servos", str(file), "--json").out)["figures"]
    found = {figure["key"]: (figure["value"], figure["origin"], figure["source"]) for figure in shown}
    assert found == {
        "speed_deg_s": ("400", "seller", "a shop"),
        "torque_ncm": ("20", "assumed", ""),
        "points": ("0° 600 µs, 170° 2400 µs", "file", "measured"),
        "start_ms": ("20", "seller", "a shop"),
    }


def test_a_source_of_no_figure_and_an_unknown_servo_are_refused(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "own.toml"
    file.write_text(OWN + 'torque = "x"\n', "utf-8")
    ran = run("servos", str(file))
    assert ran.code == 2 and "there is no figure 'torque'" in ran.err and "torque_ncm" in ran.err
    assert run("servos", "mg99").code == 2
