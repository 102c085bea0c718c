"""What a plain chip does on a random line is what the theorem about any line allows."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from servogen.pic.isa import encode
from tests.campaigns import sampled
from tests.prove import random_lines
from tests.prove.random_lines import JOBS, random_run, walk

FRAMES = 150

target = cache(random_lines.target)


@pytest.mark.parametrize("name", sampled(JOBS))
def test_every_pulse_and_every_variable_is_as_the_theorem_says(name: str) -> None:
    assert list(walk(target(name), random_run(target(name), 1, FRAMES))) == []


def test_a_changed_word_is_found() -> None:
    aim = target("stream-arm")
    value, silence = aim.names.at("value"), aim.names.at("silence")
    for word, which, found in (
        # A position's product is wrong, and with it pulses; the silence is not reset by a command, which
        # shows in no pulse before the fail-safe acts.
        (encode("RRF", f=value, d=1), 0, " wrong edges"),
        (encode("CLRF", f=silence), -1, f"place 0x{silence:02X} is "),
    ):
        place = [row.address for row in aim.names.listing.rows if row.word == word][which]
        image = aim.made.image
        image = replace(image, program={**image.program, place: encode("NOP")})
        changed = replace(aim, made=replace(aim.made, image=image))
        messages = list(walk(changed, random_run(changed, 1, FRAMES)))
        assert any(found in message for message in messages), messages
