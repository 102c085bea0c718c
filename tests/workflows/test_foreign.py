"""`tune`: under another compiler, too, every edge comes to its cycle; what is not its HEX is refused."""

import random
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from typer.testing import CliRunner

from servogen.cli.app import app
from servogen.compiler import Options, Source, compile_sources
from servogen.engines.firmware import DIALECTS, Firmware
from servogen.errors import InputError
from servogen.job import PlannedJob, load, plan_job
from servogen.pic.device import device
from servogen.pic.image import Image, to_hex
from servogen.workflows.engines import PlayedJob, planned
from servogen.workflows.retarget import Added, Tuned, Write, tune_to
from servogen.workflows.verification import checked_cycles, judge_edges, running
from tests.campaigns import sampled
from tests.workflows.other_compilers import other_compiler, sdcc, sdcc_compiled

ROOT = Path(__file__).parent.parent.parent


@cache
def job(name: str) -> PlannedJob:
    return plan_job(load(ROOT / "jobs" / f"{name}.toml"))


@cache
def firmware(name: str, dialect: str) -> Firmware:
    return planned(job(name)).make(dialect)


@dataclass(frozen=True)
class Rounds:
    """What tune said of each HEX, in turn: whether it was exact, and the worst edge."""

    exact: list[bool]
    worst: list[int]


def tuned(name: str, dialect: str, compiler: object, rounds: int = 2) -> Rounds:
    """Compiles, tunes, compiles what tune gives, until there is nothing to tune."""
    source = Source(firmware(name, dialect).text, "main.c")
    found = Rounds([], [])
    for _ in range(rounds):
        image = compiler(source.text)  # type: ignore[operator]
        said = tune_to(job(name), image, "theirs.hex", dialect, source)
        found.exact.append(said.verdict.passed)
        found.worst.append(said.verdict.worst_edge_error)
        if not said.source:
            break
        source = Source(said.source, "next.c")
    return found


@pytest.mark.parametrize(
    ("name", "dialect", "seed"),
    sampled(
        [
            *(("lab9-exercise", dialect, seed) for seed, dialect in enumerate(DIALECTS, 1)),
            ("lab8-exercise", "sdcc", 1),
            ("lab8-exercise", "xc8", 3),
        ],
        2,
    ),
)
def test_what_tune_gives_is_exact_under_a_compiler_that_adds_cycles(
    name: str, dialect: str, seed: int
) -> None:
    found = tuned(name, dialect, lambda text: other_compiler(text, dialect, job(name).device, seed))
    assert found.exact == [False, True]
    assert found.worst[0] != 0 and found.worst[1] == 0


def test_a_sequence_with_pauses_and_long_runs_is_exact_too() -> None:
    found = tuned(
        "omni-square", "xc8", lambda text: other_compiler(text, "xc8", job("omni-square").device, 4)
    )
    assert found.exact == [False, True]


@pytest.mark.campaign
def test_a_compiler_whose_delays_are_too_long_needs_more_rounds() -> None:
    """A cycle more for every 120 asked for: the delays of the next C are others, and so is what they cost."""

    def compiler(text: str) -> Image:
        long = re.sub(r"_delay\((\d+)\);", lambda call: f"_delay({int(call[1]) * 121 // 120});", text)
        return other_compiler(long, "xc8", job("lab9-exercise").device, 0)

    found = tuned("lab9-exercise", "xc8", compiler, rounds=6)
    assert found.exact == [False, False, True]


def test_servogens_own_hex_needs_no_tuning() -> None:
    said = tune_to(
        job("lab8-exercise"), firmware("lab8-exercise", "xc8").compilation.image, "main.hex", "xc8"
    )
    assert said.verdict.passed and said.source == ""
    assert all(each.theirs == each.ours for each in said.added)


def test_one_cycle_more_behind_one_statement_is_found_and_named() -> None:
    text = firmware("lab9-exercise", "xc8").text
    longer = re.sub(r"(PORTB = 0x02;   /\* horizontal high[^\n]*)", r"\1 NOP();", text, count=1)
    image = other_compiler(longer, "xc8", job("lab9-exercise").device, 0)
    usual = other_compiler(text, "xc8", job("lab9-exercise").device, 0)
    said, before = (tune_to(job("lab9-exercise"), each, "theirs.hex", "xc8") for each in (image, usual))
    changed = [(a.path, a.theirs - b.theirs) for a, b in zip(said.added, before.added, strict=True) if a != b]
    assert changed == [("in move_1 after horizontal high", 1)]


