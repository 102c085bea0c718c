"""What a person does to the page: hands on pins, waves while it runs, a text that must not be lost."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random

import pytest

pytest.importorskip("websockets", reason="the extra 'watch' is not installed")

from tests.watch.browser import Browser, Page
from tests.watch.test_page import LAB8, NO_TRIS, ROOT, Open, copy, go, slide, text, typed, watch  # noqa: F401 - a fixture

TRIPOD = ROOT / "jobs" / "hexapod-tripod.toml"
STOP = "#emergency .stop"


def held(page: Page, selector: str) -> tuple[float, float]:
    """Press the mouse on the middle of an element, and return where."""
    box = page.run(
        f"(() => {{ const e = document.querySelector({json.dumps(selector)});"
        " e.scrollIntoView({block: 'center'});"
        " const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    page.call(
        "Input.dispatchMouseEvent", type="mousePressed", x=box[0], y=box[1], button="left", clickCount=1
    )
    return box[0], box[1]


def let_go(page: Page, x: float, y: float) -> None:
    page.call("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y, button="left", clickCount=1)


def build(page: Page) -> None:
    page.until("!document.getElementById('build').disabled")
    page.run("document.getElementById('build-progress').textContent = ''")
    page.click("#build")
    page.until("!!document.querySelector('#download a') && !document.getElementById('download').hidden")


def level(page: Page, pin: str) -> int:
    """The level at which a pin is held from outside: 0, 1, or 2 where it is not held."""
    return int(page.run(f"watched.latest.chip.outside[{['RA0', 'RA1', 'RA2', 'RA3', 'RA4'].index(pin)}]"))


def stopped_walk(folder: Path) -> Path:
    """The tripod walk with an emergency stop."""
    job = copy(TRIPOD, folder)
    job.write_text(TRIPOD.read_text() + 'stop_pin = "RA4"\n')
    return job


@pytest.fixture
def stop_job(tmp_path: Path) -> Path:
    """Lab 8 with an emergency stop on RA4, pressed while it is low."""
    job = tmp_path / "stop.toml"
    job.write_text(LAB8.read_text() + '[firmware]\nengine = "player"\nstop_pin = "RA4"\n')
    return job


@pytest.mark.campaign
def test_after_a_build_the_emergency_stop_has_the_new_level(watch: Open, stop_job: Path) -> None:  # noqa: F811
    page = watch(stop_job)
    typed(page, 'stop_pin = "RA4"', 'stop_pin = "RA4"\nstop_level = "high"')
    build(page)
    page.until(f"!!document.querySelector('{STOP}')")
    x, y = held(page, STOP)
    page.until("watched.latest.chip.outside[4] === 1")
    let_go(page, x, y)
    page.until("watched.latest.chip.outside[4] === 0")
    assert page.run(f"document.querySelectorAll('{STOP}').length") == 1


def test_a_button_is_let_go_wherever_the_pointer_ends(watch: Open, stop_job: Path) -> None:  # noqa: F811
    page = watch(stop_job)
    held(page, STOP)
    page.until("watched.latest.chip.outside[4] === 0")
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=5, y=5, button="left")
    let_go(page, 5, 5)
    page.until("watched.latest.chip.outside[4] === 1")
    held(page, STOP)
    page.until("watched.latest.chip.outside[4] === 0")
    page.run(f"document.querySelector('{STOP}').dispatchEvent(new PointerEvent('pointercancel'))")
    page.until("watched.latest.chip.outside[4] === 1")
    held(page, STOP)
    page.until("watched.latest.chip.outside[4] === 0")
    page.run("window.dispatchEvent(new Event('blur'))")
    page.until("watched.latest.chip.outside[4] === 1")
    assert page.run("document.querySelector('.pressed')") is None


def test_escape_is_the_emergency_stop_wherever_the_focus_is(watch: Open, stop_job: Path) -> None:  # noqa: F811
    page = watch(stop_job)
    page.run("document.getElementById('job-text').focus()")
    page.call("Input.dispatchKeyEvent", type="keyDown", key="Escape", windowsVirtualKeyCode=27)
    page.until("watched.latest.chip.outside[4] === 0")
    page.call("Input.dispatchKeyEvent", type="keyUp", key="Escape", windowsVirtualKeyCode=27)
    page.until("watched.latest.chip.outside[4] === 1")


@pytest.mark.campaign
def test_after_an_intervention_nothing_is_said_of_the_edges_that_follow(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(stopped_walk(tmp_path))
    go(page, 4_000_000)
    assert "scheduled" in text(page, "#difference-text")
    x, y = held(page, STOP)
    let_go(page, x, y)
    said = page.until(
        "(t => t.includes('intervened') && t)(document.getElementById('difference-text').textContent)"
    )
    assert said == "you intervened at 4 s: not compared from there"
    assert text(page, "#verdict") == "not compared"
    go(page, 6_000_000)
    page.until("watched.waves.data.begin > 4_000_000 && watched.waves.data.pulses.length > 10")
    assert page.run("watched.waves.data.differing.length") == 0


@pytest.mark.campaign
def test_a_build_of_another_robot_shows_its_servos(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(copy(LAB8, tmp_path))
    page.run("document.getElementById('job-text').select()")
    page.call("Input.insertText", text=TRIPOD.read_text())
    build(page)
    page.until("document.querySelectorAll('#sliders .slider').length === 12")
    page.click("#run")
    page.until("watched.latest.cycle > 400_000")
    page.click("#run")
    assert page.run("watched.robot.trails.length") == 6
    assert page.run("document.querySelectorAll('#pin option').length") == 14


COVERED = """
(async () => {
  const shares = [];
  for (let n = 0; n < 40; n++) {
    await new Promise(done => requestAnimationFrame(done));
    const { begin, end, data } = watched.waves, past = Math.min(end, watched.latest.cycle);
    if (past <= begin) continue;
    shares.push(Math.max(0, Math.min(past, data.seen) - Math.max(begin, data.begin)) / (past - begin));
  }
  return shares.reduce((sum, share) => sum + share, 0) / shares.length;
})()
"""


@pytest.mark.campaign
@pytest.mark.parametrize("job", [LAB8, TRIPOD], ids=lambda job: job.stem)
def test_the_visible_past_is_covered_while_it_runs(watch: Open, tmp_path: Path, job: Path) -> None:  # noqa: F811
    page = watch(copy(job, tmp_path))
    go(page, 1_000_000)
    for speed in ("1/1000", "1/10", "real time", "10 ×", "full speed"):
        page.run(
            f"(e => {{ e.value = [...e.options].find(o => o.textContent === '{speed}').value;"
            " e.dispatchEvent(new Event('change')); })(document.getElementById('speed'))"
        )
        page.run("if (!watched.latest.running) document.getElementById('run').click()")
        page.until("watched.latest.running")
        assert page.run(COVERED) >= 0.98, speed


@pytest.mark.campaign
def test_what_is_typed_during_a_build_is_not_saved(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    job = copy(LAB8, tmp_path)
    page = watch(job)
    typed(page, "arm_deg = 120", "arm_deg = 140")
    page.until("!document.getElementById('build').disabled")
    page.run("document.getElementById('build').click()")
    typed(page, "arm_deg = 140", "arm_deg = 141")
    page.until("!!document.querySelector('#download a')")
    assert text(page, "#job-state") == "changed" and "arm_deg = 140" in job.read_text()
    assert page.run("document.getElementById('download').hidden"), "the HEX file is not this text's"
    typed(page, "arm_deg = 141", "arm_deg = 140")
    assert text(page, "#job-state") == "saved"
    assert not page.run("document.getElementById('download').hidden")


def test_a_file_that_was_changed_outside_is_not_overwritten(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    job = copy(LAB8, tmp_path)
    page = watch(job)
    outside = LAB8.read_text() + "# by another editor\n"
    job.write_text(outside)
    typed(page, "arm_deg = 120", "arm_deg = 140")
    page.until("!document.getElementById('save').disabled")
    page.click("#save")
    page.until("!document.getElementById('job-conflict').hidden")
    assert job.read_text() == outside
    page.click("#job-conflict button")
    assert page.run("document.getElementById('job-text').value") == outside
    assert text(page, "#job-state") == "saved"
    job.write_text(LAB8.read_text())
    typed(page, "arm_deg = 120", "arm_deg = 140")
    page.until("!document.getElementById('save').disabled")
    page.click("#save")
    page.until("!document.getElementById('job-conflict').hidden")
    page.click("#job-conflict button:last-child")
    page.until("document.getElementById('job-state').textContent === 'saved'")
    assert "arm_deg = 140" in job.read_text() and "another" in job.read_text()


@pytest.mark.campaign
def test_what_asks_for_a_click_stays_where_it_is_when_the_plan_comes(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    """The plan of a text comes whenever it is ready: it moves no button from under the pointer."""
    job = copy(LAB8, tmp_path)
    page = watch(job)
    job.write_text(LAB8.read_text() + "# by another editor\n")
    place = (
        "(b => [b.x, b.y])(document.querySelector('#job-conflict button:last-child').getBoundingClientRect())"
    )
    page.until("!document.getElementById('save').disabled")
    page.run(
        "(check => { watched.editor.check = () => { watched.held = check; }; })"
        "(watched.editor.check.bind(watched.editor))"
    )
    typed(page, "arm_deg = 120", "arm_deg = 140")
    page.click("#save")
    page.until("!document.getElementById('job-conflict').hidden")
    before = page.run(place)
    page.until("!!watched.held")
    page.run("watched.held()")
    page.until("document.getElementById('preview').textContent.includes('ghost')")
    assert page.run(place) == before
    page.click("#job-conflict button:last-child")
    page.until("document.getElementById('job-state').textContent === 'saved'")


@pytest.mark.campaign
def test_a_plan_that_takes_long_is_left_for_a_newer_text(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    """Planning 4000 steps of twelve servos takes minutes; the text is changed before that."""
    page = watch(copy(TRIPOD, tmp_path))
    typed(page, "cycles = 4 }", "cycles = 4000 }")
    page.until("document.getElementById('preview').textContent.startsWith('planning (')")
    typed(page, "cycles = 4000 }", "cycles = 5 }")
    page.until("document.getElementById('preview').textContent.includes('ghost')")


@pytest.mark.campaign
def test_undo_takes_back_what_the_timeline_did(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(copy(LAB8, tmp_path))
    before = page.run("document.getElementById('job-text').value")
    page.until("!document.getElementById('timeline-area').hidden")
    page.run("document.getElementById('timeline').focus()")
    page.press("+")
    page.until(f"document.getElementById('job-text').value !== {json.dumps(before)}")
    assert page.run("document.activeElement.id") == "timeline"
    page.run("document.getElementById('job-text').focus(); document.execCommand('undo')")
    assert page.run("document.getElementById('job-text').value") == before


def test_leaving_the_page_with_unsaved_text_is_asked(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(copy(LAB8, tmp_path))
    event = "new Event('beforeunload', { cancelable: true })"
    leaving = f"(e => {{ window.dispatchEvent(e); return e.defaultPrevented; }})({event})"
    assert page.run(leaving) is False
    typed(page, "arm_deg = 120", "arm_deg = 140")
    assert page.run(leaving) is True
    typed(page, "arm_deg = 140", "arm_deg = 120")


def test_a_wrong_breakpoint_stays_to_be_mended_beside_its_reason(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(copy(LAB8, tmp_path))
    page.click("#tab-source")
    page.run("document.getElementById('breakpoint').focus()")
    page.call("Input.insertText", text="main.c:99999")
    page.press("Enter")
    page.until("document.getElementById('breakpoint-said').textContent.includes('99999')")
    assert page.run("document.getElementById('breakpoint').value") == "main.c:99999"
    page.run("document.getElementById('breakpoint').select()")
    page.call("Input.insertText", text="RB0 rise")
    page.press("Enter")
    page.until("document.querySelectorAll('#breakpoints li').length === 1")
    assert page.run("document.getElementById('breakpoint').value") == ""
    assert text(page, "#breakpoint-said") == ""


COUNTING = """\
#pragma CLOCK_FREQ 4000000
char count;
void main(void)
{
    trisb = 0;
    count = 0;
    while (1) {
        count++;
        set_bit(portb, 0);
        delay_us(100);
        clear_bit(portb, 0);
        delay_us(200);
        delay_us(200);
    }
}
"""
"""RB0 rises for the 101st time about 50 ms after power-up, when `count` has gone past 100."""


def test_it_stops_where_a_condition_begins_to_hold(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    program = tmp_path / "counting.c"
    program.write_text(COUNTING)
    page = watch(program)
    page.click("#tab-source")
    page.run("document.getElementById('breakpoint').focus()")
    page.call("Input.insertText", text="count > 100")
    page.press("Enter")
    page.until("document.querySelectorAll('#breakpoints li').length === 1")
    page.click("#run")
    page.until("document.getElementById('said').textContent.startsWith('stopped at count > 100')")
    page.until("!watched.latest.running")
    assert 50_000 < page.run("watched.latest.cycle") < 52_000
    assert "set_bit(portb, 0)" in page.until("document.querySelector('.line.here')?.textContent")


@pytest.mark.campaign
def test_two_windows_have_moments_of_their_own_and_know_of_each_others_text(
    watch: Open,  # noqa: F811
    browser: Browser,
    tmp_path: Path,
) -> None:
    """What one saves is what the other goes on from, if it has nothing of its own."""
    job = copy(LAB8, tmp_path)
    first = watch(job)
    second = browser.page()
    second.open(first.run("location.href"))
    second.until("!document.getElementById('views').hidden && watched.latest && watched.waves.data")
    go(second, 500_000)
    first.call("Page.bringToFront")  # what is behind another window paints nothing
    go(first, 3_000_000)
    assert second.run("watched.latest.cycle") - 500_000 in range(3)
    assert first.run("watched.latest.cycle") - 3_000_000 in range(3)
    typed(first, "arm_deg = 120", "arm_deg = 150")
    first.until("!document.getElementById('save').disabled")
    first.click("#save")
    second.until("document.getElementById('job-text').value.includes('arm_deg = 150')")
    typed(second, "hold_s = 5", "hold_s = 4")
    second.until("!document.getElementById('save').disabled")
    second.click("#save")
    first.until("document.getElementById('job-text').value.includes('hold_s = 4')")
    assert "arm_deg = 150" in job.read_text() and "hold_s = 4" in job.read_text()
    assert second.problems == []
    second.close()


@pytest.mark.campaign
def test_a_build_that_takes_long_is_stopped_and_the_text_mended_on_the_page(
    watch: Open,  # noqa: F811
    tmp_path: Path,
) -> None:
    """Poses in no order, whose program would be searched for minutes; the old text builds again."""
    page = watch(copy(LAB8, tmp_path))
    angles = Random(1)
    poses = ", ".join(f"{{ arm_deg = {angles.randrange(181)}, hold_s = 0.02 }}" for _ in range(400))
    before = LAB8.read_text()
    long = before[: before.index("poses = [")] + f"poses = [{poses}]\n\n" + before[before.index("[frame]") :]
    everything = "(e => { e.focus(); e.select(); })(document.getElementById('job-text'))"
    page.run(everything)
    page.call("Input.insertText", text=long)
    page.until("!document.getElementById('build').disabled")
    page.click("#build")
    page.until("document.getElementById('build').textContent === 'stop'")
    page.click("#build")
    page.until("document.getElementById('build-progress').textContent.startsWith('stopped: ')")
    assert page.run("document.getElementById('job-text').value") == long
    page.run(everything)
    page.call("Input.insertText", text=before)
    build(page)
    assert page.until("document.getElementById('build-progress').dataset.exact") == "true"


@pytest.mark.campaign
def test_the_sliders_can_follow_the_chip_again(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(copy(LAB8, tmp_path))
    go(page, 1_000_000)
    slide(page, "77")
    go(page, 1_200_000)
    assert page.run("document.querySelector('#sliders input').value") == "77"
    page.click("#follow")
    go(page, 1_400_000)
    assert page.run("+document.querySelector('#sliders input').value") == pytest.approx(30, abs=0.2)


@pytest.mark.campaign
def test_far_requests_simulate_nothing(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(copy(LAB8, tmp_path))
    reach = page.run("watched.latest.reach")
    page.run("watched.waves.show(1e12, 1.00000001e12)")
    page.until("watched.waves.data.begin === 1e12")
    assert page.run("watched.waves.data.pulses.length") == 0
    page.run("document.getElementById('next-frame').click()")
    page.until(f"watched.latest.reach !== {reach}")
    assert page.run("watched.latest.reach") < 1_000_000


def test_names_and_comments_that_look_like_pages_stay_text(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    program = tmp_path / "<img src=x onerror=hacked=1>.c"
    program.write_text(f"// <script>hacked = 1</script><img src=x onerror=hacked=1>\n{NO_TRIS}")
    page = watch(program)
    page.click("#labels button")
    page.until("!document.getElementById('explanation').hidden")
    assert text(page, "#name") == program.name and "<script>" in text(page, "#source")
    assert page.run("typeof hacked") == "undefined"
    assert page.run("document.querySelectorAll('img, #source script, #views script').length") == 0


@pytest.mark.campaign
def test_two_fingers_zoom_the_waves_and_one_finger_measures(watch: Open, tmp_path: Path) -> None:  # noqa: F811
    page = watch(copy(LAB8, tmp_path), width=390, height=844)
    page.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
    page.click("#which")
    page.run("document.getElementById('waves').scrollIntoView({ block: 'center' })")
    x, y = page.run(
        "(b => [b.x + b.width * 0.6, b.y + b.height / 2])"
        "(document.getElementById('waves').getBoundingClientRect())"
    )
    span = page.run("watched.waves.end - watched.waves.begin")

    def touch(kind: str, *places: float) -> None:
        points = [{"x": place, "y": y, "id": number} for number, place in enumerate(places)]
        page.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    touch("touchStart", x - 20, x + 20)
    touch("touchMove", x - 40, x + 40)
    touch("touchMove", x - 80, x + 80)
    touch("touchEnd")
    page.until(f"Math.abs((watched.waves.end - watched.waves.begin) / {span} - 0.25) < 0.03")
    touch("touchStart", x)
    touch("touchEnd")
    page.until("watched.waves.cursors[1] !== null")
    assert "cycle" in text(page, "#readout")
