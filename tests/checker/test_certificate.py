"""What the checker accepts, and that it refuses everything else, saying where and why."""

from __future__ import annotations

import hashlib
import json
import lzma
import re
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from servogen.checker import Checked, Refused, check_certificate, read_certificate
from servogen.checker.certificate import fingerprint
from servogen.checker.check import WATCHDOG_US
from servogen.checker.plan import OVER, PlanPosition, read_plan
from servogen.errors import InputError
from servogen.pic import device
from servogen.pic.image import Image, to_hex
from servogen.pic.isa import encode
from tests.campaigns import sampled
from tests.checker import certify
from tests.checker.certify import PERIOD, STOP, WIDTH
from tests.checker.plans import after
from tests.prove import certificate_mutants

ROOT = Path(__file__).parents[2]
FRAME = 6
"""The address at which a frame of the test programs begins."""


def check(packed: bytes, image: Image, schedule: bytes, allowed: Collection[str] = ()) -> Checked:
    claim = read_certificate(packed, "certificate")
    return check_certificate(claim, image, schedule, "schedule.json", allowed)


def certified(image: Image, schedule: bytes) -> bytes:
    """A certificate made by the tests, with cuts at the frame and at the endless loop after a stop."""
    return certify.certify(
        image, schedule, [FRAME, max(image.program)] if b"buttons" in schedule else [FRAME]
    )


def refusal(image: Image, schedule: bytes) -> str:
    """What the checker finds wrong with a program when it lists the states itself."""
    with pytest.raises(Refused) as refused:
        certified(image, schedule)
    return str(refused.value)


def test_one_servo_is_one_state_that_repeats_each_frame() -> None:
    image, schedule = certify.plain_program(), certify.schedule()
    packed = certified(image, schedule)
    assert certify.unpack(packed)["count"] == 1
    found = check(packed, image, schedule)
    assert replace(found, over=()) == Checked(
        states=1, frames=2, cycles=2 * PERIOD + FRAME, forks=0, silence=6
    )
    assert found.over == (
        "every value of RAM and registers after a reset in any cycle",
        "every level of every input in every cycle",
        "every content of the EEPROM",
    )


@pytest.mark.parametrize("cycle", [1, 2, WIDTH])
def test_a_cut_may_be_anywhere_in_the_frame(cycle: int) -> None:
    """The rise is in cycle 0 of the frame; the delay begins in cycle 1, and the fall is in cycle 300."""
    image, schedule = certify.plain_program(), certify.schedule()
    fall = next(address for address, word in image.program.items() if word == encode("BCF", f=6))
    packed = certify.certify(image, schedule, [FRAME + cycle if cycle < WIDTH else fall])
    assert check(packed, image, schedule).states <= 2
    assert certify.unpack(packed)["columns"]["time"]["delta"][0] == cycle


@pytest.mark.parametrize(
    ("config", "clock_hz"), [("0x3ff3", 4_000_000), ("0x3ff1", 4_000_001), ("0x3ff0", 200_001)]
)
def test_an_oscillator_without_an_exact_frequency_is_refused(config: str, clock_hz: int) -> None:
    image = certify.plain_program(config=config)
    schedule = certify.schedule().replace(b"4000000", str(clock_hz).encode())
    with pytest.raises(Refused, match="no exact frequency"):
        check(certified(image, schedule), image, schedule)


@pytest.mark.parametrize(("device", "hz"), [("PIC16F84", 10_000_000), ("PIC16F84A", 20_000_000)])
def test_a_clock_that_is_too_fast_for_the_chip_is_refused(device: str, hz: int) -> None:
    """DS30430 section 8.1, DS35007 section 6.1; the oscillator is HS."""
    image = certify.plain_program(config="0x3ff2")
    allowed, faster = (
        certify.schedule()
        .replace(b'PIC16F84"', device.encode() + b'"')
        .replace(b"4000000", str(clock).encode())
        for clock in (hz, hz + 4)
    )
    assert check(certified(image, allowed), image, allowed).states == 1
    with pytest.raises(Refused, match=r"faster than the chip|no exact frequency"):
        check(certified(image, faster), image, faster)


def test_a_button_splits_every_frame_in_which_it_is_read() -> None:
    image, schedule = certify.button_program(), certify.schedule(STOP)
    found = check(certified(image, schedule), image, schedule)
    assert found.forks == 4  # seen 0, 1 and 2 times in a row before this frame; and once more from power-up