def test_the_hex_of_another_job_is_refused_with_what_differs() -> None:
    mine = job("lab8-exercise")
    for other, says in (
        ("lab9-program", "makes RB1 high, not RB0 high"),
        (
            "lab8-program",
            "it writes 600 times to its pins, not 1001 times",
        ),
        ("omni-square", "makes RB0 high and RB1 high|makes RB1 high"),
    ):
        with pytest.raises(InputError, match=f"is not main.xc8.c compiled: .*({says})"):
            tune_to(mine, firmware(other, "xc8").compilation.image, f"{other}.hex", "xc8")


def test_a_c_of_another_job_is_refused_too() -> None:
    source = Source(firmware("lab9-program", "xc8").text, "wrong.c")
    image = firmware("lab8-exercise", "xc8").compilation.image
    with pytest.raises(InputError, match=r"wrong\.c: error: is not a program of lab8-exercise"):
        tune_to(job("lab8-exercise"), image, "theirs.hex", "xc8", source)


def test_cycles_that_differ_from_pass_to_pass_are_named() -> None:
    text = firmware("lab8-exercise", "xc8").text
    unsteady = text.replace(
        "if (--frames == 0)", "if (frames & 1) { NOP(); NOP(); NOP(); } if (--frames == 0)", 1
    )
    image = other_compiler(unsteady, "xc8", job("lab8-exercise").device, 0)
    with pytest.raises(InputError, match="from one position_1 to the next its statements take"):
        tune_to(job("lab8-exercise"), image, "theirs.hex", "xc8")


def test_a_way_whose_statements_take_longer_than_it_may_is_named() -> None:
    text = firmware("lab8-exercise", "xc8").text
    slow = text.replace("if (--frames == 0)", "NOP(); " * 58 + "if (--frames == 0)")
    image = other_compiler(slow, "xc8", job("lab8-exercise").device, 0)
    with pytest.raises(InputError, match="from one position_1 to the next it takes"):
        tune_to(job("lab8-exercise"), image, "theirs.hex", "xc8")


def writes(*cycles: int) -> list[Write]:
    return [Write(cycle, "RB0 high" if number % 2 else "RB0 low") for number, cycle in enumerate(cycles)]


def test_a_tuning_as_json_has_the_cycles_of_each_way_and_the_verdict() -> None:
    verdict = SimpleNamespace(passed=False, to_json=lambda: {"frames": 3})
    found = Tuned(cast(Any, verdict), (Added("in position_1", 7, 4),), "the next C")
    assert found.to_json() == {
        "exact": False,
        "added": [{"path": "in position_1", "their_cycles": 7, "servogen_cycles": 4}],
        "verdict": {"frames": 3},
    }


def test_a_players_hex_is_not_tuned_but_verified(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="exact with any compiler") as refused:
        tune_to(player(tmp_path, 1).job, Image({}), "theirs.hex", "xc8")
    assert "servogen verify theirs.hex --against schedule.json" in (refused.value.hint or "")


def sweeping(servos: int) -> str:
    """A player's job: servos that go to and fro, every second the other way."""
    pins = [*(f"RB{bit}" for bit in range(8)), *(f"RA{bit}" for bit in range(5))][:servos]
    text = '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n[firmware]\nengine = "player"\n'
    for number, pin in enumerate(pins):
        text += f'[[servo]]\nname = "s{number}"\npin = "{pin}"\nmodel = "futaba-s3001"\n'
    poses = [
        ", ".join(f"s{number}_deg = {(low, high)[number % 2]}" for number in range(servos)) + more
        for low, high, more in ((45, 135, ", hold_s = 0.32"), (135, 45, ", move_s = 0.64, hold_s = 0.32"))
    ]
    return text + f"[motion]\nrepeat = true\nposes = [ {{ {poses[0]} }}, {{ {poses[1]} }} ]\n"


@cache
def player(folder: Path, servos: int) -> PlayedJob:
    file = folder / f"player{servos}.toml"
    file.write_text(sweeping(servos))
    return planned(plan_job(load(file)))


