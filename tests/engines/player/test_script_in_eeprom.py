"""A program too large for flash keeps the end of its script in the EEPROM: every edge is the schedule's."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from servogen.engines.board import board_of
from servogen.engines.firmware import DIALECTS, Firmware, ResourceError
from servogen.engines.player import Playing
from servogen.engines.player.engine import play
from servogen.engines.player.firmware import firmware
from servogen.engines.player.rendering import render_player
from servogen.engines.stored_script import in_eeprom, in_flash
from servogen.job import PlannedJob, loads, plan_job
from servogen.pic.device import PROGRAM_WORDS
from servogen.prove import Quantifiers, prove_for_all
from servogen.prove.eeprom import TrimSearch
from servogen.workflows.engines import planned
from servogen.workflows.job_build import Build, judge_firmware, report
from tests.engines.player.command_walks import JOB, problems, random_line
from tests.engines.player.player_jobs import ROOT, built_text, job_text, sweep, trimmed

RIPPLE = (ROOT / "jobs" / "hexapod-ripple.toml").read_text()
ROUTE = (
    "{ forward_mm = 40, cycles = 3 }, { turn_deg = 20, cycles = 3 }, { forward_mm = -30, cycles = 3 }, "
    "{ turn_deg = -20, cycles = 3 }, { forward_mm = 40, cycles = 2 }, { turn_deg = 20, cycles = 2 }"
)
SIX_WAYS = re.sub(r"route = \[.*\]", f"route = [{ROUTE}]", RIPPLE)
SERVOS = 12
SMALL = job_text(1, sweep(1, 0.04, limits=(80, 81)), limits=(80, 81), firmware="soft_start_s = 0.04\n")


def six_ways() -> Build:
    return built_text(SIX_WAYS, "c2c")


@cache
def played(text: str) -> tuple[PlannedJob, Playing]:
    job = plan_job(loads(text, "job.toml"))
    return job, play(job)[1]


def forced(text: str, dialect: str = "c2c") -> Firmware:
    """Return the firmware of a job that flash could hold, with its script in the EEPROM."""
    job, motion = played(text)
    stored = in_eeprom(motion.encoded.script.data, len(job.servos))
    made = render_player(motion, stored, job.buttons, dialect, job.device, job.name)
    return firmware(made, job, motion.layout, dialect)


def test_the_trims_are_first_and_the_end_of_the_script_fills_the_rest() -> None:
    """64 bytes, one for each of twelve trims: 52 are left (DS35007 section 3)."""
    script = bytes(range(200, 70, -1))
    stored = in_eeprom(script, SERVOS)
    assert (len(stored.flash), len(stored.eeprom), stored.first) == (130 - 52, 52, 12)
    assert stored.flash + stored.eeprom == script
    for place in range(78, 130):  # as the chip computes the address
        assert stored.eeprom[(place + stored.offset) % 256 - 12] == script[place]
    whole = in_eeprom(script[:52], SERVOS)
    assert (whole.flash, whole.offset) == (b"", 12)
    assert in_flash(script).eeprom == b"" and in_flash(script).flash == script


@pytest.mark.parametrize("dialect", DIALECTS)
def test_with_its_script_in_the_eeprom_every_edge_is_exact(dialect: str) -> None:
    assert judge_firmware(built_text(SMALL, "c2c").plan.schedule, forced(SMALL, dialect)).exact


@pytest.mark.campaign
def test_a_job_that_flash_cannot_hold_is_built_and_every_edge_is_exact() -> None:
    done = six_ways()
    script = played(SIX_WAYS)[1].encoded.script.data
    (program,) = done.programs
    assert program.exact and program.verdict.worst_edge_error == 0
    assert program.firmware.compilation.words <= PROGRAM_WORDS
    eeprom = program.image.eeprom
    assert bytes(eeprom[at] for at in range(SERVOS, 64)) == script[-52:]
    assert all(eeprom.get(trim, 0xFF) == 0xFF for trim in range(SERVOS))
    assert all(budget.left is not None and budget.left > 0 for budget in program.firmware.timing_budgets)
    place = {"flash_bytes": len(script) - 52, "eeprom_bytes": 52, "eeprom_first": 12}
    assert program.to_json()["script"] == place
    text = f"script: {len(script) - 52} bytes in flash, 52 bytes in the EEPROM, bytes 12 to 63"
    assert report(done).count(text) == 1


@pytest.mark.campaign
def test_the_same_program_with_its_script_in_flash_is_too_large() -> None:
    job, motion = played(SIX_WAYS)
    stored = in_flash(motion.encoded.script.data)
    text = render_player(motion, stored, job.buttons, "c2c", job.device, job.name)
    with pytest.raises(ResourceError, match=r"needs 10\d\d words of flash"):
        firmware(text, job, motion.layout, "c2c")


@pytest.mark.campaign
def test_it_is_proven_for_every_power_up_and_reset_and_no_other_content_of_the_eeprom() -> None:
    done = six_ways()
    image, schedule = done.programs[0].image, done.plan.schedule
    found = prove_for_all(image, schedule)
    assert found.proven, found.reason
    assert "the EEPROM holds what the file says" in found.assumptions


def test_a_proof_for_any_eeprom_is_refused_with_the_bytes_that_are_no_trims() -> None:
    schedule = built_text(SMALL, "c2c").plan.schedule
    made = forced(SMALL).compilation.image
    last = max(made.eeprom)
    found = prove_for_all(made, schedule, Quantifiers(any_eeprom=True))
    assert not found.proven and found.counterexample is not None
    assert f"more than trims: with bytes 1 to {last} erased the" in found.counterexample.message


def test_bytes_behind_the_trims_that_the_program_does_not_read_are_no_obstacle() -> None:
    own, schedule = built_text(SMALL, "c2c").programs[0], built_text(SMALL, "c2c").plan.schedule
    image = replace(own.image, eeprom={40: 7})
    assert TrimSearch(image, schedule, board_of(schedule), {}).erased() is None


@pytest.mark.campaign
@pytest.mark.parametrize(("byte", "bit"), [(12, 0), (40, 7), (63, 1)])
def test_a_wrong_bit_of_the_script_in_the_eeprom_is_found_where_that_step_begins(byte: int, bit: int) -> None:
    done = six_ways()
    own, schedule = done.programs[0], done.plan.schedule
    eeprom = {**own.image.eeprom, byte: own.image.eeprom[byte] ^ 1 << bit}
    compilation = replace(own.firmware.compilation, image=replace(own.image, eeprom=eeprom))
    verdict = judge_firmware(schedule, replace(own.firmware, compilation=compilation)).verdict
    assert not verdict.passed and verdict.difference is not None
    begun = own.verdict.start
    assert begun is not None
    # The soft start and the first three ways are in flash, so the pulses are right until then.
    frame = (verdict.difference.cycle - begun) // schedule.period
    assert frame > schedule.lead_in_frames + 3 * 3 * 48


@pytest.mark.campaign
def test_trims_and_the_script_share_the_eeprom() -> None:
    done = six_ways()
    own, schedule = done.programs[0], done.plan.schedule
    trims = {0: 25, 7: -40}
    order = played(SIX_WAYS)[1].order
    eeprom = {
        **own.image.eeprom,
        **{order.index(channel): cycles & 0xFF for channel, cycles in trims.items()},
    }
    compilation = replace(own.firmware.compilation, image=replace(own.image, eeprom=eeprom))
    changed = replace(own.firmware, compilation=compilation)
    assert judge_firmware(trimmed(schedule, trims), changed).exact


def test_a_chain_of_directions_is_read_from_the_eeprom() -> None:
    made = forced((ROOT / "jobs" / f"{JOB}.toml").read_text(), "sdcc")
    assert len(made.compilation.image.eeprom) == 52
    assert list(problems(made.compilation.image, random_line(np.random.default_rng(8), 1500))) == []


@pytest.mark.campaign
def test_a_program_that_is_too_large_either_way_is_refused_with_both_sizes() -> None:
    ways = ROUTE[: ROUTE.index(", { turn_deg = -20")]
    wave = re.sub(r"route = \[.*\]", f"route = [{ways}]", RIPPLE).replace('"ripple"', '"wave"')
    with pytest.raises(ResourceError, match=r"needs 10\d\d words.*in the EEPROM.*needs 10\d\d words"):
        planned(plan_job(loads(wave, "wave.toml"))).make("c2c")
