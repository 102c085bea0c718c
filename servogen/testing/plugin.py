"""The pytest plugin: the same tests of firmware in simulation, on the bench and on recordings.

    def test_the_led_blinks(servogen_machine):        # any firmware: HEX, C or assembly
        chip = servogen_machine("blink.c")
        chip.run_ms(500)
        assert chip.widths_us("RB0") == pytest.approx([1000] * 4, abs=20)

    from servogen.testing.plugin import assert_pulses

    @pytest.mark.servogen("build/lab8-exercise")      # a job's folder: main.hex and schedule.json
    def test_the_arm_moves(servogen_capture, servogen_schedule):
        assert_pulses(servogen_capture, servogen_schedule)

Heavy imports stand inside: every pytest run of the environment loads this file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import pytest

from servogen.errors import InputError, Location, ServogenError, did_you_mean

if TYPE_CHECKING:
    from servogen.pic.image import Image
    from servogen.programs import Program
    from servogen.pulse import PulseSchedule
    from servogen.simulator import SimulatorOptions, Stimuli
    from servogen.testing.chip import Chip
    from servogen.testing.seen_chip import SeenChip
    from servogen.testing.targets import Bench, PinCapture, SeenPins, Target
    from servogen.twin import TwinVerdict
    from servogen.units import Clock
    from servogen.verify import Tolerances

MARK, BENCH_MARK = "servogen", "servogen_bench"
MARKERS = (
    f"{MARK}(program, image=None, schedule=None, seconds=None, stimulus=None): the program that the test's "
    "fixtures run, or the folder of its build; its schedule, if it has one; how long it runs; what "
    "drives its pins",
    f"{BENCH_MARK}: the test needs a chip on the bench",
)
CAPTURES = "servogen-captures"
"""The folder in pytest's root to which the edges of failed tests are written."""


PACKAGE = Path(__file__).parents[1]
"""The folder of servogen's own modules."""

ON_THE_CHIP = "what was on the chip"
"""The name of the program if no programmer has programmed the chip."""
MARK_KEYS = ("image", "schedule", "seconds", "stimulus")

BENCH: pytest.StashKey[Bench] = pytest.StashKey()
SEEN: pytest.StashKey[list[PinCapture]] = pytest.StashKey()
CHIPS: pytest.StashKey[list[Chip | SeenChip]] = pytest.StashKey()
PROGRAMS: pytest.StashKey[dict[tuple[Path, str | None], Program]] = pytest.StashKey()


def assert_pulses(
    capture: PinCapture,
    schedule: PulseSchedule,
    tolerances: Tolerances | None = None,
    *,
    partial: bool = False,
) -> None:
    """Assert that the pins followed the schedule.

    In simulation every edge must match to the cycle, on the bench within `tolerances`. Fails as well if not
    every different frame of the schedule was seen, unless the test allows a `partial` capture.
    """
    __tracebackhide__ = True
    from servogen.testing.targets import check

    verdict = check(capture.seen, schedule, tolerances)
    capture.properties.extend(verdict.properties)
    if verdict.passed or (partial and verdict.agrees):
        return
    difference = "do not show the whole schedule" if verdict.agrees else "are not the schedule's"
    text = "\n".join(verdict.lines)
    raise AssertionError(f"the pulses seen on {capture.source} {difference}\n{text}")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("servogen", "servo firmware (servogen)")
    group.addoption(
        "--servogen-target",
        choices=("sim", "bench"),
        default="sim",
        help="what the tests of firmware run on (default: sim, the simulated chip)",
    )
    group.addoption("--servogen-port", metavar="PORT", help="the bench's analyser, such as /dev/ttyACM0")
    group.addoption(
        "--servogen-programmer",
        metavar="NAME",
        help="program the bench's chip with the program under test first: picpro, pk2cmd, ... "
        "(default: keep the program on the chip)",
    )
    group.addoption(
        "--servogen-programmer-port", metavar="PORT", help="the bench's programmer, such as /dev/ttyUSB0"
    )
    group.addoption(
        "--servogen-device",
        metavar="CHIP",
        help="the bench's chip (default: what the schedule was built for)",
    )
    group.addoption("--servogen-inputs", metavar="PORT", help="the bench's input board, such as /dev/ttyACM1")
    group.addoption(
        "--servogen-input",
        metavar="NAME=N",
        action="append",
        default=[],
        help="how the input board is wired, such as RB0=2, RB0-RB4=22 for a contact, RA1=TX1 (repeatable)",
    )
    group.addoption(
        "--servogen-serial",
        metavar="PORT",
        help="a USB serial adapter that sends to the chip, such as /dev/ttyUSB1",
    )
    group.addoption("--servogen-serial-pin", metavar="PIN", help="the pin that the serial adapter sends to")
    group.addoption(
        "--servogen-build", metavar="DIR", help="main.hex and schedule.json of tests without a mark"
    )
    group.addoption("--servogen-replay", metavar="DIR", help="take the pulses from recordings in DIR")
    group.addoption(
        "--servogen-wire",
        metavar="CHANNEL=PIN",
        action="append",
        default=[],
        help="the pin of a replayed channel that is not named after one, such as D0=RB0 (repeatable)",
    )
    group.addoption("--servogen-record", metavar="DIR", help="record what each test sees to DIR")


