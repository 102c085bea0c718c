"""A sequence of more steps or widths than the chip has words is refused before it is compiled."""

import pytest

from servogen.engines.firmware import ResourceError
from servogen.engines.sequence import tuning
from servogen.pic.device import DEVICES
from servogen.pulse import Channel, Pulse, PulseSchedule, Run
from servogen.units import Clock, Cycles


@pytest.mark.parametrize(("steps", "compiled"), [(1024, True), (1025, False)])
def test_more_steps_than_words_are_refused_before_they_are_compiled(
    steps: int, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def compile_nothing(*_: object) -> None:
        raise ResourceError("does-not-fit", "compiled")

    monkeypatch.setattr(tuning, "compiled_to_fit", compile_nothing)
    monkeypatch.setattr(tuning, "render", lambda *_: "")
    runs = tuple(Run(9, (Pulse(Cycles(0), Cycles(1000 + step)),)) for step in range(steps))
    schedule = PulseSchedule(Clock(4_000_000), Cycles(20_000), (Channel("arm", "RB0", ""),), (), runs)
    with pytest.raises(ResourceError) as error:
        tuning.tune(schedule, "c2c", DEVICES[0], "long")
    assert error.value.code == "does-not-fit"
    assert (error.value.message == "compiled") is compiled
    assert compiled or f"{steps} steps of one word or more each, the chip has 1024" in error.value.message


def test_tables_of_more_widths_than_words_are_refused_before_they_are_compiled() -> None:
    """513 frames that all differ: two words for each width."""
    runs = tuple(Run(1, (Pulse(Cycles(0), Cycles(1000 + frame)),)) for frame in range(513))
    schedule = PulseSchedule(Clock(4_000_000), Cycles(20_000), (Channel("arm", "RB0", ""),), (), runs)
    with pytest.raises(ResourceError, match=r"3 steps .* and 1026 words of widths, the chip has 1024"):
        tuning.tune(schedule, "c2c", DEVICES[0], "long")
