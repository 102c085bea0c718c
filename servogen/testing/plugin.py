"""The pytest plugin: the same tests of firmware in simulation, on the bench and on recordings.

    from servogen.testing.plugin import assert_pulses

    @pytest.mark.servogen("build/lab8-exercise")      # a job's folder: main.hex and schedule.json
    def test_the_arm_moves(servogen_capture, servogen_schedule):
        assert_pulses(servogen_capture, servogen_schedule)

Heavy imports stand inside: every pytest run of the environment loads this file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from servogen.errors import InputError, Location

if TYPE_CHECKING:
    from servogen.pic.image import Image
    from servogen.pulse import PulseSchedule
    from servogen.testing.targets import Bench, Seen, Target
    from servogen.twin import Verdict
    from servogen.verify import Tolerances

MARK, BENCH_MARK = "servogen", "servogen_bench"
MARKERS = (
    f"{MARK}(folder, image=None, schedule=None, seconds=None): the program that the test's fixtures run, "
    "its schedule, and how long it is looked at",
    f"{BENCH_MARK}: the test needs a chip on the bench",
)
CAPTURES = "servogen-captures"
"""The folder, below pytest's root, where what a failed test saw is written."""


@dataclass(frozen=True)
class Capture:
    """What the pins did in one test."""

    seen: Seen = field(repr=False)
    properties: list[tuple[str, object]] = field(repr=False)
    """The test's own, which JUnit reports show."""

    @property
    def source(self) -> str:
        """Return where it was seen, in words."""
        return self.seen.source


BENCH: pytest.StashKey[Bench] = pytest.StashKey()
SEEN: pytest.StashKey[list[Capture]] = pytest.StashKey()


def assert_pulses(
    capture: Capture,
    schedule: PulseSchedule,
    tolerances: Tolerances | None = None,
    *,
    partial: bool = False,
) -> None:
    """Assert that the pins did what the schedule says.

    In simulation that is to the cycle, on the bench within `tolerances`. Where not every different
    frame of the schedule was seen, that fails as well, unless the test allows a `partial` look.
    """
    __tracebackhide__ = True
    from servogen.testing.targets import check

    found = check(capture.seen, schedule, tolerances)
    capture.properties.extend(found.properties)
    if found.proven or (partial and found.agrees):
        return
    what = "do not show the whole schedule" if found.agrees else "are not the schedule's"
    text = "\n".join(found.lines)
    raise AssertionError(f"the pulses seen on {capture.source} {what}\n{text}")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("servogen", "servo firmware (servogen)")
    group.addoption(
        "--servogen-target",
        choices=("sim", "bench"),
        default="sim",
        help="what the tests of firmware run on (default: sim, the simulated chip)",
    )
    group.addoption("--servogen-port", metavar="PORT", help="the bench's analyser, as /dev/ttyACM0")
    group.addoption(
        "--servogen-programmer",
        metavar="NAME",
        help="program the bench's chip with the program under test first: picpro, pk2cmd, ... "
        "(default: the chip holds what it holds)",
    )
    group.addoption(
        "--servogen-programmer-port", metavar="PORT", help="the bench's programmer, as /dev/ttyUSB0"
    )
    group.addoption(
        "--servogen-device",
        metavar="CHIP",
        help="the bench's chip (default: what the schedule was built for)",
    )
    group.addoption(
        "--servogen-build", metavar="DIR", help="main.hex and schedule.json of tests without a mark"
    )
    group.addoption("--servogen-replay", metavar="DIR", help="take the pulses from recordings in DIR")
    group.addoption("--servogen-record", metavar="DIR", help="record what each test sees to DIR")


def pytest_configure(config: pytest.Config) -> None:
    for line in MARKERS:
        config.addinivalue_line("markers", line)
    if config.getoption("servogen_target") == "bench" and not config.getoption("servogen_port"):
        raise pytest.UsageError("--servogen-target=bench needs --servogen-port=PORT, the analyser's port")


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
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Write what a failed test saw, and name the file in its report."""
    report = yield
    if report.when == "call" and report.failed:
        for capture in item.stash.get(SEEN, []):
            path = _write(item, capture, item.config.rootpath / CAPTURES)
            report.sections.append(("servogen capture", f"{path}: what was seen on {capture.source}"))
            capture.properties.append(("servogen_capture", str(path)))
    return report


@pytest.fixture
def servogen_image(request: pytest.FixtureRequest) -> Image:
    """Return the program under test, compiled or assembled if it is C or assembly."""
    from servogen.programs import read_program

    path = _file(request.node, "image", "main.hex")
    _property(request.node, "servogen_program", path)
    program = read_program(path)
    for remark in program.remarks:
        request.node.warn(pytest.PytestWarning(str(remark)))
    return program.image


@pytest.fixture
def servogen_schedule(request: pytest.FixtureRequest) -> PulseSchedule:
    """Return the schedule that the program should follow."""
    from servogen.programs import read_schedule

    path = _file(request.node, "schedule", "schedule.json")
    _property(request.node, "servogen_schedule", path)
    return read_schedule(path)


@pytest.fixture
def servogen_target(request: pytest.FixtureRequest) -> Target:
    """Return what the test runs on: the simulated chip, the bench, or a recording."""
    from servogen.testing.targets import Replay, Simulator

    target: Target
    replay = request.config.getoption("servogen_replay")
    if replay:
        target = Replay(request.config.invocation_params.dir / replay, _name(request.node))
    elif request.config.getoption("servogen_target") == "bench":
        target = _bench(request)
    else:
        target = Simulator()
    request.node.user_properties.append(("servogen_target", target.name))
    return target


def _bench(request: pytest.FixtureRequest) -> Bench:
    """Return this run's bench, one for all tests, so that no program is programmed twice."""
    from servogen.testing.targets import Bench

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
        request.config.stash[BENCH] = known
    return known