def pytest_configure(config: pytest.Config) -> None:
    for line in MARKERS:
        config.addinivalue_line("markers", line)
    if config.getoption("servogen_target") == "bench" and not config.getoption("servogen_port"):
        raise pytest.UsageError("--servogen-target=bench needs --servogen-port=PORT, the analyser's port")
    if config.getoption("servogen_serial") and not (
        config.getoption("servogen_inputs") and config.getoption("servogen_serial_pin")
    ):
        raise pytest.UsageError(
            "--servogen-serial needs --servogen-serial-pin=PIN and --servogen-inputs=PORT"
        )


def pytest_unconfigure(config: pytest.Config) -> None:
    """Release the chip on the bench."""
    bench = config.stash.get(BENCH, None)
    if bench is not None:
        try:
            bench.close()
        except ServogenError as error:
            print(error)  # the tests are over: whoever unplugged the board knows


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("servogen_target") == "bench" or config.getoption("servogen_replay"):
        return
    skip = pytest.mark.skip(
        reason="needs a chip on the bench: pytest --servogen-target=bench --servogen-port=PORT, "
        "or recordings of one: pytest --servogen-replay=DIR"
    )
    for item in items:
        if item.get_closest_marker(BENCH_MARK):
            item.add_marker(skip)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Write what a failed test saw, and name the file in its report."""
    if call.when == "call" and CHIPS in item.stash and not item.config.getoption("fulltrace"):
        _show_only_the_test(call.excinfo)
    report = yield
    if report.when == "call" and report.failed:
        captures = [(_name(item), capture.seen) for capture in item.stash.get(SEEN, [])]
        try:
            captures += _pins_by_chip(item)
        except ServogenError as error:
            report.sections.append(("servogen capture", f"nothing is written: {error}"))
        for name, seen in captures:
            path = _write(name, seen, item.config.rootpath / CAPTURES)
            report.sections.append(("servogen capture", f"{path}: what was seen on {seen.source}"))
            item.user_properties.append(("servogen_capture", str(path)))
        for chip in item.stash.get(CHIPS, []):
            report.sections.append((f"servogen waves: {chip.name}", _waves(chip)))
    return report


def _show_only_the_test(raised: pytest.ExceptionInfo[BaseException] | None) -> None:
    """Remove servogen's own lines from the traceback of a failure that a chip reports."""
    if raised is None or not isinstance(raised.value, (ServogenError, AssertionError)):
        return
    last = raised.tb  # of pytest
    while (entry := last.tb_next) is not None:
        if PACKAGE in Path(entry.tb_frame.f_code.co_filename).parents:
            last.tb_next = entry.tb_next
        else:
            last = entry


@pytest.fixture
def servogen_program(request: pytest.FixtureRequest) -> Program:
    """Return the program under test, compiled or assembled if it is C or assembly."""
    path = _required_file(request.node, "image")
    _tested(request.node, path)
    return read_once(request.node, path)


@pytest.fixture
def servogen_image(servogen_program: Program) -> Image:
    """Return the words of the program under test."""
    return servogen_program.image


