"""Whatever is done to a job file, the answer is a job or an error with a place, never a crash."""

import random
import re
from pathlib import Path

import pytest

from servogen.errors import ServogenError
from servogen.job import loads, plan_job, template
from servogen.pulse import from_json, plan
from tests.campaigns import sampled

SOURCES = [
    template(),
    *(file.read_text() for file in sorted((Path(__file__).parents[2] / "jobs").glob("lab*"))),
]
VALUES = (
    *("0", "-1", "1e308", "-1e308", "nan", "inf", "true", '""', '"x"', "[]", "{}", "[1]", "1979-05-27"),
    *("1e-320", "999999999999999999999", '"RB0"', "{ a = 1 }", "[[]]", "0x10", "1.5"),
)


def mutated(random_: random.Random) -> str:
    text = random_.choice(SOURCES)
    kind = random_.random()
    if kind < 0.6:
        found = random_.choice(list(re.finditer(r'(?<== )("[^"\n]*"|[-\d_.]+|true|false)', text)))
        return text[: found.start()] + random_.choice(VALUES) + text[found.end() :]
    if kind < 0.8:
        at = random_.randrange(len(text))
        return text[:at] + random_.choice('[]{}=,."#\n x\\é') + text[at + 1 :]
    lines = text.split("\n")
    at = random_.randrange(len(lines))
    lines[at : at + 1] = random_.choice(([], [lines[at], random_.choice(lines)]))
    return "\n".join(lines)


@pytest.mark.parametrize("seed", sampled(range(8), 3))
def test_a_mutated_job_is_planned_or_refused(seed: int) -> None:
    random_ = random.Random(seed)
    for _ in range(100):
        try:
            job = plan_job(loads(mutated(random_), "job.toml"))
            schedule = plan(job.trajectory, job.servos, job.frame).schedule
        except ServogenError as error:
            assert error.location is not None
            assert error.location.file == "job.toml"
        else:
            assert from_json(schedule.json_text(), "schedule.json") == schedule