@pytest.fixture
def servogen_capture(
    request: pytest.FixtureRequest, servogen_target: Target, servogen_schedule: PulseSchedule
) -> Capture:
    """Return what the pins do while the program runs, after it was loaded and the chip reset."""
    from servogen.testing.targets import Bench, Replay

    there = isinstance(servogen_target, Bench) and servogen_target.programmer is None
    if there:
        request.node.user_properties.append(("servogen_program", "what was on the chip"))
    elif not isinstance(servogen_target, Replay):
        if isinstance(servogen_target, Bench):
            servogen_target.built_for = servogen_schedule.device
        servogen_target.load(request.getfixturevalue("servogen_image"))
    mark = request.node.get_closest_marker(MARK)
    seen = servogen_target.capture(servogen_schedule, mark.kwargs.get("seconds") if mark else None)
    request.node.user_properties.append(("servogen_source", seen.source))
    capture = Capture(seen, request.node.user_properties)
    request.node.stash.setdefault(SEEN, []).append(capture)
    folder = request.config.getoption("servogen_record")
    if folder:
        _write(request.node, capture, request.config.invocation_params.dir / folder)
    return capture


@pytest.fixture
def servogen_twin(request: pytest.FixtureRequest) -> Callable[..., Verdict]:
    """A function that runs a job's program in its robot: `servogen_twin("my.toml")` returns the verdict.

    Its other arguments are those of `servogen.twin.Settings`, and `program`, a HEX, C or assembly file. The
    test is skipped where MuJoCo is not installed.
    """
    pytest.importorskip("mujoco", reason="the twin needs MuJoCo: pip install 'servogen[twin]'")
    from servogen.build.twinning import twin_of
    from servogen.job import load, plan_job
    from servogen.twin import Settings

    def run(job: str | Path, program: str | Path | None = None, **settings: Any) -> Verdict:
        file = None if program is None else _beside(request.node, Path(program))
        verdict = twin_of(plan_job(load(_beside(request.node, Path(job)))), Settings(**settings), file)
        request.node.user_properties.append(("servogen_twin", verdict.word))
        request.node.user_properties.extend(("servogen_twin_reason", text) for text in verdict.reasons())
        return verdict

    return run


def _beside(node: pytest.Item, wanted: Path) -> Path:
    """Return a file that a test names, relative to its folder or to pytest's root."""
    places = [node.path.parent / wanted, node.config.rootpath / wanted]
    return next((place for place in places if place.exists()), places[-1])


def _file(node: pytest.Item, key: str, usual: str) -> Path:
    """Return the file that the test's mark or the command line names. Raises InputError."""
    mark = node.get_closest_marker(MARK)
    named = mark.kwargs.get(key) if mark else None
    folder = mark.args[0] if mark and mark.args else node.config.getoption("servogen_build")
    if named is None and folder is None:
        raise InputError(
            "missing-option",
            f"the test does not say its {key}",
            Location(node.nodeid),
            f'mark it @pytest.mark.{MARK}("DIR") with a folder that `servogen build` wrote, '
            "or give --servogen-build=DIR",
        )
    return _beside(node, Path(named) if named is not None else Path(folder) / usual)


def _property(node: pytest.Item, name: str, path: Path) -> None:
    inside = path.is_relative_to(node.config.rootpath)
    shown = path.relative_to(node.config.rootpath) if inside else path
    node.user_properties.append((name, shown.as_posix()))


def _name(node: pytest.Item) -> str:
    """Return the test's name as a file name, by which recordings are found."""
    return re.sub(r"[^\w.=+-]+", "-", f"{node.path.stem}-{node.name}").strip("-")


def _write(node: pytest.Item, capture: Capture, folder: Path) -> Path:
    from servogen.testing.targets import record

    folder.mkdir(parents=True, exist_ok=True)
    return record(capture.seen, folder / f"{_name(node)}.vcd")
