"""The ways of a beginner through the page, in a real browser; skipped where there is none."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("websockets", reason="the extra 'watch' is not installed")

from servogen.programs import JOB_SUFFIX, read_schedule
from servogen.watch.differences import ScheduledEdges
from servogen.watch.editing import Editor
from servogen.watch.subject import Setting, load_subject
from tests.watch.browser import Browser, Page
from tests.watch.serving import Running
from tests.watch.test_session import captured, walk_capture  # noqa: F401 - a fixture

ROOT = Path(__file__).parent.parent.parent
LAB8 = ROOT / "jobs" / "lab8-exercise.toml"
Open = Callable[..., Page]


@pytest.fixture
def watch(browser: Browser) -> Iterator[Open]:
    """Opens a file as `servogen watch` does; at the end nothing may have gone wrong in the page."""
    running: list[Running] = []
    pages: list[Page] = []

    def opened(path: Path, against: Path | None = None, **size: int) -> Page:
        setting = Setting()
        if against is not None and against.suffix == JOB_SUFFIX:
            setting = Setting(job=against)
        elif against is not None:
            setting = Setting(schedule=read_schedule(against))
        editor = Editor(path, setting) if path.suffix == JOB_SUFFIX else None
        running.append(Running(lambda progress: load_subject(path, setting, progress), editor))
        pages.append(browser.page(**size))
        pages[-1].open(running[-1].server.url)
        pages[-1].until("!document.getElementById('views').hidden && watched.latest && watched.waves.data")
        return pages[-1]

    yield opened
    try:
        for page, served in zip(pages, running, strict=True):
            page.run("0")
            assert page.problems == []
            hosts = {address.split("/")[2] for address in page.requests if not address.startswith("data:")}
            assert hosts <= {served.host, ""}
            page.close()
    finally:
        for served in running:
            served.stop()


def go(page: Page, cycle: int) -> None:
    move = f"m => {{ m.max = 1e9; m.value = {cycle}; m.dispatchEvent(new Event('input')); }}"
    page.run(f"({move})(document.getElementById('moment'))")
    page.until(f"Math.abs(watched.latest.cycle - {cycle}) < 3")
    painted(page)


def painted(page: Page) -> None:
    """Wait until the page has painted what it received last: it does so before the next picture but one."""
    second = "requestAnimationFrame(() => requestAnimationFrame(() => window.painted = true))"
    page.run(f"(() => {{ window.painted = false; {second}; }})()")
    page.until("window.painted")


def slide(page: Page, value: str) -> None:
    """Move the first servo's slider."""
    move = f"e => {{ e.value = {value}; e.dispatchEvent(new Event('input')); }}"
    page.run(f"({move})(document.querySelector('#sliders input'))")


def slider(page: Page) -> float:
    """Where the first servo's slider is, in degrees."""
    return float(page.run("document.querySelector('#sliders input').value"))


def angles(page: Page) -> list[float]:
    """The angles in degrees that the sliders say, which follow the pulses: of whole cycles, 0.18° each."""
    return list(
        page.run("[...document.querySelectorAll('#sliders output')].map(e => parseFloat(e.textContent))")
    )


def typed(page: Page, old: str, new: str) -> None:
    """Select a text in the editor and type another over it."""
    page.run(
        f"(e => {{ const at = e.value.indexOf({json.dumps(old)}); e.focus();"
        f" e.setSelectionRange(at, at + {len(old)}); }})(document.getElementById('job-text'))"
    )
    page.call("Input.insertText", text=new)


def text(page: Page, selector: str) -> str:
    return str(page.run(f"document.querySelector({json.dumps(selector)}).textContent"))


def copy(path: Path, folder: Path) -> Path:
    made = folder / path.name
    made.write_text(path.read_text())
    return made