@pytest.fixture
def servogen_schedule(request: pytest.FixtureRequest) -> PulseSchedule:
    """Return the schedule that the program should follow."""
    return _schedule(request.node, _required_file(request.node, "schedule"))


@pytest.fixture
def servogen_target(request: pytest.FixtureRequest) -> Target:
    """Return what the test runs on: the simulated chip, the bench, or a recording."""
    from servogen.testing.targets import Replay, Simulator
    from servogen.traces.channels import parse_wires

    target: Target
    replay = request.config.getoption("servogen_replay")
    if replay:
        wires = parse_wires(request.config.getoption("servogen_wire"))
        target = Replay(request.config.invocation_params.dir / replay, _name(request.node), wires)
    elif request.config.getoption("servogen_target") == "bench":
        target = session_bench(request)
    else:
        target = Simulator()
    request.node.user_properties.append(("servogen_target", target.name))
    return target


def session_bench(request: pytest.FixtureRequest) -> Bench:
    """Return this run's bench, one for all tests, so that no program is programmed twice."""
    from servogen.bench.inputs.wiring import input_wiring
    from servogen.testing.signals import pin_index
    from servogen.testing.targets import Bench, InputPorts

    known = request.config.stash.get(BENCH, None)
    if known is None:
        option = request.config.getoption
        known = Bench(
            option("servogen_port"),
            option("servogen_programmer"),
            option("servogen_programmer_port"),
            option("servogen_device"),
            request.getfixturevalue("tmp_path_factory").mktemp("servogen-bench"),
        )
        if option("servogen_inputs"):
            pin = (option("servogen_serial_pin") or "").upper()
            if pin:
                pin_index(pin)
            wiring = input_wiring(option("servogen_input"))
            known.inputs = InputPorts(option("servogen_inputs"), wiring, option("servogen_serial"), pin)
        request.config.stash[BENCH] = known
    return known


@pytest.fixture
def servogen_capture(request: pytest.FixtureRequest, servogen_target: Target) -> PinCapture:
    """Return what the pins do while the program runs, after it was loaded and the chip reset."""
    from servogen.testing.seen_chip import played_once
    from servogen.testing.targets import Bench, CaptureRequest, PinCapture, Replay

    node = request.node
    named = _file_option(node, "schedule")
    schedule = None if named is None else _schedule(node, named)
    program = None
    if isinstance(servogen_target, Bench) and servogen_target.programmer is None:
        _state(node, "servogen_program", ON_THE_CHIP)
    elif not isinstance(servogen_target, Replay):
        program = request.getfixturevalue("servogen_program")
    clock = schedule.clock if schedule else clock_for(node, program)
    stimuli = _stimuli(node, _mark(node).get("stimulus"), clock)
    built_for = schedule.device if schedule else program.device if program else None
    if isinstance(servogen_target, Bench):
        servogen_target.built_for = built_for
    if program is not None:
        servogen_target.load(program.image)
    wanted = CaptureRequest(clock, schedule, _mark(node).get("seconds"), stimuli, built_for)
    if isinstance(servogen_target, Bench) and stimuli is not None:
        seen = played_once(servogen_target, wanted, program.image if program else None)
    else:
        seen = servogen_target.capture(wanted)
    node.user_properties.append(("servogen_source", seen.source))
    capture = PinCapture(seen, clock, node.user_properties)
    node.stash.setdefault(SEEN, []).append(capture)
    folder = request.config.getoption("servogen_record")
    if folder:
        _write(_name(node), seen, request.config.invocation_params.dir / folder)
    return capture


