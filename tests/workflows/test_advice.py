"""The error of the pulses has a limit, and what is said to fit does fit."""

import re
from collections import Counter
from functools import cache

import pytest

from servogen.engines.firmware import ResourceError
from servogen.engines.player.shares import shares
from servogen.errors import InputError, ServogenError
from servogen.job import load, loads, plan_job
from servogen.job.starter import starter
from servogen.workflows import advice
from servogen.workflows import pair as pair_workflow
from servogen.workflows.engines import planned
from servogen.workflows.job_build import build
from servogen.workflows.pair import build_pair
from tests.engines.player.player_jobs import ROOT, job_text, poses
from tests.two_chips import ARM, TWO

TRIPOD = (ROOT / "jobs" / "hexapod-tripod.toml").read_text()
MORE = ", { turn_deg = 20, cycles = 3 }, { forward_mm = -30, cycles = 3 }, { turn_deg = -20, cycles = 3 }"
ROUTE = "route = [{ forward_mm = 40, cycles = 4 }]"
LONG = TRIPOD.replace('gait = "tripod"', 'gait = "wave"').replace(
    ROUTE, f"route = [{{ forward_mm = 40, cycles = 3 }}{MORE}]"
)


def refused(text: str) -> ServogenError:
    with pytest.raises(ServogenError) as caught:
        build(plan_job(loads(text, "job.toml")))
    return caught.value


def test_an_error_without_advice_is_not_its_own_cause() -> None:
    """Libraries that follow the causes of an error, to send it to another process, would never end."""
    error = refused(TWO + ARM.format(elbow="RB0"))
    assert error.code == "chip-pair" and error.__cause__ is not error


@pytest.mark.campaign
def test_beyond_its_limit_nothing_is_built_and_within_it_all_is() -> None:
    """A Tiny-S turns 0.36° in a µs; the tripod is 1.487 µs from its plan."""
    with pytest.raises(ResourceError) as caught:
        planned(plan_job(loads(TRIPOD + "max_error_us = 1.3\n", "job.toml")))
    error = caught.value
    assert error.code == "beyond-max-error"
    assert error.location is not None and error.location.key == "firmware.max_error_us"
    assert "1.487 µs, 0.535°" in error.message
    assert "max_error_us allows 1.3 µs" in error.message
    assert planned(plan_job(loads(TRIPOD + "max_error_us = 1.49\n", "job.toml"))).engine == "player"


def test_without_a_limit_of_its_own_a_job_has_ten_microseconds() -> None:
    """At 125 kHz a cycle is 32 µs: a width is up to 16 µs from the planned one."""
    slow = job_text(1, poses([[31], [77.7]], 1), clock_hz=125_000).replace('"player"', '"sequence"')
    assert refused(slow).code == "beyond-max-error"
    allowed = slow.replace('"sequence"', '"sequence"\nmax_error_us = 16')
    assert planned(plan_job(loads(allowed, "job.toml"))).plan.schedule.plan_error is not None


@pytest.mark.parametrize("limit", ["0", "-1", "nan", '"10"'])
def test_a_limit_is_a_number_above_zero(limit: str) -> None:
    with pytest.raises(InputError, match=r"firmware\.max_error_us"):
        loads(TRIPOD + f"max_error_us = {limit}\n", "job.toml")


@cache
def too_long(low: float, high: float) -> str:
    """Return a job of thirteen servos whose limit is `high`."""
    motion = poses([[low] * 13, [high] * 13], 1.28)
    return job_text(13, motion, limits=(10, high), firmware="soft_start_s = 0.16")


@cache
def frame_too_short() -> ServogenError:
    return refused(too_long(10, 178))


