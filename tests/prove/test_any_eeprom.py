"""Any content of the EEPROM: what is proven, which bytes are whose trims; no wrong byte is passed over."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from servogen.edges import PINS, join
from servogen.engines.stream.protocol import trim_cycles
from servogen.pic.image import Image, read_hex, to_hex
from servogen.programs import compile_program
from servogen.prove import Proof, Quantifiers, prove_for_all, trims
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.traces import read_edges
from servogen.units import Clock, Cycles
from servogen.workflows.job_build import BuiltProgram
from tests.campaigns import sampled
from tests.engines.player.player_jobs import built_text, job_text, sweep
from tests.prove.attack import servogen
from tests.prove.test_prove_inputs import assembled, schedule_of

ANY = Quantifiers(any_eeprom=True)
WDTE = 0x04
"""The watchdog's bit of the configuration word (DS35007, register 6-1)."""


@cache
def built(servos: int) -> tuple[PulseSchedule, BuiltProgram]:
    motion = sweep(servos, 0.04, limits=(80, 81))
    done = built_text(job_text(servos, motion, limits=(80, 81), firmware="soft_start_s = 0.04\n"), "c2c")
    return done.plan.schedule, done.programs[0]


@cache
def proof(servos: int) -> Proof:
    schedule, program = built(servos)
    return prove_for_all(program.image, schedule, ANY)


def test_a_trim_is_twos_complement_and_the_erased_byte_is_none() -> None:
    """As docs/firmware.md says it."""
    trims = [trim_cycles(byte) for byte in (0, 1, 0x7F, 0x80, 0xD8, 0xFE, 0xFF)]
    assert trims == [0, 1, 127, -128, -40, -2, 0]


@pytest.mark.parametrize("servos", sampled([1, 2]))
def test_every_trim_is_proven_and_the_answer_says_which_byte_is_whose(servos: int) -> None:
    found = proof(servos)
    assert found.proven, found.reason
    text = next(each for each in found.assumptions if "the EEPROM holds anything" in each)
    pins = [channel.pin for channel in built(servos)[0].channels]
    assert text.endswith("byte " + ", ".join(f"{byte} of {pin}" for byte, pin in enumerate(pins)))
    assert "the EEPROM holds what the file says" not in found.assumptions


@pytest.mark.campaign
def test_two_pulses_of_a_slot_are_proven_for_every_pair_of_trims() -> None:
    assert proof(2).runs - proof(1).runs > 255 * 255


FAULTS = {
    "one byte is taken for another": "    movf    EEDATA, W\n    xorlw   0x80\n    btfsc   STATUS, 2\n"
    "    incf    _next, F\n",
    "a low bit is lost for one byte": "    movlw   0x55\n    xorwf   EEDATA, W\n    btfsc   STATUS, 2\n"
    "    bcf     _next, 0\n",
}


def changed(servos: int, insert: str, folder: Path) -> Image:
    """Return the player with instructions after the trim was added."""
    text = built(servos)[1].firmware.text
    place = "    btfsc   EEDATA, 7\n    decf    _key, F\n"
    assert text.count(place) == 1
    file = folder / "changed.c"
    file.write_text(text.replace(place, place + insert))
    return compile_program(file).image


