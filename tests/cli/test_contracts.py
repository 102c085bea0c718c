"""`verify --contract` and `prove --contract`: one file says what must be, a run and a proof answer."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.prove.test_contract_proofs import ANSWER, HEADER, PULSE, WAVE, answer


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wave.asm").write_text(HEADER + WAVE.format(turns=10) + "        end\n")
    (tmp_path / "late.asm").write_text(HEADER + WAVE.format(turns=11) + "        end\n")
    (tmp_path / "answer.asm").write_text(HEADER + ANSWER.format(delay="") + "        end\n")
    (tmp_path / "wave.toml").write_text(PULSE)
    (tmp_path / "answer.toml").write_text(answer(2, 6))
    return tmp_path


def test_one_run_is_exact_or_violated_with_the_moment(files: Path, run: Run) -> None:
    found = run("verify", "wave.asm", "--contract", "wave.toml", "--seconds", "0.1")
    assert found.code == 0 and found.out.startswith("exact: one run from power-up of 0.1 s, 1 clause")
    found = run("verify", "late.asm", "--contract", "wave.toml", "--seconds", "0.1", "--json")
    answered = json.loads(found.out)
    assert (found.code, answered["verdict"], answered["exact"]) == (1, "violated", False)
    assert answered["clauses"][0]["message"] == "is high for more than 32 cycles"


def test_a_contract_is_proposed_by_a_run_that_keeps_it_and_another_breaks_it(files: Path, run: Run) -> None:
    """The other program's wave is one cycle slower on each side."""
    proposed = run(
        "measure", "wave.asm", "--contract", "first.toml", "--margin-percent", "0", "--seconds", "0.1"
    )
    assert proposed.out.splitlines()[-1] == "next: servogen verify wave.asm --contract first.toml"
    words = ["--contract", "first.toml", "--seconds", "0.1"]
    kept = run("verify", "wave.asm", *words)
    assert kept.code == 0 and kept.out.startswith("exact: one run from power-up of 0.1 s")
    broken = run("verify", "late.asm", *words)
    assert broken.code == 1 and broken.out.startswith("violated")
    assert run("simulate", "wave.asm", "--seconds", "0.1", "--edges", "wave.csv").code == 0
    assert run("measure", "wave.csv", "--contract", "seen.toml").code == 0
    assert run("verify", "wave.asm", "--contract", "seen.toml", "--seconds", "0.1").code == 0


def test_a_stimulus_drives_the_inputs_and_without_one_nothing_is_seen(files: Path, run: Run) -> None:
    (files / "press.toml").write_text(
        '[[level]]\npin = "RB0"\nat_us = [0, 500, 900, 1300]\nlevel = [1, 0, 1, 0]\n'
    )
    words = ["verify", "answer.asm", "--contract", "answer.toml", "--seconds", "0.01"]
    pressed = run(*words, "--stimulus", "press.toml")
    assert pressed.code == 0 and "2 causes" in pressed.out
    alone = run(*words)
    assert alone.code == 1 and "not seen" in alone.out
    assert run(*words, "--partial").code == 0


def test_a_contract_is_proposed_by_a_run_with_a_stimulus(files: Path, run: Run) -> None:
    """RB4 rises only if RB0 falls: 400 µs later RB0 rises, and RB4 falls a few cycles after that."""
    press = '[[level]]\npin = "RB0"\nat_us = [0, 500, {}, 1300, 1700]\nlevel = [1, 0, 1, 0, 1]\n'
    (files / "press.toml").write_text(press.format(900))
    (files / "longer.toml").write_text(press.format(910))
    words = ["--seconds", "0.01", "--stimulus", "press.toml"]
    assert run("measure", "answer.asm", "--contract", "seen.toml", "--seconds", "0.01").code == 2
    proposed = run("measure", "answer.asm", "--contract", "seen.toml", *words)
    step = "next: servogen verify answer.asm --contract seen.toml --stimulus press.toml"
    assert proposed.code == 0 and proposed.out.splitlines()[-1] == step
    assert run(*step.split()[2:], "--seconds", "0.01").code == 0
    longer = run("verify", "answer.asm", "--contract", "seen.toml", *words[:-1], "longer.toml")
    assert longer.code == 1 and longer.out.startswith("violated")


def test_a_recording_of_the_run_is_judged_like_the_run(files: Path, run: Run) -> None:
    for name, code in (("wave", 0), ("late", 1)):
        assert run("simulate", f"{name}.asm", "--seconds", "0.1", "--edges", f"{name}.csv").code == 0
        assert run("verify", f"{name}.csv", "--contract", "wave.toml").code == code


def test_a_proof_names_its_witnesses_and_a_counterexample_its_command(files: Path, run: Run) -> None:
    words = ["prove", "answer.asm", "--contract", "answer.toml"]
    proven = run(*words)
    assert proven.code == 0 and proven.out.startswith("proven, checked\n")
    assert "for every power-up, input and chip: every clause is kept" in proven.out
    restricted = run(*words, "--start", "ram=0", "--watchdog-us", "18000")
    assert restricted.code == 1 and restricted.out.startswith(
        "proven by one engine: the checker does not cover"
    )
    assert run(*words, "--start", "ram=0", "--accept-one-engine").code == 0
    assert "for every input: every clause is kept" in restricted.out
    assert "at power-up ram is 0x00" in restricted.out
    (files / "answer.toml").write_text(answer(2, 5))
    broken = run(*words, "--accept-one-engine", "--no-resets", "--json")
    command = json.loads(broken.out)["counterexample"]["command"].split()
    assert broken.code == 1 and command[:2] == ["servogen", "verify"]
    shown = run(*words, "--no-resets")
    assert shown.code == 1 and shown.out.startswith("counterexample: ") and " ".join(command) in shown.out
    replayed = run(*command[1:])
    assert replayed.code == 1 and "violated" in replayed.out


def test_what_does_not_go_together_is_refused(files: Path, run: Run) -> None:
    assert run("verify", "wave.asm").code == 2
    assert run("verify", "wave.asm", "--contract", "wave.toml", "--against", "s.json").code == 2
    assert run("prove", "wave.asm", "--contract", "wave.toml", "--against", "s.json").code == 2
    for option in ("--any-eeprom", "--hold-inputs", "--certify-held-inputs"):
        assert run("prove", "wave.asm", "--contract", "wave.toml", option).code == 2
    for options in (("--forever",), ("--rate", "1000000")):
        refused = run("verify", "wave.asm", "--contract", "wave.toml", *options)
        assert refused.code == 2 and options[0] in refused.err
    (files / "edges.csv").write_text("cycle,pin,level\n0,RB3,1\n")
    refused = run("verify", "edges.csv", "--contract", "wave.toml", "--stimulus", "s.toml")
    assert refused.code == 2 and "omit --stimulus" in refused.err
    refused = run("measure", "edges.csv", "--stimulus", "s.toml")
    assert refused.code == 2 and "omit --stimulus" in refused.err
