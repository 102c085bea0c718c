"""What the commands of jobs print: tables, last lines, JSON and exit codes, of results made by hand."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from intelhex import IntelHex

from servogen import job as job_package
from servogen import verify as verify_package
from servogen.cli import widths
from servogen.engines.firmware import ResourceError
from servogen.errors import Diagnostic, InputError, Location
from servogen.plan_error import PlanError
from servogen.pulse import Quantised
from servogen.report import text
from servogen.units import Clock, Cycles
from servogen.workflows import job_build, reporting, retarget
from servogen.workflows.certificates import CertificateVerdict
from tests.cli.conftest import Run
from tests.cli.stand_ins import stand_in
from tests.engines.tape.tape_jobs import text as tape_text

ROOT = Path(__file__).parents[2]
LAB8 = ROOT / "jobs" / "lab8-exercise.toml"
Tables = list[tuple[Any, ...]]


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> Tables:
    shown: Tables = []
    stand_in(monkeypatch, "servogen.cli.show", "table", lambda *given, least=(): shown.append(given))
    return shown


def width(
    channel: str, us: str, cycles: int, frames: int = 1, held: bool = True, which: str = ""
) -> Quantised:
    """A width whose cycle is a microsecond."""
    asked = Fraction(us)
    return Quantised(channel, 0.0, asked, Cycles(cycles), Fraction(cycles), frames, which, held)


COLUMNS = ("servo", "requested µs", "cycles", "error µs", "frames")


def test_a_ramp_of_three_widths_is_one_row_and_of_two_are_two(tables: Tables) -> None:
    """Neighbours of one servo that no pose holds; errors from the least to the greatest."""
    widths.width_table(
        [
            width("a", "1000.25", 1000, 7),
            width("a", "1010.5", 1011, held=False),
            width("a", "1020", 1020, held=False),
            width("a", "1030.75", 1030, 2, held=False),
            width("a", "1500", 1500, 9),
            width("b", "1", 1, held=False),
            width("b", "2", 2, held=False),
            width("c", "3", 3, held=False),
        ]
    )
    assert tables == [
        (
            "Pulse widths",
            COLUMNS,
            [
                ("a", "1000.250", 1000, "-0.250", 7),
                ("a, 3 widths of ramps", "1010.500 to 1030.750", "1011 to 1030", "-0.750 to +0.500", 4),
                ("a", "1500.000", 1500, "+0.000", 9),
                ("b", "1.000", 1, "+0.000", 1),
                ("b", "2.000", 2, "+0.000", 1),
                ("c", "3.000", 3, "+0.000", 1),
            ],
        )
    ]


def test_examples_of_widths_have_a_column_of_their_own(tables: Tables) -> None:
    ramp = [width("a", str(us), us, held=False) for us in (1, 2, 3)]
    widths.width_table([width("a", "900", 900, which="longest"), *ramp])
    assert tables == [
        (
            "Pulse widths",
            ("servo", "pulse", *COLUMNS[1:]),
            [
                ("a", "longest", "900.000", 900, "+0.000", 1),
                ("a, 3 widths of ramps", "", "1.000 to 3.000", "1 to 3", "+0.000 to +0.000", 3),
            ],
        )
    ]


def built(name: str = "arm", exact: bool = True, warnings: int = 0) -> Any:
    """A build of two programs."""
    programs = [
        SimpleNamespace(
            firmware=SimpleNamespace(
                dialect=dialect, compilation=SimpleNamespace(words=words, ram_bytes=ram, image=None)
            ),
            verdict=SimpleNamespace(worst_edge_error=error, plan_error=plan),
            exact=fine,
        )
        for dialect, words, ram, error, plan, fine in (
            ("c2c", 200, 8, 0, PlanError(0.25), True),
            ("xc8", 1024, 68, 3, None, exact),
        )
    ]
    schedule = SimpleNamespace(plan_error=PlanError(0.25))
    return SimpleNamespace(
        job=SimpleNamespace(name=name, clock=Clock(4_000_000)),
        engine="sequence",
        frames=30,
        programs=programs,
        exact=exact,
        plan=SimpleNamespace(widths=(), schedule=schedule),
        warnings=tuple(Diagnostic("warning", "w", f"warning {number}") for number in range(warnings)),
        to_json=lambda: {"job": name},
    )


MISSING = CertificateVerdict("not proven yet", False, missing=True)
VALID, REFUSED = CertificateVerdict("proven, checked", True), CertificateVerdict("refused: x", False)


def test_many_widths_have_a_row_for_each_servo(tables: Tables, capsys: pytest.CaptureFixture[str]) -> None:
    each = [width(servo, str(us), us) for servo in "ab" for us in (1900, 1000, *range(1100, 1117))]
    widths.width_table(each, "report.txt")
    ((_, _, rows),) = tables
    spans = ("1000.000 to 1900.000", "1000 to 1900", "+0.000 to +0.000", 19)
    assert rows == [(f"{servo}, 19 widths", *spans) for servo in "ab"]
    assert capsys.readouterr().out == "38 widths, a row for each servo: report.txt has them all\n"


@pytest.fixture
def building(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """`build` gives results["build"](job); what is written where."""
    results: dict[str, Any] = {"build": lambda job: built(), "written": []}
    stand_in(monkeypatch, job_package, "load", lambda path: path)
    stand_in(
        monkeypatch,
        job_package,
        "plan_job",
        lambda path: SimpleNamespace(name=Path(path).stem, warnings=(), notes=(), chips=()),
    )

    def build(job: Any, tell: Callable[[str], None] = lambda step: None) -> Any:
        tell("compiling")
        return results["build"](job)

    stand_in(monkeypatch, job_build, "build", build)
    stand_in(
        monkeypatch,
        job_build,
        "write",
        lambda result, folder: results["written"].append(folder),
    )
    monkeypatch.setattr("servogen.isolation.can_fork", lambda: False)  # what stands in cannot be pickled
    results["theorems"] = [MISSING, MISSING]
    stand_in(monkeypatch, "servogen.cli.build_commands", "_theorems", lambda *given: results["theorems"])
    stand_in(monkeypatch, job_build, "hex_name", lambda result, program: "main.hex")
    return results


@pytest.mark.parametrize(("exact", "code", "word"), [(True, 0, "exact"), (False, 1, "NOT EXACT")])
def test_demo_prints_one_table_and_the_warnings_of_each_job(
    run: Run, building: dict[str, Any], tables: Tables, exact: bool, code: int, word: str
) -> None:
    building["build"] = lambda job: built(job.name, exact, {"a": 0, "b": 1, "c": 2}[job.name])
    ran = run("demo", "a.toml", "b.toml", "c.toml")
    assert ran.code == code
    count = 6 if exact else 3
    assert ran.out.splitlines() == [
        "b: 1 warning in its report.txt",
        "c: 2 warnings in its report.txt",
        f"3 jobs, 6 programs in build/: {count} exact in one run, "
        "0 proven for every power-up, input and chip",
        "next: servogen watch a.toml",
    ]
    assert building["written"] == [Path("build", name) for name in "abc"]
    (programs,) = tables
    both = "exact" if exact else f"c2c: exact; xc8: {word}"
    rest = (both, "not proven yet", "0.25 µs", "sequence", 1024, 30)
    assert programs[2] == [(name, *rest) for name in "abc"]
    shown = json.loads(run("demo", "b.toml", "c.toml", "-o", "other", "--json").out)
    proven = {"proven": False, "all_runs": ["not proven yet"] * 2}
    assert shown["jobs"] == [{"folder": f"other/{name}", "job": name, **proven} for name in "bc"]
    assert [each["message"] for each in shown["diagnostics"]] == ["warning 0", "warning 1"]
    assert len(tables) == 1


def test_demo_goes_on_after_a_job_that_does_not_fit(
    run: Run, building: dict[str, Any], tables: Tables
) -> None:
    def build(job: Any) -> Any:
        if job.name == "b":
            raise ResourceError("does-not-fit", "b is too large")
        return built(job.name)

    building["build"] = build
    ran = run("demo", "a.toml", "b.toml", "c.toml", "-o", "out")
    assert (ran.code, ran.out.splitlines()[0]) == (0, "b is too large")
    assert building["written"] == [Path("out/a"), Path("out/c")]
    shown = json.loads(run("demo", "a.toml", "b.toml", "--json").out)
    assert [each["code"] for each in shown["diagnostics"]] == ["does-not-fit"]
    assert len(shown["jobs"]) == 1


def test_a_wrong_job_does_not_hide_the_others(run: Run, building: dict[str, Any], tables: Tables) -> None:
    def build(job: Any) -> Any:
        if job.name == "b":
            raise InputError("servo-limit", "a cannot go to 170°", Location("b.toml", 20))
        return built(job.name)

    building["build"] = build
    ran = run("demo", "a.toml", "b.toml", "c.toml", "-o", "out")
    assert ran.code == 2 and ran.err == "b.toml:20: error: a cannot go to 170° [servo-limit]\n"
    assert [row[0] for row in tables[0][2]] == ["a", "c"]
    shown = json.loads(run("demo", "a.toml", "b.toml", "--json").out)
    assert [each["code"] for each in shown["diagnostics"]] == ["servo-limit"]


@pytest.mark.parametrize(
    ("valid", "missing", "code"), [(True, False, 0), (False, True, 0), (False, False, 1)]
)
def test_demo_is_refused_with_a_certificate_that_is_refused(
    run: Run, building: dict[str, Any], tables: Tables, valid: bool, missing: bool, code: int
) -> None:
    """One that is missing is named in the table only."""
    building["theorems"] = [CertificateVerdict("words", valid, missing)] * 2
    assert run("demo", "a.toml", "--certificates", "c").code == code
    assert [row[2] for row in tables[0][2]] == ["words"]
    (shown,) = json.loads(run("demo", "a.toml", "--certificates", "c", "--json").out)["jobs"]
    assert (shown["proven"], shown["all_runs"]) == (valid, ["words"] * 2)


@pytest.mark.parametrize(
    ("theorems", "words", "code"),
    [
        ([VALID, VALID], (), 0),
        ([VALID, MISSING], (), 0),
        ([VALID, MISSING], ("--prove",), 1),
        ([VALID, REFUSED], (), 1),
        ([VALID, VALID], ("--prove",), 0),
    ],
)
def test_only_who_asks_for_a_proof_is_refused_without_one(
    run: Run, building: dict[str, Any], tables: Tables, monkeypatch: pytest.MonkeyPatch,
    theorems: list[CertificateVerdict], words: tuple[str, ...], code: int,
) -> None:  # fmt: skip
    stand_in(monkeypatch, job_build, "program_facts", lambda result: ())
    stand_in(monkeypatch, text, "timing_budgets_text", lambda facts, clock: iter(()))
    building["theorems"] = theorems
    ran = run("build", "jobs/a.toml", *words)
    assert ran.code == code
    assert "every power-up, input and chip: main.hex" in ran.out
    command = "servogen prove build/a/main.hex --against build/a/schedule.json, or build with --prove"
    assert (command in ran.out) == (MISSING in theorems)
    shown = json.loads(run("build", "jobs/a.toml", "--json", *words).out)
    assert shown["proven"] == all(each.valid for each in theorems)


def facts(**others: Any) -> Any:
    """A plan of two servos: one steps, one moves on a ramp."""
    model = SimpleNamespace(unit="°", speed=math.radians(600))
    servos = [
        SimpleNamespace(name="a", model=model, limits=(0.0, math.pi)),
        SimpleNamespace(name="b", model=SimpleNamespace(unit="°/s", speed=None), limits=(-math.pi, math.pi)),
    ]
    ramp = {"speed": math.pi, "speed_frame": 7, "step": None, "step_needs_s": None, "step_s": None}
    step = {"speed": None, "speed_frame": None, "step": math.pi / 2, "step_needs_s": 0.15, "step_s": 1.5}
    rows = (
        SimpleNamespace(servo=servos[0], minimum=0.0, maximum=math.radians(90.126), **ramp),
        SimpleNamespace(servo=servos[1], minimum=-0.5, maximum=0.0, **step),
    )
    job = SimpleNamespace(
        bindings=[SimpleNamespace(servo="a", joint="q1")],
        followers=(),
        notes=[SimpleNamespace(message="a note")],
        servos=servos,
        file="jobs/x.toml",
        warnings=(),
    )
    schedule = SimpleNamespace(lead_in_frames=1, loop_frames=50)
    plan = SimpleNamespace(schedule=schedule, warnings=())
    given = {"job": job, "plan": plan, "servos": rows, "ends": (), "rigid_legs_end": None, "worst": None}
    given["engine"] = False
    return SimpleNamespace(**{**given, "seconds": lambda frames: 0.02 * frames, **others})


def page(**others: Any) -> Any:
    given = {
        "html": "<html>",
        "programs_exact": True,
        "not_built": None,
        "plan_error": PlanError(0.25),
        "capture": None,
        "twin": None,
        "to_json": lambda: {"exact": True},
    }
    return SimpleNamespace(**{**given, **others})


PLAN = "the schedule is within 0.25 µs of the plan"
TWIN = [f"a.html: exact; {PLAN}", "twin: as planned", "a reason"]
UNFIT = Diagnostic("warning", "does-not-fit", "no engine can hold it")


def seen(whole: bool, partly: bool) -> Any:
    return SimpleNamespace(accepted=lambda partial: partly if partial else whole)


def physics(passed: bool) -> Any:
    return SimpleNamespace(passed=passed, word="as planned", reasons=lambda: ["a reason"])


@pytest.mark.parametrize(
    ("found", "words", "code", "lines"),
    [
        (page(), (), 0, [f"a.html: exact; {PLAN}"]),
        (page(programs_exact=False), (), 1, [f"a.html: NOT EXACT; {PLAN}"]),
        (
            page(programs_exact=False, not_built=UNFIT),
            (),
            0,
            ["no engine can hold it", f"a.html: the plan; {PLAN}"],
        ),
        (
            page(capture=seen(True, True)),
            ("--capture", "run.vcd"),
            0,
            [f"a.html: programs exact; {PLAN}", "run.vcd: first"],
        ),
        (
            page(capture=seen(False, True)),
            ("--capture", "run.vcd"),
            1,
            [f"a.html: programs exact; {PLAN}", "run.vcd: first"],
        ),
        (
            page(capture=seen(False, True)),
            ("--capture", "run.vcd", "--partial", "--rate", 5),
            0,
            [f"a.html: programs exact; {PLAN}", "run.vcd: first"],
        ),
        (
            page(capture=seen(True, True), programs_exact=False),
            ("--capture", "run.vcd"),
            1,
            [f"a.html: programs NOT EXACT; {PLAN}", "run.vcd: first"],
        ),
        (
            page(twin=physics(True)),
            ("--twin",),
            0,
            TWIN,
        ),
        (
            page(twin=physics(False)),
            ("--twin",),
            1,
            TWIN,
        ),
    ],
)
def test_report_says_what_its_page_shows(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, building: dict[str, Any], found: Any,
    words: tuple[object, ...], code: int, lines: list[str],
) -> None:  # fmt: skip
    asked: list[Any] = []

    def page_of(
        job: Any, capture: Any, tell: Callable[[str], None], rate: Any, twin: bool, wires: Any
    ) -> Any:
        tell("compiling")
        asked.append((capture, rate, twin))
        return found

    monkeypatch.chdir(tmp_path)
    stand_in(monkeypatch, reporting, "build_page", page_of)
    stand_in(monkeypatch, verify_package, "capture_lines", lambda verdict: ["first", "second"])
    ran = run("report", "jobs/a.toml", *words)
    after = "next: open a.html in a browser, or servogen watch jobs/a.toml"
    assert (ran.code, ran.out.splitlines()) == (code, [*lines, after])
    assert (tmp_path / "a.html").read_text() == "<html>"
    shown = run("report", "jobs/a.toml", *words, "-o", "b.html", "--json")
    found_json = json.loads(shown.out)
    assert (shown.code, len(shown.out.splitlines())) == (code, 1)
    assert (found_json["file"], found_json["exact"]) == ("b.html", True)
    assert [each["code"] for each in found_json["diagnostics"]] == ["does-not-fit"] * bool(found.not_built)
    capture = Path("run.vcd") if "--capture" in words else None
    assert asked == [(capture, 5 if "--rate" in words else None, "--twin" in words)] * 2


def test_only_a_capture_has_a_rate(run: Run) -> None:
    ran = run("report", "a.toml", "--rate", 5)
    assert (ran.code, "only a capture has a sampling rate" in ran.err) == (2, True)


@pytest.fixture
def tuning(monkeypatch: pytest.MonkeyPatch, building: dict[str, Any]) -> dict[str, Any]:
    """`tune` gives tuning["result"]; what it is asked."""
    firmware = SimpleNamespace(dialect="xc8")
    stand_in(
        monkeypatch, job_package, "plan_job", lambda path: SimpleNamespace(name="arm", firmware=firmware)
    )
    stand_in(monkeypatch, "servogen.cli.files", "read_image", lambda path: "image")
    stand_in(monkeypatch, verify_package, "verdict_lines", lambda verdict: ["verdict"])
    seen: dict[str, Any] = {}

    def tune_to(job: Any, image: Any, name: str, dialect: str, source: Any) -> Any:
        seen["asked"] = (image, name, dialect, source and source.text)
        return seen["result"]

    stand_in(monkeypatch, retarget, "tune_to", tune_to)
    return seen


def tuned(source: str, exact: bool) -> Any:
    added = [SimpleNamespace(path="A to B", theirs=7, ours=5)]
    return SimpleNamespace(
        source=source, added=added, verdict=SimpleNamespace(passed=exact), to_json=lambda: {"exact": exact}
    )


def test_tune_writes_the_next_c_until_the_hex_is_exact(
    run: Run, tuning: dict[str, Any], tables: Tables, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    tuning["result"] = tuned("int x;\n", False)
    ran = run("tune", "a.toml", "--hex", "other.hex")
    assert ran.code == 1
    again = "not exact yet: compile main.xc8.1.c, then servogen tune a.toml --hex … --c main.xc8.1.c"
    assert ran.out.splitlines() == ["verdict", again]
    assert tables == [("Cycles beside the delays", ("path", "other.hex", "servogen"), [("A to B", 7, 5)])]
    assert tuning["asked"] == ("image", "other.hex", "xc8", None)
    assert Path("main.xc8.1.c").read_text() == "int x;\n"
    tuning["result"] = tuned("", True)
    ran = run("tune", "a.toml", "--hex", "other.hex", "--c", "main.xc8.1.c", "--dialect", "sdcc")
    assert (ran.code, ran.out.splitlines()) == (0, ["verdict", "other.hex: 0 cycles off"])
    assert tuning["asked"] == ("image", "other.hex", "sdcc", "int x;\n")
    assert not Path("main.xc8.2.c").exists()


def test_tune_as_json_names_the_next_c_if_there_is_one(
    run: Run, tuning: dict[str, Any], tables: Tables, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for source, exact, following in (("int x;\n", False, "next.c"), ("", True, None)):
        tuning["result"] = tuned(source, exact)
        ran = run("tune", "a.toml", "--hex", "other.hex", "-o", "next.c", "--json")
        assert ran.code == (0 if exact else 1)
        assert json.loads(ran.out) == {
            "diagnostics": [],
            "job": "arm",
            "dialect": "xc8",
            "next_c": following,
            "exact": exact,
        }
    assert tables == []


def test_tune_does_not_overwrite_what_it_reads(
    run: Run, tuning: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    tuning["result"] = tuned("int x;\n", False)
    Path("mine.c").write_text("int y;\n")
    for target in ("a.toml", "other.hex", "mine.c"):
        ran = run("tune", "a.toml", "--hex", "other.hex", "--c", "mine.c", "-o", target)
        assert (ran.code, "[output-exists]" in ran.err) == (2, True), target
    assert Path("mine.c").read_text() == "int y;\n"
    assert not Path("a.toml").exists()


def test_a_build_writes_the_tape_as_bytes_and_as_hex(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A byte that the programmer would write wrongly is found by the comparison with the schedule."""
    monkeypatch.chdir(tmp_path)
    Path("dance.toml").write_text(tape_text())
    assert run("build", "dance.toml", "-o", "made").code == 0
    tape = bytearray(Path("made/tape.bin").read_bytes())
    assert IntelHex("made/tape.hex").tobinstr() == bytes(tape)
    verify = ("verify", "made/main.hex", "--against", "made/schedule.json")
    assert run(*verify).code == 0
    tape[-1] ^= 1
    Path("made/tape.bin").write_bytes(tape)
    assert run(*verify).code != 0