def test_lab_8_goes_to_30_90_and_120_and_a_change_to_150_is_built_and_proven(
    watch: Open, tmp_path: Path
) -> None:
    job = copy(LAB8, tmp_path)
    page = watch(job)
    for second, angle in ((1, 30), (4, 90), (8, 120)):
        go(page, second * 1_000_000)
        assert angles(page) == [pytest.approx(angle, abs=0.19)]
    typed(page, "arm_deg = 120", "arm_deg = 999")
    assert "999" in page.until("document.querySelector('#job-problems .error')?.textContent")
    assert page.run("document.getElementById('build').disabled")
    assert text(page, "#job-lines .error").strip() == "19"
    typed(page, "arm_deg = 999", "arm_deg = 150")
    page.until("!document.getElementById('build').disabled")
    page.click("#build")
    page.until("document.getElementById('build-progress').dataset.exact === 'true'")
    assert "exact over" in text(page, "#build-progress")
    page.until("Math.abs(parseFloat(document.querySelector('#sliders output').textContent) - 150) < 0.19")
    written = job.read_text()
    assert "arm_deg = 150, hold_s = 3 }, # 150 frames" in written
    assert written == LAB8.read_text().replace("arm_deg = 120", "arm_deg = 150")


NO_TRIS = """\
#pragma CLOCK_FREQ 4000000
void main(void)
{
    while (1) {
        set_bit(portb, 0);
        delay_us(100);
    }
}
"""


def test_one_click_says_why_rb0_is_low_in_a_program_that_forgot_tris(watch: Open, tmp_path: Path) -> None:
    program = tmp_path / "blink.c"
    program.write_text(NO_TRIS)
    page = watch(program)
    go(page, 5000)
    page.click("[title^='RB0']")
    said = page.until("document.querySelector('#explanation div').textContent")
    assert "RB0 is an input" in said and "has written 1 to RB0" in said and "never writes TRISB" in said


def test_from_a_wrong_edge_a_step_back_leads_to_its_line(watch: Open, tmp_path: Path) -> None:
    folder = ROOT / "firmware" / "lab8-exercise"
    good = (folder / "main.c2c.c").read_text()
    wrong = good.replace("delay_us(", "delay_us(1 + ", 1)
    assert wrong != good
    program = tmp_path / "wrong.c"
    program.write_text(wrong)
    page = watch(program, folder / "schedule.json")
    assert "first difference at" in text(page, "#difference-text")
    style = "getComputedStyle(document.getElementById('verdict'))"
    assert text(page, "#verdict") == "NOT exact"
    assert page.run(f"{style}.color !== {style}.backgroundColor"), "the badge can be read"
    page.click("#difference")
    difference = page.until("watched.latest.cycle > 100 && watched.latest.cycle")
    page.until("document.querySelectorAll('#marks i').length >= 1")
    assert "arm low" in page.until("document.querySelector('.line.here')?.textContent")  # it comes too late
    page.click("#back-instruction")
    page.until(f"watched.latest.cycle < {difference}")
    assert "delay_us(1 + " in page.until("document.querySelector('.line.here')?.textContent")


def test_the_first_difference_of_a_capture_is_shown_in_red(watch: Open, tmp_path: Path) -> None:
    against = ROOT / "firmware" / "lab8-exercise" / "schedule.json"
    edges = ScheduledEdges(read_schedule(against), 0).edges(0, 15_000_000)
    edges[-101] = (edges[-101][0] + 9, *edges[-101][1:])
    page = watch(captured(tmp_path / "late.vcd", 90.0, edges), against)
    assert text(page, "#difference-text").startswith("does not agree: first at")
    page.click("#difference")
    page.until("watched.waves.data.differing.length === 2")
    columns = page.run("watched.waves.data.differing.map(e => Math.round(watched.waves.x(e.cycle)))")
    row = page.run(
        "(canvas => [...canvas.getContext('2d').getImageData(0, watched.waves.top(0) + 12, canvas.width, 1)"
        ".data])(document.getElementById('waves'))"
    )
    for column in columns:
        red, green, blue, _ = row[4 * column : 4 * column + 4]
        assert red > 150 and green < 80 and blue < 80


