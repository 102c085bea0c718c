"""The functions of `servogen.api`, and how their values show themselves in a notebook."""

import subprocess
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, cast
from xml.etree import ElementTree

import pytest

from servogen import api
from servogen.cli import main, simulate_command
from servogen.errors import InputError
from servogen.job import Job, PlannedJob
from servogen.notebooks import table_html
from servogen.pic.image import Image
from servogen.programs import Program
from servogen.pulse import from_json
from servogen.simulator import Simulation, SimulatorOptions, Stimuli
from servogen.simulator import machine as machine_module
from servogen.simulator import run as run_module
from servogen.simulator.machine import Machine
from servogen.units import Clock
from servogen.workflows.job_build import Build

ROOT = Path(__file__).parents[1]
JOB = ROOT / "jobs" / "lab8-exercise.toml"
FOLDER = ROOT / "firmware" / "lab8-exercise"


@pytest.fixture(scope="module")
def made() -> Build:
    return api.build(str(JOB))


@pytest.fixture(scope="module")
def ran(made: Build) -> Simulation:
    return api.simulate(made)


def test_import_loads_nothing() -> None:
    code = (
        "import sys, servogen; print(*(name for name in sys.modules if name[:8] in ('servogen', 'numpy')))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "servogen\n"


def test_load_takes_jobs_programs_and_builds() -> None:
    job = api.load(JOB)
    assert isinstance(job, Job) and not isinstance(job, PlannedJob)
    for path, words in ((FOLDER, 91), (FOLDER / "main.hex", 91)):
        program = api.load(str(path))
        assert isinstance(program, Program) and program.image.words == words
    with pytest.raises(InputError, match=r"'\.md' is not the suffix of a job or a program"):
        api.load(ROOT / "README.md")


def test_build_gives_what_is_committed(made: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a path, a loaded job and a planned one."""
    committed = api.load(FOLDER)
    assert isinstance(committed, Program)
    assert made.exact and made.programs[0].image == committed.image
    job = api.load(JOB)
    assert isinstance(job, Job)
    monkeypatch.setattr("servogen.api.build_planned", lambda planned: planned)
    for given in (JOB, str(JOB), job):
        planned: Any = api.build(given)
        assert isinstance(planned, PlannedJob) and planned.name == "lab8-exercise"
    assert api.build(made.job) is cast(Any, made.job)


def test_simulate_runs_the_motion_of_a_build_and_a_second_of_a_program(ran: Simulation, made: Build) -> None:
    schedule = from_json((FOLDER / "schedule.json").read_text(), "schedule.json")
    span = ran.edges.clock.seconds(ran.edges.end)
    assert span == 500 * schedule.clock.us(schedule.period) / 1_000_000 == 10  # 2 s + 5 s + 3 s
    for program in (FOLDER / "main.hex", FOLDER, api.load(FOLDER), JOB):
        short = api.simulate(program)
        assert short.edges.clock.seconds(short.edges.end) == 1
        rises = sum(int(((each.pin == 5) & (each.level == 1)).sum()) for each in short.edges.chunks)
        assert rises == 49  # one in each 20 ms, the first after one of them
    assert api.simulate(FOLDER, 0.5, clock_hz=8_000_000).edges.end == 1_000_000


def test_plot_shows_a_picture_and_saves_it(ran: Simulation, made: Build, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    pictures = [api.plot(ran, 0.1), api.plot(made, 0.1)]
    for picture in pictures:
        assert ElementTree.fromstring(picture._repr_svg_()).tag.endswith("svg")
        assert len(repr(picture)) < 120
    assert repr(pictures[1]).startswith("<Picture 'lab8-exercise: from the first edge on'")
    pictures[0].save(tmp_path / "pulses.png")
    assert (tmp_path / "pulses.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InputError, match=r"'\.gif' is not a picture"):
        pictures[0].save(tmp_path / "pulses.gif")


def test_every_value_shows_itself_in_a_line(ran: Simulation, made: Build) -> None:
    program = made.programs[0]
    values = {
        "<Job lab8-exercise: arm on RB0; PIC16F84 at 4 MHz>": api.load(JOB),
        "<PlannedJob lab8-exercise: arm on RB0; PIC16F84 at 4 MHz>": made.job,
        "<JointTrajectory arm; 0 + 500 frames>": made.job.trajectory,
        "<Build lab8-exercise: sequence in c2c, xc8, sdcc; exact, 1500 frames>": made,
        "<Program in c2c: 91 words, exact>": program,
        "<Program of 91 words at 4 MHz>": api.load(FOLDER),
        "<PulseSchedule arm on RB0; 0 + 500 frames of 20 ms>": made.plan.schedule,
        "<Verdict: exact>": program.verdict,
        "<Image of 91 words, configuration 0x3FF1>": program.image,
        "<EdgeTrace of 10 s at 4 MHz>": ran.edges,
    }
    assert {text: repr(value) for text, value in values.items()} == {text: text for text in values}
    for value in (ran, program.firmware.compilation, program.firmware.compilation.listing):
        assert len(repr(value)) < 80 and "\n" not in repr(value)


class Table(HTMLParser):
    def __init__(self, html: str) -> None:
        super().__init__()
        self.cells: list[str] = []
        self.open: list[str] = []
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        assert tag in {"table", "caption", "tr", "th", "td"}
        self.open.append(tag)
        if tag in {"caption", "th", "td"}:
            self.cells.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in {"caption", "th", "td"}:
            self.cells[-1] += data


def test_values_are_tables_in_html(ran: Simulation, made: Build) -> None:
    assert Table(made._repr_html_()).cells[6:10] == ["c2c", "91", "2", "exact"]
    assert Table(made.plan.schedule._repr_html_()).cells[-3:] == [
        "arm",
        "RB0",
        "1167 to 1667",
    ]  # 30° and 120°
    assert Table(made.job._repr_html_()).cells[-3:] == ["arm", "RB0", "Futaba S3001"]
    assert Table(ran._repr_html_()).cells[1:4] == ["pin", "changes", "RB0"]
    program = api.load(ROOT / "tests" / "labs_xc8" / "chaser.c")
    assert isinstance(program, Program) and "main" in Table(program._repr_html_()).cells
    assert Table(table_html("<b>&", ["a"], [["<script>"]])).cells == ["<b>&", "a", "<script>"]


@pytest.mark.parametrize("seconds", [-1, float("nan"), 3601, 1e30, "2"])
def test_a_time_that_cannot_be_simulated_is_refused(
    made: Build, ran: Simulation, seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("servogen.api.run", lambda *_: pytest.fail("it runs"))
    for refused in (
        lambda: api.simulate(made, seconds),
        lambda: api.simulate(FOLDER, seconds),
        lambda: api.plot(ran, seconds),
    ):
        with pytest.raises(InputError, match="is not a number from 0 to 3600") as error:
            refused()
        assert error.value.code == "out-of-range"


def test_a_program_runs_from_no_time_at_all_to_an_hour(monkeypatch: pytest.MonkeyPatch) -> None:
    spans: list[int] = []
    monkeypatch.setattr("servogen.api.run", lambda image, clock, span, *more: spans.append(span))
    for seconds in (0, 3600):
        api.simulate(FOLDER, seconds)
    assert spans == [0, 3600 * 1_000_000]


def test_a_build_runs_its_own_program_with_the_inputs_of_its_schedule_or_the_given_ones(
    made: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[tuple[object, ...]] = []
    monkeypatch.setattr("servogen.api.run", lambda *given: ran.append(given))
    monkeypatch.setattr("servogen.api.inputs_of", lambda schedule: "held")
    given = Stimuli(())
    for stimulus, inputs in ((None, "held"), (given, given)):
        api.simulate(made, stimulus=stimulus)
        image, clock, span, _, played = ran.pop()
        assert image is made.programs[0].image
        assert (clock, span, played) == (Clock(4_000_000), 500 * 20_000, inputs)
    api.simulate(FOLDER, stimulus=given)
    assert ran.pop()[-1] is given


def test_a_picture_has_the_pulses_of_what_is_given(
    made: Build, ran: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its title is the job's name, if there is one; only a build has a schedule to compare with."""
    runs: list[tuple[object, object]] = []

    def simulate(program: object, seconds: object) -> Simulation:
        runs.append((program, seconds))
        return ran

    monkeypatch.setattr("servogen.api.simulate", simulate)
    monkeypatch.setattr("servogen.api.Picture", lambda figure: figure)
    monkeypatch.setattr("servogen.api.pulse_figure", lambda *given: given)
    job, end = api.load(JOB), ran.edges.end
    titled = "{}: from the first edge on"
    for source, title, schedule in (
        (ran, "pulses", None),
        (ran.edges, "pulses", None),
        (FOLDER, "pulses", None),
        (job, "lab8-exercise", None),
        (made, "lab8-exercise", made.plan.schedule),
    ):
        for seconds, until in ((None, end), (0.5, 500_000)):
            picture: Any = api.plot(source, seconds)
            assert picture[0].end == picture[1] == until
            assert picture[2:] == (titled.format(title), schedule)
    assert runs == [(source, seconds) for source in (FOLDER, job, made) for seconds in (None, 0.5)]


@pytest.mark.parametrize("clock_hz", [0, -4_000_000, float("nan"), "4 MHz"])
def test_a_clock_that_is_not_a_frequency_is_refused(clock_hz: int) -> None:
    with pytest.raises(InputError, match="is not a whole number of at least 1") as error:
        api.simulate(FOLDER, 0.001, clock_hz=clock_hz)
    assert error.value.code == "wrong-clock"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: api.load(3), "path = 3 is not the path of a file"),  # type: ignore[arg-type]
        (lambda: api.build(None), "job = None is not the path of a file"),  # type: ignore[arg-type]
        (lambda: api.simulate(FOLDER, stimulus=5), "stimulus = 5 is not the path of a file"),  # type: ignore[arg-type]
        (lambda: api.simulate(FOLDER, stimulus="none.toml"), "none.toml: error: cannot be read"),
    ],
)
def test_what_is_not_a_file_is_named(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError) as raised:
        call()
    assert message in str(raised.value)


