"""What `simulate` prints and passes on, of states and profiles made by hand."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen import edges, simulator
from servogen.cli import simulate_command
from servogen.errors import Diagnostic, InputError
from servogen.units import Clock, Cycles
from tests.cli.conftest import Run
from tests.cli.stand_ins import stand_in

CLOCK = Clock(4_000_000)


def state(**others: Any) -> Any:
    given = {
        "cycles": 250_000,
        "pc": 0x1F,
        "w": 5,
        "status": 0x18,
        "registers": {"TMR0": 7, "FSR": 0xAB},
        "resets": {"power_on": 1, "mclr": 0, "watchdog": 2},
        "deepest_stack": 3,
        "stack_wraps": 0,
        "warnings": (),
        "eeprom": bytes(64),
        "to_json": lambda: {"pc": 31},
    }
    return SimpleNamespace(**{**given, **others})


def spent(cycles: int, executions: int = 1) -> Any:
    return SimpleNamespace(cycles=cycles, executions=executions)


def profile(**others: Any) -> Any:
    given = {
        "cycles": 200,
        "functions": {"main": spent(50), "": spent(100), "loop": spent(50)},
        "lines": {("a/b.c", 7): spent(20, 4), ("a/b.c", 9): spent(60, 5)},
        "coverage": 0.5,
        "deepest_stack": 2,
        "ram_high_water": 9,
        "read_unwritten": (),
        "to_json": lambda: {"cycles": 200},
    }
    return SimpleNamespace(**{**given, **others})


def test_a_state_has_its_registers_in_hexadecimal_and_its_resets(capsys: pytest.CaptureFixture[str]) -> None:
    """250,000 cycles of a microsecond."""
    simulate_command._print_state(state(), CLOCK, 12)
    assert capsys.readouterr().out.splitlines() == [
        "250000 cycles, 0.25 s, 12 edges",
        "PC 0x01F  W 0x05  STATUS 0x18",
        "TMR0 0x07  FSR 0xAB",
        "resets: 1 power_on, 2 watchdog; deepest stack 3 of 8, 0 wraps",
    ]


def test_a_profile_begins_with_what_takes_most_cycles(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tables: list[Any] = []
    stand_in(monkeypatch, "servogen.cli.show", "table", lambda *given: tables.append(given))
    simulate_command._print_profile(profile())
    functions = [("-", 100, "50.00"), ("main", 50, "25.00"), ("loop", 50, "25.00")]
    lines = [("b.c:9", 60, "30.00", 5), ("b.c:7", 20, "10.00", 4)]
    assert tables == [
        ("Functions", ("function", "cycles", "%"), functions),
        ("Lines", ("line", "cycles", "%", "executions"), lines),
    ]
    assert capsys.readouterr().out.splitlines() == [
        "50.0 % of the program's words were executed",
        "deepest stack 2 of 8, 9 bytes of RAM written",
    ]
    tables.clear()
    many = {("a.c", number): spent(number) for number in range(1, 22)}
    simulate_command._print_profile(profile(lines=many))
    assert [row[1] for row in tables[1][2]] == [*range(21, 1, -1)]  # twenty of the twenty-one
    tables.clear()
    simulate_command._print_profile(profile(lines={}, cycles=0, read_unwritten=(0x0C, 0x4F)))
    assert [title for title, *_ in tables] == ["Functions"]
    assert capsys.readouterr().out.splitlines()[-1] == "read before they were written: 0x0C, 0x4F"


@pytest.mark.parametrize(
    ("seconds", "cycles", "span"),
    [(None, None, 1_000_000), (0.25, None, 250_000), (0.0, None, 0), (None, 7, 7), (None, 0, 0)],
)
def test_a_program_runs_for_a_second_unless_told_otherwise(
    seconds: float | None, cycles: int | None, span: int
) -> None:
    assert simulate_command._span(CLOCK, seconds, cycles) == span


def test_seconds_and_cycles_exclude_each_other() -> None:
    with pytest.raises(InputError, match="--seconds and --cycles exclude each other"):
        simulate_command._span(CLOCK, 0.0, 0)


def test_progress_is_told_at_the_last_edge_of_each_chunk_that_has_one() -> None:
    chunks = [SimpleNamespace(cycle=[1, 5]), SimpleNamespace(cycle=[]), SimpleNamespace(cycle=[9])]
    told: list[int] = []
    assert list(simulate_command._told(iter(chunks), told.append)) == chunks  # type: ignore[arg-type]
    assert told == [5, 9]


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """`simulate` runs seen["state"]; what is asked of the machine."""
    seen: dict[str, Any] = {"state": state(), "made": [], "profiled": 0}
    program = SimpleNamespace(image="image", listing=None, device="PIC16F84A")

    class Machine:
        def __init__(self, image: Any, clock: Clock, board: Any, stimuli: Any) -> None:
            seen["made"].append((clock.hz, board.device, stimuli))

        def stream(self, span: Cycles) -> Iterator[Any]:
            seen["span"] = span
            return iter(())

        def state(self) -> Any:
            return seen["state"]

    class Edges:
        def __init__(self, clock: Clock, chunks: Any, end: Cycles) -> None:
            self.end = end

        def driven(self) -> list[Any]:
            return [SimpleNamespace(cycle=[1, 2]), SimpleNamespace(cycle=[3])]

    def profiled(machine: Any, span: Cycles, listing: Any) -> Any:
        seen["profiled"] += 1
        return profile()

    stand_in(monkeypatch, "servogen.cli.files", "read_program", lambda file, device: program)
    stand_in(monkeypatch, "servogen.programs", "clock_of", lambda program, hz: Clock(hz or 4_000_000))
    stand_in(monkeypatch, simulator, "Machine", Machine)
    stand_in(monkeypatch, simulator, "profile", profiled)
    stand_in(monkeypatch, simulator, "trace", lambda machine, span, listing: iter(["first", "second"]))
    stand_in(monkeypatch, simulator, "load_stimuli", lambda path, clock: f"signals {path}")
    stand_in(monkeypatch, "servogen.simulator.stimulus", "file_inputs", lambda stimuli, clock: ())
    stand_in(monkeypatch, edges, "EdgeTrace", Edges)
    stand_in(monkeypatch, "servogen.traces", "recorded", lambda trace, writers: trace)
    monkeypatch.chdir(tmp_path)
    return seen


def test_simulate_writes_only_what_is_asked_for(run: Run, simulated: dict[str, Any]) -> None:
    ran = run("simulate", "a.hex")
    assert (ran.code, ran.err, list(Path().iterdir())) == (0, "", [])
    assert ran.out.splitlines()[0] == "250000 cycles, 0.25 s, 3 edges"
    assert len(ran.out.splitlines()) == 4
    assert (simulated["made"], simulated["span"]) == ([(4_000_000, "PIC16F84A", None)], 1_000_000)
    run("simulate", "a.hex", "--trace", "t", "--clock-hz", 8_000_000, "--device", "PIC16F84", "--cycles", 5)
    assert Path("t").read_text() == "first\nsecond\n"
    assert (simulated["made"][-1], simulated["span"]) == ((8_000_000, "PIC16F84", None), 5)
    assert simulated["profiled"] == 0
    assert len(run("simulate", "a.hex", "--profile").out.splitlines()) > 6
    Path("s.toml").write_text("")
    run("simulate", "a.hex", "--stimulus", "s.toml")
    assert simulated["made"][-1][2] == "signals s.toml"


def test_the_json_of_simulate_has_a_profile_if_asked_for(run: Run, simulated: dict[str, Any]) -> None:
    simulated["state"] = state(warnings=(Diagnostic("warning", "w", "odd"),))
    shown = run("simulate", "a.hex", "--json")
    found = json.loads(shown.out)
    assert [each["code"] for each in found.pop("diagnostics")] == ["w"]
    assert found == {"pc": 31, "edges": 3}
    assert shown.err.splitlines()[0] == "1 warning:"
    found = json.loads(run("simulate", "a.hex", "--json", "--profile").out)
    assert found["profile"] == {"cycles": 200}
