"""The pytest plugin, as a user's tests meet it: simulated, on recordings, on the bench, in reports."""

import re
import shutil
import sys
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, cast
from xml.etree import ElementTree

import pytest

# Here, so that the runs inside this process find them and do not load them each anew.
from servogen.bench.inputs.wiring import input_wiring
from servogen.bench.virtual.analyser import AnalyserOptions, VirtualAnalyser
from servogen.bench.virtual.chip import VirtualChip
from servogen.bench.virtual.k150 import ProgrammerOptions, VirtualProgrammer
from servogen.edges import edge_chunk
from servogen.errors import Diagnostic, InputError, ToolError
from servogen.pic.image import Image
from servogen.programs import Program
from servogen.pulse import from_json
from servogen.testing import plugin
from servogen.testing.targets import InputPorts
from servogen.traces.captures import capture_writer
from servogen.twin import TwinSettings
from servogen.units import Clock, Cycles
from tests.bench.conftest import Serve, image_of, serve  # noqa: F401 - a fixture

pytest_plugins = ["pytester"]

MHZ4 = Clock(4_000_000)
ROOT = Path(__file__).parents[2]
JOB = ROOT / "firmware" / "lab8-exercise"

PAGE = (ROOT / "docs" / "testing-firmware.md").read_text()
TEST = re.sub(r"  # what.*", "", re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)[-1])
TEST = TEST.replace("build/lab8-exercise", "job").replace("test_the_arm_moves", "test_arm")
"""The page's own example of a servo job."""


TWICE = """

@pytest.mark.servogen("job", seconds=1)
def test_again(servogen_capture, servogen_schedule):
    assert_pulses(servogen_capture, servogen_schedule, partial=True)
"""


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    """A project with a job's folder and one test of it."""
    shutil.copytree(JOB, pytester.path / "job", ignore=shutil.ignore_patterns("*.vcd", "edges.csv"))
    pytester.makepyfile(test_firmware=TEST)
    return pytester


def properties(path: Path) -> dict[str, str]:
    """Of the only test in a JUnit report."""
    return {
        str(each.get("name")): str(each.get("value")) for each in ElementTree.parse(path).iter("property")
    }


def run(project: pytest.Pytester, *options: str) -> pytest.RunResult:
    return project.runpytest_inprocess(
        "-p", "no:xdist", "-p", "no:hypothesispytest", "--strict-markers", *options
    )


def break_the_program(project: pytest.Pytester) -> None:
    """Another program than the schedule's: that of lab 9."""
    shutil.copy(ROOT / "firmware" / "lab9-exercise" / "main.hex", project.path / "job" / "main.hex")


def test_a_proven_program_passes_and_the_report_says_what_was_measured(project: pytest.Pytester) -> None:
    run(project, "--junitxml=report.xml").assert_outcomes(passed=1)
    found = properties(project.path / "report.xml")
    assert found["servogen_target"] == "sim"
    assert found["servogen_program"] == "job/main.hex"
    assert found["servogen_source"] == "the simulated chip"
    assert found["servogen_verdict"] == "exact"
    assert found["servogen_frames"] == "1500"  # three loops of 500 frames
    assert found["servogen_plan_error"] == "0.333 µs, 0.06°"
    assert found["servogen_RB0_worst_width_error_cycles"] == "0"


def test_a_wrong_program_fails_with_the_verdict_and_its_capture(project: pytest.Pytester) -> None:
    break_the_program(project)
    result = run(project, "--junitxml=report.xml")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "*the pulses seen on the simulated chip are not the schedule's*",
            "*NOT exact: compared*; the schedule is within 0.333 µs, 0.06° of the plan",
            "*RB0 arm:*",
            "*servogen-captures/test_firmware-test_arm.vcd: what was seen on the simulated chip*",
        ]
    )
    capture = project.path / "servogen-captures" / "test_firmware-test_arm.vcd"
    assert capture.is_file()
    assert properties(project.path / "report.xml")["servogen_capture"] == str(capture)


def test_a_recording_is_replayed_without_the_program(project: pytest.Pytester) -> None:
    run(project, "--servogen-record=seen").assert_outcomes(passed=1)
    (project.path / "job" / "main.hex").unlink()
    run(project, "--servogen-replay=seen", "--junitxml=report.xml").assert_outcomes(passed=1)
    assert properties(project.path / "report.xml")["servogen_target"] == "replay"


