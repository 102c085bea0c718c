"""`servogen capture` against the virtual analyser, over a pseudo-terminal and the SUMP protocol."""

import errno
import json
import os
from fractions import Fraction
from pathlib import Path

import pytest

from servogen.bench.ports import Unplugged, open_port
from servogen.bench.virtual.analyser import AnalyserOptions, VirtualAnalyser
from servogen.bench.virtual.chip import VirtualChip
from servogen.errors import Location
from servogen.pic.image import Image
from servogen.units import Clock
from tests.bench.conftest import LAB8, Run, Serve

SCHEDULE = LAB8 / "schedule.json"
CLOCK = Clock(4_000_000)


def analyser(image: Image, ppm: int = 0, **options: object) -> dict[str, VirtualAnalyser]:
    chip = VirtualChip(image, CLOCK, ppm=Fraction(ppm))
    return {"analyser": VirtualAnalyser(chip, AnalyserOptions(**options))}  # type: ignore[arg-type]


def captured(run: Run, port: str, path: Path, *options: object) -> None:
    done = run("capture", "--port", port, "-o", path, *options)
    assert done.code == 0, done.err


@pytest.mark.parametrize("ppm", [180, 0, -250])
def test_a_captured_job_is_proven_and_the_crystals_error_found(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path, ppm: int
) -> None:
    port = serve(analyser(lab8, ppm)).paths["analyser"]
    captured(run, port, tmp_path / "run.vcd", "--against", SCHEDULE)
    done = run("verify", tmp_path / "run.vcd", "--against", SCHEDULE, "--json")
    verdict = json.loads(done.out)
    assert done.code == 0
    assert verdict["agrees"]
    assert verdict["crystal_ppm"] == pytest.approx(ppm, abs=2)


def test_a_second_capture_goes_on_where_the_chip_is(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path
) -> None:
    port = serve(analyser(lab8, 180)).paths["analyser"]
    for number in range(2):
        captured(run, port, tmp_path / f"{number}.vcd", "--against", SCHEDULE, "--seconds", 3)
        assert run("verify", tmp_path / f"{number}.vcd", "--against", SCHEDULE, "--partial").code == 0
    assert (tmp_path / "0.vcd").read_bytes() != (tmp_path / "1.vcd").read_bytes()


def test_without_rle_every_sample_is_a_word(run: Run, serve: Serve, lab8: Image, tmp_path: Path) -> None:
    port = serve(analyser(lab8, memory=1 << 18)).paths["analyser"]
    captured(run, port, tmp_path / "run.vcd", "--no-rle", "--seconds", 0.06, "--json")
    done = run("verify", tmp_path / "run.vcd", "--against", SCHEDULE, "--partial")
    assert done.code == 0, done.out


def test_too_little_memory_for_a_frame_is_refused_with_the_arithmetic(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path
) -> None:
    port = serve(analyser(lab8)).paths["analyser"]
    done = run("capture", "--port", port, "-o", tmp_path / "run.vcd", "--no-rle", "--against", SCHEDULE)
    assert done.code == 2
    assert "24576 bytes are 12288 words" in done.err
    assert "20000 samples of a word each" in done.err
    assert not (tmp_path / "run.vcd").exists()


def test_a_device_without_metadata_is_used_with_the_memory_that_is_said(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path
) -> None:
    port = serve(analyser(lab8, metadata=False)).paths["analyser"]
    captured(run, port, tmp_path / "run.vcd", "--memory", 8192, "--seconds", 2, "--against", SCHEDULE)
    assert run("verify", tmp_path / "run.vcd", "--against", SCHEDULE, "--partial").code == 0


def test_single_wrong_samples_are_told_as_glitches(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path
) -> None:
    port = serve(analyser(lab8, glitches_per_s=40)).paths["analyser"]
    captured(run, port, tmp_path / "run.vcd", "--seconds", 4, "--wire", "0=RB0", "--against", SCHEDULE)
    verdict = json.loads(run("verify", tmp_path / "run.vcd", "--against", SCHEDULE, "--json").out)
    assert verdict["channels"][0]["glitches"] > 0