@pytest.mark.parametrize(
    ("image", "schedule", "why"),
    sampled(
        [
            (certify.button_program(seen=2), certify.schedule(STOP), "a missing edge"),
            (certify.button_program(seen=4), certify.schedule(STOP), "an edge that is not expected"),
            (certify.button_program(read="btfsc 5,4"), certify.schedule(STOP), "a missing edge|an edge"),
            (
                certify.button_program(read="btfss 5,3"),
                certify.schedule(STOP),
                "an input was not read in the frame",
            ),
            (certify.plain_program(), certify.schedule(STOP), "an input was not read in the frame"),
            (certify.button_program(), certify.schedule(), "a missing edge"),
            (certify.plain_program(width=WIDTH + 1), certify.schedule(), "a missing edge"),
            (certify.plain_program(width=WIDTH - 1), certify.schedule(), "an edge that is not expected"),
            (certify.plain_program(config="0x3ff5"), certify.schedule(), "a watchdog that may time out"),
            (certify.plain_program(clear="sleep"), certify.schedule(), "SLEEP"),
            (certify.plain_program(clear="return"), certify.schedule(), "a return with an empty stack"),
            (certify.plain_program(clear="call $"), certify.schedule(), "a stack of more than eight levels"),
            (
                certify.plain_program(clear="goto 1000"),
                certify.schedule(),
                "a word that is not an instruction",
            ),
            (certify.plain_program(clear="movwf 6"), certify.schedule(), "an edge that is not expected"),
            (certify.plain_program(clear="rlf 6,f"), certify.schedule(), "a pin whose level is unknown"),
            (certify.plain_program(clear="btfsc 0x30,0"), certify.schedule(), "a missing edge|an edge"),
            (certify.plain_program(clear="btfsc 5,2"), certify.schedule(), "a missing edge|an edge"),
        ],
        6,
    ),
    ids=range(17),
)
def test_a_wrong_program_has_no_certificate(image: Image, schedule: bytes, why: str) -> None:
    assert re.search(why, refusal(image, schedule))


def test_a_refusal_says_which_state_cycle_frame_address_and_pins() -> None:
    """Two cycles late: the fall is due in cycle 300 of the frame, in which a taken skip begins."""
    said = refusal(certify.plain_program(width=WIDTH + 2), certify.schedule())
    assert re.fullmatch(
        rf"{FRAME + WIDTH + 2} cycles after power-up, at address 0x0[0-9A-F]{{2}}, frame 0, "
        rf"cycle {WIDTH + 2}, high pins: RB0: a missing edge",
        said,
    )


def test_a_watchdog_that_is_cleared_in_every_frame_does_no_harm() -> None:
    image, schedule = certify.plain_program(config="0x3ff5", clear="clrwdt"), certify.schedule()
    assert check(certified(image, schedule), image, schedule).states == 1


@pytest.mark.parametrize("cleared", [True, False])
def test_a_prescaler_that_counted_for_tmr0_may_let_the_watchdog_time_out_early(cleared: bool) -> None:
    """DS35007 section 5.2.1: it keeps its count when PSA is set, here after it counted 128 cycles for TMR0.
    Then its ratio becomes 1:128, and 10 ms without CLRWDT follow.
    """
    option = " bsf 3,5\n movlw 0x{}\n movwf 1\n bcf 3,5\n"
    start = " org 0x200\nstart clrf 6\n bsf 3,5\n clrf 6\n bcf 3,5\n clrf 0x21\n clrwdt\n"
    start += option.format("D7") + " clrf 1\n" + certify.delay(128)
    start += option.format("D8") + option.format("DF") + " clrwdt\n" * cleared + " clrf 1\n"
    start += certify.delay(10_000) + " clrwdt\n goto frame\n"
    image = certify.plain_program(config="0x3ff5", clear="clrwdt", first="goto start", after=start)
    if cleared:
        assert check(certified(image, certify.schedule()), image, certify.schedule()).frames
    else:
        assert "a watchdog that may time out" in refusal(image, certify.schedule())


