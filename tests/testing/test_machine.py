"""The fixtures for firmware without a schedule: programs, marks, recordings, what is skipped on the bench."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

# Here, so that the runs inside this process find them and do not load them each anew.
import servogen.testing.chip
import servogen.testing.seen_chip
from servogen.bench.virtual.analyser import AnalyserOptions, VirtualAnalyser
from servogen.bench.virtual.chip import VirtualChip
from servogen.pic.assembler import assemble
from servogen.pic.image import to_hex
from servogen.units import Clock
from tests.bench.conftest import Serve, serve  # noqa: F401 - a fixture
from tests.simulator.helpers import HEAD, WATCHDOG_OFF

pytest_plugins = ["pytester"]

BLINK = f"""{HEAD}{WATCHDOG_OFF}
        bsf     STATUS, RP0
        movlw   0xFE
        movwf   TRISB
        bcf     STATUS, RP0
loop    movf    PORTA, w                ; RB0 shows RA0, inverted
        xorlw   1
        movwf   PORTB
        goto    loop
        end
"""
STIMULUS = """
[[periodic]]
pin = "RA0"
period_us = 1000
high_us = 400
"""
TESTS = '''
import pytest

NEAR = dict(abs=5)

@pytest.mark.servogen("blink.asm", seconds=0.01, stimulus="wave.toml")
def test_capture(servogen_capture):
    assert servogen_capture.widths_us("RB0")[1:] == pytest.approx([600] * 8, **NEAR)

@pytest.mark.servogen("blink.asm", stimulus="wave.toml")
def test_machine(servogen_machine):
    chip = servogen_machine()
    chip.run_ms(10)
    assert chip.periods_us("RB0")[1:] == pytest.approx([1000] * 8, **NEAR)
    assert chip.widths_us("RB0")[1:] == pytest.approx([600] * 8, **NEAR)

def test_hex_and_assembly_at_another_clock(servogen_machine):
    text = """[[periodic]]
pin = "RA0"
period_us = 1000
high_us = 400"""
    for name in ("blink.asm", "blink.hex", "built"):
        chip = servogen_machine(name, stimulus=text, clock_hz=10_000_000, device="PIC16F84A")
        chip.run_ms(10)
        assert chip.cycle in (25_000, 25_001)
        assert chip.periods_us("RB0")[1:] == pytest.approx([1000] * 8, **NEAR)

def test_inputs(servogen_machine):
    levels = []
    for level in (0, 1):
        chip = servogen_machine("blink.hex", inputs={"RA0": level})
        chip.run_ms(1)
        levels.append(chip.pin("RB0"))
    assert levels == [1, 0]
'''


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    (pytester.path / "blink.asm").write_text(BLINK)
    (pytester.path / "blink.hex").write_text(to_hex(assemble(BLINK, "blink.asm").image))
    (pytester.mkdir("built") / "main.hex").write_text((pytester.path / "blink.hex").read_text())
    (pytester.path / "wave.toml").write_text(STIMULUS)
    return pytester


def run(project: pytest.Pytester, *options: str) -> pytest.RunResult:
    return project.runpytest_inprocess(
        "-p", "no:xdist", "-p", "no:hypothesispytest", "--strict-markers", "-rs", *options
    )


WRITES = """
        list p={chip}
        include <p{chip}.inc>
        __config 0x3FF1
        bsf     STATUS, RP0
        clrf    TRISB
        bsf     EECON1, WREN
        movlw   0x55
        movwf   EECON2
        movlw   0xAA
        movwf   EECON2
        bsf     EECON1, WR
wait    btfss   EECON1, EEIF
        goto    wait
        bcf     STATUS, RP0
        bsf     PORTB, 0
stand   goto    stand
        end
"""
WRITTEN = """
import pytest

CHIPS = (("16f84.asm", {}, 10), ("16f84a.asm", {}, 4), ("16f84a.asm", {"device": "PIC16F84"}, 10))

@pytest.mark.parametrize(("name", "given", "ms"), CHIPS)
def test_machine(servogen_machine, name, given, ms):
    chip = servogen_machine(name, **given)
    assert chip.run_until("RB0 rise") / 1000 == pytest.approx(ms, abs=0.1)

