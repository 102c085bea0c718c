"""`prove FILE --against schedule.json` as a user runs it: three answers, what it writes and refuses."""

from __future__ import annotations

import json
import lzma
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from servogen.pic.image import to_hex
from servogen.programs import read_schedule
from servogen.pulse.expected import expected
from servogen.traces import read_edges
from servogen.units import Cycles
from servogen.verify import verify
from tests.checker import certify

Run = Callable[..., Any]

STARTS = Path(__file__).parent.parent / "verify" / "start_state"
SCHEDULE = STARTS / "schedule.json"
FIRMWARE = Path(__file__).parent.parent.parent / "firmware"


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_proof_names_its_assumptions_and_writes_a_certificate(run: Run) -> None:
    done = run("prove", STARTS / "good.asm", "--against", SCHEDULE, "--certificate", "good.xz")
    assert done.code == 0, done.err
    assert done.out.startswith("proven, checked\n  for every power-up, input and chip: ")
    assert "    the EEPROM holds what the file says" in done.out
    assert run("assemble", STARTS / "good.asm", "-o", "good.hex").code == 0
    assert run("check-certificate", "good.xz", "good.hex", "--against", SCHEDULE).code == 0
    other = Path("other.json")
    other.write_text(SCHEDULE.read_text().replace("1500", "1501"))
    assert run("check-certificate", "good.xz", "good.hex", "--against", other).code == 1
    taped = certify.unpack(Path("good.xz").read_bytes()) | {"tape": "0" * 64}
    Path("taped.xz").write_bytes(certify.pack(taped))
    untaped = run("check-certificate", "taped.xz", "good.hex", "--against", SCHEDULE)
    assert (untaped.code, "tape.bin: error" in untaped.err) == (2, True), "the tape is beside the schedule"


def test_a_button_that_is_held_has_a_certificate_only_if_asked_for_and_no_valid_one_unless_allowed(
    run: Run,
) -> None:
    """The program has no stop button. With the button held, nobody can tell."""
    text = json.loads(certify.schedule({**certify.STOP, "pulses": "hold"}))
    Path("s.json").write_text(json.dumps(text | {"inputs": [{"pin": "RA4", "level": 1}]}))
    Path("a.hex").write_text(to_hex(certify.plain_program()))
    prove = ("prove", "a.hex", "--against", "s.json", "--certificate", "c.xz")
    assert run(*prove).code == 1
    held = run(*prove, "--hold-inputs")
    assert held.code == 2
    assert "the checker does not cover one level of RA4 (--hold-inputs)" in held.err
    assert "--certify-held-inputs" in held.err
    assert not Path("c.xz").exists()
    certified = run(*prove, "--hold-inputs", "--certify-held-inputs")
    assert certified.code == 1, "it is not the theorem"
    assert certified.out.startswith("proven by one engine: the checker does not cover one level of RA4 (")
    assert run(*prove, "--hold-inputs", "--certify-held-inputs", "--accept-one-engine").code == 0
    check = ("check-certificate", "c.xz", "a.hex", "--against", "s.json")
    refused = run(*check)
    assert refused.code == 1
    assert "refused: it holds RA4 at 1" in refused.out
    allowed = run(*check, "--allow-held", "RA4")
    assert allowed.code == 0
    assert "valid, with RA4 held at 1, as was allowed" in allowed.out


@pytest.mark.parametrize("name", ["floatin", "ram", "latch", "wdt_pre2"])
def test_the_command_that_is_printed_shows_the_wrong_edge(run: Run, name: str) -> None:
    done = run("prove", STARTS / f"{name}.asm", "--against", SCHEDULE)
    assert done.code == 1
    first, command = done.out.splitlines()
    assert first.startswith("counterexample: ")
    words = shlex.split(command.strip())
    assert words[:2] == ["servogen", "simulate"]
    assert run(*words[1:]).code == 0
    schedule = read_schedule(SCHEDULE)
    trace = read_edges(Path("counterexample.csv"), schedule.clock)
    span = Cycles(int(words[words.index("--cycles") + 1]))
    assert not verify(expected(schedule), trace, span).agrees


def test_json_says_the_same(run: Run) -> None:
    done = run("prove", STARTS / "floatin.asm", "--against", SCHEDULE, "--json")
    said = json.loads(done.out)
    assert (done.code, said["answer"]) == (1, "counterexample")
    assert 'pin = "RA2"' in said["counterexample"]["stimulus"]
    assert json.loads(run("prove", STARTS / "good.asm", "--against", SCHEDULE, "--json").out)["states"] > 0


def test_a_search_that_is_cut_short_is_not_decided(run: Run) -> None:
    folder = Path(__file__).parent.parent.parent / "firmware" / "lab8-program"
    done = run("prove", folder / "main.hex", "--against", folder / "schedule.json", "--max-states", 5)
    assert done.code == 1
    assert done.out.startswith("not decided: more than 5 states (")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--certificate", "x.xz"], "needs --against"),
        (["--against", str(SCHEDULE), "--clock-hz", "4000000"], "--clock-hz are for a program without"),
        (["--against", "missing.json"], "missing.json"),
        (["--against", str(SCHEDULE), "--certificate", str(SCHEDULE)], "is what is read"),
    ],
)
def test_options_that_contradict_each_other_are_bad_input(run: Run, options: list[str], message: str) -> None:
    done = run("prove", STARTS / "good.asm", *options)
    assert done.code == 2
    assert message in done.err


