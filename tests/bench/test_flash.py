"""`servogen flash`: the real picpro against the virtual K150, and stand-ins that say what others do."""

import errno
import fcntl
import importlib.util
import json
import os
import random
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import pytest
from intelhex import IntelHex

from servogen.bench.programmers.flash import flash
from servogen.bench.programmers.picpro import tolerant, where_it_acts
from servogen.bench.programmers.table import PROGRAMMERS, InstalledProgrammer, ProgrammingRequest, find
from servogen.bench.virtual.chip import VirtualChip
from servogen.bench.virtual.k150 import ProgrammerOptions, VirtualProgrammer
from servogen.errors import ToolError
from servogen.pic.device import config_word, device
from servogen.pic.image import Image, to_hex
from servogen.units import Clock
from tests.bench.conftest import LAB8, Run, Serve, image_of

BUILT = LAB8 / "main.hex"
EMPTY = Image({0: 0x2800}, 0x3FF1)

FREE = ("--device", "PIC16F84A", "--force")
"""Options for an image that has no schedule."""

SAYS = """\
#!{python}
import sys
sys.stdout.write({output!r})
sys.exit({code})
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """The lab exercise's program with its schedule beside it: built for a PIC16F84."""
    path = tmp_path / "lab8.hex"
    path.write_text(BUILT.read_text())
    (tmp_path / "schedule.json").write_text((LAB8 / "schedule.json").read_text())
    return path


def programmer(**options: object) -> VirtualProgrammer:
    chip = VirtualChip(EMPTY, Clock(4_000_000), ppm=Fraction(0))
    return VirtualProgrammer(chip, ProgrammerOptions(**options))  # type: ignore[arg-type]


def stand_in(folder: Path, name: str, output: str, code: int) -> Path:
    """A program in the place of a programmer's that says `output` and ends with `code`."""
    path = folder / name
    path.write_text(SAYS.format(python=sys.executable, output=output, code=code))
    path.chmod(0o755)
    return path


def hex_file(folder: Path, image: Image) -> Path:
    path = folder / "x.hex"
    path.write_text(to_hex(image))
    return path


# The real picpro, over a pseudo-terminal.

picpro = pytest.mark.skipif(
    not __import__("importlib").util.find_spec("picpro"), reason="picpro is not installed"
)


@picpro
def test_picpro_programs_the_virtual_chip_with_every_word(run: Run, program: Path, serve: Serve) -> None:
    device = programmer()
    port = serve({"programmer": device}).paths["programmer"]
    done = run("flash", program, "--programmer", "picpro", "--port", port)
    assert done.code == 0, done.err
    assert "read back and compared: program memory, data EEPROM, configuration word" in done.out
    wanted = image_of(BUILT)
    assert device.chip.image.flash() == wanted.flash()
    assert device.chip.image.config == wanted.config


@picpro
def test_picpro_programs_the_eeprom_too(run: Run, program: Path, serve: Serve, tmp_path: Path) -> None:
    device = programmer()
    port = serve({"programmer": device}).paths["programmer"]
    image = Image(image_of(BUILT).program, 0x3FF1, {n: n + 1 for n in range(64)})
    done = run("flash", hex_file(tmp_path, image), *FREE, "--programmer", "picpro", "--port", port)
    assert done.code == 0, done.err
    assert dict(device.chip.image.eeprom) == dict(image.eeprom)


@picpro
def test_a_word_that_is_not_taken_is_found_and_named(run: Run, program: Path, serve: Serve) -> None:
    port = serve({"programmer": programmer(wrong_bit_at=0x12)}).paths["programmer"]
    done = run("flash", program, "--programmer", "picpro", "--port", port)
    assert done.code == 1
    assert (
        f"{port}: error: the program memory differs from the file, first in the program memory at "
        "address 0x012: " in done.err
    )


@picpro
def test_an_eeprom_byte_that_is_not_taken_is_found_and_named(run: Run, program: Path, serve: Serve) -> None:
    port = serve({"programmer": programmer(wrong_eeprom_at=5)}).paths["programmer"]
    done = run("flash", program, "--programmer", "picpro", "--port", port)
    assert done.code == 1
    assert "first in the data EEPROM at address 0x005: 0xFE where the file has 0xFF" in done.err