@pytest.mark.servogen("16f84a.asm", seconds=0.02)
def test_capture(servogen_capture):
    assert servogen_capture.rising_us("RB0") == pytest.approx([4000], abs=100)
"""


def test_firmware_runs_on_the_chip_that_its_source_names(pytester: pytest.Pytester) -> None:
    """Its write to the EEPROM takes 10 ms on a PIC16F84 (DS30430), 4 ms on a PIC16F84A (DS35007)."""
    for chip in ("16f84", "16f84a"):
        (pytester.path / f"{chip}.asm").write_text(WRITES.format(chip=chip))
    pytester.makepyfile(test_written=WRITTEN)
    run(pytester).assert_outcomes(passed=4)


def test_firmware_without_a_schedule_is_tested_recorded_and_replayed(project: pytest.Pytester) -> None:
    project.makepyfile(test_blink=TESTS)
    run(project, "--servogen-record=seen", "--junitxml=report.xml").assert_outcomes(passed=4)
    names = {path.name for path in (project.path / "seen").iterdir()}
    assert names == {
        "test_blink-test_capture.vcd",
        "test_blink-test_machine.vcd",
        "test_blink-test_hex_and_assembly_at_another_clock.vcd",
        "test_blink-test_hex_and_assembly_at_another_clock-chip2.vcd",
        "test_blink-test_hex_and_assembly_at_another_clock-chip3.vcd",
        "test_blink-test_inputs.vcd",
        "test_blink-test_inputs-chip2.vcd",
    }
    programs = programs_of(project)
    assert programs["test_capture"] == ("blink.asm",)
    assert programs["test_hex_and_assembly_at_another_clock"] == ("blink.asm", "blink.hex", "built/main.hex")
    replayed = run(project, "--servogen-replay=seen", "-k", "capture or machine or inputs")
    replayed.assert_outcomes(passed=3, deselected=1)


def test_a_test_that_fails_by_a_bit_shows_what_was_seen(project: pytest.Pytester) -> None:
    (project.path / "blink.asm").write_text(BLINK.replace("xorlw   1", "xorlw   2"))
    project.makepyfile(test_blink=TESTS)
    result = run(project, "-k", "capture or machine")
    result.assert_outcomes(failed=2, deselected=2)
    result.stdout.fnmatch_lines(
        [
            "*test_blink-test_capture.vcd: what was seen on the simulated chip*",
            "*servogen waves: blink.asm*",
            "RA0  *▔*▁*",
            "RB0  *▔*▁*",
            "*RB0 = 1 *blink.asm:*: movwf   PORTB*",
            "blink.asm at 10 ms: blink.asm:*",
        ]
    )


def test_a_chip_with_too_many_edges_fails_its_test_alone(
    project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(servogen.testing.chip, "MAX_EDGES", 5)
    project.makepyfile(test_blink=TESTS)
    result = run(project, "-k", "machine or inputs")
    result.assert_outcomes(failed=1, passed=1, deselected=2)
    result.stdout.fnmatch_lines(["*nothing is written:*more than 5*", "*servogen waves*", "*more than 5*"])


def test_without_a_programmer_nobody_claims_that_the_program_was_tested(
    project: pytest.Pytester,
    serve: Serve,  # noqa: F811
) -> None:
    """The chip's own program makes pulses of 3 cycles in 6; the test names another one."""
    pulses = BLINK.replace("movf    PORTA, w", "bsf PORTB, 0\n nop\n nop\n bcf PORTB, 0\n goto loop")
    chip = VirtualChip(assemble(pulses, "pulses.asm").image, Clock(4_000_000))
    port = serve({"analyser": VirtualAnalyser(chip, AnalyserOptions())}).paths["analyser"]
    project.makepyfile(
        test_pulses="""
        import pytest
        from servogen.errors import InputError

        def test_run(servogen_machine):
            chip = servogen_machine("blink.asm")
            chip.run_us(300)
            assert set(chip.widths("RB0")) == {3}
            chip.run_ms(100)
            with pytest.raises(InputError, match="the analyser's memory is too small"):
                chip.rising("RB0")
            assert chip.interrupts == 0

        @pytest.mark.servogen("blink.asm", seconds=0.0003)
        def test_capture(servogen_capture):
            assert servogen_capture.periods("RB0")[:4] == [6] * 4

        def test_a_word_that_is_misspelt(servogen_machine):
            servogen_machine("blink.asm").width("RB0")
        """
    )
    result = run(project, "--servogen-target=bench", f"--servogen-port={port}", "--junitxml=report.xml")
    result.assert_outcomes(passed=1, skipped=1, failed=1)
    result.stdout.fnmatch_lines(["*a chip has no 'width'*", "*needs the simulated chip: chip.interrupts*"])
    assert set(programs_of(project).values()) == {("what was on the chip",)}


