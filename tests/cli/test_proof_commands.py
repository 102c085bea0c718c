"""What `prove` and `check-certificate` print and pass on, of answers made by hand."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen import checker
from servogen.cli.schedule_proof import Claim, Over
from servogen.prove.quantifiers import EVERYTHING, Quantifiers
from servogen.simulator import SimulatorOptions
from servogen.units import Clock
from tests.cli.conftest import Run as Command
from tests.cli.stand_ins import stand_in


def request(**others: Any) -> Claim:
    return Claim(counterexample=Path("wrong.toml"), **others)


@dataclass(frozen=True)
class Asked:
    """What `prove --against` asks for."""

    against: Path
    claim: Claim
    over: Over


def wrong(stimulus: str = "", **others: Any) -> Any:
    """A run that goes wrong in cycle 12,345."""
    given = {"message": "RB0 rises", "cycle": 12_345, "clock_hz": None, "eeprom": None, **others}
    return SimpleNamespace(**given, stimulus=lambda schedule: stimulus, arguments=lambda: ["--start", "w=1"])


@pytest.mark.parametrize(
    ("over", "held", "words"),
    [
        (EVERYTHING, {}, "every power-up, input and chip"),
        (EVERYTHING, {0: 1}, "every power-up and chip"),
        (replace(EVERYTHING, resets=False), {}, "every input and chip"),
        (replace(EVERYTHING, start=(("w", 1),)), {}, "every input and chip"),
        (replace(EVERYTHING, watchdog=False), {}, "every power-up and input"),
        (replace(EVERYTHING, tmr0_phase=False), {}, "every power-up and input"),
        (replace(EVERYTHING, eeprom_write=False), {}, "every power-up and input"),
        (replace(EVERYTHING, eeprom_write=False), {0: 1}, "every power-up"),
        (replace(EVERYTHING, resets=False), {0: 1}, "every chip"),
        (replace(EVERYTHING, resets=False, watchdog=False), {}, "every input"),
        (
            replace(EVERYTHING, resets=False, watchdog=False),
            {0: 1},
            "one power-up, the inputs and the chip that are assumed",
        ),
    ],
)
def test_only_what_is_quantified_over_is_claimed(over: Quantifiers, held: dict[int, int], words: str) -> None:
    assert over.text(held=bool(held)) == words


def test_the_content_of_a_counterexample_is_beside_its_inputs() -> None:
    assert request().content == Path("wrong.hex")


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Asked]:
    """The requests that `prove --against` makes."""
    requests: list[Asked] = []

    def prove(file: Path, device: str | None, against: Path, claim: Claim, over: Over, json: bool) -> int:
        requests.append(Asked(against, claim, over))
        return 1 if json else 0

    stand_in(monkeypatch, "servogen.cli.schedule_proof", "prove_schedule", prove)
    return requests


@pytest.mark.parametrize(
    ("words", "changes"),
    [
        ((), {}),
        (("--hold-inputs",), {"inputs": False}),
        (("--no-tmr0-phase",), {"tmr0_phase": False}),
        (("--no-resets",), {"resets": False}),
        (("--watchdog-us", 7000), {"watchdog": False}),
        (("--eeprom-write-us", 9000), {"eeprom_write": False}),
        (("--any-eeprom",), {"any_eeprom": True}),
    ],
)
def test_an_option_takes_one_thing_out_of_the_proof(
    run: Command, asked: list[Asked], words: tuple[object, ...], changes: dict[str, bool]
) -> None:
    assert run("prove", "a.hex", "--against", "s.json", *words).code == 0
    (wanted,) = asked
    assert wanted.over.quantifiers() == replace(EVERYTHING, **changes)
    times = {"--watchdog-us": "watchdog_us", "--eeprom-write-us": "eeprom_write_us"}
    own = {times[str(words[0])]: words[1] for _ in [0] if words[:1] and words[0] in times}
    assert wanted.over.board("PIC16F84A") == SimulatorOptions("PIC16F84A", **own)  # type: ignore[arg-type]
    assert (wanted.against, wanted.claim) == (Path("s.json"), Claim())


def test_the_exit_code_of_prove_is_that_of_its_proof(run: Command, asked: list[Asked]) -> None:
    common = ("prove", "a.hex", "--against", "s.json")
    assert run(*common, "--max-states", 7, "--start", "w=0x12", "--json").code == 1
    (wanted,) = asked
    assert wanted.claim == Claim(max_states=7)
    assert wanted.over == Over(power_up=["w=0x12"])
    assert run(*common, "--certificate", "c").code == 0
    assert asked[1].claim == Claim(certificate=Path("c"))
    assert run(*common, "--any-line", "job.toml", "--counterexample", "x.toml").code == 0
    assert asked[2].claim == Claim(any_line=Path("job.toml"), counterexample=Path("x.toml"))


@pytest.mark.parametrize(
    "words",
    [
        ("--against", "s.json", "--from", "0"),
        ("--against", "s.json", "--to", "0"),
        ("--against", "s.json", "--clock-hz", 4_000_000),
        ("--against", "s.json", "--any-line", "j.toml", "--certificate", "c"),
        ("--against", "s.json", "--any-line", "j.toml", "--hold-inputs"),
        ("--against", "s.json", "--any-line", "j.toml", "--any-eeprom"),
        ("--hold-inputs",),
        ("--no-tmr0-phase",),
        ("--any-eeprom",),
        ("--start", "w=1"),
        ("--no-resets",),
        ("--watchdog-us", 0),
        ("--eeprom-write-us", 0),
        ("--certificate", "c"),
        ("--max-states", 1),
        ("--accept-one-engine",),
        ("--any-line", "j.toml"),
    ],
)
def test_options_that_do_not_go_together_are_refused(
    run: Command, asked: list[Asked], words: tuple[object, ...]
) -> None:
    ran = run("prove", "a.hex", *words)
    assert (ran.code, ran.out, asked) == (2, "", [])
    assert "[conflicting-options]" in ran.err


@pytest.mark.parametrize("fine", [True, False])
@pytest.mark.parametrize("interrupts", ["included", "excluded"])
def test_the_answers_about_a_program_are_text_or_json(
    run: Command, monkeypatch: pytest.MonkeyPatch, fine: bool, interrupts: str
) -> None:
    from servogen.pic.analysis import facts

    times: list[Any] = []
    answer = SimpleNamespace(
        question="q", status="s", text="t", over="o", findings=("f", "g"), to_json=lambda: {"question": "q"}
    )

    class Facts:
        def __init__(self, image: Any, listing: Any, clock: Clock, tell: Any) -> None:
            times.append((image, clock.hz))

        def answers(self) -> list[Any]:
            return [answer]

        def time(self, start: str, end: str, interrupts: bool) -> Any:
            times.append((start, end, interrupts))
            return answer

    stand_in(monkeypatch, facts, "Facts", Facts)
    stand_in(monkeypatch, facts, "decided_and_fine", lambda answers: fine)
    stand_in(
        monkeypatch,
        "servogen.cli.files",
        "read_program",
        lambda *_: SimpleNamespace(image="image", listing=None),
    )
    stand_in(monkeypatch, "servogen.programs", "clock_of", lambda program, hz: Clock(hz or 4_000_000))
    common = ("prove", "a.hex", "--from", "x", "--to", "y", "--interrupts", interrupts)
    ran = run(*common)
    lines = ["q: s", "  t", "  over o", "  f", "  g"]
    assert (ran.code, ran.out.splitlines()) == (0 if fine else 1, lines * 2)
    shown = run(*common, "--json", "--clock-hz", 8_000_000)
    assert shown.code == (0 if fine else 1)
    assert json.loads(shown.out) == {"diagnostics": [], "file": "a.hex", "answers": [{"question": "q"}] * 2}
    asked = ("x", "y", interrupts == "included")
    assert times == [("image", 4_000_000), asked, ("image", 8_000_000), asked]


@pytest.mark.parametrize("held", [{}, {"RB1": 1, "RA0": 0}])
def test_check_certificate_says_what_was_checked(
    run: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, held: dict[str, int]
) -> None:
    held_texts = tuple(f"{pin} held at {level}" for pin, level in held.items())
    counts = checker.Checked(5, 6, 7, 8, ("every input",), held_texts)
    claim = SimpleNamespace(held=held, count=5, tape="")
    stand_in(monkeypatch, checker, "read_certificate", lambda data, name: claim)
    allowed: list[Any] = []
    stand_in(
        monkeypatch, checker, "check_certificate", lambda *given, tape: allowed.append(given[-1]) or counts
    )
    for name in ("c.xz", "s.json"):
        (tmp_path / name).write_text("x")
    (tmp_path / "a.hex").write_text(":00000001FF\n")
    words = ("check-certificate", tmp_path / "c.xz", tmp_path / "a.hex", "--against", tmp_path / "s.json")
    with_held = ", with RB1 held at 1, with RA0 held at 0" if held else ""
    ran = run(*words)
    assert (ran.code, ran.out.splitlines()) == (
        0,
        [
            f"{tmp_path / 'c.xz'}: valid{with_held}",
            "  over every input",
            "  checked: 5 states, 6 frames, 7 cycles, 8 splits",
        ],
    )
    shown = json.loads(run(*words, "--json", "--allow-held", "RB1", "--allow-held", "RA0").out)
    assert allowed == [(), ["RB1", "RA0"]]
    assert shown == {
        "diagnostics": [],
        "valid": True,
        "held": held,
        "states": 5,
        "frames": 6,
        "cycles": 7,
        "forks": 8,
        "over": ["every input"],
        "restrictions": list(held_texts),
    }

    def refuse(*_: Any, tape: bytes) -> None:
        raise checker.Refused("state 3")

    stand_in(monkeypatch, checker, "check_certificate", refuse)
    ran = run(*words)
    assert (ran.code, ran.out) == (1, f"{tmp_path / 'c.xz'}: refused: state 3\n")
    ran = run(*words, "--json")
    assert (ran.code, json.loads(ran.out)) == (
        1,
        {"diagnostics": [], "valid": False, "covered": True, "reason": "state 3", "held": held},
    )

    def leave(*_: Any, tape: bytes) -> None:
        raise checker.NotCovered("SLEEP", "at address 3")

    stand_in(monkeypatch, checker, "check_certificate", leave)
    ran = run(*words)
    assert (ran.code, ran.out) == (
        1,
        f"{tmp_path / 'c.xz'}: not covered: at address 3: the checker does not cover: SLEEP\n",
    )
    assert json.loads(run(*words, "--json").out)["covered"] is False
