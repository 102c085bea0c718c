"""Several captures of one motion in one file: each is judged by itself, and nothing across a seam."""

import json
import re
from fractions import Fraction
from pathlib import Path
from statistics import mean

import numpy as np
import pytest

from servogen.bench.analysers.memory import CaptureNeeds, CapturePlan, plan
from servogen.bench.analysers.recording import Stitched, stitch
from servogen.bench.analysers.sump import Runs
from servogen.bench.analysers.sump_client import ReceivedSamples
from servogen.bench.virtual.analyser import AnalyserOptions, VirtualAnalyser
from servogen.bench.virtual.chip import VirtualChip
from servogen.errors import ToolError
from servogen.pulse import from_json
from servogen.pulse.expected import expected
from servogen.report.signals import captured
from servogen.units import Clock
from servogen.workflows.reporting import capture_facts
from tests.bench.conftest import LAB8, ROOT, Run, Serve, image_of, shorter_in
from tests.campaigns import sampled

HEXAPOD = ROOT / "firmware" / "hexapod-tripod"
SMALL = 8192
"""Bytes of an analyser of 4096 samples of 16 bits."""


def device(folder: Path, **options: object) -> dict[str, VirtualAnalyser]:
    chip = VirtualChip(image_of(folder / "main.hex"), Clock(4_000_000), ppm=Fraction(180))
    return {"analyser": VirtualAnalyser(chip, AnalyserOptions(memory=SMALL, **options))}  # type: ignore[arg-type]


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("folder", "seconds", "frames"),
    sampled(
        [
            (HEXAPOD, (), 291),  # edges at 17.5 different times of a frame, 36.3 words: 111 fit
            (LAB8, ("--seconds", 30), 1500),  # 2 edges in a frame, 5.2 words: 782 fit
        ]
    ),
)
def test_a_motion_longer_than_the_memory_is_stitched_and_proven(
    run: Run, serve: Serve, tmp_path: Path, folder: Path, seconds: tuple[object, ...], frames: int
) -> None:
    port = serve(device(folder)).paths["analyser"]
    against = folder / "schedule.json"
    done = run(
        "capture", "--port", port, "-o", tmp_path / "run.vcd", "--against", against, *seconds, "--json"
    )
    assert done.code == 0, done.err
    said = json.loads(done.out)
    assert said["captures"] > 1
    done = run("verify", tmp_path / "run.vcd", "--against", against, "--json")
    verdict = json.loads(done.out)
    assert (done.code, verdict["reasons"]) == (0, [])
    assert len(verdict["pieces"]) == said["captures"]
    assert verdict["frames"] >= frames
    assert verdict["crystal_ppm"] == pytest.approx(180, abs=2)
    assert verdict["different_frames_seen"] == verdict["different_frames"]
    drawn_where_it_is_planned(folder, tmp_path / "run.vcd", said["captures"])


def drawn_where_it_is_planned(folder: Path, path: Path, captures: int) -> None:
    """A job's page shows one piece, each pulse at its place in the schedule."""
    schedule = from_json((folder / "schedule.json").read_text(), "schedule.json")
    facts = capture_facts(schedule, path)
    assert re.fullmatch(rf"run\.vcd, piece \d of {captures}", facts.name)
    first, *_ = captured(schedule, facts.trace, facts.verdict)
    period = 20_000
    runs = [run.pulses[0] for run in (*schedule.lead_in, *schedule.loop) for _ in range(run.frames)]
    for rise, width in zip(first.rise[:50], first.width[:50], strict=True):
        frame = round(rise / period)  # the first servo's pulses rise as their frame begins
        pulse = runs[frame]
        assert pulse is not None
        assert abs(width - pulse.width) < 2
        assert abs(rise - frame * period - pulse.rise) < 5


def test_the_text_says_that_it_is_stitched(run: Run, serve: Serve, tmp_path: Path) -> None:
    port = serve(device(LAB8)).paths["analyser"]
    common = ("--port", port, "-o", tmp_path / "run.vcd", "--against", LAB8 / "schedule.json")
    done = run("capture", *common, "--no-rle", "--rate", 100_000, "--seconds", 0.1)
    assert "stitched from 5 captures, because one holds 1 frame; the time between two" in done.out
    done = run("verify", tmp_path / "run.vcd", "--against", LAB8 / "schedule.json", "--partial")
    assert done.code == 0
    assert done.out.startswith("agrees as far as it was seen: 1 of 3 different frames; ")
    assert "nothing is measured across a seam" in done.out