def test_new_writes_a_file_once(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """job.toml unless told otherwise; an existing file is overwritten with --force only."""
    monkeypatch.chdir(tmp_path)
    ran = run("new")
    assert (ran.code, ran.out.splitlines()[1:]) == (
        0,
        ["  servogen check job.toml", "  servogen watch job.toml"],
    )
    text = Path("job.toml").read_text()
    Path("job.toml").write_text("mine")
    again = run("new")
    assert (again.code, again.out, Path("job.toml").read_text()) == (2, "", "mine")
    assert "exists already" in again.err
    assert run("new", "--force").code == 0
    assert Path("job.toml").read_text() == text
    assert run("new", "b.toml", "--force").code == 0


def test_check_ends_with_the_number_of_servos_the_loop_and_the_error(run: Run, tables: Tables) -> None:
    """Three poses of 2, 5 and 3 s at 50 frames a second; the plan's own error is in its last words."""
    ran = run("check", LAB8)
    last = ran.out.splitlines()[-1]
    assert last.startswith(f"{LAB8}: 1 servo, loop of 500 frames, 10 s; the schedule is within ")
    assert [title for title, *_ in tables] == ["Pulse widths"]
    assert run("check", LAB8, "--json").out.count("\n") == 1
    assert len(tables) == 1


@pytest.mark.parametrize(("exact", "code", "word"), [(True, 0, "exact"), (False, 1, "NOT EXACT")])
def test_build_ends_with_its_folder_its_verdict_and_its_warnings(
    run: Run,
    building: dict[str, Any],
    tables: Tables,
    monkeypatch: pytest.MonkeyPatch,
    exact: bool,
    code: int,
    word: str,
) -> None:
    """In build/ and the job's name unless told otherwise."""
    stand_in(monkeypatch, job_build, "program_facts", lambda result: ())
    stand_in(
        monkeypatch, "servogen.report.text", "timing_budgets_text", lambda facts, clock: iter(["budgets"])
    )
    building["build"] = lambda job: built(job.name, exact, 2)
    ran = run("build", "jobs/a.toml")
    assert (ran.code, ran.out.splitlines()) == (
        code,
        [
            "budgets",
            f"build/a: {word}; {PLAN}; all of it in report.txt",
            "every power-up, input and chip: main.hex, main.hex: not proven yet: servogen prove "
            "build/a/main.hex --against build/a/schedule.json, or build with --prove",
            "next: servogen watch jobs/a.toml, or servogen flash build/a/main.hex",
        ],
    )
    assert ran.err.splitlines()[0] == "2 warnings:"
    assert [title for title, *_ in tables] == [
        "Pulse widths",
        "Programs: engine sequence, 30 frames compared",
    ]
    shown = run("build", "jobs/a.toml", "-o", "other", "--json")
    found = json.loads(shown.out)
    assert (shown.code, found["folder"], found["job"]) == (code, "other", "a")
    assert (len(found["diagnostics"]), len(tables)) == (2, 2)
    assert "2 warnings" in shown.err
    assert building["written"] == [Path("build/a"), Path("other")]


@pytest.fixture
def planning(monkeypatch: pytest.MonkeyPatch, building: dict[str, Any], tmp_path: Path) -> list[Any]:
    """`plan` has these facts; the pictures and films that are drawn."""
    from servogen.report import film, motion_plot, motion_table, plan_facts
    from servogen.workflows import horns

    stand_in(monkeypatch, horns, "job_horns", lambda job: ())
    drawn: list[Any] = []
    found = facts(tracks=(), to_json=lambda: {"plan": 1})
    found.job.notes = ()
    stand_in(monkeypatch, "servogen.workflows.engines", "nearest_pulses", lambda job: (job, "pulses"))
    stand_in(monkeypatch, plan_facts, "plan_facts", lambda job, pulses, engine: found)
    stand_in(monkeypatch, motion_table, "frame_lines", lambda *given: iter(["a", "b"]))
    stand_in(monkeypatch, motion_plot, "motion_plot", lambda *given: drawn.append(given[-1]))
    stand_in(monkeypatch, film, "job_scene", lambda job: "scene")
    stand_in(monkeypatch, film, "film", lambda scene, path: drawn.append((scene, path)))
    monkeypatch.chdir(tmp_path)
    return drawn


def test_plan_writes_only_what_is_asked_for(run: Run, planning: list[Any], tables: Tables) -> None:
    ran = run("plan", "a.toml")
    assert (ran.code, planning, list(Path().iterdir())) == (0, [], [])
    assert ran.out.splitlines()[-1].startswith("jobs/x.toml: 2 servos")
    run("plan", "a.toml", "--csv", "a.csv")
    assert (Path("a.csv").read_text(), planning) == ("a\nb\n", [])
    run("plan", "a.toml", "--plot", "a.png")
    run("plan", "a.toml", "--animate", "a.gif")
    assert planning == [Path("a.png"), ("scene", Path("a.gif"))]
    count = len(tables)
    assert json.loads(run("plan", "a.toml", "--json").out)["plan"] == 1
    assert len(tables) == count


def test_warnings_of_a_plan_and_a_check_come_last(
    run: Run, planning: list[Any], tables: Tables, monkeypatch: pytest.MonkeyPatch
) -> None:
    from servogen.report import plan_facts

    warned = (Diagnostic("warning", "w", "one"),)
    found = facts()
    found.job.warnings, found.plan.warnings = warned, (Diagnostic("warning", "w", "two"),)
    stand_in(
        monkeypatch, plan_facts, "plan_facts", lambda *_, **__: SimpleNamespace(**vars(found), tracks=())
    )
    ran = run("plan", "a.toml")
    assert ran.err.splitlines()[0] == "2 warnings:"
    schedule = SimpleNamespace(
        clock=Clock(4_000_000), loop_frames=50, period=Cycles(20_000), plan_error=PlanError(0.25)
    )
    pulses = SimpleNamespace(schedule=schedule, widths=(), warnings=warned)
    note = Diagnostic("note", "n", "a note")
    job = SimpleNamespace(name="a", servos=[1, 2], warnings=warned, chips=())
    with_engine = SimpleNamespace(notes=(note,))
    played = SimpleNamespace(job=with_engine, plan=pulses, to_json=lambda: {"played": 1})
    stand_in(monkeypatch, job_package, "plan_job", lambda path: job)
    stand_in(monkeypatch, "servogen.workflows.engines", "planned", lambda job: played)
    ran = run("check", "a.toml")
    assert ran.out.splitlines() == ["a note", f"a.toml: 2 servos, loop of 50 frames, 1 s; {PLAN}"]
    assert (ran.code, ran.err.splitlines()[0]) == (0, "2 warnings:")
    shown = run("check", "a.toml", "--json")
    assert (json.loads(shown.out)["played"], shown.err) == (1, "")
    assert [each["code"] for each in json.loads(shown.out)["diagnostics"]] == ["w", "n"]