def test_a_recording_of_something_else_fails(project: pytest.Pytester) -> None:
    break_the_program(project)
    run(project, "--servogen-record=seen").assert_outcomes(failed=1)
    shutil.copy(JOB / "main.hex", project.path / "job" / "main.hex")
    run(project, "--servogen-replay=seen").assert_outcomes(failed=1)


def test_a_missing_recording_is_named(project: pytest.Pytester) -> None:
    result = run(project, "--servogen-replay=seen")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*there is no recording of this test*", "*--servogen-record=*"])


def test_a_bench_test_is_skipped_with_what_to_do(project: pytest.Pytester) -> None:
    project.makepyfile(test_firmware=TEST.replace("@pytest", "@pytest.mark.servogen_bench\n@pytest", 1))
    result = run(project, "-rs")
    result.assert_outcomes(skipped=1)
    result.stdout.fnmatch_lines(["*needs a chip on the bench: pytest --servogen-target=bench*"])


@pytest.mark.parametrize(("hex_file", "outcome"), [("lab8-exercise", "passed"), ("lab8-program", "failed")])
def test_the_same_test_runs_on_the_bench(
    project: pytest.Pytester,
    serve: Serve,  # noqa: F811
    hex_file: str,
    outcome: str,
) -> None:
    """A chip whose crystal is 180 ppm fast, seen by a SUMP analyser at 1 MHz."""
    chip = VirtualChip(
        image_of(ROOT / "firmware" / hex_file / "main.hex"), Clock(4_000_000), ppm=Fraction(180)
    )
    port = serve({"analyser": VirtualAnalyser(chip, AnalyserOptions())}).paths["analyser"]
    bench = ("--servogen-target=bench", f"--servogen-port={port}")
    result = run(project, *bench, "--servogen-record=seen", "--junitxml=report.xml")
    result.assert_outcomes(**{outcome: 1})
    found = properties(project.path / "report.xml")
    assert found["servogen_source"] == (
        f"the bench's chip, which this run did not program, by the analyser on {port}"
    )
    assert found["servogen_program"] == "what was on the chip"
    replayed = run(project, "--servogen-replay=seen")
    replayed.assert_outcomes(**{outcome: 1})
    if outcome == "passed":
        assert float(found["servogen_crystal_ppm"]) == pytest.approx(180, abs=2)


picpro = pytest.mark.skipif(not find_spec("picpro"), reason="picpro is not installed: pip install picpro")


def bench_with_a_programmer(serve: Serve) -> tuple[VirtualProgrammer, tuple[str, ...]]:  # noqa: F811
    """A chip with lab 8's program on it, at 180 ppm, and the options that use its programmer and analyser."""
    other = image_of(ROOT / "firmware" / "lab8-program" / "main.hex")
    chip = VirtualChip(other, Clock(4_000_000), ppm=Fraction(180))
    programmer = VirtualProgrammer(chip)
    paths = serve({"analyser": VirtualAnalyser(chip), "programmer": programmer}).paths
    return programmer, (
        *("--servogen-target=bench", f"--servogen-port={paths['analyser']}"),
        *("--servogen-programmer=picpro", f"--servogen-programmer-port={paths['programmer']}"),
    )


@picpro
def test_the_bench_is_programmed_with_the_program_under_test_once(
    project: pytest.Pytester,
    serve: Serve,  # noqa: F811
) -> None:
    programmer, bench = bench_with_a_programmer(serve)
    project.makepyfile(test_firmware=TEST + TWICE)
    result = run(project, *bench, "--junitxml=report.xml")
    result.assert_outcomes(passed=2)
    wanted = image_of(JOB / "main.hex")
    assert programmer.chip.image.flash() == wanted.flash()
    assert programmer.erased == 1
    found = properties(project.path / "report.xml")
    assert found["servogen_program"] == "job/main.hex"
    assert found["servogen_verdict"] == AGREES  # of the second, which looks for one second
    assert found["servogen_source"].startswith(
        "the bench's chip, which this run programmed, by the analyser on"
    )
    assert float(found["servogen_crystal_ppm"]) == pytest.approx(180, abs=2)


