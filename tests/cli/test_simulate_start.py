"""The machine's options at power-up are options of `simulate`."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.conftest import Ran

SOURCE = " list r=dec\n __config 0x3FF1\n movf 5, w\n movwf 0x20\n movf 0x30, w\nstand goto stand\n end\n"


def state(run: Callable[..., Ran], folder: Path, *options: object) -> dict[str, list[int]]:
    program = folder / "read.asm"
    program.write_text(SOURCE)
    ran = run("simulate", program, "--cycles", 20, "--json", *options)
    assert ran.code == 0
    return json.loads(ran.out)  # type: ignore[no-any-return]


def test_ram_floating_pins_and_a_seed(run: Callable[..., Ran], tmp_path: Path) -> None:
    assert state(run, tmp_path)["w"] == 0
    assert state(run, tmp_path, "--start", "ram=0x5A")["w"] == 0x5A
    assert state(run, tmp_path, "--floating", 1)["ram"][0x20 - 0x0C] == 0x1F
    drawn = [state(run, tmp_path, "--start-seed", seed)["ram"] for seed in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]


@pytest.mark.parametrize(
    ("option", "value"), [("--start", "ram=256"), ("--floating", 2), ("--power-up-us", -1)]
)
def test_a_value_that_no_chip_has_is_refused(
    run: Callable[..., Ran], tmp_path: Path, option: str, value: object
) -> None:
    program = tmp_path / "read.asm"
    program.write_text(SOURCE)
    ran = run("simulate", program, option, value)
    assert ran.code == 2
    assert str(value).split("=")[-1] in ran.err
