"""`prove FILE` as a user runs it: answers, exit codes, marks, JSON."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]

HEAD = '    list p=16f84, r=dec\n    include "p16f84.inc"\n    __config {config}\n    org 0\n'
GOOD = HEAD.format(config="_WDT_ON & _XT_OSC") + "main\n clrwdt\n movf PORTB, w\nback\n goto main\n    end\n"


@pytest.fixture
def good(tmp_path: Path) -> Path:
    path = tmp_path / "good.asm"
    path.write_text(GOOD)
    return path


def test_a_program_without_fault_has_exit_code_0_and_every_answer_says_what_it_holds_for(
    run: Run, good: Path
) -> None:
    done = run("prove", good)
    assert done.code == 0, done.out
    assert "the stack never holds more than 8 return addresses: holds" in done.out
    assert "at most 4 cycles (0.004 ms at 4000000 Hz) between two clearings" in done.out
    assert done.out.count("\n  over every ") == done.out.count(": holds") == 6


@pytest.mark.parametrize(
    ("old", "new", "question", "status"),
    [
        ("back", "back\n btfss 0x20, 0", "nothing is read that was never written", "found"),
        ("back", "back\n bsf PORTA, 0", "only outputs are written", "found"),
        ("main\n", "main\n call main\n", "the stack never holds more than 8 return addresses", "found"),
        ("    end", " nop\n    end", "every word can be reached", "found"),
        ("back", "back\n movwf PCL", "every path is followed", "not decided"),
        ("back", "back\n btfss PORTB, 0\n goto back", "the watchdog never times out", "not decided"),
    ],
)
def test_each_fault_has_exit_code_1_and_its_address(
    run: Run, good: Path, old: str, new: str, question: str, status: str
) -> None:
    good.write_text(GOOD.replace(old, new, 1))
    done = run("prove", good, "--json")
    assert done.code == 1
    answer = next(each for each in json.loads(done.out)["answers"] if each["question"] == question)
    assert answer["status"] == status
    assert answer["findings"] or answer["text"]
    assert all(finding["source"].endswith(tuple("0123456789")) for finding in answer["findings"])


def test_times_between_marks_are_printed_and_in_json(run: Run, good: Path) -> None:
    done = run("prove", good, "--from", "main", "--to", "back", "--json")
    assert done.code == 0
    answer = json.loads(done.out)["answers"][-1]
    assert (answer["minimum_cycles"], answer["maximum_cycles"]) == (2, 2)
    twice = run("prove", good, "--from", "main", "--to", "back", "--from", "back", "--to", "0x000")
    assert "the time from main to back: holds\n  2 to 2 cycles" in twice.out
    assert "the time from back to 0x000: holds\n  2 to 2 cycles" in twice.out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--from", "main"), "1 --from and 0 --to"),
        (("--from", "mian", "--to", "back"), "'mian' is not a label"),
        (("--from", "0xZZ", "--to", "back"), "'0xZZ' is not an address from 0x000 to 0x3FF"),
        (("--from", "99", "--to", "back"), "line 99 has no words"),
    ],
)
def test_a_wrong_mark_is_bad_input(run: Run, good: Path, options: tuple[str, ...], said: str) -> None:
    done = run("prove", good, *options)
    assert done.code == 2
    assert said in done.err


def test_a_hex_file_has_addresses_as_marks_only(run: Run, good: Path, tmp_path: Path) -> None:
    file = tmp_path / "good.hex"
    assert run("assemble", good, "-o", file).code == 0
    assert run("prove", file, "--from", "0x000", "--to", "0x002").code == 0
    named = run("prove", file, "--from", "main", "--to", "0x002")
    assert (named.code, "labels and lines need C or assembly source" in named.err) == (2, True)


def test_a_file_that_is_not_there_or_is_no_program_is_bad_input(run: Run, tmp_path: Path) -> None:
    assert run("prove", tmp_path / "none.hex").code == 2
    (tmp_path / "bad.hex").write_text("hello\n")
    assert run("prove", tmp_path / "bad.hex").code == 2


def test_without_a_word_about_the_chip_it_is_the_pic16f84(run: Run, tmp_path: Path) -> None:
    """Not the PIC16F84A, whose name the source tests for."""
    path = tmp_path / "any.asm"
    path.write_text(
        '  ifdef __16F84A\n  error "another chip"\n  endif\n  org 0\nmain\n clrwdt\n goto main\n  end\n'
    )
    assert run("prove", path).code == 0
    other = run("prove", path, "--device", "PIC16F84A")
    assert other.code == 2
    assert "another chip" in other.err