def test_a_certificate_of_something_else_is_refused() -> None:
    image, schedule = certify.plain_program(), certify.schedule()
    packed = certified(image, schedule)
    other = replace(image, eeprom={0: 1})
    with pytest.raises(Refused, match="another program"):
        check(packed, other, schedule)
    with pytest.raises(Refused, match="another schedule"):
        check(packed, image, schedule + b" ")
    data = certify.unpack(packed)
    data["image"] = fingerprint(certify.plain_program(width=WIDTH + 1))
    with pytest.raises(Refused, match="a missing edge"):
        check(certify.pack(data), certify.plain_program(width=WIDTH + 1), schedule)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda data: data["columns"].pop("w"), "columns w"),
        (lambda data: data.update(format=1), "format 2"),
        (lambda data: data.update(count=True), "it needs format 2"),
        (lambda data: data.update(count=10**9), "count or cuts"),
        (lambda data: data.update(cuts=[1024]), "count or cuts"),
        (lambda data: data.update(cuts=[[]]), "count or cuts"),
        (lambda data: data.update(held={"RA9": 0}), "held"),
        (lambda data: data["columns"].update(pc={"all": 1024}), "column pc"),
        (lambda data: data["columns"].update(pc={"all": 1.0}), "column pc"),
        (lambda data: data["columns"].update(pc={"delta": [6, 0]}), "column pc"),
        (lambda data: data["columns"].update(pc={"delta": [1 << 70]}), "too large|int"),
        (lambda data: data["columns"].update(w={"all": 0x0101}), "column w"),
        (lambda data: data["columns"].update(w={"all": 0x1FF00}), "column w"),
        (lambda data: data["columns"].update(status={"all": 0x10000}), "column status"),
        (lambda data: data["columns"].update(intcon={"all": 0x8000}), "column intcon"),
        (lambda data: data["columns"].update(place={"all": 9}), "column place"),
        (lambda data: data.update(places=[[[1, 1, 0, 0], 1 << 13, 0]]), "places"),
        (lambda data: data["columns"].update(w=[]), "column|attribute"),
    ],
)
def test_what_is_not_a_certificate_is_bad_input(change: Callable[[dict[str, Any]], Any], why: str) -> None:
    data = certify.unpack(certified(certify.plain_program(), certify.schedule()))
    change(data)
    with pytest.raises(InputError, match=why):
        certify.reread(data)


def test_a_listed_state_in_which_an_interrupt_may_come_at_any_time_is_refused() -> None:
    """TMR0 is unknown there, so that the run from this state could not know when the interrupt comes."""
    image, schedule = certify.plain_program(), certify.schedule()
    data = certify.unpack(certified(image, schedule))
    data["count"] = 2
    for column in data["columns"].values():
        column["delta"].append(0)
    for enabled in (0xA0, 0x90, 0x88):
        data["columns"]["intcon"] = {"delta": [0, enabled]}
        with pytest.raises(Refused, match=r"cycles after state 1.*: (a missing edge|the state is within)"):
            check(certify.pack(data), image, schedule)


def test_a_position_that_the_schedule_does_not_have_is_refused() -> None:
    image, schedule = certify.plain_program(), certify.schedule()
    for key, value, why in (
        ("frame", {"all": 1}, "fewer frames"),
        ("place", {"all": 0}, "none such"),
    ):
        data = certify.unpack(certified(image, schedule))
        data["columns"][key] = value
        data["places"] = data["places"] if key == "frame" else [[[[]], 0, 0]]
        with pytest.raises(Refused, match=why):
            check(certify.pack(data), image, schedule)


def test_a_held_input_is_part_of_the_claim_and_allowed_by_name_only() -> None:
    image, schedule = certify.plain_program(clear="btfsc 5,2"), certify.schedule()
    data = certify.unpack(certified(certify.plain_program(), schedule)) | {"image": fingerprint(image)}
    data["held"] = {"RA2": 1}
    assert certify.reread(data).held == {"RA2": 1}
    with pytest.raises(Refused, match="it holds RA2 at 1: the theorem is about every level"):
        check(certify.pack(data), image, schedule)
    with pytest.raises(Refused, match="it holds RA2"):
        check(certify.pack(data), image, schedule, ["RA3"])
    assert check(certify.pack(data), image, schedule, ["RA2"]).restrictions == (
        "RA2 held at 1, as was allowed",
    )
    # A schedule that states one level, and no rule, is about that level: no other is allowed by itself.
    stating = json.dumps(json.loads(schedule) | {"inputs": [{"pin": "RA2", "level": 1}]}).encode()
    data["schedule"] = hashlib.sha256(stating).hexdigest()
    found = check(certify.pack(data), image, stating)
    assert found.restrictions == ("RA2 held at 1, the only level that the schedule is about",)
    assert "every level of every input that is not held in every cycle" in found.over
    with pytest.raises(Refused, match="it holds RA2 at 0"):
        check(certify.pack(data | {"held": {"RA2": 0}}), image, stating)
    data["schedule"] = hashlib.sha256(schedule).hexdigest()
    for held in ({"RA2": 0}, {"RA3": 1}, {}):  # the skip shortens the frame
        data["held"] = held
        with pytest.raises(Refused, match=r"no listed|missing"):
            check(certify.pack(data), image, schedule, ["RA2", "RA3"])


