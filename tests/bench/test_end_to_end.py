"""The steps of docs/bench.md against `servogen rig`, each one command in a process of its own.

The chip's crystal is 180 ppm fast; the analyser samples once a microsecond.
"""

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.native import parts
from servogen.pic.device import device
from servogen.pic.image import to_hex
from tests.bench.conftest import ROOT, Bench, Run, image_of, running

HEXAPOD = ROOT / "firmware" / "hexapod-tripod"
OTHER = ROOT / "firmware" / "lab8-program" / "main.hex"

picpro = pytest.mark.skipif(not find_spec("picpro"), reason="picpro is not installed: pip install picpro")


def seen(run: Run, bench: Bench, schedule: Path, where: Path) -> dict[str, object]:
    """The verdict on what the analyser sees now."""
    path = where / "run.vcd"
    done = run("capture", "--port", bench.paths["analyser"], "--against", schedule, "-o", path)
    assert done.code == 0, done.err
    done = run("verify", path, "--against", schedule, "--json")
    verdict: dict[str, object] = json.loads(done.out)
    assert done.code == (0 if verdict["agrees"] else 1)
    return verdict


@pytest.mark.campaign
@picpro
def test_a_program_with_a_pulse_of_two_microseconds_more_is_caught(run: Run, tmp_path: Path) -> None:
    folder, old, new = HEXAPOD, "ROW[] = {\n    95, 95, 95, 75,", "ROW[] = {\n    97, 95, 95, 75,"
    text = (folder / "main.c2c.c").read_text()
    assert old in text
    source = Source(text.replace(old, new, 1), "wrong.c")
    wrong = compile_sources([source], Options(dialect="c2c", device=device("16F84A"))).image
    assert wrong.flash() != image_of(folder / "main.hex").flash()
    path, schedule = tmp_path / "wrong.hex", folder / "schedule.json"
    path.write_text(to_hex(wrong))
    with running(folder.name, "--crystal-ppm", 180, "--hex", folder / "main.hex") as bench:
        to = ("--programmer", "picpro", "--port", bench.paths["programmer"])
        refused = run("flash", path, *to, "--against", schedule)
        assert refused.code == 2
        assert "its pulses are not exact against" in refused.err
        done = run("flash", path, *to, "--device", "PIC16F84A", "--force")
        assert done.code == 0, done.err
        assert not seen(run, bench, schedule, tmp_path)["agrees"]


def cloned(folder: Path) -> Path:
    if not (shutil.which("git") and shutil.which("make") and (ROOT / ".git").exists()):
        pytest.skip("needs git, make and a clone of the repository")
    subprocess.run(["git", "clone", "--quiet", "--depth", "1", ROOT.as_uri(), folder], check=True)
    for part in parts():  # an installation compiles them; these are of the same sources
        shutil.copy(part.library, folder / part.library.relative_to(ROOT))
    return folder


@pytest.mark.campaign
@picpro
def test_from_a_clean_clone_make_flash_capture_and_verify_are_one_command_each(
    run: Run, tmp_path: Path
) -> None:
    """With the Python that runs the tests instead of one that is installed anew."""
    job = "lab8-exercise"
    clone, venv = cloned(tmp_path / "clone"), Path(sys.prefix)
    schedule = clone / "build" / job / "schedule.json"
    with running(job, "--crystal-ppm", 180, "--hex", OTHER) as bench:
        assert not seen(run, bench, ROOT / "firmware" / job / "schedule.json", tmp_path)["agrees"]
        port = bench.paths["programmer"]
        done = subprocess.run(
            ["make", "-o", venv / ".installed", "flash", f"JOB={job}", f"PORT={port}", f"VENV={venv}"],
            cwd=clone,
            env={**os.environ, "PYTHONPATH": str(clone)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert "read back and compared" in done.stdout
        verdict = seen(run, bench, schedule, tmp_path)
    assert verdict["reasons"] == []
    assert verdict["agrees"]
    assert verdict["sample_us"] == 1
    assert verdict["crystal_ppm"] == pytest.approx(180, abs=2)
    assert verdict["different_frames_seen"] == verdict["different_frames"]
