"""Errors have one form: as gcc writes them, and with --json on standard output, with the same exit code."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import Ran, Run

ROOT = Path(__file__).parents[2]
JOB = ROOT / "jobs" / "lab8-exercise.toml"
KEYS = ("severity", "code", "message", "file", "line", "column", "key", "cycle", "address", "hint")


def only(ran: Ran) -> dict[str, Any]:
    """The one diagnostic of a document that has nothing else."""
    document = json.loads(ran.out)
    assert list(document) == ["diagnostics"]
    (found,) = document["diagnostics"]
    assert tuple(found) == KEYS
    return dict(found)


def test_a_broken_job(run: Run, tmp_path: Path) -> None:
    job = tmp_path / "arm.toml"
    text = JOB.read_text("utf-8").replace('pin = "RB0"', 'pin = "RB9"')
    job.write_text(text, "utf-8")
    line = next(number for number, each in enumerate(text.splitlines(), 1) if "RB9" in each)
    for command in ("check", "build", "plan"):
        ran = run(command, job)
        assert (ran.code, ran.out) == (2, "")
        assert ran.err.splitlines() == [
            f"{job}:{line}:1: error: servo[1].pin: unknown pin 'RB9' [unknown-pin]",
            "  did you mean 'RB7'?",
        ]
        ran = run(command, job, "--json")
        assert ran.code == 2
        found = only(ran)
        assert [found[key] for key in KEYS] == [
            *("error", "unknown-pin", "unknown pin 'RB9'", str(job), line, 1, "servo[1].pin", None, None),
            "did you mean 'RB7'?",
        ]


def test_an_error_in_c(run: Run, tmp_path: Path) -> None:
    source = tmp_path / "x.c"
    source.write_text("char b;\nvoid main(void) {\n    b = 5 +* 2;\n    bb = 1;\n}\n")
    ran = run("compile", source)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.splitlines() == [
        f"{source}:3:14: error: '*' needs a pointer, not 'signed int' [c-type]",
        "        b = 5 +* 2;",
        "                 ^",
        f"{source}:4:5: error: 'bb' is not declared [c-undeclared]",
        "        bb = 1;",
        "        ^",
        "  did you mean 'b'?",
    ]
    ran = run("compile", source, "--json")
    assert ran.code == 2
    found = json.loads(ran.out)["diagnostics"]
    assert [(each["line"], each["column"], each["code"]) for each in found] == [
        (3, 14, "c-type"),
        (4, 5, "c-undeclared"),
    ]


def test_a_warning_in_c_stands_in_the_document_of_the_result(run: Run, tmp_path: Path) -> None:
    source = tmp_path / "x.c"
    source.write_text("void main(void) { 1; while (1); }\n")
    document = json.loads(run("compile", source, "--json").out)
    assert next(iter(document)) == "diagnostics"
    (found,) = document["diagnostics"]
    assert (found["severity"], found["code"], found["line"], found["column"]) == (
        "warning",
        "c-no-effect",
        1,
        19,
    )
    assert document["words"] > 0


def test_a_warning_is_switched_off_by_its_code(run: Run, tmp_path: Path) -> None:
    source = tmp_path / "x.c"
    source.write_text("void main(void) { 1; while (1); }\n")
    assert "c-no-effect" in run("compile", source).err
    ran = run("compile", source, "--no-warning", "c-unused", "--no-warning", "c-no-effect")
    assert (ran.code, ran.err) == (0, "")
    for code in ("c-no-efect", "c-lvalue"):  # misspelt; the code of an error
        ran = run("compile", source, "--no-warning", code)
        assert ran.code == 2
        assert f"no warning has the code '{code}'" in ran.err
    assert "did you mean 'c-no-effect'?" in run("compile", source, "--no-warning", "c-no-efect").err


def test_an_error_in_assembly(run: Run, tmp_path: Path) -> None:
    source = tmp_path / "x.asm"
    source.write_text(" list p=16f84\n movlw nothing\n end\n")
    ran = run("assemble", source)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.splitlines() == [
        f"{source}:2:8: error: symbol not previously defined: 'nothing' [asm-undefined-symbol]",
        "     movlw nothing",
        "           ^",
    ]
    ran = run("simulate", source, "--cycles", 5, "--json")
    found = only(ran)
    assert (ran.code, found["code"], found["line"], found["column"]) == (2, "asm-undefined-symbol", 2, 8)


def test_a_bad_capture(run: Run, tmp_path: Path) -> None:
    capture = tmp_path / "seen.csv"
    capture.write_text("cycle,pin,level\n0,RB0,1\n7,RB9,0\n")
    schedule = ROOT / "firmware" / "lab8-exercise" / "schedule.json"
    ran = run("verify", capture, "--against", schedule)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith(f"{capture}:3: error: pin 'RB9' is not allowed [csv-syntax]\n  allowed: RA0, ")
    ran = run("verify", capture, "--against", schedule, "--json")
    found = only(ran)
    assert (ran.code, found["code"], found["line"]) == (2, "csv-syntax", 3)


def test_a_missing_port(run: Run, tmp_path: Path) -> None:
    output = tmp_path / "seen.vcd"
    ran = run("capture", "-o", output, "--port", "/dev/ttyNONE", "--seconds", 0.1)
    assert (ran.code, ran.out) == (3, "")
    assert ran.err == (
        "/dev/ttyNONE: error: there is no such port [no-such-port]\n  `servogen doctor` lists the ports\n"
    )
    ran = run("capture", "-o", output, "--port", "/dev/ttyNONE", "--seconds", 0.1, "--json")
    found = only(ran)
    assert (ran.code, found["code"], found["file"]) == (3, "no-such-port", "/dev/ttyNONE")


@pytest.mark.parametrize("arguments", [("check",), ("check", JOB, "--frobnicate"), ("frobnicate",)])
def test_a_wrong_command_line(run: Run, arguments: tuple[object, ...]) -> None:
    ran = run(*arguments)
    assert (ran.code, ran.out) == (2, "")
    first, hint = ran.err.splitlines()
    assert first.startswith("servogen: error: ") and first.endswith(" [usage]")
    assert hint.startswith("  see: servogen ") and hint.endswith("--help")
    ran = run(*arguments, "--json")
    assert (ran.code, only(ran)["code"]) == (2, "usage")


def test_json_is_asked_for_before_two_dashes_only(run: Run, tmp_path: Path) -> None:
    ran = run("check", "--", "--json")
    assert (ran.code, ran.out) == (2, "")
    assert "--json: error: cannot be read" in ran.err
