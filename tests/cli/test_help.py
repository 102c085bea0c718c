"""What `--help` says is what was written, and every command is found by its name."""

import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer
from rich.text import Text

from servogen.cli.app import GROUPS, MODULES, LazyCommands, app
from tests.cli.conftest import Run
from tools import answers

JOB = str(Path(__file__).parents[2] / "jobs" / "hexapod-wave.toml")


def helps() -> Iterator[str]:
    """The help of the application, of its commands and of their options."""
    group: Any = typer.main.get_command(app)
    context = typer.Context(group)
    commands = (group.resolve_command(context, [name])[1] for name in group.list_commands(context))
    for command in (group, *commands):
        yield command.help or ""
        for parameter in command.params:
            yield getattr(parameter, "help", None) or ""


def test_every_command_with_json_is_compared_between_commits_or_it_is_said_why_not() -> None:
    group: Any = typer.main.get_command(app)
    context = typer.Context(group)
    commands = {name: group.resolve_command(context, [name])[1] for name in group.list_commands(context)}
    printing = {
        name for name, command in commands.items() if "json" in {each.name for each in command.params}
    }
    assert printing == {each.split()[0] for each in answers.COMMANDS} ^ answers.NOT_ASKED.keys()


def test_no_help_has_brackets_that_are_taken_for_markup() -> None:
    """The help is shown as rich's markup, in which [word] is a style and vanishes."""
    assert Text.from_markup("the job's [stream]").plain == "the job's "
    texts = list(helps())
    assert len(texts) > 100
    assert [text for text in texts if Text.from_markup(text).plain != text] == []


def test_no_help_has_the_quotes_of_its_source() -> None:
    """In a docstring adjacent strings are not joined: their quotes are shown."""
    assert [text for text in helps() if re.search(r'"\s+"', text)] == []


OPTIONS: dict[str, tuple[object, float | None, float | None]] = {
    "--arrive-s": (1.0, 0, 4),
    "--at-cycle": (0, 0, 864_000_000_000),  # two days at 20 MHz
    "--baud": (None, 50, None),
    "--beta-sign": (1, None, None),
    "--clearance-mm": (None, 0, 100_000),
    "--clock-hz": (None, 1, None),
    "--body-height-mm": (None, 0, 100_000),
    "--cycle-s": (None, 0, 1_000_000),
    "--direction-deg": (0.0, -360, 360),
    "--duty": (None, 0, 1),
    "--elements": (None, 1, None),
    "--first": (0, 0, 253),
    "--friction": (0.8, None, None),
    "--level": (1, 0, 8),
    "--body-yaw-deg": (0.0, -180, 180),
    "--margin-mm": (None, 0, 100_000),
    "--gap-mm": (12.0, 0, 100_000),
    "--lift-mm": (20.0, 0, 100_000),
    "--loops": (1, 1, None),
    "--max-commands": (100_000, 1, None),
    "--max-s": (3600.0, 0, 1_000_000),
    "--max-states": (None, 1, None),
    "--memory-mb": (300, 50, None),
    "--patience": (60.0, 0, None),
    "--period-us": (20_000, 1000, 1_000_000),
    "--points": (7, 3, 100),
    "--power-up-us": (72_000, None, None),  # the data sheet's typical 72 ms, parameter 33
    "--rate": (None, 1, None),
    "--noise": (0.0, 0, None),
    "watch --port": (0, 0, 65_535),
    "--to-s": (None, 0, None),
    "twin --seconds": (None, 0, None),
    "--seed": (1, 0, None),
    "--spring-mm": (None, 0, 100_000),
    "--stance-width-mm": (None, 0, 100_000),
    "--stride-mm": (40.0, -100_000, 100_000),
    "--timeout": (10.0, 0.1, None),
    "--tolerance-deg": (None, 0.1, None),
    "--turn-deg": (0.0, -360, 360),
    "--watchdog-us": (18_000, None, None),  # 18 ms, parameter 31
    "capture --memory": (None, 8, None),
    "capture --rate": (None, 1, None),
    "capture --seconds": (None, 0.001, None),
    "drive --step-mm": (None, 1, None),
    "drive --turn-deg": (None, 0.1, None),
    "flash --timeout": (120.0, 1, None),
    "gait --cycles": (None, 0, 10_000),
    "grade --timeout": (120.0, 0.1, None),
    "flash --chip": (None, 1, 2),
    "grade --port": (0, 0, 65_535),
    "prove --watchdog-us": (None, None, None),  # any
    "rig --memory": (24_576, 16, None),  # the Openbench Logic Sniffer's 24 KiB
    "rig --rate": (100_000_000, 1, None),
    "simulate --cycles": (None, 0, 10**16),
    "twin --step-mm": (0.0, None, None),
    **dict.fromkeys(("--crystal-ppm", "--rough-mm", "--slope-deg"), (0.0, None, None)),
    "--margin-percent": (0.5, 0, 50),
    **dict.fromkeys(("--floating", "--tmr0-phase"), (0, None, None)),
    **{
        f"--{name}": ((0.0,) * 3, None, None)
        for name in ("force-n", "moment-nm", "rotation-rad", "translation")
    },
}
"""The default, minimum and maximum of the options that take a number. One command's own come first."""

ON = {"--browser", "--compensate", "--oscillator-start-up", "--rle", "rig --scheduler", "--stitch"}