@picpro
def test_picpro_never_looks_at_the_configuration_word_but_it_is_read_back(
    run: Run, program: Path, serve: Serve
) -> None:
    """picpro says that all is verified over a wrong one: here another oscillator."""
    port = serve({"programmer": programmer(wrong_config=True)}).paths["programmer"]
    done = run("flash", program, "--programmer", "picpro", "--port", port)
    assert done.code == 1
    assert "picpro reports success, but the chip differs from the file" in done.err
    assert "first in the configuration word: 0x3FF0 where the file has 0x3FF1" in done.err


@picpro
def test_of_a_protected_chip_the_configuration_word_is_compared(
    run: Run, serve: Serve, tmp_path: Path
) -> None:
    image = Image(image_of(BUILT).program, config_word("XT", code_protect=True))
    port = serve({"programmer": programmer()}).paths["programmer"]
    done = run("flash", hex_file(tmp_path, image), *FREE, "--programmer", "picpro", "--port", port)
    assert done.code == 0, done.err
    assert "read back and compared: configuration word" in done.out


@pytest.mark.parametrize("code", [errno.ENOTTY, errno.EINVAL, errno.EIO])
def test_picpro_may_lack_a_modem_line_but_no_port(code: int) -> None:
    """A pseudo-terminal answers ENOTTY or EINVAL; EIO is a programmer that was unplugged."""

    def update(line: object) -> None:
        raise OSError(code, os.strerror(code))

    with nullcontext() if code != errno.EIO else pytest.raises(OSError, match=os.strerror(code)):
        port = SimpleNamespace()
        tolerant(update)(port)
        assert port.lacks_dtr


@pytest.mark.parametrize(("lacks_dtr", "waits"), [(False, 1), (True, 0)])
def test_picpro_waits_for_a_reset_only_where_a_line_resets(lacks_dtr: bool, waits: int) -> None:
    asked: list[object] = []

    def reset(interface: object) -> bool:
        asked.append(interface)
        return True

    interface = SimpleNamespace(port=SimpleNamespace(lacks_dtr=lacks_dtr))
    assert where_it_acts(reset)(interface) is not lacks_dtr
    assert len(asked) == waits