@picpro
def test_a_wrong_program_is_programmed_and_fails_with_its_capture(
    project: pytest.Pytester,
    serve: Serve,  # noqa: F811
) -> None:
    """What was on the chip before cannot stand in for the program under test."""
    _, bench = bench_with_a_programmer(serve)
    break_the_program(project)
    result = run(project, *bench, "--junitxml=report.xml")
    result.assert_outcomes(failed=1)
    capture = project.path / "servogen-captures" / "test_firmware-test_arm.vcd"
    result.stdout.fnmatch_lines(
        [f"*{capture}: what was seen on the bench's chip, which this run programmed*"]
    )
    found = properties(project.path / "report.xml")
    assert found["servogen_capture"] == str(capture)
    assert found["servogen_verdict"] == "does not agree"
    shutil.copy(capture, project.mkdir("seen") / capture.name)
    run(project, "--servogen-replay=seen").assert_outcomes(failed=1)


@pytest.mark.campaign
@picpro
def test_a_chip_that_cannot_be_programmed_is_an_error_and_nothing_is_claimed(
    project: pytest.Pytester,
    serve: Serve,  # noqa: F811
) -> None:
    programmer, bench = bench_with_a_programmer(serve)
    programmer.options = ProgrammerOptions(wrong_bit_at=0x10)
    result = run(project, *bench, "--junitxml=report.xml")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*the program memory differs from the file*at address 0x010*"])
    assert "servogen_verdict" not in properties(project.path / "report.xml")


def test_a_partial_recording_is_never_taken_for_whole(project: pytest.Pytester) -> None:
    path = project.mkdir("seen") / "test_firmware-test_arm.vcd"
    with capture_writer(path, 1_000_000, missing="the analyser disappeared") as writer:
        first = edge_chunk(*zip(*pulses(500), strict=True))
        writer.add(first)
        writer.finish(Cycles(10_000_000))
    result = run(project, "--servogen-replay=seen")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*the capture is incomplete: the analyser disappeared*"])


def pulses(frames: int) -> list[tuple[int, int, int]]:
    """The job's own edges from a moment before its first, as an analyser sees them."""
    schedule = from_json((JOB / "schedule.json").read_text(), "schedule.json")
    loop = [run.pulses[0] for run in schedule.loop for _ in range(run.frames)]
    widths = [loop[frame % len(loop)] for frame in range(frames)]
    rows = [(0, 5, 0)]
    for number, pulse in enumerate(widths):
        assert pulse is not None
        rise = 500 + number * schedule.period
        rows += [(rise, 5, 1), (rise + pulse.width, 5, 0)]
    return rows


ONE_SECOND = TEST.replace('"job")', '"job", seconds=1)')
AGREES, EXACT = (f"{word} as far as it was seen" for word in ("agrees", "exact"))


def test_a_look_that_does_not_show_every_frame_fails_unless_the_test_allows_it(
    project: pytest.Pytester,
) -> None:
    project.makepyfile(test_firmware=ONE_SECOND)
    result = run(project, "--junitxml=report.xml")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([f"*{EXACT}: 1 of 3 different frames; *"])
    found = properties(project.path / "report.xml")
    assert found["servogen_verdict"] == EXACT
    assert found["servogen_different_frames"] == "1 of 3 different frames"
    project.makepyfile(
        test_firmware=ONE_SECOND.replace(
            "assert_pulses(servogen_capture, servogen_schedule)",
            "assert_pulses(servogen_capture, servogen_schedule, partial=True)",
        )
    )
    run(project).assert_outcomes(passed=1)
    break_the_program(project)
    run(project).assert_outcomes(failed=1)


@pytest.mark.parametrize("frames", [90, 502])
def test_a_recording_of_an_analyser_is_judged_by_the_frames_in_it(
    project: pytest.Pytester, frames: int
) -> None:
    """90 frames are of the first position; the test's own seconds cut nothing off."""
    project.makepyfile(test_firmware=ONE_SECOND)
    path = project.mkdir("seen") / "test_firmware-test_arm.vcd"
    with capture_writer(path, 1_000_000) as writer:
        writer.add(edge_chunk(*zip(*pulses(frames), strict=True)))
        writer.finish(Cycles(frames * 20_000))
    result = run(project, "--servogen-replay=seen", "--junitxml=report.xml")
    result.assert_outcomes(**{"failed" if frames < 500 else "passed": 1})
    verdict = properties(project.path / "report.xml")["servogen_verdict"]
    assert verdict == (AGREES if frames < 500 else "agrees")
    tolerances = properties(project.path / "report.xml")["servogen_tolerances"]
    assert tolerances == "a sample and 0.1 µs of width, 0.1 µs of period and 0.5 µs of edge"