def test_without_stitching_what_does_not_fit_is_refused_with_the_arithmetic(
    run: Run, serve: Serve, tmp_path: Path
) -> None:
    port = serve(device(HEXAPOD)).paths["analyser"]
    common = ("--port", port, "-o", tmp_path / "run.vcd")
    done = run("capture", *common, "--no-stitch", "--against", HEXAPOD / "schedule.json")
    assert done.code == 2
    held = re.search(r"4096 words hold (\d+) frames of ([\d.]+) words and the one in .*, not (\d+)", done.err)
    assert held, done.err
    frames, words, wanted = (float(number) for number in held.groups())
    schedule = from_json((HEXAPOD / "schedule.json").read_text(), "schedule.json")
    assert wanted == schedule.lead_in_frames + schedule.loop_frames
    instants = [
        len({edge for pulse in run.pulses if pulse for edge in (pulse.rise, pulse.rise + pulse.width)})
        for run in schedule.loop
        for _ in range(run.frames)
    ]
    # run-length encoding takes two words for each change of level, and a few for the time between two frames
    assert 2 * mean(instants) <= words <= 2 * mean(instants) + 2
    assert 4096 / words - 3 <= frames <= 4096 / words
    done = run("capture", *common, "--seconds", 60)
    assert done.code == 2
    assert "with --against, several captures are stitched" in done.err


def test_too_little_memory_for_a_frame_is_refused_however_many_captures_are_made(
    run: Run, serve: Serve, tmp_path: Path
) -> None:
    port = serve(device(LAB8)).paths["analyser"]
    common = ("--port", port, "-o", tmp_path / "run.vcd", "--against", LAB8 / "schedule.json")
    done = run("capture", *common, "--no-rle")
    assert done.code == 2
    assert "8192 bytes are 4096 words" in done.err
    assert "20000 samples of a word each" in done.err


def test_an_analyser_that_goes_away_leaves_a_stitched_capture_that_is_not_whole(
    run: Run, serve: Serve, tmp_path: Path
) -> None:
    port = serve(device(HEXAPOD, unplug_after=3001)).paths["analyser"]
    against = HEXAPOD / "schedule.json"
    done = run("capture", "--port", port, "-o", tmp_path / "run.vcd", "--against", against)
    assert done.code == 3
    assert not (tmp_path / "run.vcd").exists()
    done = run("verify", tmp_path / "run.partial.vcd", "--against", against)
    assert done.code == 1
    assert "the capture is incomplete: the analyser disappeared after 3001 of" in done.out


def test_a_pulse_that_is_two_microseconds_too_long_is_caught_in_whatever_piece_it_is(
    run: Run, serve: Serve, tmp_path: Path
) -> None:
    port = serve(device(HEXAPOD)).paths["analyser"]
    against = tmp_path / "schedule.json"
    for frame in (220, 344):
        against.write_text(shorter_in(HEXAPOD, frame))
        if frame == 220:
            done = run("capture", "--port", port, "-o", tmp_path / "run.vcd", "--against", against)
            assert done.code == 0, done.err
        done = run("verify", tmp_path / "run.vcd", "--against", against)
        assert done.code == 1
        where = rf"- first at [0-9.]+ s \(piece \d\), RB0 \(L1-turn\), frame {frame} "
        assert re.search(where, done.out), done.out


def stitched_until(failing: int) -> Stitched:
    """What is left of looks at a pin at rest, of which one fails, by its number from 1 on."""
    schedule = from_json((LAB8 / "schedule.json").read_text(), "schedule.json")
    one = CaptureNeeds(Fraction(1, 50), Fraction(2), 5, Fraction(2), 2)
    silence = Runs(np.zeros(1, dtype=np.uint32), np.zeros(1, dtype=np.int64), 200_000)

    def look(planned: CapturePlan, number: int) -> ReceivedSamples:
        if number == failing:
            raise ToolError("no-answer", "nothing rose on channel 0")
        return ReceivedSamples(silence)

    return stitch(look, plan(SMALL, 1_000_000, True, one), 50, False, expected(schedule), {0: 5})


def test_a_look_that_fails_leaves_those_before_it() -> None:
    found = stitched_until(failing=2)
    assert (len(found.records), found.missing) == (1, "nothing rose on channel 0")


def test_a_first_look_that_fails_is_the_error_itself() -> None:
    with pytest.raises(ToolError, match="nothing rose on channel 0"):
        stitched_until(failing=1)