def test_a_held_button_needs_its_name_also_where_the_schedule_states_its_level() -> None:
    """The button's other level has a meaning, so a certificate of one level is not about the schedule."""
    stop = {**STOP, "pulses": "hold"}
    schedule = json.loads(certify.schedule(stop)) | {"inputs": [{"pin": "RA4", "level": 1}]}
    text = json.dumps(schedule).encode()
    image = certify.plain_program()
    data = certify.unpack(certified(image, certify.schedule()))
    data |= {"schedule": hashlib.sha256(text).hexdigest(), "held": {"RA4": 1}}
    with pytest.raises(Refused, match="it holds RA4 at 1"):
        check(certify.pack(data), image, text)
    assert check(certify.pack(data), image, text, ["RA4"]).restrictions


@pytest.mark.parametrize("limit", ["MAX_CYCLES", "MAX_ROWS", "MAX_RUNS"])
def test_the_work_is_bounded(limit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    image, schedule = certify.button_program(), certify.schedule(STOP)
    packed = certified(image, schedule)
    monkeypatch.setattr("servogen.checker.check." + limit, 0)
    with pytest.raises(Refused, match="than"):
        check(packed, image, schedule)


def test_a_certificate_may_list_as_many_states_as_the_checker_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    packed = certified(certify.button_program(), certify.schedule(STOP))
    count = certify.unpack(packed)["count"]
    monkeypatch.setattr("servogen.checker.certificate.MAX_STATES", count)
    assert read_certificate(packed, "certificate").count == count
    monkeypatch.setattr("servogen.checker.certificate.MAX_STATES", count - 1)
    with pytest.raises(InputError, match="count or cuts"):
        read_certificate(packed, "certificate")


def test_broken_and_huge_files_are_bad_input() -> None:
    good = certified(certify.plain_program(), certify.schedule())
    huge = lzma.compress(b"0" * (65 << 20))
    deep = lzma.compress(b"[" * 100_000)
    for bad in (
        b"",
        b"no",
        good[:-9],
        good + b"x",
        good + good,
        huge,
        deep,
        lzma.compress(b"[]"),
        lzma.compress(b"\xff"),
    ):
        with pytest.raises(InputError, match="not a certificate"):
            read_certificate(bad, "certificate")


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"[]",
        b"{}",
        b"[" * 100_000,
        certify.schedule().replace(b"RB0", b"RC0"),
        certify.schedule(width=PERIOD),
    ],
)
def test_what_is_not_a_schedule_is_bad_input(text: bytes) -> None:
    with pytest.raises(InputError, match="not a schedule"):
        read_plan(text, "schedule.json")


@pytest.mark.campaign
def test_every_mutant_of_a_certificate_is_refused_or_equivalent() -> None:
    """Many more: `python -m tests.prove.certificate_mutants`."""
    image, schedule = certify.button_program(), certify.schedule(STOP)
    case = certificate_mutants.Subject(image, schedule, certify.unpack(certified(image, schedule)))
    counts, accepted = certificate_mutants.run(case, 60, 1)
    assert not accepted
    assert counts["refused"] > 30
    programs, kept = certificate_mutants.run_programs(case, 60, 1)
    assert not kept
    assert programs["refused"] > 40


