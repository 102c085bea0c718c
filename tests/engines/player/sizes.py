"""Measures what the player's tables hold for the kept jobs.

`python -m tests.engines.player.sizes` prints the rows of two tables in docs/firmware.md: of the
jobs, and of the flash of one of them.
"""

from __future__ import annotations

from servogen.compiler import Options, Source, compile_sources
from servogen.engines.player.engine import play
from servogen.job import load, plan_job
from servogen.pic.image import read_hex
from servogen.pulse import from_json
from tests.engines.player.player_jobs import ROOT

JOBS = ("hexapod-tripod", "hexapod-ripple", "hexapod-wave", "hexapod-turn", "scara-pick", "rvm1-program")

PARTS = {
    "start-up, ports, the loop of frames": ("__start", "main"),
    "tables": ("__table",),
    "the script and the time of a step": ("rewind", "play", "step", "next_step", "read_script"),
    "the arithmetic": ("make_widths", "make_width", "weigh_swing", "weigh", "blend"),
    "kernel": ("pulses",),
}
"""The parts of a program, and their functions up to the first full stop of their names."""


def flash(name: str) -> dict[str, int]:
    """Return the words of each part of a committed program."""
    source = Source((ROOT / "firmware" / name / "main.c2c.c").read_text(), "main.c2c.c")
    compilation = compile_sources([source], Options(dialect="c2c"))
    part_of = {function: part for part, functions in PARTS.items() for function in functions}
    words = dict.fromkeys(PARTS, 0)
    for function in compilation.listing.functions:
        words[part_of[function.name.partition(".")[0]]] += function.end - function.start
    assert sum(words.values()) == compilation.words
    return words


def row(name: str) -> str:
    """Return a job's row: the bytes of its tables, and of its committed program the words and the distance
    from the plan.
    """
    encoded = play(plan_job(load(ROOT / "jobs" / f"{name}.toml")))[1].encoded
    made = ROOT / "firmware" / name
    words = len(read_hex((made / "main.hex").read_text(), "main.hex").image.program)
    error = from_json((made / "schedule.json").read_text(), "schedule.json").plan_error
    assert error is not None
    counts = (len(encoded.rows), len(encoded.script.data), len(encoded.script.timings), len(encoded.laws))
    return f"| `{name}` | {' | '.join(map(str, counts))} | {words} | {error.width_us:.1f} µs |"


def main() -> None:
    for name in JOBS:
        print(row(name))
    for part, words in flash(JOBS[0]).items():
        print(f"| {words} | {part}")


if __name__ == "__main__":
    main()