@pytest.fixture
def servogen_machine(
    request: pytest.FixtureRequest, servogen_target: Target
) -> Generator[Callable[..., Chip]]:
    """Return a function that returns a chip with a program: `servogen_machine("blink.c")`.

    Its other arguments: `clock_hz` and `device`, by default what the program's source says; `inputs`, levels
    that pins are held at from power-up on; `stimulus`, a file or its text; `options`, those of the simulator.
    On the bench and on recordings a test skips where it does what cannot be done there.
    """
    from servogen.programs import clock_of
    from servogen.simulator import SimulatorOptions
    from servogen.testing.chip import Board, Chip
    from servogen.testing.seen_chip import BenchPlayer, ReplayPlayer, SeenChip
    from servogen.testing.targets import Bench, Replay

    node = request.node
    chips: list[Chip | SeenChip] = node.stash.setdefault(CHIPS, [])

    def machine(
        program: str | Path | None = None,
        *,
        clock_hz: int | None = None,
        device: str | None = None,
        inputs: Mapping[str, int] | None = None,
        stimulus: str | Path | None = None,
        options: SimulatorOptions | None = None,
    ) -> Chip:
        path = _required_file(node, "image") if program is None else _beside(node, Path(program))
        made = read_once(node, path, device)
        if isinstance(servogen_target, Bench) and servogen_target.programmer is None:
            _state(node, "servogen_program", ON_THE_CHIP)
        elif not isinstance(servogen_target, Replay):
            _tested(node, path)
        clock = clock_of(made, clock_hz)
        given = stimulus if stimulus is not None else _mark(node).get("stimulus")
        stimuli = _stimuli(node, given, clock)
        chip: Chip | SeenChip
        if isinstance(servogen_target, Replay):
            replay = replace(servogen_target, test=_chip_name(node, len(chips)))
            player = ReplayPlayer(replay.recordings(clock))
            chip = SeenChip(path.name, clock, player, made.image, inputs)
        elif isinstance(servogen_target, Bench):
            servogen_target.built_for = device or made.device
            chip = SeenChip(path.name, clock, BenchPlayer(servogen_target), made.image, inputs, stimuli)
            if servogen_target.programmer is not None:
                servogen_target.load(made.image)
        else:
            around = options or SimulatorOptions()
            board = replace(around, device=device or made.device or around.device)
            chip = Chip(Board(path.name, made.image, clock, made.listing, board, stimuli, inputs or {}))
        chips.append(chip)
        return cast("Chip", chip)  # what a chip that is only seen cannot do skips the test

    yield machine
    folder = request.config.getoption("servogen_record")
    for name, seen in _pins_by_chip(node) if folder else ():
        _write(name, seen, request.config.invocation_params.dir / folder)


@pytest.fixture
def servogen_twin(request: pytest.FixtureRequest) -> Callable[..., TwinVerdict]:
    """Return a function that runs a job's program in its robot: `servogen_twin("my.toml")` is the verdict.

    Its other arguments are those of `servogen.twin.Settings`, and `program`, a HEX, C or assembly file. The
    test is skipped where MuJoCo is not installed.
    """
    pytest.importorskip("mujoco", reason="the twin needs MuJoCo: pip install 'servogen[twin]'")
    from servogen.job import load, plan_job
    from servogen.twin import TwinSettings
    from servogen.workflows.twinning import twin_of

    def run(job: str | Path, program: str | Path | None = None, **settings: Any) -> TwinVerdict:
        file = None if program is None else _beside(request.node, Path(program))
        verdict = twin_of(plan_job(load(_beside(request.node, Path(job)))), TwinSettings(**settings), file)
        request.node.user_properties.append(("servogen_twin", verdict.word))
        request.node.user_properties.extend(("servogen_twin_reason", text) for text in verdict.reasons())
        return verdict

    return run


def _beside(node: pytest.Item, wanted: Path) -> Path:
    """Return a file that a test names, relative to its folder or to pytest's root."""
    places = [node.path.parent / wanted, node.config.rootpath / wanted]
    return next((place for place in places if place.exists()), places[-1])


def _mark(node: pytest.Item) -> Mapping[str, Any]:
    """Return the arguments of the test's mark by name. Raises InputError for an unknown one."""
    mark = node.get_closest_marker(MARK)
    unknown = next((key for key in (mark.kwargs if mark else ()) if key not in MARK_KEYS), None)
    if unknown is not None:
        raise InputError(
            "unknown-key",
            f"@pytest.mark.{MARK} has no '{unknown}'",
            Location(node.nodeid),
            did_you_mean(unknown, MARK_KEYS),
        )
    return mark.kwargs if mark else {}