def test_the_state_machine_of_the_buttons() -> None:
    """docs/firmware.md, sentence by sentence, with two frames of lead-in and a loop of one."""
    data = json.loads(certify.schedule(STOP | {"start": {"pin": "RA3", "level": 0}}))
    data["lead_in"] = [{"frames": 3, "pulses": [[0, 100]]}, {"frames": 1, "pulses": [[0, 200]]}]
    released, start, stop, both = 0x18, 0x10, 0x08, 0
    plan = read_plan(json.dumps(data).encode(), "schedule.json")

    def frames(levels: list[int]) -> list[tuple[int, int]]:
        position, found = plan.first, []
        for level in levels:
            position = after(plan, position, level)
            found.append((position.frame, position.memory[1]))
        return found

    assert plan.first == PlanPosition(2, (0, 1, 0, 0))
    assert frames([released] * 5) == [(2, 1)] * 5  # until start is pressed, the first frame repeats
    assert frames([start, start, released, start, start, start]) == [(2, 1)] * 5 + [(3, 1)]
    assert frames([start] * 6) == [(2, 1), (2, 1), (3, 1), (4, 1), (4, 1), (4, 1)]
    # stop removes the pulses from the fourth frame on, and has priority
    assert frames([stop] * 4) == [(2, 1), (2, 1), (2, 0), (2, 0)]
    assert frames([both] * 4) == [(2, 1), (2, 1), (2, 0), (2, 0)]
    # a button that stays pressed does not start again after a stop; a new press does, from the first frame
    assert frames([stop] * 3 + [released] + [start] * 3)[-2:] == [(2, 0), (3, 1)]
    assert frames([both] * 3 + [start] * 4)[-1] == (2, 0)
    data["buttons"]["pulses"] = "hold"
    plan = read_plan(json.dumps(data).encode(), "schedule.json")
    assert frames([start] * 4 + [stop] * 5)[-3:] == [(4, 1)] * 3  # it keeps the current pulses
    data["buttons"] |= {"start": None, "pulses": "off"}
    plan = read_plan(json.dumps(data).encode(), "schedule.json")
    position = plan.first
    for _ in range(3):
        position = after(plan, position, stop)
    assert position == OVER  # only a reset ends it


def test_the_watchdog_periods_are_the_data_sheets() -> None:
    """DS35007, parameter 31: 7 ms at least, 33 ms at most; the checker has a number of its own."""
    assert device.WATCHDOG_US == (7_000, 33_000)
    assert device.WATCHDOG_US[0] == WATCHDOG_US


def test_the_checker_is_small_and_shares_nothing_with_the_prover() -> None:
    files = sorted((ROOT / "servogen" / "checker").glob("*.py"))
    imported = {
        name
        for file in files
        for name in re.findall(r"^ *(?:from|import) (servogen[\w.]*)", file.read_text(), re.M)
    }
    foreign = {name for name in imported if not name.startswith("servogen.checker")}
    of_the_chip = {"servogen.pic.image", "servogen.pic.isa"}
    assert foreign == {"servogen.errors", "servogen.native", "servogen.units"} | of_the_chip
    chip = (ROOT / "servogen" / "checker" / "chip.c").read_text()
    assert re.findall("#include (.*)", chip) == ["<stdbool.h>", "<stdint.h>", '"layout.h"']


def test_the_command_says_valid_refused_or_bad_input(
    tmp_path: Path, servogen: Callable[..., Any] = lambda *words: run_command(words)
) -> None:
    image, schedule = certify.plain_program(), certify.schedule()
    (tmp_path / "a.hex").write_text(to_hex(image))
    (tmp_path / "b.hex").write_text(to_hex(certify.plain_program(width=WIDTH + 1)))
    (tmp_path / "s.json").write_bytes(schedule)
    (tmp_path / "c.xz").write_bytes(certified(image, schedule))
    (tmp_path / "bad.xz").write_bytes(b"bad")
    against = ("--against", str(tmp_path / "s.json"))
    code, text = servogen("check-certificate", str(tmp_path / "c.xz"), str(tmp_path / "a.hex"), *against)
    assert code == 0
    assert "c.xz: valid" in text
    code, text = servogen(
        "check-certificate", str(tmp_path / "c.xz"), str(tmp_path / "b.hex"), *against, "--json"
    )
    assert code == 1
    assert json.loads(text)["valid"] is False
    code, text = servogen("check-certificate", str(tmp_path / "bad.xz"), str(tmp_path / "a.hex"), *against)
    assert code == 2


def run_command(words: tuple[str, ...]) -> tuple[int, str]:
    from typer.testing import CliRunner

    from servogen.cli.app import app

    result = CliRunner().invoke(app, list(words))
    return getattr(result.exception, "exit_code", result.exit_code), result.output