def stance_pixels(page: Page) -> int:
    """How many pixels of the robot's canvas have the colour of the support polygon."""
    return int(
        page.run(
            "(canvas => { const brush = canvas.getContext('2d');"
            " const at = brush.getImageData(0, 0, canvas.width, canvas.height).data;"
            " let count = 0; for (let n = 0; n < at.length; n += 4) count += at[n + 3] > 10 &&"
            " Math.abs(at[n] - 91) < 12 && Math.abs(at[n + 1] - 112) < 12 && Math.abs(at[n + 2] - 131) < 12;"
            " return count; })(document.getElementById('robot'))"
        )
    )


@pytest.mark.campaign
def test_captured_pulses_move_the_robot_beside_the_plan(watch: Open, walk_capture: Path) -> None:  # noqa: F811
    """The capture lifts L1 by 100 µs more than the plan: 100 µs of the mpx-tiny-s."""
    page = watch(walk_capture, ROOT / "jobs" / "hexapod-tripod.toml")
    page.press("f")  # on both sides of a step: each foot leaves a trail
    go(page, page.run("Math.round(watched.waves.model.origin + 90.9 * watched.waves.model.period)"))
    names = page.run("watched.robot.model.servos.map(servo => servo.name)")
    moved, planned = page.run("[watched.robot.angles, watched.robot.ghost]")
    away = {name: math.degrees(one - other) for name, one, other in zip(names, moved, planned, strict=True)}
    servo = page.run("watched.robot.model.servos[1]")
    slope = np.degrees(np.diff(servo["angles"]) / np.diff(servo["widths_us"]))
    assert away.pop("L1-lift") == pytest.approx(100 * slope[0], abs=slope[0])
    assert list(away.values()) == pytest.approx([0] * 11, abs=slope[0])  # a sample is 1 µs
    assert not page.run("document.getElementById('robot-area').hidden")
    assert page.run("watched.robot.trails.filter(trail => trail.length > 1).length") == 6
    assert stance_pixels(page) > 100, "the support polygon"
    assert page.run("document.getElementById('hands').offsetParent === null")


@pytest.mark.campaign
def test_the_emergency_stop_of_a_walking_hexapod_shows_in_the_frame(watch: Open, tmp_path: Path) -> None:
    job = tmp_path / "stop.toml"
    job.write_text(
        (ROOT / "jobs" / "hexapod-tripod.toml").read_text() + 'stop_pin = "RA4"\nstop_pulses = "off"\n'
    )
    page = watch(job)
    go(page, 3_000_000)
    assert page.run("watched.latest.widths.filter(w => w).length") == 12
    page.run("document.querySelector('#emergency .stop').dispatchEvent(new PointerEvent('pointerdown'))")
    page.until("watched.latest.chip.outside[4] === 0")
    for _ in range(8):
        before = page.run("watched.latest.cycle")
        page.click("#next-frame")
        page.until(f"watched.latest.cycle > {before}")
    assert page.run("watched.latest.widths.filter(w => w).length") == 0
    assert "frame 1" in text(page, "#now")


@pytest.mark.campaign
def test_three_poses_are_recorded_with_sliders_and_built(watch: Open, tmp_path: Path) -> None:
    job = copy(LAB8, tmp_path)
    page = watch(job)
    for angle in (45, 60, 75):
        slide(page, str(angle))
        page.click("#record")
        page.until(f"document.getElementById('job-text').value.includes('arm_deg = {angle},')")
    page.until("!document.getElementById('build').disabled")
    page.click("#build")
    page.until("document.getElementById('build-progress').dataset.exact === 'true'")
    lines = [
        line.strip() for line in job.read_text().splitlines() if "arm_deg" in line and line.strip()[0] == "{"
    ]
    assert lines[2].endswith("# 150 frames")
    assert lines[3:] == [f"{{ arm_deg = {angle}, hold_s = 1 }}," for angle in (45, 60, 75)]


def order(page: Page) -> list[float]:
    """The angles of the poses as the editor's text has them."""
    rows = page.run("document.getElementById('job-text').value").splitlines()
    found = [re.search(r"^ *\{ arm_deg = (\S+),", row) for row in rows]
    return [float(each[1]) for each in found if each]


