"""The simplest pulse, counted by hand from the data sheet's cycles."""

from servogen.edges import HIGH, LOW
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.simulator import simulate
from servogen.units import Clock

RB0 = 5


def test_a_pulse_lasts_as_long_as_its_instructions() -> None:
    program = [
        encode("BSF", f=3, b=5),  # cycle 0
        encode("CLRF", f=6),  # 1: TRISB = 0
        encode("BCF", f=3, b=5),  # 2
        encode("BSF", f=6, b=0),  # 3: high
        encode("NOP"),  # 4
        encode("GOTO", k=6),  # 5, 6
        encode("BCF", f=6, b=0),  # 7: low
        encode("GOTO", k=7),
    ]
    run = simulate(Image(dict(enumerate(program)), 0x3FF1), Clock(4_000_000), 100)
    (chunk,) = run.edges.chunks
    of_rb0 = [(int(c), int(v)) for c, p, v in zip(*chunk, strict=True) if p == RB0]
    assert of_rb0 == [(1, LOW), (3, HIGH), (7, LOW)]
    assert run.state.cycles in (100, 101)
