"""The page as a workbench: all of it on one screen, text beside consequence, in a real browser."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from functools import partial
from pathlib import Path

import pytest

pytest.importorskip("websockets", reason="the extra 'watch' is not installed")

from servogen.watch.editing import Editor
from servogen.watch.subject import Setting, load_subject
from tests.watch.browser import Browser, Page
from tests.watch.serving import Running
from tests.watch.test_page import LAB8, NO_TRIS, ROOT, Open, copy, go, painted, text, typed, watch  # noqa: F401
from tests.watch.test_page_stories import stopped_walk

NODE = shutil.which("node")
BOX = "(e => { const b = e.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; })"


def box(page: Page, selector: str) -> list[float]:
    """Left, top, right and bottom of an element, in pixels of the window."""
    return list(page.run(f"{BOX}(document.querySelector({json.dumps(selector)}))"))


def point(page: Page, x: float, y: float) -> None:
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)


@pytest.mark.campaign
@pytest.mark.parametrize(("width", "height", "code"), [(1280, 800, 12.5), (1920, 1080, 16)])
def test_text_robot_waves_and_hands_share_one_screen_that_is_filled(
    watch: Open,  # noqa: F811
    tmp_path: Path,
    width: int,
    height: int,
    code: float,
) -> None:
    page = watch(stopped_walk(tmp_path), width=width, height=height)
    size = page.run("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
    assert size == [width, height]
    parts = ("#verdict", "#run", "#job-text", "#build", "#robot", "#waves", "#sliders", "#emergency .stop")
    for part in parts:
        left, top, right, bottom = box(page, part)
        assert 0 <= left < right <= width and 0 <= top < bottom, part
        assert bottom <= height or part == "#sliders", part
    assert box(page, "#job-text")[2] <= box(page, "#robot")[0], "text left, robot right"
    assert box(page, "#robot")[3] <= box(page, "#waves")[1]
    assert max(box(page, part)[2] for part in ("#waves", "#tools")) > width - 25
    assert page.run("parseFloat(getComputedStyle(document.getElementById('job-text')).fontSize)") == code


@pytest.mark.campaign
def test_on_a_phone_the_emergency_stop_stays_in_sight(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(stopped_walk(tmp_path), width=390, height=844)
    for place in (0, 1e6):
        page.run(f"window.scrollTo(0, {place})")
        painted(page)
        left, top, right, bottom = box(page, "#emergency .stop")
        assert 0 <= left < right <= 390 and 0 <= top < bottom <= 844


@pytest.mark.campaign
def test_chip_and_hands_are_docked_below_or_beside(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(copy(LAB8, tmp_path), width=1280, height=800)
    assert box(page, "#tools")[1] >= box(page, "#text-area")[3]
    page.click("#dock")
    assert box(page, "#tools")[0] >= box(page, "#seen")[2]
    page.reload("watched.latest && watched.waves?.data")
    assert box(page, "#tools")[0] >= box(page, "#seen")[2], "as it was left"
    page.click("#dock")


def test_a_change_is_planned_while_it_is_typed_and_shown_as_a_ghost(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    job = copy(LAB8, tmp_path)
    page = watch(job)
    go(page, 1_000_000)
    degrees = "watched.robot.ghost[0] * 180 / Math.PI"
    assert page.run(degrees) == pytest.approx(30, abs=0.2)
    typed(page, "arm_deg = 30", "arm_deg = 60")
    page.until(f"Math.abs({degrees} - 60) < 0.2")
    assert page.run("watched.robot.angles[0] * 180 / Math.PI") == pytest.approx(30, abs=0.2)
    width = page.run("watched.waves.options.preview(watched.waves.rows[0], 1_000_000)")
    assert width == pytest.approx(1000 + 60 / 0.18, abs=1), "1000 µs at 0°, 0.18° for each further µs"
    assert "ghost" in text(page, "#preview") and job.read_text() == LAB8.read_text()
    typed(page, "arm_deg = 60", "arm_deg = 30")
    page.until(f"Math.abs({degrees} - 30) < 0.2 && !document.getElementById('preview').textContent")


@pytest.mark.campaign
def test_the_ghost_of_a_walk_is_that_of_its_text_also_behind_the_frames_that_lead_in(
    watch: Open,  # noqa: F811
    tmp_path: Path,
) -> None:
    """The engine stands the robot up first: an untouched text is no other plan, and a changed one is late."""
    page = watch(copy(ROOT / "jobs" / "hexapod-tripod.toml", tmp_path))
    page.until("document.querySelectorAll('#job-problems li').length > 0")
    assert text(page, "#preview") == ""
    go(page, 4_000_000)
    scheduled = page.run("watched.robot.ghost")
    typed(page, "lift_mm = 20", "lift_mm = 20.001")
    page.until("document.getElementById('preview').textContent.includes('ghost')")
    painted(page)
    assert page.run("watched.robot.ghost") == pytest.approx(scheduled, abs=0.01)


@pytest.mark.campaign
def test_a_pose_is_linked_in_text_timeline_and_waves(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    """Lab 8: 30° for 2 s, 90° for 5 s, 120° for 3 s, in the lines 17 to 19 of its file."""
    page = watch(copy(LAB8, tmp_path))
    go(page, 4_000_000)
    now = "[...document.querySelectorAll('.pose')].findIndex(e => e.classList.contains('now'))"
    linked = "[...document.querySelectorAll('.pose')].findIndex(e => e.classList.contains('linked'))"
    page.until(f"{now} === 1")
    left, top, right, bottom = box(page, "#pose-2")
    point(page, (left + right) / 2, (top + bottom) / 2)
    page.until(f"{linked} === 2 && !!document.querySelector('#job-bands .linked')")
    lines = page.run(
        "document.querySelector('#job-bands .linked').getBoundingClientRect().top"
        " - document.querySelector('#job-bands .now').getBoundingClientRect().top"
    )
    assert lines == pytest.approx(
        page.run("parseFloat(getComputedStyle(document.getElementById('job-text')).lineHeight)")
    )
    left, top, right, bottom = box(page, "#waves")
    point(page, (left + right) / 2, (top + bottom) / 2)  # 4 s: the second pose
    page.until(f"{linked} === 1")
    bands = page.run(
        "watched.waves.options.bands(0, 12e6)"
        ".map(each => each.map(c => (c - watched.waves.model.origin) / 1e6))"
    )
    assert bands == [[2, 7]]
    page.run("document.getElementById('job-text').scrollTop = 0")
    at = "(e => { const b = e.getBoundingClientRect(), h = parseFloat(getComputedStyle(e).lineHeight);"
    x, y, step = page.run(
        f"{at} return [b.left + 90, b.top + 8 + h / 2 - e.scrollTop, h]; }})"
        "(document.getElementById('job-text'))"
    )
    page.run("document.getElementById('job-text').scrollTop = 1e6")
    scrolled = page.run("document.getElementById('job-text').scrollTop")
    point(page, x, y + 16 * step - scrolled)  # line 17
    page.until(f"{linked} === 0")
    point(page, x, y + 18 * step - scrolled)
    page.until(f"{linked} === 2")


@pytest.mark.campaign
def test_what_a_narrow_pose_says_is_whole(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    """Its number, and how long it is held where there is room for that: nothing runs under the handle."""
    job, text = tmp_path / "short.toml", LAB8.read_text()
    before, _, behind = text.partition("    { arm_deg = 30")
    rows = "".join(f"    {{ arm_deg = {30 * n}, hold_s = {(0.1, 4)[n % 2]} }},\n" for n in range(6))
    job.write_text(before + rows + "]" + behind.partition("\n]")[2])
    page = watch(job)
    page.until("document.querySelectorAll('.pose').length === 6")
    ends = (
        "[...document.querySelectorAll('.pose')].map(e => {"
        " const seen = [...e.querySelectorAll('b, span:not(.handle)')].filter(each => each.offsetWidth);"
        " return [seen.length, seen.at(-1).getBoundingClientRect().right,"
        " e.querySelector('.handle').getBoundingClientRect().left]; })"
    )
    shown = page.run(ends)
    assert all(right <= handle for _, right, handle in shown)
    assert {count for count, _, _ in shown} == {1, 2}


def test_a_click_on_a_line_stops_there_and_warnings_stand_at_their_lines(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    program = tmp_path / "blink.c"
    program.write_text(NO_TRIS)
    page = watch(program)
    marks = page.run(
        "[...document.querySelectorAll('.mark')].map(e => [e.parentElement.dataset.line, e.textContent])"
    )
    assert [line for line, _ in marks] == ["5"] and "TRISB never makes it an output" in marks[0][1]
    page.click(".line[data-line='6'] button")
    page.until("watched.latest.breakpoints.join() === 'line 6'")
    assert (
        page.run("document.querySelector(\".line[data-line='6'] button\").getAttribute('aria-pressed')")
        == "true"
    )
    page.click("#run")
    page.until("watched.latest.stopped === 'line 6'")
    page.click(".line[data-line='6'] button")
    page.until("watched.latest.breakpoints.length === 0")
    go(page, 5000)
    page.click("#labels button")  # beside the waves, where no pin is driven
    assert "RB0 is an input" in page.until("document.querySelector('#explanation div').textContent")


UART = """\
#pragma CLOCK_FREQ 4000000
void bit_time(void) { delay_us(200); delay_us(200); delay_us(200); delay_us(205); }
void send(char byte)
{
    char n;
    clear_bit(portb, 1);
    bit_time();
    for (n = 0; n < 8; n++) {
        if (byte & 1) set_bit(portb, 1);
        else clear_bit(portb, 1);
        byte = byte >> 1;
        bit_time();
    }
    set_bit(portb, 1);
    delay_ms(3);
}
void main(void)
{
    set_bit(portb, 1);
    trisb = 0xFD;
    delay_ms(3);
    while (1) {
        send(0x48);
        send(0x69);
    }
}
"""
"""It sends "Hi" at about 1200 baud, 833 µs a bit."""


@pytest.mark.campaign
def test_the_console_shows_what_comes_back_on_any_pin(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    program = tmp_path / "uart.c"
    program.write_text(UART)
    page = watch(program)
    page.click("#tab-serial")
    page.run(
        "for (const [id, value] of [['listen-pin', 'RB1'], ['listen-baud', '1200']]) {"
        " const e = document.getElementById(id); e.value = value; e.dispatchEvent(new Event('change')); }"
    )
    page.click("#run")
    page.until("/from the chip: 48 69.*Hi/.test(document.getElementById('transcript').textContent)")
    # while it runs: where it stops, the window may cut the byte
    page.until("(watched.waves.data.said[6] || []).some(each => each[2] === '69')")


def evaluated(module: str, script: str) -> object:
    assert NODE is not None
    path = (ROOT / "templates" / "watch" / module).as_uri()
    command = [
        NODE,
        "--input-type=module",
        "-e",
        f'import * as m from "{path}"; console.log(JSON.stringify({script}))',
    ]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


@pytest.mark.skipif(NODE is None, reason="there is no node here")
def test_times_and_bytes_are_read_as_they_are_typed() -> None:
    model = "{ cycle_us: 1, origin: 500, period: 20000 }"
    texts = ["4.9 s", "1:30", "20:00:00", "20 h", "350ms", "7", "frame 12", "cycle 4000", "soon", "1 km", ""]
    read = evaluated("moment.js", f"{json.dumps(texts)}.map(text => m.cycleOf(text, {model}))")
    hour = 3600 * 10**6
    assert read == [
        4_900_000,
        90 * 10**6,
        20 * hour,
        20 * hour,
        350_000,
        7_000_000,
        240_500,
        4000,
        None,
        None,
        None,
    ]
    for kind, typed_text, meant in (
        ("hex", "FF 00 7F", [255, 0, 127]),
        ("hex", "FF007F", [255, 0, 127]),
        ("hex", "0x41, a", [65, 10]),
        ("decimal", "255 0 127", [255, 0, 127]),
        ("text", "ab", [97, 98]),
        ("hex", "", []),
    ):
        assert evaluated("console.js", f"m.bytesOf({json.dumps(typed_text)}, '{kind}')") == meant
    assert "256" in str(evaluated("console.js", "m.bytesOf('1 256', 'decimal')"))
    assert "'g1'" in str(evaluated("console.js", "m.bytesOf('00 g1', 'hex')"))


def test_a_time_is_typed_and_a_wrong_one_is_answered(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(copy(LAB8, tmp_path))
    for asked, cycle in (("20 h", 72 * 10**9), ("0.5 s", 500_000)):
        page.run(
            f"document.getElementById('go').value = '{asked}';"
            "document.getElementById('go-form').requestSubmit()"
        )
        page.until(f"Math.abs(watched.latest.cycle - {cycle}) < 3")
    page.run(
        "document.getElementById('go').value = 'soon'; document.getElementById('go-form').requestSubmit()"
    )
    page.until("document.getElementById('said').textContent.startsWith(\"'soon' is not a time\")")


def test_a_server_that_has_ended_is_unmistakable_and_found_again_at_the_same_place(
    browser: Browser, tmp_path: Path
) -> None:
    """The moment, the breakpoints, the tabs, the waves and what was typed are as they were."""
    job = copy(ROOT / "jobs" / "lab8-exercise.toml", tmp_path)

    def served(port: int = 0, token: str = "") -> Running:
        load = partial(load_subject, job, Setting())
        return Running(load, Editor(job, Setting()), port=port, token=token)

    first = served()
    page = browser.page()
    page.open(first.server.url)
    page.until("watched.latest && watched.waves && watched.waves.data")
    typed(page, "arm_deg = 120", "arm_deg = 140")
    for tab in ("#tab-source", "#tab-memory"):
        page.click(tab)
    page.run("document.getElementById('breakpoint').value = 'RB0 rise'")
    page.run("document.getElementById('breakpoint-form').requestSubmit()")
    page.until("document.querySelectorAll('#breakpoints li').length === 1")
    go(page, 777_000)
    page.run("watched.waves.show(700_000, 800_000)")
    here = page.run("watched.latest.cycle")
    first.stop()
    page.until("document.body.classList.contains('gone')")
    said = text(page, "#link")
    assert said.startswith("The server does not answer.")
    assert f"servogen watch lab8-exercise.toml --at-cycle {here}" in said
    assert not page.run("document.getElementById('link').hidden")
    assert page.run("document.getElementById('views').inert && document.getElementById('time').inert")
    page.run("watched.latest = null")
    again = served(first.server.port, first.token)
    try:
        back = f"!document.body.classList.contains('gone') && watched.latest?.cycle === {here}"
        page.until(f"{back} && watched.latest.breakpoints.join() === 'RB0 rise'")
        assert page.run("document.getElementById('link').hidden && !document.getElementById('views').inert")
        chosen = "[...document.querySelectorAll('[role=tab][aria-selected=true]')].map(tab => tab.id)"
        assert page.run(chosen) == ["tab-source", "tab-memory"]
        assert page.run("[watched.waves.begin, watched.waves.end]") == [700_000, 800_000]
        assert "arm_deg = 140" in page.run("document.getElementById('job-text').value")
        assert text(page, "#job-state") == "changed"
        page.until("document.getElementById('preview').textContent.includes('ghost')")
        page.close()
    finally:
        again.stop()


@pytest.mark.campaign
def test_legs_have_the_same_colours_and_names_in_every_view(watch: Open) -> None:  # noqa: F811
    pytest.importorskip("mujoco", reason="the twin's physics needs MuJoCo")
    page = watch(ROOT / "jobs" / "hexapod-tripod.toml")
    page.click("#twin-show")
    page.until("!!watched.robot.bodies")
    legs = page.run("watched.robot.bodies.lines.map(line => line.leg ?? null)")
    assert sorted(filter(None, legs)) == ["L1", "L2", "L3", "R1", "R2", "R3"]
    assert page.run("watched.robot.model.ends.map(end => end.name)") == list(filter(None, legs))
    assert math.isclose(page.run("watched.robot.bodies.heading"), 0, abs_tol=0.05)


def test_the_modules_are_plain_and_their_lines_short() -> None:
    """No build step, at most 110 characters a line, and few variables of a module."""
    for module in sorted((ROOT / "templates" / "watch").glob("*.js")):
        lines = module.read_text().splitlines()
        assert max(map(len, lines)) <= 110, module.name
        assert sum(line.startswith(("let ", "var ")) for line in lines) == 0, module.name