def drag(page: Page, selector: str, to: str, by: float = 0) -> None:
    """Drag the middle of an element to the middle of another, and so many pixels farther."""
    middle = "(e => { const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })"
    page.run(f"document.querySelector({json.dumps(selector)}).scrollIntoView({{ block: 'center' }})")
    (x, y), (end, _) = (
        page.run(f"{middle}(document.querySelector({json.dumps(each)}))") for each in (selector, to)
    )
    page.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)
    for step in range(1, 5):
        at = x + (end + by - x) * step / 4
        page.call("Input.dispatchMouseEvent", type="mouseMoved", x=at, y=y, button="left", buttons=1)
    page.call("Input.dispatchMouseEvent", type="mouseReleased", x=end + by, y=y, button="left", clickCount=1)


@pytest.mark.campaign
def test_poses_are_dragged_on_a_timeline_by_mouse_and_keyboard(watch: Open, tmp_path: Path) -> None:
    job = copy(LAB8, tmp_path)
    page = watch(job)
    assert page.until("document.querySelectorAll('#timeline .pose').length") == 3
    drag(page, "#pose-0 b", "#pose-1", 60)
    page.until("!!document.querySelector('#pose-1[aria-selected=true]')")
    page.until("document.getElementById('job-state').textContent === 'changed'")
    assert order(page) == [90, 30, 120]
    assert slider(page) == pytest.approx(30), "the pose that is chosen is shown"
    scale = page.run(
        "(e => e.clientWidth - 46 * 3 - 8)(document.getElementById('timeline')) / 10"
    )  # 2, 5 and 3 s share the width
    drag(page, "#pose-2 .handle", "#pose-2 .handle", 1.2 * scale)
    page.until("document.getElementById('job-text').value.includes('arm_deg = 120, hold_s = 4.2')")
    page.run("document.getElementById('timeline').focus()")
    page.until("document.querySelector('#pose-2 span').textContent === '4.2 s'")
    page.press("+")
    page.until("document.getElementById('job-text').value.includes('arm_deg = 120, hold_s = 4.3')")
    page.press("ArrowLeft")
    page.until("!!document.querySelector('#pose-1[aria-selected=true]')")
    page.press("Delete")
    page.until("document.querySelectorAll('#timeline .pose').length === 2")
    assert order(page) == [90, 120]
    page.press("ArrowLeft", shift=True)
    page.until("document.querySelector('#timeline').textContent.startsWith('1 4.3 s')")
    assert order(page) == [120, 90]
    page.until("!document.getElementById('build').disabled")
    page.click("#build")
    page.until("document.getElementById('build-progress').dataset.exact === 'true'")
    written = job.read_text()
    wanted = (
        "    { arm_deg = 120, hold_s = 4.3 }, # 150 frames\n    { arm_deg = 90, hold_s = 5 },  # 250 frames\n"
    )
    assert wanted in written and "# To let the servo rest without pulses" in written
    assert written.replace(wanted, "") == re.sub(r"    \{ arm_deg.*\n", "", LAB8.read_text())


@pytest.mark.campaign
def test_a_slider_moves_the_simulated_chip_of_a_stream_job(watch: Open) -> None:
    page = watch(ROOT / "jobs" / "stream-arm.toml")
    go(page, 500_000)
    before = page.run("watched.latest.widths[5]")
    slide(page, "e.max")
    go(page, 800_000)
    assert page.run("watched.latest.widths[5]") == pytest.approx(2000, abs=8) != before


