"""The HTML report: whole, self-contained, the same each time, and its numbers those of the build."""

import json
import math
import re
from html.parser import HTMLParser
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.edges import edge_chunk
from servogen.job import load, plan_job
from servogen.pic.listing import ListedFunction, Listing
from servogen.pulse import plan
from servogen.report.drawing import Axis, dots_path, nice, points_path, steps_path
from servogen.report.html import costs, program_values
from servogen.report.signals import frames_to_show, pose_frames
from servogen.report.signals import planned as planned_rows
from servogen.report.text import Overrun, ProgramFacts
from servogen.report.wiring import package, remarks, wires
from servogen.traces.captures import capture_writer
from servogen.units import Clock, Cycles
from servogen.workflows.engines import planned
from servogen.workflows.reporting import ReportPage, build_page
from tests.campaigns import sampled

ROOT = Path(__file__).parents[2]

JOB = """
[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"
[motion]
poses = [{ arm_deg = 0, hold_s = 0.1 }, { arm_deg = 90, hold_s = 0.1 }]
"""

VOID = {"meta", "link", "br", "img", "input", "hr"}
DRAWN_SHORT = {"path", "line", "rect"}


class Tags(HTMLParser):
    """Checks that every tag is closed, and notes addresses that would be fetched."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []
        self.wrong: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.fetched += [value or "" for name, value in attrs if name in ("src", "href", "xlink:href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in DRAWN_SHORT:
            self.wrong.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> ReportPage:
    return build_page(plan_job(load(job_file(tmp_path_factory.mktemp("job")))))


def job_file(folder: Path, text: str = JOB, name: str = "two-poses") -> Path:
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


def data_of(html: str) -> dict[str, object]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html)
    assert found
    data: dict[str, object] = json.loads(found[1])
    return data


def test_a_page_is_whole_and_fetches_nothing(page: ReportPage) -> None:
    tags = Tags()
    tags.feed(page.html)
    assert not tags.open and not tags.wrong
    assert all(address.startswith("#") for address in tags.fetched)
    assert "http" not in page.html
    assert "url(" not in page.html


def test_the_same_job_gives_the_same_page(page: ReportPage, tmp_path: Path) -> None:
    assert build_page(plan_job(load(job_file(tmp_path)))).html == page.html
    assert str(tmp_path) not in page.html


def test_the_page_says_what_is_exact(page: ReportPage) -> None:
    assert page.programs_exact
    assert "every edge exact" in page.html
    assert (
        "Compared 30 frames, 0.6 s, 600000 cycles, on all 13 pins" in page.html
    )  # three loops of ten frames
    assert "<td>30 of 30</td>" in page.html


def test_the_drawn_pulses_are_the_planned_ones_and_the_programs(page: ReportPage) -> None:
    """Five frames of 1 ms for 0° and five of 1.5 ms for 90°, 20 ms apart."""
    planned, simulated = data_of(page.html)["rows"]  # type: ignore[misc]
    assert planned["width"] == [1000] * 5 + [1500] * 5
    assert np.diff(planned["rise"]).tolist() == [20_000] * 9
    assert (planned.pop("kind"), simulated.pop("kind")) == ("planned", "simulated")
    assert simulated == planned


def test_the_page_opens_on_a_few_frames_in_which_pulses_can_be_seen(page: ReportPage) -> None:
    data = data_of(page.html)
    begin, end = data["first"]  # type: ignore[misc]
    assert end - begin == 80_000
    assert sum(begin <= rise < end for rise in data["rows"][0]["rise"]) == 4  # type: ignore[index]


def test_dark_narrow_and_printed_pages_have_a_style_of_their_own(page: ReportPage) -> None:
    for medium in ("screen and (prefers-color-scheme: dark)", "(max-width: 640px)", "print"):
        assert f"@media {medium}" in page.html


def test_each_function_has_its_cost(page: ReportPage) -> None:
    table = page.html.split('id="costs"')[1].split("</table>")[0]
    assert "cycles of a call" in table
    assert "<td>main</td>" in table
    listing = page.html.split("<pre>")[1].split("function ")[1]
    listed = re.findall(r"^(\w+) +[0-9A-F]{4} +(\d+) ", listing, re.M)
    assert len(listed) > 2
    for name, words in listed:
        assert re.search(rf"<td>{name}</td><td>[0-9A-F]{{4}}</td><td>{words}</td>", table), name


def test_buttons_and_the_serial_line_are_wired(tmp_path: Path) -> None:
    job = tmp_path / "job.toml"
    job.write_text(JOB + '[stream]\nreceive_pin = "RB6"\ntransmit_pin = "RA2"\n')
    assert [(wire.number, wire.pin, wire.use) for wire in wires(plan_job(load(job)))][1:3] == [
        (12, "RB6", "serial line in, 2400 baud, 5 V, idle high"),
        (1, "RA2", "serial line out, 5 V, idle high"),
    ]
    job.write_text(JOB + '[firmware]\nengine = "player"\nstart_pin = "RB1"\n')
    assert any(
        wire.pin == "RB1" and wire.use.startswith("start button") for wire in wires(plan_job(load(job)))
    )
    assert any(line.startswith("RB1: start, pressed for 3 frames") for line in remarks(plan_job(load(job))))


def test_the_package_is_drawn_as_the_data_sheet_shows_it() -> None:
    """DS35007, DIP-18 from above: pin 18 is opposite to pin 1."""
    job = load(Path(__file__).parents[2] / "jobs" / "lab9-exercise.toml")
    pins = package(job.servos)
    sides = ([pin for pin in pins if pin.left == side] for side in (True, False))
    left, right = (sorted(side, key=attrgetter("y")) for side in sides)
    assert [pin.name for pin in left] == ["RA2", "RA3", "RA4", "MCLR", "VSS", "RB0", "RB1", "RB2", "RB3"]
    names = ["RA1", "RA0", "OSC1", "OSC2", "VDD", "RB7", "RB6", "RB5", "RB4"]
    assert [pin.name for pin in right] == names
    assert [pin.number for pin in left] == list(range(1, 10))
    assert [pin.number for pin in right] == list(range(18, 9, -1))
    assert [pin.y for pin in left] == [pin.y for pin in right]
    assert {pin.servo for pin in pins} == {"", *(servo.name for servo in job.servos)}
    assert all(pin.name == servo.pin for pin in pins for servo in job.servos if pin.servo == servo.name)


def test_what_the_wiring_needs_beside_wires_is_said(tmp_path: Path) -> None:
    job = tmp_path / "job.toml"
    job.write_text(JOB.replace('pin = "RB0"', 'pin = "RA4"\nopen_drain = true'))
    page = build_page(plan_job(load(job))).html
    assert "RA4 is open drain: it needs a pull-up resistor, 1 to 10 kΩ to VDD." in page
    assert "Peak current of the servos: 720 mA (1 at once)." in page
    assert "not stated" not in page


@pytest.mark.parametrize(
    ("least", "most", "unbounded", "words"),
    [
        (4, 4, (), "4"),
        (4, 9, (), "4 to 9"),
        (4, None, (), "4 or more"),
        (4, None, ("while at line 12",), "4 or more: while at line 12"),
        (4, None, tuple("abcd"), "4 or more: a, b and 2 more"),
        (None, None, (), "–"),
    ],
)
def test_cycles_are_told_as_far_as_they_are_known(
    least: int | None, most: int | None, unbounded: tuple[str, ...], words: str
) -> None:
    listed = ListedFunction("main", 0, 7, minimum_cycles=least, maximum_cycles=most, unbounded=unbounded)
    assert next(iter(costs(Listing((), (listed,)))))[-1] == words


def test_a_tables_place_in_the_c_is_told_and_not_its_label() -> None:
    listed = ListedFunction("__table.KEYFRAME@main.c2c.c:42:21", 0, 7)
    assert next(iter(costs(Listing((), (listed,)))))[0] == "table KEYFRAME, main.c2c.c:42"


@pytest.mark.parametrize("fail_safe", sampled(["hold", "off"]))
def test_a_stream_job_has_a_page_of_its_neutral_pose(tmp_path: Path, fail_safe: str) -> None:
    job = tmp_path / "job.toml"
    job.write_text(JOB.split("[motion]")[0] + f'[stream]\nfail_safe = "{fail_safe}"\n')
    made = build_page(plan_job(load(job)))
    assert made.programs_exact
    assert "serial line in, 2400 baud" in made.html
    rows = data_of(made.html)["rows"]
    assert set(rows[0]["width"]) == {1500}  # type: ignore[index]


def test_names_cannot_break_the_page(tmp_path: Path) -> None:
    html = build_page(plan_job(load(job_file(tmp_path, name="a<script>b")))).html
    assert "a<script>b" not in html
    assert "a&lt;script&gt;b" in html


@pytest.mark.parametrize(("width", "exact"), [(1500, True), (1502, False)])
def test_a_capture_stands_beside_the_plan_where_it_belongs(tmp_path: Path, width: int, exact: bool) -> None:
    """A capture of 1 sample a µs that begins in the middle of frame 3: 1000, 1000, then 1500 five times."""
    rises = np.arange(7) * 20_000 + 15_000
    falls = rises + np.array([1000, 1000, 1500, 1500, width, 1500, 1500])
    cycle = np.concatenate(([0], np.column_stack((rises, falls)).ravel()))
    chunk = edge_chunk(cycle, np.full(len(cycle), 5), np.array([0] + [1, 0] * 7))
    path = tmp_path / "run.vcd"
    with capture_writer(path, 1_000_000) as writer:
        writer.add(chunk)
        writer.finish(Cycles(150_000))
    page = build_page(plan_job(load(job_file(tmp_path))), path)
    assert page.capture is not None and page.capture.passed is exact
    assert ("agrees" in page.html) is exact
    assert (">every edge exact<" in page.html) is exact, "the head does not say more than the capture shows"
    planned, _, captured = data_of(page.html)["rows"]  # type: ignore[misc]
    assert captured["rise"] == pytest.approx(planned["rise"][3:], abs=1)
    assert captured["width"] == pytest.approx([1000, 1000, 1500, 1500, width, 1500, 1500], abs=0.2)


def test_a_line_of_steps_has_a_gap_where_there_is_no_value() -> None:
    times, values = np.array([0.0, 1, 2, 3, 4]), np.array([5.0, 5, np.nan, 7])
    assert steps_path(times, values) == "M0 5H2M3 7H4"


def test_a_step_goes_up_where_the_value_changes() -> None:
    assert steps_path(np.array([0.0, 1, 2]), np.array([5.0, 6])) == "M0 5H1V6H2"


def test_points_and_dots_leave_out_what_is_not_there() -> None:
    x, y = np.array([0.0, 1, np.nan, 3, 3]), np.array([0.0, 1, 2, 3, 3])
    assert points_path(x, y) == "M0 0L1 1M3 3L3 3"
    assert dots_path(x, y) == "M0 0h0M1 1h0M3 3h0"


@pytest.mark.parametrize(("step", "round_step"), [(0.9, 1), (1, 1), (1.1, 2), (3, 5), (6, 10), (0.03, 0.05)])
def test_ticks_stand_at_round_numbers(step: float, round_step: float) -> None:
    assert nice(step) == pytest.approx(round_step)


def test_ticks_lie_within_the_axis() -> None:
    ticks = Axis(-3.0, 17.0, 100.0, 300.0).ticks(5)
    assert [tick.label for tick in ticks] == ["0", "5", "10", "15"]
    assert [tick.at for tick in ticks] == ["130", "180", "230", "280"]


def test_the_frames_hold_every_pose(tmp_path: Path) -> None:
    """Nine poses, in no order, with ramps between them: 1000 + 1000 α / 180 µs each."""
    angles = [90, 10, 170, 40, 140, 20, 160, 60, 120]
    poses = ", ".join(f"{{ arm_deg = {angle}, move_s = 1, hold_s = 0.2 }}" for angle in angles)
    text = re.sub(r"poses = .*", f"poses = [{poses}]", JOB)
    assert str(angles[-1]) in text
    job = plan_job(load(job_file(tmp_path, text + '\n[firmware]\nengine = "sequence"\n', "nine-poses")))
    schedule = plan(job.trajectory, job.servos, job.frame).schedule
    (row,) = planned_rows(schedule)

    def widths(poses: tuple[int, ...] = ()) -> set[int]:
        views = frames_to_show(schedule, poses)
        pulses = zip(row.rise, row.width, strict=True)
        return {
            round(width) for rise, width in pulses for view in views if view.start_us < rise < view.end_us
        }

    wanted = {round(job.servos[0].width_us(math.radians(angle))) for angle in angles}
    assert len(wanted) == 9
    assert wanted <= widths(pose_frames(job))
    assert not wanted <= widths()


def test_a_walk_has_no_poses_and_shows_six_frames() -> None:
    job = plan_job(load(Path(__file__).parents[2] / "jobs" / "hexapod-tripod.toml"))
    assert pose_frames(job) == ()
    assert len(frames_to_show(planned(job).plan.schedule)) == 6


@pytest.mark.parametrize(
    ("exact", "overrun", "said"),
    [
        (False, Overrun(Cycles(20_000)), ["wrong", "overrun: by cycle 20000 after reset (20000 µs)"]),
        (False, None, ["wrong"]),  # the engine keeps no such bit
        (True, Overrun(None), []),
    ],
)
def test_a_program_that_is_not_proven_says_why_and_when_it_was_late(
    exact: bool, overrun: Overrun | None, said: list[str]
) -> None:
    verdict: Any = SimpleNamespace(
        passed=exact,
        clock=Clock(4_000_000),
        span=SimpleNamespace(frames=2, compared=Cycles(40_000)),
        plan_error=None,
        start=Cycles(12_000) if exact else None,
        reasons=() if exact else ("wrong",),
        channels=(),
    )
    facts = ProgramFacts("c2c", "main.c", "main.hex", 100, 20, verdict, (), overrun)
    assert program_values(facts)["start"] == ("12000 µs after reset" if exact else None)
    assert list(program_values(facts)["reasons"]) == said  # type: ignore[call-overload]


def test_the_page_says_what_is_proven_beside_one_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of exactly this program and schedule: the certificate of another one counts for nothing."""
    from servogen.watch.subject import Setting, load_subject, proven_sentence

    job = ROOT / "jobs" / "lab8-exercise.toml"
    kept = tmp_path / "build" / "lab8-exercise" / "main.cert.xz"
    kept.parent.mkdir(parents=True)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    unknown, proven = "all runs: not proven yet: servogen prove", "all runs: proven, checked"
    for certificate, said in ((None, unknown), ("lab9-exercise", unknown), ("lab8-exercise", proven)):
        if certificate is not None:
            kept.write_bytes((ROOT / "certificates" / certificate / "main.cert.xz").read_bytes())
        assert f"<p>one run: exact; {said}</p>" in build_page(plan_job(load(job))).html
        assert proven_sentence(load_subject(job, Setting())) == said