def test_a_mistake_of_the_test_shows_the_test_and_no_line_of_servogen(project: pytest.Pytester) -> None:
    project.makepyfile(
        test_mistake="""
        def test_pin(servogen_machine):
            chip = servogen_machine("blink.asm")
            chip.press("RB9")

        def test_bytes(servogen_machine):
            chip = servogen_machine("blink.asm", inputs={"RA0": 1})
            chip.run_ms(100)
            chip.uart("RB0", 2400)

        def test_defect(servogen_machine):
            servogen_machine("blink.asm").run_ms(None)
        """
    )
    result = run(project, "-k", "not defect")
    result.assert_outcomes(failed=2)
    result.stdout.fnmatch_lines_random(
        ["*there is no pin 'RB9'*", '>*chip.press("RB9")', '>*chip.uart("RB0", 2400)']
    )
    result.stdout.no_fnmatch_line("*signals.py*")
    result.stdout.no_fnmatch_line("*chip.py*")
    run(project, "-k", "defect").stdout.fnmatch_lines(["*chip.py*TypeError*"])


def programs_of(project: pytest.Pytester) -> dict[str, tuple[str, ...]]:
    """Return the programs that the report names, by test."""
    return {
        str(case.get("name")): tuple(
            str(each.get("value")) for each in case.iter("property") if each.get("name") == "servogen_program"
        )
        for case in ElementTree.parse(project.path / "report.xml").iter("testcase")
    }


def test_what_the_bench_cannot_do_is_skipped_with_the_reason(project: pytest.Pytester) -> None:
    """Before the bench is used: there is none."""
    project.makepyfile(test_blink=TESTS)
    result = run(project, "--servogen-target=bench", "--servogen-port=/nowhere")
    result.assert_outcomes(skipped=4)
    result.stdout.fnmatch_lines_random(
        [
            "*needs the simulated chip: an input board does not make a periodic signal*",
            "*needs the simulated chip: chip.inputs={'RA0': 0}; nothing drives the chip's inputs here: "
            "--servogen-inputs=PORT, an input board*",
        ]
    )


def test_a_mark_that_is_wrong_or_not_enough_says_what_to_do(project: pytest.Pytester) -> None:
    project.makepyfile(
        test_wrong="""
        import pytest

        @pytest.mark.servogen("blink.hex")
        def test_seconds(servogen_capture): ...

        @pytest.mark.servogen("blink.hex", seconds=1)
        def test_schedule(servogen_schedule): ...

        @pytest.mark.servogen("blink.hex", second=1)
        def test_key(servogen_capture): ...

        @pytest.mark.servogen("blink.hex", seconds=1, stimulus='[[reset]]\\npressed_us = 3')
        def test_stimulus(servogen_capture): ...

        def test_program(servogen_machine):
            servogen_machine()

        def test_missing(servogen_machine):
            servogen_machine("blunk.hex")
        """
    )
    result = run(project)
    result.assert_outcomes(errors=4, failed=2)
    result.stdout.fnmatch_lines_random(
        [
            "*the test states neither a schedule nor a duration*",
            "*seconds=0.5*",
            "*the test does not state its schedule*",
            "*@pytest.mark.servogen has no 'second'*",
            "*did you mean 'seconds'?*",
            "*test_stimulus*released_us*",
            "*the test does not state its program*",
            "*blunk.hex*error*",
        ]
    )