@picpro
def test_an_empty_socket_is_told(
    run: Run, program: Path, serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time that picpro has is over as soon as it waits for a chip."""
    rest, seen = subprocess.Popen.communicate, ""

    def until_it_waits(self: subprocess.Popen[str], timeout: float | None = None) -> tuple[str, None]:
        nonlocal seen
        assert self.stdout is not None
        while timeout is not None:
            seen += self.stdout.read(1)
            if "insert chip" in seen:
                raise subprocess.TimeoutExpired(self.args, timeout)
        return seen + rest(self)[0], None

    monkeypatch.setattr(subprocess.Popen, "communicate", until_it_waits)
    port = serve({"programmer": programmer(no_chip=True)}).paths["programmer"]
    done = run("flash", program, "--programmer", "picpro", "--port", port)
    assert done.code == 3
    assert "no chip in the programmer's socket" in done.err


@picpro
def test_a_silent_programmer_is_told(run: Run, program: Path, serve: Serve) -> None:
    """picpro itself waits 10 s for an answer."""
    port = serve({"programmer": programmer(silent=True)}).paths["programmer"]
    done = run("flash", program, "--programmer", "picpro", "--port", port, "--timeout", 1)
    assert done.code == 3
    assert (
        f"{port}: error: picpro did not end within 1 s and printed nothing: does the programmer answer?"
        in done.err
    )


@picpro
def test_garbage_from_a_programmer_is_told(run: Run, program: Path, serve: Serve) -> None:
    port = serve({"programmer": programmer(garbage=True)}).paths["programmer"]
    done = run("flash", program, "--programmer", "picpro", "--port", port)
    assert done.code == 3
    assert "no programmer that speaks P18A answers" in done.err


@picpro
def test_a_programmer_unplugged_in_mid_flash_leaves_nothing_believed(
    run: Run, program: Path, serve: Serve
) -> None:
    port = serve({"programmer": programmer(unplug_after=400)}).paths["programmer"]
    done = run("flash", program, "--programmer", "picpro", "--port", port)
    assert done.code == 3
    assert "disappeared while it worked" in done.err


@picpro
def test_a_port_that_another_servogen_has_is_busy(run: Run, program: Path, serve: Serve) -> None:
    port = serve({"programmer": programmer()}).paths["programmer"]
    handle = os.open(port, os.O_RDWR | os.O_NOCTTY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        done = run("flash", program, "--programmer", "picpro", "--port", port)
    finally:
        os.close(handle)
    assert done.code == 3
    assert "in use by another program" in done.err


@picpro
def test_a_missing_port_is_named(run: Run, program: Path) -> None:
    done = run("flash", program, "--programmer", "picpro", "--port", "/dev/ttyNONE")
    assert done.code == 3
    assert "/dev/ttyNONE: error: there is no such port" in done.err


@picpro
def test_a_file_is_no_port(run: Run, program: Path, tmp_path: Path) -> None:
    port = tmp_path / "port"
    port.write_text("")
    done = run("flash", program, "--programmer", "picpro", "--port", port)
    assert done.code == 3
    assert f"{port}: error: is not a serial port" in done.err
    assert port.read_text() == ""


def test_an_interrupt_ends_the_programmers_program_too(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while its output is awaited: nothing goes on programming the chip behind the user's back."""
    started: list[subprocess.Popen[str]] = []

    def interrupted(self: subprocess.Popen[str], timeout: float) -> None:
        started.append(self)
        raise KeyboardInterrupt

    monkeypatch.setattr(subprocess.Popen, "communicate", interrupted)
    pk2cmd = next(each for each in PROGRAMMERS if each.name == "pk2cmd")
    tool = InstalledProgrammer(pk2cmd, (sys.executable, "-c", "import time; time.sleep(60)"))
    order = ProgrammingRequest(program, device("16F84"), None)
    with pytest.raises(KeyboardInterrupt):
        flash(tool, order, image_of(BUILT))
    (process,) = started
    assert process.wait(300) == -signal.SIGKILL


# What the others say, as far as it is published, else assumed.


@pytest.mark.parametrize(
    ("name", "output", "code", "exit_code", "sentence"),
    [
        ("pk2cmd", "No PICkit 2 found.\n", 10, 3, "no PICkit 2 is connected"),
        ("pk2cmd", "Vdd Error\n", 5, 3, "wrong voltage"),
        ("pk2cmd", "Operation Failed\n", 7, 3, "the operation failed"),
        ("pk2cmd", "PK2DeviceFile.dat device file not found.\n", 24, 3, "PK2DeviceFile.dat"),
        ("pk2cmd", "Program Memory Errors\n", 34, 1, "programming or its verification failed"),
        ("ipecmd", "Programming/Verify complete\nProgram Succeeded.\n", 0, 0, "verified by the programmer"),
        ("ipecmd", "Target Device ID (0x0) is an Invalid Device ID.\n", 0, 3, "another chip, or none"),
        ("ipecmd", "Failed to program device\n", 0, 3, "programming failed"),
        ("ipecmd", "", 0, 3, "did not print 'Program Succeeded.'"),
        ("usbpicprog", "command line passed\n", 0, 0, "capture and verify"),
        ("usbpicprog", "usbpicprog not found\n", 0, 3, "no usbpicprog is connected"),
        ("picprog", "", 0, 0, "verified by the programmer"),
        ("picprog", "", 69, 3, "no JDM programmer answers"),
        ("picprog", "", 9, 3, "exit code 9"),
    ],
)
def test_what_a_programmer_says_becomes_one_sentence(
    run: Run,
    program: Path,
    serve: Serve,
    tmp_path: Path,
    name: str,
    output: str,
    code: int,
    exit_code: int,
    sentence: str,
) -> None:
    port = serve({"programmer": programmer()}).paths["programmer"]
    done = run("flash", program, "--programmer", stand_in(tmp_path, name, output, code), "--port", port)
    assert done.code == exit_code, done
    assert sentence in done.out + done.err


PICPRO_GOOD = (
    "Chip detected.\nErasing chip.\nProgramming ROM.\nVerifying ROM.\nROM verified.\nEEPROM verified.\n"
)


def reads(program: Path, eeprom: Path) -> str:
    """What a stand-in of picpro does when it is to dump a memory."""
    return f"""\
import shutil
if "dump" in sys.argv:
    files = {{"rom": {str(program)!r}, "eeprom": {str(eeprom)!r}}}
    shutil.copy(files[sys.argv[2]], sys.argv[sys.argv.index("-o") + 1])
"""


def erased(folder: Path) -> Path:
    """A dump of an erased EEPROM."""
    path = folder / "eeprom.hex"
    IntelHex(dict.fromkeys(range(64), 0xFF)).write_hex_file(str(path))
    return path


@pytest.mark.parametrize(
    ("output", "exit_code", "sentence"),
    [
        (PICPRO_GOOD.replace("ROM verified.\nEE", "ROM verification failed.\nEE") + "Done!\n", 1, "differs"),
        (PICPRO_GOOD.replace("EEPROM verified.", "EEPROM verification failed."), 1, "EEPROM differs"),
        (PICPRO_GOOD.replace("EEPROM verified.\n", ""), 3, "did not print 'EEPROM verified.'"),
        ("Done!\n", 3, "did not print 'ROM verified.'"),
        ("Chip detected.\nErasing chip.\nErasure failed.\n", 3, "could not be erased"),
        ('Unable to find chip type "16F84A" in data file.\n', 3, "chip data lacks the device"),
        ("IndexError: Data record out of range.\n", 3, "refuses a HEX file that fills the EEPROM"),
    ],
)
def test_picpro_ends_with_0_whatever_happened(
    run: Run, program: Path, serve: Serve, tmp_path: Path, output: str, exit_code: int, sentence: str
) -> None:
    port = serve({"programmer": programmer()}).paths["programmer"]
    path = stand_in(tmp_path, "picpro", output, 0)
    path.write_text(path.read_text().replace("sys.exit(0)", reads(program, erased(tmp_path))))
    done = run("flash", program, "--programmer", path, "--port", port)
    assert done.code == exit_code, done
    assert sentence in done.err


def test_success_over_a_wrong_verification_is_found_by_reading_back(
    run: Run, program: Path, serve: Serve, tmp_path: Path
) -> None:
    port = serve({"programmer": programmer()}).paths["programmer"]
    other = hex_file(tmp_path, Image({**image_of(BUILT).program, 3: 0x0064}))
    path = stand_in(tmp_path, "picpro", PICPRO_GOOD, 0)
    path.write_text(path.read_text().replace("sys.exit(0)", reads(other, erased(tmp_path))))
    done = run("flash", program, "--programmer", path, "--port", port)
    assert done.code == 1
    assert (
        "reports success, but the chip differs from the file, first in the program memory at address 0x003"
        in done.err
    )


@pytest.mark.parametrize(("word", "exit_code"), [(None, 0), (0x0064, 1)])
def test_pk2cmd_success_is_believed_only_when_it_reads_the_same_back(
    run: Run, program: Path, tmp_path: Path, word: int | None, exit_code: int
) -> None:
    image = image_of(BUILT)
    held = image if word is None else Image({**image.program, 3: word}, image.config)
    (tmp_path / "held.hex").write_text(to_hex(held))
    path = stand_in(tmp_path, "pk2cmd", "PICkit 2 Program Report\n", 0)
    copies = f"""\
import shutil
for each in sys.argv:
    if each.startswith("-GF"):
        shutil.copy({str(tmp_path / "held.hex")!r}, each[3:])
"""
    path.write_text(path.read_text().replace("sys.exit(0)", copies))
    done = run("flash", program, "--programmer", path)
    assert done.code == exit_code, done
    if word is None:
        assert "read back and compared: program memory" in done.out
    else:
        assert "differs from the file, first in the program memory at address 0x003" in done.err


@pytest.mark.parametrize(
    "written", ["", "hello\n", "\xff\xfe", ":00000001FE\n", ":03420000414243F5\n:00000001FF\n"]
)
def test_a_file_of_the_chip_that_is_not_understood_is_a_failure_of_the_programmer(
    run: Run, program: Path, tmp_path: Path, written: str
) -> None:
    """Exit code 3: nothing is known of the chip, and the file that was to be programmed is not to blame."""
    path = stand_in(tmp_path, "pk2cmd", "PICkit 2 Program Report\n", 0)
    writes = f"""\
for each in sys.argv:
    if each.startswith("-GF"):
        open(each[3:], "w", encoding="latin-1").write({written!r})
"""
    path.write_text(path.read_text().replace("sys.exit(0)", writes))
    done = run("flash", program, "--programmer", path)
    assert done.code == 3, done
    assert "pk2cmd read the chip back into a file that is not understood: " in done.err
    assert str(tmp_path / "read.hex") not in done.err


# What is refused before anything is programmed.


@pytest.mark.parametrize(
    ("image", "sentence"),
    [
        (Image({0: 0x2800}), "no configuration word"),
        (Image({}, 0x3FF1), "no program"),
        (Image({0: 0x2800}, config_word("XT", watchdog=True)), "watchdog is on"),
    ],
)
def test_an_image_that_cannot_work_is_refused_unless_forced(
    run: Run, tmp_path: Path, image: Image, sentence: str
) -> None:
    path, tool = hex_file(tmp_path, image), stand_in(tmp_path, "pk2cmd", "", 0)
    done = run("flash", path, "--programmer", tool, "--dry-run", "--device", "PIC16F84A")
    assert done.code == 2
    assert sentence in done.err
    done = run("flash", path, "--programmer", tool, "--dry-run", *FREE)
    assert done.code == 0
    assert sentence in done.err


def test_a_watchdog_that_is_cleared_is_no_objection(run: Run, tmp_path: Path) -> None:
    image = Image({0: 0x0064, 1: 0x2800}, config_word("XT", watchdog=True))
    tool = stand_in(tmp_path, "pk2cmd", "", 0)
    assert run("flash", hex_file(tmp_path, image), "--programmer", tool, "--dry-run", *FREE).code == 0


def test_an_image_that_is_not_exact_is_refused(run: Run, tmp_path: Path) -> None:
    tool = stand_in(tmp_path, "pk2cmd", "", 0)
    (tmp_path / "schedule.json").write_text((LAB8 / "schedule.json").read_text())
    wrong = hex_file(tmp_path, EMPTY)
    done = run("flash", wrong, "--programmer", tool, "--dry-run")
    assert done.code == 2
    assert "its pulses are not exact against" in done.err
    (tmp_path / "x.hex").write_text(BUILT.read_text())
    assert run("flash", wrong, "--programmer", tool, "--dry-run").code == 0


def test_an_image_without_a_schedule_needs_force(run: Run, program: Path, tmp_path: Path) -> None:
    (tmp_path / "schedule.json").unlink()
    command = ("flash", program, "--programmer", stand_in(tmp_path, "pk2cmd", "", 0), "--dry-run")
    refused = run(*command, "--device", "PIC16F84")
    assert refused.code == 2
    assert "no schedule.json beside" in refused.err
    forced = run(*command, "--device", "PIC16F84", "--force")
    assert forced.code == 0
    assert "no schedule.json beside" in forced.err
    assert run(*command, "--against", LAB8 / "schedule.json").code == 0


def test_the_chip_is_the_one_that_the_program_was_built_for(run: Run, program: Path, tmp_path: Path) -> None:
    command = ("flash", program, "--programmer", stand_in(tmp_path, "pk2cmd", "", 0), "--dry-run")
    assert "-PPIC16F84 " in run(*command).out
    schedule = tmp_path / "schedule.json"
    schedule.write_text(schedule.read_text().replace('"PIC16F84"', '"PIC16F84A"'))
    assert "-PPIC16F84A " in run(*command).out


def test_another_chip_than_the_one_that_it_was_built_for_is_refused(
    run: Run, program: Path, tmp_path: Path
) -> None:
    command = ("flash", program, "--programmer", stand_in(tmp_path, "pk2cmd", "", 0), "--dry-run")
    refused = run(*command, "--device", "16F84A")
    assert refused.code == 2
    assert "it was built for a PIC16F84, --device is PIC16F84A" in refused.err
    assert "-PPIC16F84A " in run(*command, "--device", "16F84A", "--force").out
    assert run(*command, "--device", "16f84").code == 0


def test_a_chip_that_nothing_names_is_asked_for_even_by_force(
    run: Run, program: Path, tmp_path: Path
) -> None:
    (tmp_path / "schedule.json").unlink()
    tool = stand_in(tmp_path, "pk2cmd", "", 0)
    done = run("flash", program, "--programmer", tool, "--dry-run", "--force")
    assert done.code == 2
    assert "the chip is not known" in done.err
    assert "--device PIC16F84 " in done.err


def test_doctor_finds_what_flash_finds(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """picpro is a library of this Python, and PICkit 3 and 4 are both programmed by ipecmd."""
    stand_in(tmp_path, "ipecmd", "", 0)
    monkeypatch.setenv("PATH", str(tmp_path))
    told = json.loads(run("doctor", "--json").out)["tools"]
    for programmer in PROGRAMMERS:
        try:
            find(programmer.name)
        except ToolError:
            assert told[programmer.name] is None, programmer.name
        else:
            assert told[programmer.name], programmer.name
    assert told["ipecmd"] == told["pickit3"] == str(tmp_path / "ipecmd")


def test_without_any_programmers_program_all_that_would_do_are_named(
    run: Run, program: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    done = run("flash", program)
    assert done.code == 3
    assert "error: no program for a programmer is installed" in done.err
    for each in PROGRAMMERS:
        assert f"{each.name} ({each.hardware})" in done.err


def test_code_protection_and_a_chip_without_an_id_are_said(run: Run, tmp_path: Path) -> None:
    tool = stand_in(tmp_path, "pk2cmd", "", 0)
    path = hex_file(tmp_path, Image({0: 0x2800}, config_word("XT", code_protect=True)))
    done = run("flash", path, "--programmer", tool, "--dry-run", "--device", "PIC16F84", "--force")
    assert done.code == 0
    assert "code protection is on" in done.err
    assert "has no device ID" in done.err


def test_a_programmer_that_is_not_in_the_table_is_refused(run: Run, program: Path) -> None:
    done = run("flash", program, "--programmer", "picproo")
    assert done.code == 2
    assert "did you mean 'picpro'?" in done.err


def test_a_programmer_on_a_port_needs_one(run: Run, program: Path, tmp_path: Path) -> None:
    done = run("flash", program, "--programmer", stand_in(tmp_path, "picprog", "", 0))
    assert done.code == 2
    assert "--port" in done.err


@pytest.mark.parametrize("seed", range(20))
def test_a_programmer_answers_again_after_garbage_and_a_silence(seed: int) -> None:
    clock = [0.0]
    device_under_test = programmer()
    device_under_test.now = lambda: clock[0]
    dice = random.Random(seed)
    for _ in range(8):
        device_under_test.received(b"P" + dice.randbytes(1023))
        assert len(device_under_test.outgoing) <= 4096
    clock[0] += 1.5
    for sent, answer in ((b"\1", b"Q"), (b"P", b"P"), (b"\2x", b"x"), (b"\x15", b"P18A"), (b"\1", b"Q")):
        device_under_test.received(sent)
        assert bytes(device_under_test.outgoing) == answer
        device_under_test.outgoing.clear()


def test_a_silence_in_the_middle_of_a_session_changes_nothing_that_was_answered() -> None:
    clock = [0.0]
    device_under_test = programmer()
    device_under_test.now = lambda: clock[0]
    device_under_test.received(b"P\7\xff")  # half of the number of words that are to follow
    clock[0] += 0.9
    device_under_test.received(b"\xff")
    assert bytes(device_under_test.outgoing) == b"PN", "no chip has as many words"
    clock[0] += 1.1
    device_under_test.received(b"\1")
    assert bytes(device_under_test.outgoing) == b"Q"


def test_without_the_programming_voltage_nothing_changes_on_the_chip() -> None:
    device_under_test = programmer()
    for garbage in (b"P\7\0\1" + bytes(32), b"\x0e", b"\5", b"\1"):
        device_under_test.received(garbage)
    assert device_under_test.chip.image == EMPTY


def test_a_chip_is_programmed_after_100_kb_of_garbage(run: Run, program: Path, serve: Serve) -> None:
    device = programmer()
    port = serve({"programmer": device}).paths["programmer"]
    handle = os.open(port, os.O_RDWR | os.O_NOCTTY)
    try:
        data = memoryview(random.Random(7).randbytes(100_000))
        while data:
            data = data[os.write(handle, data) :]
        while device.taken < 100_000:  # a real port sends everything before it closes
            time.sleep(0.01)
    finally:
        os.close(handle)
    done = run("flash", program, "--port", port, "--programmer", "picpro")
    assert done.code == 0, done.err
