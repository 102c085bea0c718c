from pathlib import Path

import pytest

DIMMER = Path(__file__).parent.parent / "dimmer.c"


@pytest.fixture
def chip(servogen_machine):
    return servogen_machine(DIMMER, inputs={"RB0": 1})


def light(chip, since_us):
    """Return the mean share of the time that the lamp is on."""
    widths, periods = (measure("RB3", since_us=since_us) for measure in (chip.widths_us, chip.periods_us))
    return sum(widths[: len(periods)]) / sum(periods)


def test_it_begins_with_a_quarter_of_the_light(chip):
    chip.run_ms(100)
    assert light(chip, since_us=0) == pytest.approx(0.25, abs=0.05)


def test_a_press_makes_it_bright_and_the_next_one_dark(chip):
    for share in (0.75, 0.25):
        chip.press("RB0", bounce_ms=4, hold_ms=60)
        chip.run_ms(40)
        begun = chip.us
        chip.run_ms(100)
        assert light(chip, since_us=begun) == pytest.approx(share, abs=0.05)


def test_a_touch_of_10_ms_is_no_press(chip):
    chip.press("RB0", hold_ms=10)
    chip.run_ms(100)
    assert light(chip, since_us=0) == pytest.approx(0.25, abs=0.05)
