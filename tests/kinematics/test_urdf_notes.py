"""What a URDF file has and the parser does not know: notes with lines, and nothing else on the terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

from servogen.kinematics.urdf import from_urdf

CHAIN = """<robot name="one two">
  <link name="base"><skeleton/></link>
  <link name="tip"/>
  <joint name="lift" type="revolute">
    <parent link="base"/><child link="tip"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1" jerk="3"/>
    <colour name="red"/>
  </joint>
  <colour/>
  <weird/><weird/>
  <weird/>
</robot>
"""


def test_each_kind_is_one_note_at_its_first_line(capfd: pytest.CaptureFixture[str]) -> None:
    notes = from_urdf(CHAIN, "arm.urdf").notes
    assert capfd.readouterr() == ("", "")
    said = {note.message: (note.location.line if note.location else None, note.hint) for note in notes}
    link, joint, robot = (
        "<link> has: origin, inertial, visual, collision",
        "<joint> has: origin, parent, child, axis, limit, mimic, dynamics, calibration, safety_controller",
        "<robot> has: link, joint, material, transmission, gazebo",
    )
    assert said == {
        "the tag <skeleton> of <link> in 'base' is not read": (2, link),
        "the attribute \"jerk\" of <limit> in 'lift' is not read": (
            7,
            "<limit> has: lower, upper, effort, velocity",
        ),
        "the tag <colour> of <joint> in 'lift' is not read": (8, joint),
        "the tag <colour> of <robot> in 'one two' is not read": (10, robot),
        "the tag <weird> of <robot> in 'one two' is not read, nor are 2 more": (11, robot),
    }
    assert {note.code for note in notes} == {"urdf-ignored"} and {note.severity for note in notes} == {"note"}


def test_a_file_of_known_parts_has_no_note() -> None:
    known = "\n".join(
        line
        for line in CHAIN.replace("<skeleton/>", "").splitlines()
        if "weird" not in line and "colour" not in line
    ).replace(' jerk="3"', "")
    assert from_urdf(known, "arm.urdf").notes == ()


def test_a_name_with_a_quote_has_a_note_without_a_line() -> None:
    notes = from_urdf(
        CHAIN.replace('name="base"', 'name="ba\'se"').replace('"base"/', '"ba\'se"/'), "a.urdf"
    ).notes
    assert any("<skeleton>" in note.message for note in notes)


def test_the_notes_stand_beside_a_job_s_own(tmp_path: Path) -> None:
    from servogen.job import loads, plan_job

    (tmp_path / "arm.urdf").write_text(CHAIN)
    job = """[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[robot]
name = "arm.urdf"
[[servo]]
name = "lift"
pin = "RB0"
model = "sg90"
joint = "lift"
[motion]
poses = [{ lift_deg = 90, hold_s = 1 }]
"""
    notes = plan_job(loads(job, str(tmp_path / "job.toml"))).notes
    places = [note.location for note in notes if note.code == "urdf-ignored"]
    assert sorted(place.line or 0 for place in places if place) == [2, 7, 8, 10, 11]