@pytest.mark.parametrize(("fault", "byte"), [*zip(FAULTS, (0x80, 0x55), strict=True)])
def test_a_fault_of_one_trim_value_is_found_and_simulate_shows_it(
    fault: str, byte: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The fall of the counterexample's edges is where neither the schedule nor the byte wants it."""
    schedule, _ = built(1)
    image = changed(1, FAULTS[fault], tmp_path)
    assert prove_for_all(image, schedule).proven, "nothing is wrong with the file's EEPROM"
    monkeypatch.chdir(tmp_path)
    Path("mutant.hex").write_text(to_hex(image))
    Path("schedule.json").write_text(schedule.json_text())
    answer = json.loads(
        servogen("prove", "mutant.hex", "--against", "schedule.json", "--any-eeprom", "--json")
    )
    assert answer["answer"] == "counterexample"
    assert set(answer["counterexample"]["eeprom"].values()) == {byte}
    words = shlex.split(answer["counterexample"]["command"])
    content = read_hex(Path(words[2]).read_text(), words[2]).image.eeprom
    assert content[0] == byte
    servogen(*words[1:])
    trace = read_edges(Path("counterexample.csv"), Clock(schedule.clock.hz))
    pin = PINS.index(schedule.channels[0].pin)
    edges = [(int(c), int(level)) for c, p, level in zip(*join(trace.chunks), strict=True) if p == pin]
    rises = [cycle for cycle, level in edges if level == 1]
    falls = [cycle for cycle, level in edges if level == 0 and cycle > rises[0]]
    frames = [run.pulses[0] for run in (*schedule.lead_in, *schedule.loop) for _ in range(run.frames)]
    wanted = [pulse.width + trim_cycles(byte) for pulse in frames if pulse is not None]
    widths = [fall - rise for rise, fall in zip(rises, falls, strict=False)]
    assert any(width != planned for width, planned in zip(widths, wanted, strict=False))


PULSE = """
frame   clrf EEADR
        bsf STATUS, RP0
        bsf EECON1, RD
        bcf STATUS, RP0
{take}
        movlw 100
        movwf 0x21
        bsf PORTB, 1
wide    decfsz 0x21, f
        goto wide
        bcf PORTB, 1
        movlw 180
        movwf 0x21
rest    decfsz 0x21, f
        goto rest
        nop
{pad}
        goto frame
"""
WIDTH = 1 + 299


def reading(take: str, cycles: int) -> tuple[Image, PulseSchedule]:
    pads = 3
    period = 4 + cycles + 2 + 1 + 299 + 1 + 2 + 539 + 1 + pads + 2
    return assembled(PULSE.format(take=take, pad="        nop\n" * pads)), schedule_of(period, WIDTH)


def test_a_program_whose_pulses_no_byte_changes_is_proven_too() -> None:
    image, schedule = reading("        movf EEDATA, w\n        movwf 0x30\n", 2)
    found = prove_for_all(image, schedule, ANY)
    assert found.proven, found.reason
    assert any("no pulse depends on it" in each for each in found.assumptions)


def test_two_servos_without_trims_are_proven_too() -> None:
    """Pulses of 300 cycles on RB1, and then on RB2; the EEPROM is not read."""
    pulse = """
        movlw 100
        movwf 0x21
        bsf PORTB, {bit}
        decfsz 0x21, f
        goto $-1
        bcf PORTB, {bit}
"""
    outputs = "        bsf STATUS, RP0\n        movlw 0xF9\n        movwf TRISB\n        bcf STATUS, RP0\n"
    both = pulse.format(bit=1) + pulse.format(bit=2)
    image = assembled(f"{outputs}frame nop\n{both}        goto frame\n")
    one = schedule_of(1 + 2 * 303 + 2, 300)
    second = Channel("other", "RB2", "futaba-s3001")
    pulses = (Pulse(Cycles(0), Cycles(300)), Pulse(Cycles(303), Cycles(300)))
    schedule = replace(one, channels=(*one.channels, second), loop=(Run(1, pulses),))
    found = prove_for_all(image, schedule, ANY)
    assert found.proven, found.reason
    assert found.assumptions[-1] == "the EEPROM holds anything: no pulse depends on it"


@pytest.mark.parametrize(
    "take",
    [
        "        btfsc EEDATA, 3\n        goto $+1\n",
        "        movf EEDATA, w\n        iorwf PORTB, f\n",
    ],
)
def test_a_byte_that_moves_a_rise_or_another_pin_is_not_passed_over(take: str) -> None:
    image, schedule = reading(take, 3 if "goto" in take else 2)
    assert prove_for_all(image, schedule).proven or "iorwf" in take
    assert not prove_for_all(image, schedule, ANY).proven


def delayed(label: str) -> str:
    """Return instructions that take W cycles, and some."""
    return f"""
        movwf 0x34
        bcf STATUS, C
        rrf 0x34, f
        btfsc STATUS, C
        goto $+1
        bcf STATUS, C
        rrf 0x34, f
        btfss STATUS, C
        goto {label}
        goto $+1
        nop
{label} incf 0x34, f
        nop
        decfsz 0x34, f
        goto $-2
"""


TRIMMED = f"""
        clrf 0x33
        {{first}}
frame   clrf EEADR
{{read}}
        movf EEDATA, w
{{choice}}
        movwf 0x30
        incf 0x30, w
        btfsc STATUS, Z
        clrf 0x30
        movlw 128
        addwf 0x30, w
        movwf 0x31
        comf 0x31, w
        movwf 0x32
        bsf PORTB, 1
        movf 0x31, w
{delayed("long")}
        bcf PORTB, 1
        movf 0x32, w
{delayed("short")}
        {{last}}
        goto frame
"""
"""Frames of 307 cycles with a pulse of 144 and the trim in byte 0 of the EEPROM."""
READ = "        bsf STATUS, RP0\n        bsf EECON1, RD\n        bcf STATUS, RP0\n        nop\n"
THROUGH_FSR = "        movlw 0x88\n        movwf FSR\n        {}\n        bsf INDF, 0\n"
TRIM = {"first": "", "read": READ, "choice": "        nop\n        nop\n", "last": "nop"}


def trimmed(**parts: str) -> tuple[Image, PulseSchedule]:
    return assembled(TRIMMED.format(**(TRIM | parts))), schedule_of(307, 144)


def test_a_small_program_with_a_trim_is_proven() -> None:
    found = prove_for_all(*trimmed(), ANY)
    assert found.proven, found.reason
    assert found.assumptions[-1].endswith("byte 0 of RB1")


def test_a_trim_that_only_some_pulses_have_is_not_passed_over() -> None:
    """The pulses from the second one on have none: the byte does not change their length."""
    image, schedule = trimmed(choice="        btfsc 0x33, 0\n        movlw 0xFF\n", last="bsf 0x33, 0")
    assert prove_for_all(image, schedule).proven
    found = prove_for_all(image, schedule, ANY)
    assert not found.proven
    assert found.counterexample is not None and found.counterexample.eeprom == {0: 1}


@pytest.mark.parametrize("before", ["nop", "movf TMR0, w"])
@pytest.mark.campaign
def test_a_byte_that_is_read_through_fsr_is_any(before: str) -> None:
    """DS35007 section 2.5: FSR = 0x88 makes INDF another name of EECON1."""
    image, schedule = trimmed(read=THROUGH_FSR.format(before))
    assert prove_for_all(image, schedule).proven
    assert not prove_for_all(image, schedule, ANY).proven


SUB = "sub     return\n"


@pytest.mark.parametrize("byte", [0, 0x33, 0xFE])
def test_a_pulse_that_is_one_cycle_late_with_one_content_is_found(byte: int) -> None:
    """Its GOTO takes a cycle more than the skip of it; the frame is as long as with any other content."""
    compare = f"        movf EEDATA, w\n        xorlw {byte}\n        {{}} STATUS, Z\n        goto $+1\n"
    body = TRIMMED
    for place, skip in (("        movf 0x31, w\n", "btfsc"), ("        movf 0x32, w\n", "btfss")):
        assert body.count(place) == 1
        body = body.replace(place, compare.format(skip) + place)
    image, schedule = assembled(body.format(**TRIM)), schedule_of(307 + 4 + 5, 144 + 4)
    assert prove_for_all(image, schedule).proven
    found = prove_for_all(image, schedule, ANY)
    assert not found.proven and found.counterexample is not None
    assert found.counterexample.eeprom == {0: byte}


def test_a_byte_that_is_read_through_fsr_after_another_one_and_tmr0_is_any() -> None:
    """The trim is byte 1, read where FSR = 0x88 makes INDF EECON1; EEDATA holds byte 0 before."""
    second = "        incf EEADR, f\n        movlw 0x88\n        movwf FSR\n        movf TMR0, w\n"
    body = TRIMMED.replace("{read}", READ + second + "        bsf INDF, 0\n        call sub\n") + SUB
    image, schedule = assembled(body.format(**TRIM)), schedule_of(307 + 5 + 4, 144)
    assert prove_for_all(image, schedule).proven
    assert not prove_for_all(image, schedule, ANY).proven


KEPT = f"""
        bsf STATUS, RP0
        movlw 0xDF
        movwf OPTION_REG
        bcf STATUS, RP0
        clrf EEADR
{READ}
        movf EEDATA, w
        movwf 0x35
        incf 0x35, w
        btfsc STATUS, Z
        clrf 0x35
frame   clrf TMR0
        call sub
        movlw 128
        addwf 0x35, w
        movwf 0x31
        bsf PORTB, 1
        movf 0x31, w
{delayed("long")}
        bcf PORTB, 1
        call sub
        movf TMR0, w
        sublw 25
        movwf 0x34
        movlw 0xC0
        andwf 0x34, w
        swapf 0x41, w
{{late}}
        movf 0x34, w
{delayed("short")}
        movlw 0
        addlw 0
        call sub
        goto frame
{SUB}"""
"""Frames of 315 cycles, which TMR0 ends; the trim is read once and kept in 0x35. Z where a pulse is long."""


@pytest.mark.parametrize(
    ("late", "proven"),
    [("        nop\n        nop", True), ("        btfsc STATUS, Z\n        movwf 0x35", False)],
)
def test_a_byte_that_only_late_chips_overwrite_is_not_taken_for_kept(late: str, proven: bool) -> None:
    """Once TMR0 is awaited, the chips are alike but for 0x35: what 0x41 held is the next trim of some."""
    image, schedule = assembled(KEPT.format(late=late)), schedule_of(315, 144)
    assert prove_for_all(image, schedule).proven
    found = prove_for_all(image, schedule, ANY)
    assert found.proven == proven, found.reason


NEXT = "        incf EEADR, f\n" + READ.replace("        nop\n", "")
"""Reads the next byte of the EEPROM."""
FROM_BYTE_5 = f"        movlw 5\n        movwf EEADR\n{READ}        movf EEDATA, w\n        xorlw 0x77\n"
UNDECIDED = {
    "a byte of the RAM that decides": ("        btfsc 0x40, 0\n        nop\n", 2),
    "a table beside TMR0": (
        "        movf EEDATA, w\n        movwf 0x30\n        movf TMR0, w\n        movf 0x30, w\n", 4
    ),
    "an interrupt": ("        movf TMR0, w\n        bsf INTCON, GIE\n", 2),
    "three bytes": (
        f"        movf EEDATA, w\n        movwf 0x35\n{NEXT}"
        f"        movf EEDATA, w\n        movwf 0x36\n{NEXT}"
        "        movf EEDATA, w\n        addwf 0x35, w\n        addwf 0x36, w\n        movwf 0x30\n"
        "        btfsc 0x30, 0\n        nop\n",
        18,
    ),
    "a rise at the byte's time": ("        movf EEDATA, w\n" + delayed("x"), 270),
}  # fmt: skip


@pytest.mark.parametrize(
    ("case", "reason"),
    [
        ("a byte of the RAM that decides", "an unknown bit decides (address 0x010, frame -1)"),
        (
            "a table beside TMR0",
            "what depends on the EEPROM is read beside TMR0 (address 0x013, frame -1)",
        ),
        ("an interrupt", "an interrupt is enabled (address 0x011, frame -1)"),
        ("three bytes", "3 bytes of the EEPROM decide together (address 0x01C, frame -1)"),
        (
            "a rise at the byte's time",
            "a pin changes at a time that depends on the EEPROM (address 0x023, frame -1)",
        ),
    ],
)
def test_what_the_proof_cannot_follow_is_not_decided_and_it_says_what(case: str, reason: str) -> None:
    """Each is proven with the file's EEPROM; "any EEPROM:" is the proof's second part."""
    found = prove_for_all(*reading(*UNDECIDED[case]), ANY)
    assert (found.proven, found.reason) == (False, f"any EEPROM: {reason}")


def test_an_address_in_the_eeprom_that_is_not_known_is_not_decided() -> None:
    """It is a byte of the RAM, which holds anything at power-up."""
    body = PULSE.replace("clrf EEADR", "movf 0x40, w\n        movwf EEADR")
    image = assembled(body.format(take="        nop\n        nop\n", pad="        nop\n" * 3))
    found = prove_for_all(image, schedule_of(4 + 1 + 2 + 303 + 542 + 3 + 2, WIDTH), ANY)
    assert not found.proven
    assert found.reason == "any EEPROM: the address in the EEPROM is not known (address 0x010, frame -1)"


def test_a_fall_that_the_read_of_tmr0_keeps_from_its_rise_is_not_decided() -> None:
    body = PULSE.replace("bcf PORTB", "movf TMR0, w\n        bcf PORTB")
    image = assembled(body.format(take="        nop\n        nop\n", pad="        nop\n" * 2))
    found = prove_for_all(image, schedule_of(4 + 2 + 304 + 542 + 2 + 2, WIDTH + 1), ANY)
    assert (found.proven, found.counterexample) == (False, None)
    assert found.reason == "any EEPROM: a pulse on RB1 is not the schedule's (frame 0)"


def test_after_different_times_a_watchdog_may_be_due_for_some_chips_only() -> None:
    """A call between the pulse, as long as the byte says, and the pause that makes up for it."""
    body = TRIMMED.replace("        movf 0x32, w\n", "        call sub\n        movf 0x32, w\n")
    image = assembled((body + "sub     clrwdt\n        return\n").format(**TRIM))
    assert image.config is not None
    watched = replace(image, config=image.config | WDTE)
    found = prove_for_all(watched, schedule_of(307 + 5, 144), ANY)
    assert (found.proven, found.reason) == (False, "any EEPROM: the watchdog is on")


def test_two_channels_cannot_have_one_trim() -> None:
    """RB2's pulse, 143 cycles after RB1's, has byte 0 as its trim, too."""
    second = TRIMMED[TRIMMED.index("        bsf PORTB, 1") : TRIMMED.index("        {last}")]
    second = second.replace("PORTB, 1", "PORTB, 2").replace("long", "long2").replace("short", "short2")
    outputs = "bsf STATUS, RP0\n        bcf TRISB, 2\n        bcf STATUS, RP0"
    body = TRIMMED.replace("        {last}\n", second + "        {last}\n")
    image = assembled(body.format(**TRIM | {"first": outputs}))
    one = schedule_of(594, 144)
    pulses = (Pulse(Cycles(0), Cycles(144)), Pulse(Cycles(287), Cycles(144)))
    channels = (*one.channels, Channel("other", "RB2", "futaba-s3001"))
    schedule = replace(one, channels=channels, loop=(Run(1, pulses),))
    assert prove_for_all(image, schedule).proven
    found = prove_for_all(image, schedule, ANY)
    assert not found.proven and found.counterexample is not None
    assert found.counterexample.eeprom == {0: 1}


def test_a_program_that_waits_for_a_byte_is_not_passed_over() -> None:
    """With 0x77 in byte 5 there is no pulse."""
    wait = f"hang    nop\n{FROM_BYTE_5}        btfsc STATUS, Z\n        goto hang\n"
    image, schedule = trimmed(first=wait.strip())
    assert prove_for_all(image, schedule).proven
    assert not prove_for_all(image, schedule, ANY).proven


def test_frames_without_a_pulse_are_not_passed_over() -> None:
    """If byte 0 makes a delay before the first frame long, as TMR0 says, no frame has a pulse."""
    first = f"""
        clrf EEADR
{READ}
        comf EEDATA, w
        movwf 0x3B
        bsf STATUS, RP0
        movlw 0xDF
        movwf OPTION_REG
        bcf STATUS, RP0
        clrf TMR0
        call sub
        movf 0x3B, w
{delayed("first")}
        movf TMR0, w
        andlw 0x80
        movwf 0x3A
        call sub
"""
    body = TRIMMED.replace("        bsf PORTB, 1\n", "        btfss 0x3A, 7\n        bsf PORTB, 1\n") + SUB
    image, schedule = assembled(body.format(**TRIM | {"first": first})), schedule_of(307 + 1, 144)
    assert prove_for_all(image, schedule).proven
    found = prove_for_all(image, schedule, ANY)
    assert not found.proven and found.reason.startswith("any EEPROM: no pulse comes"), found.reason


def test_the_steps_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    image, schedule = reading("        movf EEDATA, w\n        movwf 0x30\n", 2)
    monkeypatch.setattr(trims, "MAX_STEPS", 3)
    found = prove_for_all(image, schedule, ANY)
    assert (found.proven, found.reason) == (False, "any EEPROM: more than 3 steps")


@pytest.mark.campaign
def test_what_only_another_content_writes_is_not_known_after_a_reset() -> None:
    """Byte 5 = 0x77 sets a bit of RAM, which stops the program after the next reset; at power-up RAM is 0."""
    first = f"""
        btfsc 0x40, 0
hang    goto hang
        movlw 5
        movwf EEADR
{READ}
        movf EEDATA, w
        xorlw 0x77
        btfsc STATUS, Z
        bsf 0x40, 0
        nop
"""
    image, schedule = trimmed(first=first)
    zero = Quantifiers(start=(("ram", 0),))
    assert prove_for_all(image, schedule, zero).proven
    assert prove_for_all(image, schedule, replace(zero, any_eeprom=True, resets=False)).proven
    assert not prove_for_all(image, schedule, replace(zero, any_eeprom=True)).proven


def test_a_certificate_is_not_about_every_eeprom(tmp_path: Path) -> None:
    schedule, program = built(1)
    (tmp_path / "main.hex").write_text(to_hex(program.image))
    (tmp_path / "schedule.json").write_text(schedule.json_text())
    with pytest.raises(AssertionError):  # exit code 2
        servogen(
            "prove", tmp_path / "main.hex", "--against", tmp_path / "schedule.json",
            "--any-eeprom", "--certificate", tmp_path / "c.xz",
        )  # fmt: skip