@pytest.mark.parametrize(
    ("buttons", "message"),
    [
        ('{"start": null, "stop": null, "pulses": "off", "pressed_frames": 3}', "neither 'start' nor 'stop'"),
        (
            '{"start": {"pin": "RB0", "level": 0}, "stop": null, "pulses": "off", "pressed_frames": 3}',
            "RB0 is a servo's",
        ),
        (
            '{"start": {"pin": "RA0", "level": 0}, "stop": null, "pulses": "on", "pressed_frames": 3}',
            "neither 'off' nor 'hold'",
        ),
        (
            '{"start": {"pin": "RA0", "level": 2}, "stop": null, "pulses": "off", "pressed_frames": 3}',
            "neither 0 nor 1",
        ),
        ('{"start": {"pin": "RA0", "level": 0}, "stop": null, "pulses": "off"}', "pressed_frames"),
    ],
)
def test_rules_of_buttons_that_cannot_be_are_bad_input(run: Run, buttons: str, message: str) -> None:
    file = Path("buttons.json")
    file.write_text(SCHEDULE.read_text().replace('"lead_in"', f'"buttons": {buttons}, "lead_in"'))
    done = run("prove", STARTS / "good.asm", "--against", file)
    assert done.code == 2
    assert message in done.err


def test_what_is_switched_off_is_assumed_and_has_no_certificate(run: Run) -> None:
    options = ("--start", "ram=0", "--no-resets", "--watchdog-us", 18_000)
    done = run("prove", STARTS / "good.asm", "--against", SCHEDULE, *options)
    assert done.code == 1, done.err
    first = "proven by one engine: the checker does not cover known values at power-up (--start), "
    assert done.out.startswith(first + "chips that are never reset (--no-resets), one period of the watchdog")
    assert "  for every input: " in done.out
    accepted = run("prove", STARTS / "good.asm", "--against", SCHEDULE, *options, "--accept-one-engine")
    assert (accepted.code, accepted.out) == (0, done.out)
    assert "    at power-up ram is 0x00" in done.out
    assert "    there is no reset after power-on" in done.out
    done = run("prove", STARTS / "good.asm", "--against", SCHEDULE, *options, "--certificate", "good.xz")
    assert done.code == 2
    assert "a certificate covers every power-up" in done.err
    for wrong in ("acc=1", "w=256", "w"):
        done = run("prove", STARTS / "good.asm", "--against", SCHEDULE, "--start", wrong)
        assert done.code == 2
        assert wrong.partition("=")[0] in done.err
    assert run("prove", STARTS / "good.asm", "--no-resets").code == 2


def test_a_program_that_sleeps_has_a_certificate_that_is_valid(run: Run) -> None:
    text = (
        (STARTS / "good.asm")
        .read_text()
        .replace("frame   bsf", "        bsf 11,4\n        bcf 11,4\nframe   bsf")
    )
    Path("good.asm").write_text(
        text.replace("nop\n        goto frame", "nop\n        goto frame\n        sleep")
    )
    Path("frame.inc").write_text((STARTS / "frame.inc").read_text())
    assert run("prove", "good.asm", "--against", SCHEDULE, "--certificate", "good.xz").code == 0
    ended = (SCHEDULE, Path("once.json"))
    data = json.loads(ended[0].read_text())
    data["lead_in"] = data["loop"]
    data["loop"] = [{"frames": 1, "pulses": [None]}]
    ended[1].write_text(json.dumps(data))
    Path("once.asm").write_text(text.replace("goto frame", "sleep\n        goto $"))
    done = run("prove", "once.asm", "--against", "once.json", "--certificate", "once.xz")
    assert done.code == 0, done.err
    assert run("assemble", "once.asm", "-o", "once.hex").code == 0
    assert run("check-certificate", "once.xz", "once.hex", "--against", "once.json").code == 0
    Path("early.asm").write_text(text.replace("goto frame", "sleep\n        goto frame"))
    assert run("assemble", "early.asm", "-o", "early.hex").code == 0
    assert run("check-certificate", "once.xz", "early.hex", "--against", "once.json").code == 1


def test_two_witnesses_that_disagree_are_an_internal_error_that_names_both(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A certificate that lacks its last state is one that the checker must refuse."""
    from servogen.prove import certificate

    def torn(*given: Any) -> bytes:
        content = json.loads(lzma.decompress(certificate(*given)))
        content["cuts"] = content["cuts"][:-1]
        return lzma.compress(json.dumps(content).encode())

    monkeypatch.setattr("servogen.workflows.certificates.certificate", torn)
    done = run("prove", STARTS / "good.asm", "--against", SCHEDULE)
    assert (done.code, done.out) == (3, "")
    assert "servogen.prove says proven, and servogen.checker refuses its certificate: " in done.err
    assert "[internal-error]" in done.err


def test_a_proof_is_kept_for_the_next_build_and_only_a_checked_one(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    program, schedule = FIRMWARE / "lab9-program" / "main.hex", FIRMWARE / "lab9-program" / "schedule.json"
    assert run("prove", program, "--against", schedule, "--no-resets", "--accept-one-engine").code == 0
    job = FIRMWARE.parent / "jobs" / "lab9-program.toml"

    def known() -> list[str]:
        built = run("build", job, "-o", "made", "--json")
        assert built.code == 0, built.err
        answer = json.loads(built.out)
        assert (answer["exact"], answer["proven"]) == (True, False)
        return [str(text) for text in answer["all_runs"]]

    assert known() == ["not proven yet"] * 3
    assert run("prove", program, "--against", schedule).code == 0
    assert known() == ["proven, checked", "not proven yet", "not proven yet"]
    (kept,) = (tmp_path / "cache").rglob("*.cert.xz")
    wrong = kept.rename(Path("made/main.cert.xz"))
    assert known()[0] == "proven, checked", "a certificate beside the HEX file counts, too"
    wrong.rename("made/main.xc8.cert.xz")
    assert known() == ["not proven yet"] * 3, "not for another program"