def test_the_bench_needs_its_port(project: pytest.Pytester) -> None:
    result = run(project, "--servogen-target=bench")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--servogen-target=bench needs --servogen-port=PORT*"])


def test_a_test_that_does_not_say_its_program_is_told_how(project: pytest.Pytester) -> None:
    project.makepyfile(test_firmware=TEST.replace('@pytest.mark.servogen("job")\n', ""))
    result = run(project)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*the test does not state its program*", '*@pytest.mark.servogen("DIR")*'])
    run(project, "--servogen-build=job").assert_outcomes(passed=1)


def test_c_is_compiled_and_the_time_is_said(project: pytest.Pytester) -> None:
    mark = '@pytest.mark.servogen("job", image="job/main.xc8.c", seconds=11)'
    project.makepyfile(test_firmware=TEST.replace('@pytest.mark.servogen("job")', mark))
    run(project, "--junitxml=report.xml").assert_outcomes(passed=1)
    assert properties(project.path / "report.xml")["servogen_program"] == "job/main.xc8.c"


def test_a_test_moves_the_robot_and_its_report_has_the_verdict(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without MuJoCo it is skipped. The twin is a stand-in that tells what it was given."""
    asked: list[tuple[Any, ...]] = []

    def twin_of(*given: Any) -> Any:
        asked.append(given)
        return SimpleNamespace(word="falls", reasons=lambda: ["it tips", "it slips"])

    monkeypatch.setattr("servogen.workflows.twinning.twin_of", twin_of)
    monkeypatch.setattr("servogen.job.load", lambda path: path.name)
    monkeypatch.setattr("servogen.job.plan_job", lambda job: f"planned {job}")
    pytester.makepyfile(
        test_twin="""
        def test_walk(servogen_twin):
            assert servogen_twin("a.toml", loops=3).word == "falls"
            servogen_twin("a.toml", "b.hex")
        """
    )
    monkeypatch.setitem(sys.modules, "mujoco", cast(Any, None))
    result = run(pytester, "-rs")
    result.assert_outcomes(skipped=1)
    result.stdout.fnmatch_lines(["*the twin needs MuJoCo: pip install 'servogen?twin?'*"])
    monkeypatch.setitem(sys.modules, "mujoco", ModuleType("mujoco"))
    run(pytester, "--junitxml=report.xml").assert_outcomes(passed=1)
    assert [(job, settings.loops, file and file.name) for job, settings, file in asked] == [
        ("planned a.toml", 3, None),
        ("planned a.toml", TwinSettings().loops, "b.hex"),
    ]
    stated = [
        (each.get("name"), each.get("value"))
        for each in ElementTree.parse(pytester.path / "report.xml").iter("property")
    ]
    once = [
        *(("servogen_twin", "falls"), ("servogen_twin_reason", "it tips")),
        ("servogen_twin_reason", "it slips"),
    ]
    assert stated == 2 * once


# Hook by hook, without a run of pytest.


def test_every_option_is_explained_on_the_page() -> None:
    added: list[str] = []
    group = SimpleNamespace(addoption=lambda name, **facts: added.append(name))
    parser: Any = SimpleNamespace(getgroup=lambda *names: group)
    plugin.pytest_addoption(parser)
    assert len(added) == 13
    assert set(added) == set(re.findall(r"--servogen-[a-z-]+", PAGE))


def config(**options: Any) -> Any:
    """A configuration of pytest with these options; the others have their defaults."""
    lines: list[tuple[str, str]] = []
    return SimpleNamespace(
        getoption=lambda name: options.get(name, [] if name == "servogen_input" else None),
        addinivalue_line=lambda name, line: lines.append((name, line)),
        lines=lines,
        stash=pytest.Stash(),
        rootpath=options.get("rootpath", Path("/project")),
    )


def node(folder: Path, mark: Any = None, given: Any = None) -> Any:
    """A test in `folder`, with a mark of this plugin and a configuration if they are given."""
    return SimpleNamespace(
        path=folder / "test_a.py",
        name="test_b[x/y]",
        nodeid="test_a.py::test_b",
        config=given or config(rootpath=folder),
        get_closest_marker=lambda name: mark,
        user_properties=[],
        stash=pytest.Stash(),
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, ""),
        ({"servogen_target": "bench"}, "needs --servogen-port=PORT"),
        ({"servogen_target": "bench", "servogen_port": "/dev/ttyACM0"}, ""),
        ({"servogen_port": "/dev/ttyACM0"}, ""),
        ({"servogen_serial": "S"}, "--servogen-serial needs --servogen-serial-pin=PIN and"),
        ({"servogen_serial": "S", "servogen_serial_pin": "RB1"}, "--servogen-serial needs"),
        ({"servogen_serial": "S", "servogen_inputs": "I"}, "--servogen-serial needs"),
        ({"servogen_serial": "S", "servogen_inputs": "I", "servogen_serial_pin": "RB1"}, ""),
        ({"servogen_inputs": "I"}, ""),
    ],
)
def test_options_that_need_others_name_them(options: dict[str, str], message: str) -> None:
    given = config(**options)
    if message:
        with pytest.raises(pytest.UsageError, match=message):
            plugin.pytest_configure(given)
    else:
        plugin.pytest_configure(given)
    markers = [line.partition("(")[0].partition(":")[0] for name, line in given.lines if name == "markers"]
    assert markers == ["servogen", "servogen_bench"]


def test_the_bench_is_closed_when_the_run_ends(capsys: pytest.CaptureFixture[str]) -> None:
    plugin.pytest_unconfigure(config())
    closed = []

    def fail() -> None:
        raise ToolError("port-lost", "the device disappeared")

    for close, said in ((lambda: closed.append(True), ""), (fail, "the device disappeared")):
        given = config()
        given.stash[plugin.BENCH] = SimpleNamespace(close=close)
        plugin.pytest_unconfigure(given)
        assert said in capsys.readouterr().out
    assert closed == [True]


def test_one_bench_serves_the_whole_run_with_its_inputs() -> None:
    options = {
        "servogen_port": "/dev/ttyACM0",
        "servogen_programmer": "picpro",
        "servogen_device": "PIC16F84A",
        "servogen_programmer_port": "/dev/ttyUSB0",
        "servogen_inputs": "/dev/ttyACM1",
        "servogen_serial": "/dev/ttyUSB1",
        "servogen_serial_pin": "rb6",
        "servogen_input": ["RB0=30"],
    }
    folder = SimpleNamespace(mktemp=lambda name: Path("/tmp") / name)

    def bench(**changes: Any) -> tuple[Any, Any]:
        request: Any = SimpleNamespace(
            config=config(**{**options, **changes}), getfixturevalue=lambda name: folder
        )
        return plugin.session_bench(request), request

    made, request = bench()
    assert plugin.session_bench(request) is made
    assert (made.port, made.programmer, made.programmer_port, made.device, made.folder.name) == (
        *("/dev/ttyACM0", "picpro", "/dev/ttyUSB0", "PIC16F84A"),
        "servogen-bench",
    )
    assert made.inputs == InputPorts("/dev/ttyACM1", input_wiring(["RB0=30"]), "/dev/ttyUSB1", "RB6")
    silent, _ = bench(servogen_serial=None, servogen_serial_pin=None)
    assert (silent.inputs.serial, silent.inputs.serial_pin) == (None, "")
    bare, _ = bench(servogen_inputs=None)
    assert bare.inputs is None
    with pytest.raises(InputError, match="there is no pin 'RC9'"):
        bench(servogen_serial_pin="RC9")


def test_a_program_is_read_once_for_each_device_and_its_remarks_are_warnings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, warned = [], []

    def read_program(path: Path, device: str | None) -> Program:
        read.append((path.name, device))
        return Program(Image({}), clock=Clock(10_000_000), remarks=(Diagnostic("warning", "w", "odd"),))

    monkeypatch.setattr("servogen.programs.read_program", read_program)
    made = config(rootpath=tmp_path)
    mark = SimpleNamespace(args=("a.hex",), kwargs={})
    for _ in range(2):
        given = node(tmp_path, mark, made)
        given.warn = warned.append
        for device in (None, "PIC16F84A"):
            assert plugin.read_once(given, tmp_path / "a.hex", device).clock == Clock(10_000_000)
        assert plugin.clock_for(given, None) == Clock(10_000_000)
        assert plugin.clock_for(given, Program(Image({}), clock=MHZ4)) == MHZ4
    assert read == [("a.hex", None), ("a.hex", "PIC16F84A")]
    assert {str(each) for each in warned} == {"servogen: warning: odd [w]"}
    assert plugin.clock_for(node(tmp_path), None) == MHZ4, "no program is named"