def player_made_by_another(text: str, seed: int, more: str = "") -> Image:
    """The player's C with NOPs behind its statements, and `more` where the pins rise."""
    draw = random.Random(seed)
    lines = []
    for line in text.splitlines():
        statement = line.startswith("    ") and line.endswith(";") and "asm(" not in line
        lines.append(line + (" NOP(); NOP();" if statement and draw.random() < 0.4 else ""))
        if "both rise" in line:
            lines.append(more)
    options = Options(dialect="xc8", device=device("PIC16F84"), optimise=draw.choice(("speed", "size")))
    return compile_sources([Source("\n".join(lines), "other.c")], options).image


@pytest.mark.parametrize("seed", sampled([1, 2]))
def test_a_players_hex_is_exact_whatever_the_c_costs(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = player(tmp_path, 6)
    text = found.make("xc8").text
    schedule = tmp_path / "schedule.json"
    schedule.write_text(found.plan.schedule.json_text())
    right, wrong = tmp_path / "right.hex", tmp_path / "wrong.hex"
    right.write_text(to_hex(player_made_by_another(text, seed)))
    wrong.write_text(to_hex(player_made_by_another(text, seed, '    asm("nop");')))
    assert run("verify", str(right), "--against", str(schedule)) == 0
    assert "exact" in capsys.readouterr().out
    assert run("verify", str(wrong), "--against", str(schedule)) == 1
    assert "width +1" in capsys.readouterr().out


def run(*arguments: str) -> int:
    result = CliRunner().invoke(app, list(arguments))
    print(result.output)
    return result.exit_code


def test_the_command_leads_to_an_exact_hex_round_by_round(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """0 when the HEX is exact, 1 while it is not; the C's names go on by number."""
    toml = str(ROOT / "jobs" / "lab9-program.toml")
    for number, code in ((0, 1), (1, 0)):
        c_file = tmp_path / (f"main.c2c.{number}.c" if number else "main.c2c.c")
        if number == 0:
            c_file.write_text(firmware("lab9-program", "c2c").text)
        theirs = tmp_path / f"{number}.hex"
        theirs.write_text(
            to_hex(other_compiler(c_file.read_text(), "c2c", job("lab9-program").device, seed=9))
        )
        assert run("tune", toml, "--hex", str(theirs), "--c", str(c_file)) == code
        out = capsys.readouterr().out
        again = f"not exact yet: compile {tmp_path / 'main.c2c.1.c'}, then servogen tune {toml} --hex … --c "
        assert (again in out, f"{theirs}: 0 cycles off" in out) == (bool(code), not code)
    assert sorted(path.name for path in tmp_path.glob("*.c")) == ["main.c2c.1.c", "main.c2c.c"]
    assert run("tune", toml, "--hex", str(theirs), "--c", str(c_file), "--json") == 0


@pytest.mark.skipif(sdcc() is None, reason="SDCC's pic14 port is not on this machine")
@pytest.mark.parametrize(
    "name", ["lab8-program", "lab8-exercise", "lab9-program", "lab9-exercise", "omni-square"]
)
def test_under_the_real_sdcc_every_edge_is_exact_after_one_tuning(name: str, tmp_path: Path) -> None:
    found = tuned(name, "sdcc", lambda text: sdcc_compiled(text, job(name).device.name, tmp_path, sdcc()))  # type: ignore[arg-type]
    assert found.exact == [False, True]


@pytest.mark.skipif(sdcc() is None, reason="SDCC's pic14 port is not on this machine")
@pytest.mark.parametrize(("servos", "in_time"), [(4, True), (10, True), (12, False)])
def test_the_player_under_the_real_sdcc_is_exact_untuned_where_its_c_ends_in_time(
    servos: int, in_time: bool, tmp_path: Path
) -> None:
    """A slot for which the C was not ready comes a round of TMR0 later: 8192 cycles."""
    found = player(tmp_path, servos)
    image = sdcc_compiled(found.make("sdcc").text, "PIC16F84", tmp_path, sdcc())  # type: ignore[arg-type]
    assert image is not None
    schedule, span = found.plan.schedule, checked_cycles(found.plan.schedule)
    verdict = judge_edges(schedule, running(schedule, image, span), span)
    assert verdict.passed == in_time
    if not in_time:
        assert verdict.difference is not None and verdict.difference.observed is not None
        assert verdict.difference.observed - (verdict.difference.expected or 0) == 8192
