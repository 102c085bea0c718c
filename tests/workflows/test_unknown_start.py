"""A job whose program reads what has no value at power-up is not exact, whatever command asks.

The compiler's own programs read no such thing, so each test puts in front of one a skip that depends on a
byte of RAM which was never written. The pulses are the schedule's all the same.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from servogen.engines.firmware import Firmware
from servogen.job import load, plan_job
from servogen.pic.image import Image, to_hex
from servogen.pic.isa import decode, encode
from servogen.workflows.engines import PlayedJob, planned
from servogen.workflows.job_build import judge_firmware
from tests.cli.conftest import Ran, run  # noqa: F401 - a fixture

JOB = Path(__file__).parents[2] / "jobs" / "lab8-exercise.toml"
NEVER_WRITTEN = 0x4F
Run = Callable[..., Ran]


def of_unknown_start(image: Image) -> Image:
    """Return the program behind BTFSC 0x4F, 0; NOP."""
    first = decode(image.program[0])
    assert first is not None
    assert first.instruction.mnemonic not in ("BTFSC", "BTFSS", "DECFSZ", "INCFSZ", "ADDWF")
    free = max(image.program) + 1
    words = (encode("BTFSC", f=NEVER_WRITTEN, b=0), encode("NOP"), image.program[0], encode("GOTO", k=1))
    added = {free + index: word for index, word in enumerate(words)}
    return replace(image, program={**image.program, **added, 0: encode("GOTO", k=free)})


def behind_a_skip(firmware: Firmware) -> Firmware:
    compilation = replace(firmware.compilation, image=of_unknown_start(firmware.compilation.image))
    return replace(firmware, compilation=compilation)


def claims(text: str) -> list[str]:
    """Return the lines that say "exact" otherwise than as "not exact"."""
    return [line for line in text.splitlines() if re.search(r"(?<!not )\bexact\b", line, re.IGNORECASE)]


@pytest.fixture
def unknown_start(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let every job's firmware begin with the skip."""

    def behind_skips(job: object) -> PlayedJob:
        found = planned(job)  # type: ignore[arg-type]
        return replace(found, make=lambda dialect: behind_a_skip(found.make(dialect)))

    with monkeypatch.context() as patched:
        patched.setattr(import_module(judge_firmware.__module__), "planned", behind_skips)
        yield


def test_the_proof_that_build_demo_and_report_share_finds_it() -> None:
    found = planned(plan_job(load(JOB)))
    schedule, firmware = found.plan.schedule, found.make("c2c")
    assert judge_firmware(schedule, firmware).exact
    program = judge_firmware(schedule, behind_a_skip(firmware))
    assert program.verdict.edges_agree
    assert not program.exact
    assert "RAM 0x4F" in program.verdict.reasons[0]


def test_a_claim_is_recognised() -> None:
    assert claims("a: exact\nb: NOT EXACT\nc: not exact\nall frames exact") == [
        "a: exact",
        "all frames exact",
    ]


def test_build_says_so(run: Run, tmp_path: Path, unknown_start: None) -> None:  # noqa: F811
    ran = run("build", JOB, "--output", tmp_path)
    assert ran.code == 1
    assert "NOT EXACT" in ran.out
    assert claims(ran.out + (tmp_path / "report.txt").read_text()) == []
    ran = run("build", JOB, "--output", tmp_path, "--json")
    said = json.loads(ran.out)
    assert (ran.code, said["exact"]) == (1, False)
    assert [program["exact"] for program in said["programs"]] == [False] * 3


def test_demo_says_so(run: Run, tmp_path: Path, unknown_start: None) -> None:  # noqa: F811
    ran = run("demo", JOB, "--output", tmp_path)
    assert ran.code == 1
    assert "NOT EXACT" in ran.out
    (counts,) = claims(ran.out)
    assert counts.endswith(": 0 exact in one run, 0 proven for every power-up, input and chip")


def test_report_says_so(run: Run, tmp_path: Path, unknown_start: None) -> None:  # noqa: F811
    page = tmp_path / "page.html"
    ran = run("report", JOB, "--output", page)
    assert ran.code == 1
    assert "NOT EXACT" in ran.out
    words = re.sub(r"<(style|script)\b.*?</\1>|<[^>]*>", "\n", page.read_text(), flags=re.DOTALL)
    assert claims(ran.out + words) == []
    assert "NOT exact" in words


@pytest.mark.parametrize("json_too", [(), ("--json",)])
def test_tune_says_so(run: Run, tmp_path: Path, json_too: tuple[str, ...]) -> None:  # noqa: F811
    """Its delays are exact, so that there is no next C, and yet other chips may behave differently."""
    firmware = planned(plan_job(load(JOB))).make("c2c")
    theirs = tmp_path / "theirs.hex"
    theirs.write_text(to_hex(of_unknown_start(firmware.compilation.image)))
    ran = run("tune", JOB, "--hex", theirs, "--dialect", "c2c", *json_too)
    assert ran.code == 1
    assert list(tmp_path.iterdir()) == [theirs]
    if json_too:
        said = json.loads(ran.out)
        assert (said["exact"], said["verdict"]["exact"], said["next_c"]) == (False, False, None)
    else:
        assert "NOT exact" in ran.out
        assert claims(ran.out) == []


def test_the_same_job_is_proven_without_the_skip(run: Run, tmp_path: Path) -> None:  # noqa: F811
    ran = run("build", JOB, "--output", tmp_path)
    assert ran.code == 0
    assert claims(ran.out)
    assert claims((tmp_path / "report.txt").read_text())
