"""What `simulate` prints and passes on, of states and profiles made by hand."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen import edges, simulator
from servogen.errors import Diagnostic
from servogen.units import Clock, Cycles
from tests.cli.conftest import Run
from tests.cli.stand_ins import stand_in


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
