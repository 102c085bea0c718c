"""`certificates/`: the proofs for all inputs of the committed firmware, which `make demo` checks."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import pytest

from servogen.checker import read_certificate
from servogen.checker.certificate import fingerprint
from servogen.pic.image import Image, read_hex
from servogen.programs import read_schedule
from servogen.workflows.certificates import beside, check_file
from tests.campaigns import sampled
from tests.prove.attack import servogen

ROOT = Path(__file__).parent.parent.parent
KEPT = ROOT / "certificates"
PROGRAMS = sorted((ROOT / "firmware").glob("*/main*.hex"))
JOB = "lab9-program"


def image_of(program: Path) -> Image:
    return read_hex(program.read_text(), str(program)).image


@pytest.mark.parametrize("program", sampled(PROGRAMS, 12), ids=lambda path: f"{path.parent.name}/{path.name}")
def test_every_program_has_a_certificate_of_itself_and_its_schedule(program: Path) -> None:
    """If not: make certificates."""
    file = beside(KEPT / program.parent.name / program.name)
    claim = read_certificate(file.read_bytes(), str(file))
    assert claim.image == fingerprint(image_of(program))
    schedule = (program.parent / "schedule.json").read_bytes()
    assert claim.schedule == hashlib.sha256(schedule).hexdigest()


def test_they_are_small_and_none_is_left_over() -> None:
    files = sorted(path for path in KEPT.rglob("*") if path.is_file())
    assert files == sorted(beside(KEPT / path.parent.name / path.name) for path in PROGRAMS)
    sizes = [path.stat().st_size for path in files]
    assert max(sizes) <= 200_000
    assert sum(sizes) <= 1_500_000


def test_one_is_valid_for_its_program_only() -> None:
    folder = ROOT / "firmware" / JOB
    schedule = read_schedule(folder / "schedule.json")
    file = beside(KEPT / JOB / "main.hex")
    assert check_file(file, image_of(folder / "main.hex"), schedule).text == "proven, checked"
    other = check_file(file, image_of(folder / "main.sdcc.hex"), schedule)
    assert (other.valid, other.missing) == (False, False)
    assert "another program" in other.text
    assert check_file(KEPT / "none", image_of(folder / "main.hex"), schedule).text == "no certificate"


def test_demo_shows_what_the_checker_says(tmp_path: Path) -> None:
    job = ROOT / "jobs" / f"{JOB}.toml"
    answer = json.loads(servogen("demo", job, "--output", tmp_path, "--certificates", KEPT, "--json"))
    (shown,) = answer["jobs"]
    assert (shown["exact"], shown["proven"], set(shown["all_runs"])) == (True, True, {"proven, checked"})
    wrong = tmp_path / "certificates"
    shutil.copytree(KEPT / JOB, wrong / JOB)
    shutil.copy(KEPT / JOB / "main.sdcc.cert.xz", wrong / JOB / "main.cert.xz")
    answer = json.loads(servogen("demo", job, "--output", tmp_path, "--certificates", wrong, "--json"))
    assert sum("refused" in text for text in answer["jobs"][0]["all_runs"]) == 1


def test_demo_proves_what_has_no_certificate_and_writes_it_even_if_the_cache_has_one(tmp_path: Path) -> None:
    job = ROOT / "jobs" / f"{JOB}.toml"
    for folder in (tmp_path / "new", tmp_path / "cached"):
        made = ("demo", job, "--output", tmp_path, "--certificates", folder, "--prove", "--json")
        assert set(json.loads(servogen(*made))["jobs"][0]["all_runs"]) == {"proven, checked"}
        for program in ("main", "main.sdcc", "main.xc8"):
            name = f"{JOB}/{program}.cert.xz"
            assert (folder / name).read_bytes() == (KEPT / name).read_bytes()