def test_a_silent_device_is_an_error_that_names_the_port(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path
) -> None:
    port = serve(analyser(lab8, silent=True)).paths["analyser"]
    done = run("capture", "--port", port, "-o", tmp_path / "run.vcd")
    assert done.code == 3
    assert f"{port}: error: the device does not answer" in done.err


def test_garbage_instead_of_an_identity_is_refused(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path
) -> None:
    port = serve(analyser(lab8, garbage=True)).paths["analyser"]
    done = run("capture", "--port", port, "-o", tmp_path / "run.vcd")
    assert done.code == 3
    assert "the device is not a SUMP analyser" in done.err


def test_a_chip_that_does_nothing_never_triggers(
    run: Run, serve: Serve, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("servogen.workflows.capture.PATIENCE_S", 0.5)
    port = serve(analyser(Image({0: 0x2800}, 0x3FF1))).paths["analyser"]
    done = run("capture", "--port", port, "-o", tmp_path / "run.vcd", "--seconds", 0.1)
    assert done.code == 3
    assert "nothing rose on channel 0" in done.err


@pytest.mark.parametrize("fault", ["stop_after", "unplug_after"])
def test_a_capture_that_ends_early_is_kept_and_never_taken_for_whole(
    run: Run, serve: Serve, lab8: Image, tmp_path: Path, fault: str
) -> None:
    port = serve(analyser(lab8, **{fault: 1001})).paths["analyser"]
    done = run("capture", "--port", port, "-o", tmp_path / "run.vcd", "--against", SCHEDULE)
    assert done.code == 3
    assert "after 1001 of" in done.err
    assert not (tmp_path / "run.vcd").exists()
    partial = tmp_path / "run.partial.vcd"
    assert str(partial) in done.err
    done = run("verify", partial, "--against", SCHEDULE)
    assert done.code == 1
    assert "does NOT agree" in done.out
    assert "the capture is incomplete: the analyser" in done.out


def test_a_port_that_is_not_there_is_named(run: Run, tmp_path: Path) -> None:
    done = run("capture", "--port", tmp_path / "none", "-o", tmp_path / "run.vcd")
    assert done.code == 3
    assert f"{tmp_path / 'none'}: error: there is no such port" in done.err


def test_a_file_is_no_port(run: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = run("capture", "--port", tmp_path / "file", "-o", tmp_path / "run.vcd")
    assert done.code == 3
    assert "cannot be opened as a serial port" in done.err


def test_a_port_whose_device_is_gone_cannot_be_cleared() -> None:
    master, slave = os.openpty()
    path = os.ttyname(slave)
    with open_port(path, 115_200) as port:
        port.clear()
        os.close(master)
        with pytest.raises(Unplugged, match="the device disappeared while it was in use") as lost:
            port.clear()
    os.close(slave)
    assert (lost.value.code, lost.value.first.location) == ("port-lost", Location(path))


def test_two_processes_cannot_have_one_port(run: Run, serve: Serve, lab8: Image, tmp_path: Path) -> None:
    import serial

    port = serve(analyser(lab8)).paths["analyser"]
    with serial.Serial(port, exclusive=True):
        done = run("capture", "--port", port, "-o", tmp_path / "run.vcd")
    assert done.code == 3
    assert "in use by another program" in done.err


def test_a_port_that_the_system_calls_busy_is_in_use(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def busy(*_: object) -> int:
        raise OSError(errno.EBUSY, "Device or resource busy")

    monkeypatch.setattr(os, "open", busy)
    done = run("capture", "--port", "/dev/ttyACM0", "-o", tmp_path / "run.vcd")
    assert done.code == 3
    assert "/dev/ttyACM0: error: is in use by another program" in done.err


def test_no_permission_says_which_group_to_join(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def refused(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refused)
    done = run("capture", "--port", "/dev/ttyACM0", "-o", tmp_path / "run.vcd")
    assert done.code == 3
    assert "permission denied" in done.err
    assert "dialout" in done.err