def _file_option(node: pytest.Item, key: str) -> Path | None:
    """Return the file that the test's mark or the command line names; None where they do not."""
    from servogen.programs import BUILT_SCHEDULE

    named = _mark(node).get(key)
    if named is not None:
        return _beside(node, Path(named))
    mark = node.get_closest_marker(MARK)
    place = mark.args[0] if mark and mark.args else node.config.getoption("servogen_build")
    if place is None:
        return None
    path = _beside(node, Path(place))
    schedule = path / BUILT_SCHEDULE
    return path if key == "image" else schedule if schedule.exists() else None


def _required_file(node: pytest.Item, key: str) -> Path:
    """Return the file that the test's mark or the command line names. Raises InputError."""
    path = _file_option(node, key)
    if path is None:
        raise InputError(
            "missing-option",
            f"the test does not state its {'program' if key == 'image' else key}",
            Location(node.nodeid),
            f'mark it @pytest.mark.{MARK}("DIR"), with a folder that `servogen build` wrote or a program, '
            "or give --servogen-build=DIR",
        )
    return path


def read_once(node: pytest.Item, path: Path, device: str | None = None) -> Program:
    """Return the program in a file, which is compiled once for all tests of this run."""
    from servogen.programs import read_program

    known = node.config.stash.setdefault(PROGRAMS, {})
    if (path, device) not in known:
        known[path, device] = read_program(path, device)
    for remark in known[path, device].remarks:
        node.warn(pytest.PytestWarning(str(remark)))
    return known[path, device]


def clock_for(node: pytest.Item, program: Program | None) -> Clock:
    """Return the clock of a program without a schedule, which is read for it if it is named."""
    from servogen.programs import clock_of

    path = _file_option(node, "image") if program is None else None
    return clock_of(program if path is None else read_once(node, path))


def _schedule(node: pytest.Item, path: Path) -> PulseSchedule:
    from servogen.programs import read_schedule

    _property(node, "servogen_schedule", path)
    return read_schedule(path)


def _stimuli(node: pytest.Item, given: str | Path | None, clock: Clock) -> Stimuli | None:
    """Return the stimuli in a file, or in the text of one. Raises InputError."""
    from servogen.simulator import load_stimuli, parse_stimuli

    if given is None:
        return None
    if isinstance(given, str) and "[[" in given:
        return parse_stimuli(given, node.nodeid, clock)
    return load_stimuli(_beside(node, Path(given)), clock)


def _waves(chip: Chip | SeenChip) -> str:
    """Return what a chip did last, or why that cannot be shown."""
    try:
        return "\n".join(chip.report())
    except ServogenError as error:
        return str(error)


def _pins_by_chip(node: pytest.Item) -> list[tuple[str, SeenPins]]:
    """Return what was seen of each of the test's chips, with the names of its recordings."""
    from servogen.testing.targets import further

    chips: list[Chip | SeenChip] = node.stash.get(CHIPS, [])
    return [
        (further(_chip_name(node, number), piece), seen)
        for number, chip in enumerate(chips)
        for piece, seen in enumerate(chip.seen)
    ]


def _property(node: pytest.Item, name: str, path: Path) -> None:
    inside = path.is_relative_to(node.config.rootpath)
    shown = path.relative_to(node.config.rootpath) if inside else path
    _state(node, name, shown.as_posix())


def _state(node: pytest.Item, name: str, value: str) -> None:
    """State a property of the test in its report, once."""
    if (name, value) not in node.user_properties:
        node.user_properties.append((name, value))


def _tested(node: pytest.Item, path: Path) -> None:
    """State in the test's report which program it tests."""
    from servogen.programs import program_file

    _property(node, "servogen_program", program_file(path))


def _name(node: pytest.Item) -> str:
    """Return the test's name as a file name, by which recordings are found."""
    return re.sub(r"[^\w.=+-]+", "-", f"{node.path.stem}-{node.name}").strip("-")


def _chip_name(node: pytest.Item, number: int) -> str:
    """Return the name of the recordings of the test's first, second, ... chip."""
    return f"{_name(node)}-chip{number + 1}" if number else _name(node)


def _write(name: str, seen: SeenPins, folder: Path) -> Path:
    from servogen.testing.targets import record

    folder.mkdir(parents=True, exist_ok=True)
    return record(seen, folder / f"{name}.vcd")