def test_arrow_keys_walk_a_robot_on_command_and_escape_stops_it(watch: Open) -> None:
    page = watch(ROOT / "jobs" / "hexapod-command.toml")
    go(page, 2_500_000)
    assert page.run("watched.latest.planned")
    stance = page.run("watched.latest.widths")
    page.press("ArrowLeft")
    page.until("watched.latest.running && !watched.latest.planned")
    pressed = (
        "document.querySelector('#walk [aria-pressed=true], #emergency [aria-pressed=true]').textContent"
    )
    assert page.run(pressed) == "left"
    page.press(" ")
    page.until("!watched.latest.running")
    begin = page.run("watched.latest.cycle")
    go(page, begin + 1_500_000)
    assert page.run("watched.latest.widths") != stance
    page.click("#emergency .stop")
    assert page.run(pressed) == "stop"
    page.until("watched.latest.running")
    page.press("ArrowUp")  # the button has the focus: the group takes its keys
    assert page.run(pressed) == "forward"
    page.press("Escape")
    assert page.run(pressed) == "stop"
    page.click("#run")
    page.until("!watched.latest.running")
    go(page, page.run("watched.latest.cycle") + 5_000_000)
    assert page.run("watched.latest.widths") == stance


def bodies(page: Page) -> list[float]:
    """Where the body is, from the text below the robot: x, y and height in mm, at the moment of the chip."""
    page.until(
        "document.getElementById('twin-text').textContent.startsWith("
        "`bodies at ${(Math.floor(watched.latest.cycle / 1000) / 1000).toFixed(3)} s; `)"
    )
    found = re.search(r"body at (\S+) mm, (\S+) mm, (\S+) mm high", text(page, "#twin-text"))
    assert found
    return [float(each) for each in found.groups()]


@pytest.mark.campaign
def test_bodies_follow_the_chip_forwards_backwards_and_into_its_emergency_stop(
    watch: Open, tmp_path: Path
) -> None:
    """Without pulses the motors let the legs go, and the body sinks."""
    pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo")
    job = tmp_path / "stop.toml"
    job.write_text(
        (ROOT / "jobs" / "hexapod-tripod.toml").read_text() + 'stop_pin = "RA4"\nstop_pulses = "off"\n'
    )
    page = watch(job)
    page.click("#twin-show")
    go(page, 2_000_000)
    begin = bodies(page)
    page.click("#run")
    page.until("watched.latest.cycle > 2_500_000")
    page.click("#run")
    page.until("!watched.latest.running")
    go(page, 4_000_000)
    walked = bodies(page)
    assert walked[0] > begin[0] + 20, "it has walked"
    assert page.run("watched.robot.bodies.lines.length") == 7
    said = text(page, "#twin-text")
    assert "on the ground: L2 R1 R3; ground: friction 0.8" in said, "one of the two tripods"
    go(page, 2_000_000)
    assert bodies(page) == begin
    page.run("document.querySelector('#emergency .stop').dispatchEvent(new PointerEvent('pointerdown'))")
    page.until("watched.latest.chip.outside[4] === 0")
    go(page, 4_000_000)
    stopped = bodies(page)
    assert stopped[0] < begin[0] + 20 and stopped[2] < begin[2] - 5
    page.reload("watched.latest && document.getElementById('twin-show')?.checked")
    assert bodies(page) == stopped
    page.click("#twin-show")
    page.until("document.getElementById('twin-text').textContent === '' && !watched.robot.bodies")