def test_a_stimulus_may_be_a_file(tmp_path: Path) -> None:
    """RB1, an input, is copied to RB0, an output, within one loop of 4 cycles."""
    (tmp_path / "copy.asm").write_text(
        " __config 0x3FF1\n bsf 3, 5\n bcf 6, 0\n bcf 3, 5\n"
        "loop btfss 6, 1\n bcf 6, 0\n btfsc 6, 1\n bsf 6, 0\n goto loop\n end\n"
    )
    (tmp_path / "press.toml").write_text('[[level]]\npin = "RB1"\nat_us = [0, 500]\nlevel = [0, 1]\n')
    ran = api.simulate(tmp_path / "copy.asm", 0.001, stimulus=tmp_path / "press.toml")
    rises = [
        cycle
        for chunk in ran.edges.chunks
        for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True)
        if (pin, level) == (5, 1)
    ]
    assert len(rises) == 1 and 500 <= rises[0] < 510


def test_the_program_of_a_job_runs_on_the_chip_of_the_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    devices = []

    class Noted(Machine):
        def __init__(
            self, image: Image, clock: Clock, options: SimulatorOptions, *more: Any, **named: Any
        ) -> None:
            devices.append(options.device)
            super().__init__(image, clock, options, *more, **named)

    for module in (run_module, machine_module, simulate_command):
        monkeypatch.setattr(module, "Machine", Noted)
    path = tmp_path / "job.toml"
    path.write_text(JOB.read_text().replace('"PIC16F84"', '"PIC16F84A"'))
    job = api.load(path)
    devices.clear()  # of the engine that measures its statements
    api.simulate(job, 0.001)
    assert devices[-1] == "PIC16F84A"
    for options, expected in (((), "PIC16F84A"), (("--device", "PIC16F84"), "PIC16F84")):
        monkeypatch.setattr(sys, "argv", ["servogen", "simulate", str(path), "--cycles", "100", *options])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 0
        assert devices[-1] == expected
