"""What `twin` prints, writes and passes on, of a run made by hand; no physics is needed."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen import job as job_package
from servogen.errors import Diagnostic
from servogen.report import film
from servogen.twin import pictures
from servogen.units import Clock
from servogen.workflows import twinning
from tests.cli.conftest import Run
from tests.cli.stand_ins import stand_in


@pytest.fixture
def twinned(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """`twin` runs to seen["verdict"]; what it is asked, the tables and the files that are drawn."""
    record = SimpleNamespace(
        bodies=SimpleNamespace(assumptions=("bodies",)),
        rig=SimpleNamespace(assumptions=("rig",)),
        settings=SimpleNamespace(ground=SimpleNamespace(text=lambda: "on flat ground")),
    )
    verdict = SimpleNamespace(
        passed=True,
        word="as planned",
        checks=(),
        missed="",
        judged=True,
        record=record,
        events=[SimpleNamespace(seconds=1.256, text="it falls")],
        reasons=lambda: ["because"],
        to_json=lambda: {"word": "as planned"},
    )
    seen: dict[str, Any] = {"verdict": verdict, "tables": [], "drawn": []}
    warnings = (Diagnostic("warning", "w", "odd"),)
    loaded = SimpleNamespace(name="six", warnings=warnings, clock=Clock(4_000_000))

    def twin_of(job: Any, settings: Any, hexfile: Any, stimuli: Any, tell: Any) -> Any:
        tell("running")
        seen["asked"] = (settings, hexfile, stimuli)
        return verdict

    stand_in(monkeypatch, job_package, "load", lambda path: path)
    stand_in(monkeypatch, job_package, "plan_job", lambda path: loaded)
    stand_in(monkeypatch, twinning, "twin_of", twin_of)
    stand_in(monkeypatch, "servogen.simulator", "load_stimuli", lambda path, clock: f"signals {path}")
    stand_in(monkeypatch, pictures, "comparison_rows", lambda verdict: iter([("path",)]))
    stand_in(monkeypatch, pictures, "servo_rows", lambda verdict: iter([("servo",)]))
    stand_in(monkeypatch, pictures, "check_rows", lambda verdict: iter([("check",)]))
    stand_in(monkeypatch, pictures, "csv_text", lambda verdict: "csv\n")
    stand_in(
        monkeypatch, pictures, "twin_plot", lambda verdict, name, path: seen["drawn"].append((name, path))
    )
    stand_in(monkeypatch, pictures, "twin_scene", lambda verdict, name: f"scene of {name}")
    stand_in(monkeypatch, film, "film", lambda scene, path: seen["drawn"].append((scene, path)))
    stand_in(monkeypatch, "servogen.cli.show", "table", lambda *given: seen["tables"].append(given))
    monkeypatch.chdir(tmp_path)
    return seen


@pytest.mark.parametrize(("passed", "code"), [(True, 0), (False, 1)])
def test_a_twin_prints_what_it_did_and_ends_with_its_verdict(
    run: Run, twinned: dict[str, Any], passed: bool, code: int
) -> None:
    twinned["verdict"].passed = passed
    ran = run("twin", "a.toml")
    assert ran.code == code
    assert ran.out.splitlines() == [
        "assumed: bodies",
        "assumed: rig",
        "1.26 s: it falls",
        "because",
        "a.toml: as planned; on flat ground",
    ]
    assert ran.err.splitlines()[0] == "1 warning:"
    compared = (
        "Planned and simulated",
        ("what", "asked", "rigid legs, ideal wheels", "simulated"),
        [("path",)],
    )
    servos = ("Servos", ("servo", "peak N·m", "stall N·m", "rms N·m", "lag °"), [("servo",)])
    assert twinned["tables"] == [compared, servos]
    twinned["verdict"].checks = (1,)
    run("twin", "a.toml")
    checks = ("Expectations", ("what", "measured", "allowed", "unit", ""), [("check",)])
    assert twinned["tables"][2:] == [compared, servos, checks]
    shown = run("twin", "a.toml", "--json")
    found = json.loads(shown.out)
    assert (shown.code, found["job"], found["word"], shown.err) == (code, "six", "as planned", "")
    assert (len(found["diagnostics"]), len(twinned["tables"])) == (1, 5)


def test_a_twin_without_options_walks_once_on_flat_ground(run: Run, twinned: dict[str, Any]) -> None:
    """docs/twin.md: friction 0.8, no slope, step or bumps; all parts work; the motion once."""
    run("twin", "a.toml")
    settings, hexfile, stimuli = twinned["asked"]
    ground = settings.ground
    assert (ground.friction, ground.slope, ground.step, ground.rough, ground.seed) == (0.8, 0, 0, 0, 1)
    assert (settings.broken, settings.unplugged, settings.seconds, settings.loops) == ((), (), None, 1)
    assert (hexfile, stimuli, twinned["drawn"], list(Path().iterdir())) == (None, None, [], [])


def test_the_options_of_a_twin_are_in_degrees_and_millimetres(run: Run, twinned: dict[str, Any]) -> None:
    words = (
        "--friction",
        0.5,
        "--slope-deg",
        30,
        "--rough-mm",
        3,
        "--seed",
        7,
        "--loops",
        4,
    )
    words += ("--broken", "a", "--broken", "b", "--unplugged", "c", "--seconds", 2.5, "--hex", "x.hex")
    Path("s.toml").write_text("")
    run(
        "twin",
        "a.toml",
        *words,
        "--stimulus",
        "s.toml",
        "--csv",
        "a.csv",
        "--plot",
        "a.png",
        "--film",
        "a.gif",
    )
    settings, hexfile, stimuli = twinned["asked"]
    ground = settings.ground
    assert (ground.friction, ground.seed) == (0.5, 7)
    assert [ground.slope, ground.step, ground.rough] == pytest.approx([math.pi / 6, 0, 0.003])
    assert (settings.broken, settings.unplugged) == (("a", "b"), ("c",))
    assert (settings.seconds, settings.loops) == (2.5, 4)
    assert (hexfile, stimuli) == (Path("x.hex"), "signals s.toml")
    assert Path("a.csv").read_text() == "csv\n"
    assert twinned["drawn"] == [("six", Path("a.png")), ("scene of six", Path("a.gif"))]
    run("twin", "a.toml", "--step-mm", 12)
    assert twinned["asked"][0].ground.step == pytest.approx(0.012)


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("--plot", "a.gif"), "unknown-suffix"),
        (("--film", "a.png"), "unknown-suffix"),
        (("--plot", "a.png", "--csv", "a.png"), "output-exists"),
        (("--csv", "a.toml"), "output-exists"),
        (("--stimulus", "s.toml", "--csv", "s.toml"), "output-exists"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_before_the_run(
    run: Run, twinned: dict[str, Any], words: tuple[str, ...], code: str
) -> None:
    ran = run("twin", "a.toml", *words)
    assert (ran.code, f"[{code}]" in ran.err, "asked" in twinned) == (2, True, False)