@pytest.mark.campaign
def test_without_mujoco_the_page_says_what_to_install(watch: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    page = watch(ROOT / "jobs" / "hexapod-tripod.toml")
    page.click("#twin-show")
    page.until("document.getElementById('twin-text').textContent.includes('servogen[twin]')")
    assert not page.run("document.getElementById('twin-show').checked")


SHOWN = """\
#pragma CLOCK_FREQ 4000000
char count;
int total;
void inner(void) { count = 7; total = 1000; delay_us(50); }
void main(void)
{
    trisb = 0xFE;
    option_reg = 0xC5;
    eeprom_write(2, 0xA5);
    inner();
    while (1) {
        set_bit(portb, 0);
        delay_us(200);
        clear_bit(portb, 0);
        delay_us(200);
    }
}
"""


def cells(page: Page, table: str) -> dict[str, str]:
    """The rows of a table by their names."""
    rows = f"[...document.getElementById('{table}').rows].map(r => [...r.cells].map(c => c.textContent))"
    return dict(page.run(rows))


@pytest.mark.campaign
def test_the_chip_is_shown_at_the_moment(watch: Open, tmp_path: Path) -> None:
    """Values of the source, as the data sheet names their places (DS35007, sections 2 to 5)."""
    program = tmp_path / "shown.c"
    program.write_text(SHOWN)
    page = watch(program)
    typed = (
        f"document.getElementById('breakpoint').value = {json.dumps(breakpoint)};"
        "document.getElementById('breakpoint-form').requestSubmit()"
        for breakpoint in ("inner()", "RB0 rise")
    )
    page.run("; ".join(typed))  # the second one before the server has answered the first
    page.until("watched.latest.breakpoints.length === 2")
    page.click("#run")
    page.until("watched.latest.stopped === 'inner()'")
    painted(page)
    assert re.fullmatch(r"0x\w{3}", text(page, "#stack")), "the call's return address"
    assert cells(page, "variables")["count"] == "0"
    page.click("#run")
    page.until("watched.latest.stopped === 'RB0 rise'")
    painted(page)
    assert text(page, "#stack") == "empty"
    variables, registers, peripherals = (
        cells(page, table) for table in ("variables", "registers", "peripherals")
    )
    assert (variables["count"], variables["total"]) == ("7", "1000")
    assert registers["TRISB"] == "0xFE" and registers["OPTION_REG"] == "0xC5"
    assert registers["PORTB"] == "0x01"
    assert peripherals["timer"].endswith("counts cycles, 1:64") and peripherals["prescaler"].endswith(
        "of the timer"
    )
    assert peripherals["interrupts"] == "0 taken" and peripherals["state"] == "running"
    assert page.run("document.querySelector('[title^=\"RB0\"]').dataset.level") == "1"
    assert text(page, "#eeprom").split()[:4] == ["FF", "FF", "A5", "FF"]
    assert "set_bit" in text(page, "#source") and page.run("!!document.querySelector('#instructions .next')")
    assert page.run("document.querySelectorAll('#instructions li').length") == 9


def test_the_waves_are_measured_from_seconds_to_a_cycle(watch: Open) -> None:
    """The first pulse of lab 8 is 1167 µs wide: 30°."""
    page = watch(ROOT / "firmware" / "lab8-exercise" / "main.hex", LAB8)
    go(page, 100_000)
    page.run("watched.waves.show(0, 9e9)")
    assert page.run("watched.waves.end - watched.waves.begin") == 4_000_000
    page.run("document.getElementById('waves').focus()")
    for _ in range(30):
        page.press("+")
    assert page.run("watched.waves.end - watched.waves.begin") == 8
    fall = page.run("watched.waves.model.origin") + 1167
    assert page.run(
        f"(watched.waves.show({fall} - 3000, {fall} + 20_000), watched.waves.place(0, {fall} - 1167),"
        f" watched.waves.place(1, {fall}), true)"
    )
    page.until(f"watched.waves.data.begin === {fall} - 3000")
    painted(page)
    assert "1167 µs" in text(page, "#readout") and "1167 cycles" in text(page, "#readout")
    page.press("]")
    painted(page)
    assert "1166 µs" in text(page, "#readout") and "1166 cycles" in text(page, "#readout")
    described = "watched.waves.options.describe(watched.waves.options.rows[0], 1167)"
    assert page.run(described) == "1167 µs 30.1°"  # 167 µs of 0.18° each


def test_bytes_are_typed_on_the_serial_console(watch: Open) -> None:
    """FF, servo, position: 254 of 254 is the slowest end of the servo's pulses, 2 ms."""
    page = watch(ROOT / "jobs" / "stream-arm.toml")
    go(page, 500_000)
    page.run("document.getElementById('bytes').value = 'FF 00 FE'")
    page.run("document.getElementById('serial-form').requestSubmit()")
    page.until("document.getElementById('transcript').textContent.startsWith('to the chip: FF 00 FE')")
    go(page, 800_000)
    assert page.run("watched.latest.widths[watched.waves.options.rows[0].pin]") == pytest.approx(2000, abs=8)
    page.run("document.getElementById('bytes').value = 'FF 00 FE'")
    page.run("document.getElementById('baud').value = '20'")
    page.run("document.getElementById('serial-form').noValidate = true")
    page.run("document.getElementById('serial-form').requestSubmit()")
    page.until("document.getElementById('said').textContent.includes('allowed are 50 to 115200')")


def luminance(colour: str) -> float:
    """The relative luminance of WCAG 2.2."""
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))


