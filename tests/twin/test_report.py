"""What people see of a twin: the command, the page, the pictures, the pytest fixture."""

import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo: pip install 'servogen[twin]'")

from tests.twin.walking import AHEAD, SUPPLIED, text_of, walking, went_ahead

pytest_plugins = ["pytester"]


FFMPEG = shutil.which("ffmpeg")
ONE_CYCLE = "{ forward_mm = 40, cycles = 1 }"


def run(arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    from servogen.cli.main import main

    monkeypatch.setattr(sys, "argv", ["servogen", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


@pytest.fixture
def job(tmp_path: Path) -> Path:
    path = tmp_path / "walk.toml"
    path.write_text(
        text_of(ONE_CYCLE, extra=SUPPLIED + "\n[expect]\nrobot_within_mm = 5\nturn_within_deg = 3\n")
    )
    return path


def test_the_command_compares_and_exits_with_0(
    job: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    plot, csv = tmp_path / "walk.png", tmp_path / "walk.csv"
    names = ["--plot", str(plot), "--csv", str(csv)]
    assert run(["twin", str(job), *names, "--json"], monkeypatch) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["passed"]
    assert answer["asked"] == pytest.approx({"forward_m": 0.04, "left_m": 0, "turn_deg": 0})
    assert answer["simulated"]["forward_m"] == pytest.approx(0.04, rel=0.05)
    assert [check["name"] for check in answer["checks"]] == ["falls", "robot", "turn"]
    assert any("0.64 kg (its file states no mass_g)" in text for text in answer["assumptions"])
    assert plot.read_bytes().startswith(b"\x89PNG")
    rows = csv.read_text().splitlines()
    assert rows[0].startswith("time_s,x_mm,y_mm,z_mm,yaw_deg") and len(rows) > 200


@pytest.mark.campaign
def test_a_failing_expectation_exits_with_1_and_says_why(
    job: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(["twin", str(job), "--unplugged", "R2-lift"], monkeypatch) == 1
    shown = capsys.readouterr().out
    assert "turn:" in shown and "first cause: R2-lift receives no pulses at all" in shown
    assert "NOT as expected; friction 0.8" in shown


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--unplugged", "R9-lift"], "there is no servo 'R9-lift'"),
        (["--broken", "leg"], "there is no servo 'leg'"),
        (["--friction", "-1"], "friction = -1 is not between 0 and 5"),
        (["--step-mm", "10", "--rough-mm", "5"], "a step or is rough, not both"),
        (["--seconds", "0"], "seconds = 0 is less than 0.02"),
        (["--seconds", "1e9"], "longer than half an hour"),
        (["--film", "walk.avi"], "'.avi' is not a film"),
    ],
)
def test_what_cannot_be_is_refused(
    job: Path,
    arguments: list[str],
    text: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert run(["twin", str(job), *arguments], monkeypatch) == 2
    assert text in capsys.readouterr().err


def test_without_mujoco_the_command_exits_with_3(
    job: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert run(["twin", str(job)], monkeypatch) == 3
    assert "pip install 'servogen[twin]'" in capsys.readouterr().err


def test_a_job_without_a_robot_has_no_twin(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(["twin", "jobs/lab8-exercise.toml"], monkeypatch) == 2
    assert "the twin needs a robot" in capsys.readouterr().err


def test_the_page_shows_the_twin() -> None:
    from servogen.report.html import PageFacts, html_page
    from servogen.twin.pictures import page_facts

    made = walking(AHEAD, extra=SUPPLIED)
    facts = page_facts(went_ahead())
    html = html_page(PageFacts(made.found.job, made.found.plan, (), twin=facts))
    assert '<h2 id="twin">' in html and "height of the feet" in html and "0.64 kg (its file" in html
    assert '<h2 id="twin">' not in html_page(PageFacts(made.found.job, made.found.plan, ()))


def test_the_film_shows_the_legs_where_the_bodies_are() -> None:
    """The thigh of each leg is as long as the robot's file says, in every picture."""
    from servogen.twin.pictures import MAX_PICTURES, twin_scene

    verdict = went_ahead()
    scene = twin_scene(verdict, "walk")
    assert len(scene.parts) == 1 + 6 and scene.count <= MAX_PICTURES
    assert scene.count * scene.picture_s == pytest.approx(verdict.record.time[-1], abs=0.1)
    for part in scene.parts[1:]:
        for coxa, thigh, foot, tip in part.frames:
            assert np.linalg.norm(thigh - coxa) == pytest.approx(0.030, abs=1e-9)
            assert np.linalg.norm(foot - thigh) == pytest.approx(np.hypot(0.060, 0.020), abs=1e-9)
            assert np.linalg.norm(tip - foot) == pytest.approx(0.080, abs=5e-4)  # tilts with its equality


@pytest.mark.skipif(FFMPEG is None, reason="an MP4 needs ffmpeg")
def test_an_mp4_plays_as_long_as_the_run(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="films need matplotlib")
    from servogen.report.film import film
    from servogen.twin.pictures import twin_scene

    scene = twin_scene(went_ahead(), "walk")
    shown = slice(None, None, scene.count // 5)
    parts = tuple(replace(part, frames=part.frames[shown]) for part in scene.parts)
    short = replace(scene, parts=parts, picture_s=0.2)
    assert short.count in (5, 6)
    path = tmp_path / "walk.mp4"
    film(short, path)
    assert path.read_bytes()[4:8] == b"ftyp"
    command = [FFMPEG or "", "-i", str(path), "-vf", "scale=64:52,format=gray", "-f", "rawvideo", "-"]
    played = subprocess.run(command, capture_output=True, check=True)
    duration = re.search(rb"Duration: 00:00:(\d+\.\d+)", played.stderr)
    assert duration and float(duration[1]) == pytest.approx(0.2 * short.count, abs=0.05)
    pictures = np.frombuffer(played.stdout, np.uint8).reshape(-1, 52, 64)
    assert len(np.unique(pictures, axis=0)) == len(pictures) == short.count, "the robot moves"


@pytest.mark.campaign
def test_the_fixture_runs_a_job_in_its_robot(pytester: pytest.Pytester, job: Path) -> None:
    pytester.makepyfile(
        f"""
        def test_it_goes(servogen_twin):
            assert servogen_twin({str(job)!r}).passed

        def test_it_turns(servogen_twin):
            verdict = servogen_twin({str(job)!r}, unplugged=("R2-lift",))
            assert verdict.passed, verdict.reasons()
        """
    )
    done = pytester.runpytest_inprocess("-p", "no:cacheprovider", "-n0")
    done.assert_outcomes(passed=1, failed=1)
    done.stdout.fnmatch_lines(["*first cause: R2-lift receives no pulses at all*"])


def test_a_program_without_pulses_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    silent = tmp_path / "silent.asm"
    silent.write_text(" list p=16f84a\n org 0\nhere goto here\n end\n")
    assert run(["twin", "jobs/scara-pick.toml", "--hex", str(silent)], monkeypatch) == 1
    shown = capsys.readouterr().out
    assert "servos without pulses: 4 servos" in shown and "shoulder receives no pulses at all" in shown