@pytest.mark.campaign
def test_a_period_that_is_said_to_fit_does_and_a_shorter_one_does_not() -> None:
    error, text = frame_too_short(), too_long(10, 178)
    assert error.code == "frame-too-short" and error.hint is not None
    found = re.search(r"period_us = (\d+) \((\d+) bytes of motion, (\d+) words, [\d.]+ µs\)", error.hint)
    assert found
    longer = text.replace("[frame]", f"[frame]\nperiod_us = {found[1]}")
    made = planned(plan_job(loads(longer, "job.toml")))
    assert (made.data_bytes, made.make("c2c").compilation.words) == (int(found[2]), int(found[3]))
    # The slots and the C of the frame add up to what the refusal says it needs.
    needed = re.search(r"take (\d+) cycles", error.message)
    slots = re.search(r"of the frame: (.*), the C for the next frame (\d+): (\d+) of 20000 µs", error.hint)
    assert needed and slots
    shown = [int(slot.split()[-1]) for slot in slots[1].split(", ")]
    assert len(shown) == 7 and sum(shown) + int(slots[2]) == int(slots[3]) == int(needed[1])


def test_shorter_pulses_that_are_said_to_fit_build_once_they_are_in_the_file() -> None:
    error = frame_too_short()
    assert error.hint is not None
    found = re.search(
        r"max_deg = ([\d.]+) of (.*), and no pose beyond \((\d+) bytes of motion, (\d+)", error.hint
    )
    assert found and found[2].split(", ") == [f"s{number}" for number in range(13)]
    done = build(plan_job(loads(too_long(10, float(found[1])), "job.toml")))
    assert done.exact
    assert done.programs[0].firmware.compilation.words == int(found[4])


@pytest.mark.campaign
def test_limits_that_are_said_to_fit_build_once_they_are_in_the_file() -> None:
    """A slot keeps 20 µs beyond the longest pulse unless the servo's limits are narrower."""
    text = job_text(
        13, poses([[10] * 13, [158.4] * 13], 1.28), limits=(10, 178), firmware="soft_start_s = 0.16"
    )
    error = refused(text)
    assert error.code == "frame-too-short" and error.hint is not None
    limits = re.findall(r"(s\d+) max_deg = ([\d.]+)(?=, s| \()", error.hint)
    assert [angle for _, angle in limits] == ["158.4", "158.4"]
    for name, angle in limits:
        begin = text.index(f'name = "{name}"')
        text = text[:begin] + text[begin:].replace("max_deg = 178", f"max_deg = {angle}", 1)
    assert planned(plan_job(loads(text, "job.toml"))).make("c2c").timing_budgets[1].left


def test_each_change_is_announced_and_none_is_tried_once_time_is_up() -> None:
    job = plan_job(loads(TRIPOD, "job.toml"))
    error = InputError("beyond-max-error", "too far")
    told: list[str] = []
    clock = iter([0.0, 1.0, *[advice.MAX_S + 1] * 99])
    found = advice.with_advice(job, error, told.append, lambda: next(clock))
    assert told == ["trying cycle_s = 1.2"]
    assert found.hint is not None and "no further changes were tried" in found.hint
    assert found.details["advice"]["stopped_early"] is True  # type: ignore[index]