def parameters() -> Iterator[tuple[str, Any]]:
    """Every option and argument of every command."""
    group: Any = typer.main.get_command(app)
    context = typer.Context(group)
    for name in group.list_commands(context):
        yield from ((name, each) for each in group.resolve_command(context, [name])[1].params)


def test_flags_are_off_and_numbers_have_their_defaults_and_limits() -> None:
    """A flag is off unless it can be turned off with --no-; a number has its default and its limits."""
    seen: set[str] = set()
    for command, each in parameters():
        long = next((name for name in each.opts if name.startswith("--")), "")
        key = next((key for key in (f"{command} {long}", long) if key in OPTIONS or key in ON), "")
        seen.add(key)
        found = (each.default, getattr(each, "min", None), getattr(each, "max", None))
        if getattr(each, "is_flag", False):
            assert (each.default, bool(each.secondary_opts)) == (key in ON, key in ON), (command, long)
        elif key:
            assert found == OPTIONS[key], (command, long)
        else:
            assert found[1:] == (None, None), (command, long)
            assert not isinstance(each.default, int | float) and each.default != (0.0,) * 3, (command, long)
    assert seen == {"", *OPTIONS, *ON}


def test_the_list_of_commands_says_of_each_what_its_own_help_says() -> None:
    """Although it is read from the sources, without loading a command."""
    group: Any = typer.main.get_command(app)
    context = typer.Context(group)
    for name in MODULES:
        listed = group.get_command(context, name)
        assert listed.params == []
        loaded = group.resolve_command(context, [name])[1]
        assert (listed.help, listed.rich_help_panel) == (loaded.help, loaded.rich_help_panel)
        assert listed.help


@cache
def loaded_by(*words: str) -> frozenset[str]:
    """The modules that a command, in a process of its own, has loaded when it ends."""
    code = (
        f"import sys; sys.argv = {['servogen', *words]!r}\n"
        "from servogen.cli import main\n"
        "try: main()\n"
        "except SystemExit: print(*sys.modules)"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return frozenset(ran.stdout.splitlines()[-1].split())


def packages_of(modules: frozenset[str]) -> set[str]:
    """The packages of servogen that these modules are in."""
    return {name.split(".")[1] for name in modules if name.startswith("servogen.")}


def test_only_the_module_of_the_command_is_loaded() -> None:
    """What the other commands need costs no time at the start."""
    modules = {f"servogen.cli.{module}" for module in MODULES.values()}
    assert loaded_by("mobility", "--help") & modules == {f"servogen.cli.{MODULES['mobility']}"}
    assert loaded_by("--help") & modules == set()


def test_checking_a_job_loads_no_compiler_no_simulator_and_no_library_for_pictures() -> None:
    """A check plans: what makes, runs and shows the firmware is loaded by the commands that do so."""
    loaded = loaded_by("check", JOB)
    unused = {"compiler", "simulator", "verify", "traces", "prove", "movemaster"}
    assert packages_of(loaded).isdisjoint(unused)
    assert "servogen.job.plan" in loaded
    assert "servogen.workflows.job_build" not in loaded
    assert {"numpy", "pydantic", "rich", "tree_sitter"} <= loaded
    heavy = {
        "scipy",
        "sympy",
        "matplotlib",
        "mujoco",
        "pycparser",
        "jinja2",
        "z3",
        "aiohttp",
        "serial",
        "vcd",
    }
    assert loaded.isdisjoint(heavy)


def test_a_command_that_is_close_to_the_unknown_one_is_named() -> None:
    group = typer.main.get_command(app)
    assert isinstance(group, LazyCommands)
    with pytest.raises(Exception, match="Did you mean 'calibrate'"):
        group.main(["calibrat"], prog_name="servogen", standalone_mode=False)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("nan", "Invalid value for '--stride-mm': 'nan' is not a number"),
        ("1e9", "Invalid value for '--stride-mm': '1e9' should be less than or equal to 100000"),
        ("far", "Invalid value for '--stride-mm': 'far' should be a valid number"),
    ],
)
def test_a_value_that_an_option_does_not_take_is_named(run: Run, value: str, message: str) -> None:
    for words in (("--stride-mm", value), (f"--stride-mm={value}",)):
        ran = run("gait", "tripod", *words)
        assert ran.code == 2
        assert message in ran.err


def test_the_commands_are_shown_in_groups_and_h_is_help(run: Run) -> None:
    shown = run("-h")
    assert (shown.code, shown.err) == (0, "")
    titles = re.findall(r"^╭─ (.*?) ─+╮$", shown.out, re.M)
    assert titles == ["Options", *GROUPS]
    panels = re.split(r"^╭─ .*$", shown.out, flags=re.M)[2:]
    for panel, modules in zip(panels, GROUPS.values(), strict=True):
        first = re.findall(r"^│ ([a-z][a-z-]*)  ", panel, re.M)
        assert first == [name for names in modules.values() for name in names]
    for command in ("grade", "fk", "simulate"):
        assert run(command, "-h").out == run(command, "--help").out


def test_a_hex_file_is_simulated_without_the_compiler_and_the_engines() -> None:
    program = Path(__file__).parents[2] / "firmware" / "lab8-exercise" / "main.hex"
    loaded = packages_of(loaded_by("simulate", str(program), "--cycles", "100"))
    assert "simulator" in loaded
    assert not loaded & {"workflows", "compiler", "engines", "job", "kinematics", "motion", "pulse"}