@pytest.mark.campaign
def test_text_is_legible_on_a_light_and_on_a_dark_page(watch: Open) -> None:
    """WCAG 2.2, 1.4.3: a contrast of 4.5 at least."""
    page = watch(ROOT / "firmware" / "lab8-exercise" / "main.hex")
    names = ("ink", "soft", "bad", "good", "main", "page", "field", "here", "main-ink", "input")
    style = "getComputedStyle(document.body)"
    for scheme in ("light", "dark"):
        page.colours(scheme)
        colours = {name: page.run(f"{style}.getPropertyValue('--{name}').trim()") for name in names}
        shown = [int(each) for each in re.findall(r"\d+", page.run(f"{style}.backgroundColor"))]
        assert shown == [int(colours["page"][at : at + 2], 16) for at in (1, 3, 5)]
        assert (luminance(colours["page"]) < 0.1) == (scheme == "dark")
        pairs = [(one, "page") for one in ("ink", "soft", "bad", "good", "main", "input")]
        pairs += [("ink", "field"), ("soft", "field"), ("ink", "here"), ("main-ink", "main")]
        for one, other in pairs:
            bright, dim = sorted((luminance(colours[one]), luminance(colours[other])), reverse=True)
            assert (bright + 0.05) / (dim + 0.05) >= 4.5, (scheme, one, other)


@pytest.mark.campaign
def test_a_window_keeps_its_place_when_it_is_loaded_again(watch: Open) -> None:
    page = watch(ROOT / "firmware" / "lab8-exercise" / "main.hex")
    go(page, 77_000)
    page.run("watched.waves.show(70000, 80000)")
    page.until("watched.waves.data.begin >= 60000 && watched.waves.end - watched.waves.begin === 10000")
    page.run("watched.waves.place(0, 72000); watched.waves.place(1, 74000)")
    here = page.run("watched.latest.cycle")
    page.reload(f"watched.latest?.cycle === {here} && !!watched.waves.data")
    assert page.run("[watched.waves.begin, watched.waves.end]") == [70_000, 80_000]
    assert page.run("watched.waves.cursors") == [72_000, 74_000]


def test_the_keyboard_alone_suffices(watch: Open) -> None:
    page = watch(LAB8)
    page.until("!document.getElementById('build').disabled")  # the text is planned: its controls are there
    page.press("f")
    page.until("watched.latest.cycle >= 20000")
    page.press("n")
    page.until("watched.latest.cycle % 20000 !== 0")
    page.press(" ")
    page.until("watched.latest.running")
    page.press(" ")
    page.until("!watched.latest.running")
    reached = []
    for _ in range(70):
        page.press("Tab")
        reached.append(
            page.run("document.activeElement.id || document.activeElement.getAttribute('aria-label')")
        )
    controls = page.run(
        "[...document.querySelectorAll('button, select, input, textarea, canvas')]"
        ".filter(e => e.offsetParent && !e.disabled && e.tabIndex >= 0)"
        ".map(e => e.id || e.getAttribute('aria-label')).filter(Boolean)"
    )
    assert set(controls) <= set(reached)
    page.run("document.getElementById('tab-hands').focus()")
    page.press("ArrowRight")  # of a list of tabs the arrow keys choose one
    assert page.run("[document.activeElement.id, document.getElementById('hands').hidden]") == [
        "tab-chip",
        True,
    ]


@pytest.mark.campaign
@pytest.mark.parametrize("job", ["lab8-exercise", "hexapod-tripod"])
def test_a_narrow_page_does_not_scroll_sideways(watch: Open, job: str) -> None:
    page = watch(ROOT / "jobs" / f"{job}.toml", width=390, height=844)
    assert page.run("document.documentElement.scrollWidth") <= 390