def test_once_time_is_up_no_segment_of_a_route_is_tried_either(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two segments, only the first begins in time; the hint says so, and so do the details."""
    route = "route = [{ forward_mm = 40, cycles = 1 }, { turn_deg = 20, cycles = 1 }]"
    job = plan_job(loads(TRIPOD.replace(ROUTE, route), "job.toml"))
    monkeypatch.setattr(advice, "change_groups", lambda *_: [])
    monkeypatch.setattr(advice, "table_shares", lambda *_: None)
    monkeypatch.setattr(advice, "tried_fit", lambda *_: None)
    told: list[str] = []
    clock = iter([0.0, advice.MAX_S, *[advice.MAX_S + 0.1] * 9])
    found = advice.with_advice(job, ResourceError("does-not-fit", "no"), told.append, lambda: next(clock))
    assert told == ["trying segment 1 alone"]
    assert found.hint is not None and "no further changes were tried" in found.hint
    assert found.details["advice"]["stopped_early"] is True  # type: ignore[index]


def numbers(text: str) -> list[str]:
    """The numbers of a table's lines, without those in comments."""
    return re.findall(r"\b\w+\b", re.sub(r"/\*.*?\*/", "", text))


@pytest.mark.parametrize("name", ["hexapod-turn", "hexapod-command", "scara-pick"])
def test_the_shares_of_all_parts_are_the_bytes_of_the_tables_in_the_c(name: str) -> None:
    """Counted in the committed C: two tables, the laws, and three bytes for each timing."""
    text = (ROOT / "firmware" / name / "main.c2c.c").read_text()
    bodies = dict(re.findall(r"char (\w+)\[\] = {(.*?)\n}", text, flags=re.DOTALL))
    tables = {key: len(numbers(body)) for key, body in bodies.items()}
    sizes: Counter[str] = Counter()
    part = ""
    for line in bodies["CONSTANT"].splitlines():  # a part begins at a line with its name
        part = (re.findall(r"/\* (\w+)", line) or [part])[0]
        sizes[part] += len(numbers(line))
    laws = sum(sizes[key] for key in ("laws", "LAW", "LIFT_LAW", "SPOT_LAW"))
    parts = shares(plan_job(load(ROOT / "jobs" / f"{name}.toml"))).parts
    assert sum(part.rows for part in parts) == tables["ROW"]
    assert sum(part.script for part in parts) == tables["SCRIPT"]
    assert sum(part.timings for part in parts) == 3 * sizes["FRAMES"]
    assert sum(part.laws for part in parts) == laws
    assert all(part.bytes == part.rows + part.script + part.timings + part.laws for part in parts)


def test_a_part_takes_what_the_motion_grows_by_with_it() -> None:
    """hexapod-turn is planned with and without its second segment; only the way back is shared."""
    text = (ROOT / "jobs" / "hexapod-turn.toml").read_text()
    alone = text.replace(", { turn_deg = 20, cycles = 9 }", "")
    assert alone != text
    both, one = (shares(plan_job(loads(each, "job.toml"))) for each in (text, alone))
    turn = next(part for part in both.parts if "turn_deg" in part.name)
    assert abs(turn.bytes - (both.bytes - one.bytes)) <= 12


@pytest.mark.campaign
def test_each_change_that_is_said_to_fit_a_walk_does() -> None:
    error = refused(LONG)
    assert error.code == "does-not-fit" and error.hint is not None
    fits = error.hint
    assert 'gait = "tripod"' in fits
    changed = LONG.replace('gait = "wave"', 'gait = "tripod"')
    made = planned(plan_job(loads(changed, "job.toml")))
    words = made.make("c2c").compilation.words
    error_us = made.plan.schedule.plan_error
    assert error_us is not None
    assert (
        f"less: {made.data_bytes} bytes of motion, {words} words, {error_us.width_us:g} µs)"
        in fits[fits.index('gait = "tripod"') :]
    )
    alone = LONG.replace(MORE, "")
    data = planned(plan_job(loads(alone, "job.toml"))).data_bytes
    assert f"segment 1 alone takes {data} bytes of motion" in fits
    assert "segment 4 alone takes" in fits
    advice = error.details["advice"]
    assert isinstance(advice, dict)
    (tripod,) = (each for each in advice["proposals"] if each["change"] == 'gait = "tripod"')
    assert (tripod["motion_bytes"], tripod["words"]) == (made.data_bytes, words)
    assert f"({advice['motion_bytes'] - made.data_bytes} bytes less: {made.data_bytes} bytes" in fits
    # The refusal counts the poses itself; the parts add up to them.
    poses_bytes = re.search(r"poses have (\d+) bytes", error.message)
    assert poses_bytes and sum(part["rows"] for part in advice["parts"]) == int(poses_bytes[1])
    turn = next(part for part in advice["parts"] if part["part"] == "segment 2 (turn_deg = 20)")
    assert f"segment 2 (turn_deg = 20): {turn['bytes']} of {advice['motion_bytes']} bytes" in fits


@pytest.mark.campaign
def test_a_walk_on_command_that_does_not_fit_has_changes_that_do() -> None:
    text = (ROOT / "jobs" / "hexapod-command.toml").read_text().replace('gait = "tripod"', 'gait = "wave"')
    error = refused(text)
    assert error.code == "does-not-fit" and error.hint is not None
    assert 'gait = "tripod" (' in error.hint
    found = re.search(
        r"commands without turn_deg \(\d+ bytes less: (\d+) bytes of motion, (\d+) words, ([\d.]+) µs\)",
        error.hint,
    )
    assert found
    made = planned(plan_job(loads(text.replace("turn_deg = 20, ", ""), "job.toml")))
    assert made.data_bytes == int(found[1])
    assert made.make("c2c").compilation.words == int(found[2])
    needed = re.search(r"the program needs (\d+) words", error.message)
    words = re.search(r"of the words: the motion (\d+), all else (\d+): (\d+) of 1024", error.hint)
    assert needed and words and int(words[1]) + int(words[2]) == int(words[3]) == int(needed[1])


def test_a_limit_that_no_engine_keeps_has_a_larger_one_that_fits() -> None:
    """The widths of lab9-exercise are whole cycles, 0.433 µs off."""
    text = (ROOT / "jobs" / "lab9-exercise.toml").read_text() + "\n[firmware]\nmax_error_us = 0.4\n"
    error = refused(text)
    assert error.code == "beyond-max-error" and "nor can the player" in error.message
    assert error.hint is not None and re.search(r"max_error_us = 1 \([^)]*, 0\.433 µs\)", error.hint)
    assert planned(plan_job(loads(text.replace("= 0.4\n", "= 1\n"), "job.toml"))).engine == "sequence"


def test_nothing_is_tried_for_other_errors() -> None:
    """A pulse of 10 cycles fits no change of the motion."""
    text = job_text(1, poses([[31], [77]], 1), clock_hz=125_000, firmware="max_error_us = 20")
    error = refused(text)
    assert error.code == "pulse-too-short" and "what fits" not in str(error)


@pytest.mark.parametrize(("count", "tried"), [(500, True), (501, False)])
def test_for_motions_far_beyond_the_chip_nothing_is_tried(
    count: int, tried: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[object] = []

    def refuse(job: object) -> None:
        calls.append(job)
        raise ResourceError("does-not-fit", "no")

    monkeypatch.setattr(advice, "planned", refuse)
    monkeypatch.setattr(advice, "shares", refuse)
    moments = ", ".join(f"{{ arm_deg = {number % 181}, hold_s = 0.02 }}" for number in range(count))
    job = plan_job(
        loads(
            '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
            f'[[servo]]\nname = "arm"\npin = "RB0"\nmodel = "futaba-s3001"\n[motion]\nposes = [{moments}]\n',
            "job.toml",
        )
    )
    error = ResourceError("does-not-fit", "too long")
    assert advice.with_advice(job, error) is error
    assert bool(calls) is tried


LAW = """[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"
[motion]
law = "cubic"
poses = [
    { arm_deg = 30, hold_s = 2 },
    { arm_deg = 90, move_s = 1.4, hold_s = 5 },
    { arm_deg = 120, move_s = 0.8, hold_s = 3 },
]
"""


@pytest.mark.campaign
def test_a_larger_engine_than_the_smallest_says_why() -> None:
    """The widths of 20 s of frames are more words than the chip has; the exercise needs few."""
    job = plan_job(loads(LAW.replace("move_s = 1.4", "move_s = 20"), "job.toml"))
    played = planned(job)
    (why,) = [note.message for note in played.job.notes if note.code == "engine-chosen"]
    lines, error = len(played.make("c2c").text.splitlines()), played.plan.schedule.plan_error_us
    assert why.endswith(f"its price: {lines} lines of C, and pulses within {error:g} µs of the plan")
    assert why.startswith(
        "the player plays this motion: planned, but more than the sequence engine can hold: "
    )
    assert "the chip has 1024" in why
    easy = plan_job(loads((ROOT / "jobs" / "lab8-exercise.toml").read_text(), "job.toml"))
    assert not [note for note in planned(easy).job.notes if note.code == "engine-chosen"]


@pytest.mark.campaign
def test_the_advice_for_one_engine_counts_no_bytes_of_another() -> None:
    job = plan_job(
        loads(LAW.replace("move_s = 1.4", "move_s = 20") + '[firmware]\nengine = "sequence"\n', "job.toml")
    )
    found = advice.with_advice(job, ResourceError("does-not-fit", "too large"))
    assert "by part" not in str(found) and found.details["advice"]["motion_bytes"] is None  # type: ignore[index]


@pytest.mark.parametrize(("middle_us", "named"), [(1500, False), (1501, False), (1515, True)])
def test_where_the_pulses_miss_a_bent_calibration_is_named(middle_us: int, named: bool) -> None:
    """1500 µs is on the line from 1000 µs at 0° to 2000 µs at 180°."""
    points = f"points = [{{ angle_deg = 0, width_us = 1000 }}, {{ angle_deg = 90, width_us = {middle_us} }}, "
    points += "{ angle_deg = 180, width_us = 2000 }]"
    text = LAW.replace('model = "futaba-s3001"', f'model = "futaba-s3001"\n{points}')
    text = (
        text[: text.index("law =")]
        + "poses = [{ arm_deg = 33.3, hold_s = 1 }, { arm_deg = 90.1, hold_s = 1 }]\n"
    )
    with pytest.raises(ResourceError) as caught:
        planned(plan_job(loads(text + '[firmware]\nengine = "sequence"\nmax_error_us = 0.01\n', "job.toml")))
    assert (
        "the calibration of arm is bent: a point is 15.0 µs off a straight line" in str(caught.value)
    ) is named


def turning(turn_deg: float, cycle_s: float = 1.28) -> str:
    """The job of a new quadruped with three joints a leg that turns on the spot."""
    text = starter("quadruped-coxa-femur-tibia", "mg996r", ROOT / "my.toml")
    text = text.replace("{ forward_mm = 8 }", f"{{ turn_deg = {turn_deg:g} }}")
    return text.replace("# cycle_s = 1.28 ", f"cycle_s = {cycle_s:g} ")


def on_two_chips(text: str, last: str) -> str:
    """The job with two chips, as docs/job.md describes them; the servos from `last` on are on the second."""
    begin = text.index("[chip]")
    end = text.index("\n\n", begin)
    chip = text[begin:end].replace("[chip]", "[[chip]]")
    names = re.findall(r'^name = "(.*-.*)"', text, re.MULTILINE)
    names = [name for name in names if name != "quadruped-coxa-femur-tibia"]
    place = names.index(last)
    servos = [", ".join(f'"{name}"' for name in part) for part in (names[:place], names[place:])]
    chips = [f'{chip}\nwire = "RB0"\nservos = [{part}]\n' for part in servos]
    return text[:begin] + "".join(chips) + text[end:]


def test_what_two_chips_cannot_hold_is_refused_with_what_they_can(monkeypatch: pytest.MonkeyPatch) -> None:
    def no(*_: object) -> None:
        raise ResourceError("does-not-fit", "no")

    monkeypatch.setattr(pair_workflow, "build_alone", no)
    monkeypatch.setattr(advice, "tried_fit", lambda *_: advice.ResourceUse(1000, 600, 9.5, 2))
    with pytest.raises(ServogenError) as caught:
        build_pair(plan_job(loads(on_two_chips(turning(15), "RF-coxa"), "my.toml")))
    assert "turn_deg = 11.2 (" in str(caught.value) and "1000 words or fewer each" in str(caught.value)


def test_two_chips_are_tried_where_a_pin_is_left_for_the_wire(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not of a job that has two, nor of one with a button, whose chip no other can follow."""
    monkeypatch.setattr(advice, "tried_fit", lambda *_: None)
    monkeypatch.setattr(advice, "table_shares", lambda *_: None)
    button = turning(15).replace('engine = "player"', 'engine = "player"\nstart_pin = "RA4"')
    for text, tried in ((turning(15), True), (button, False), (on_two_chips(turning(15), "RF-coxa"), False)):
        told: list[str] = []
        advice.with_advice(plan_job(loads(text, "my.toml")), ResourceError("does-not-fit", "no"), told.append)
        assert any("two chips" in each for each in told) is tried
