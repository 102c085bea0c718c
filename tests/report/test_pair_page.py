"""The page of two chips: both are wired as their jobs say, and the lines meet the pins that they join."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from servogen.job import loads, plan_job
from servogen.report.pair import PairFacts, pair_page
from servogen.workflows.engines import chip_jobs
from tests.two_chips import ARM, TWO

SVG = "{http://www.w3.org/2000/svg}"


def page(change: str = "", to: str = "", exact: bool = True) -> str:
    text = (TWO + ARM.format(elbow="RB0")).replace(change, to) if change else TWO + ARM.format(elbow="RB0")
    jobs = chip_jobs(plan_job(loads(text, "arm.toml")))
    return pair_page(
        PairFacts("arm", jobs, exact, "one run", ["c2c: said"], [("c2c", "12", "34", "exact")], "one run")
    )


def test_every_servo_stands_at_its_pin_of_its_chip() -> None:
    text = page()
    first, second = text.split("Every pin")[1].split("<b>chip 2</b>")
    assert "<td>shoulder</td>" in first and "<td>elbow</td>" in second and "elbow" not in first
    assert "wire to the second chip&#39;s RA1" in first and "wire from the first chip&#39;s RB0" in second
    assert "http" not in text.replace('xmlns="http://www.w3.org/2000/svg"', ""), "it needs no network"


def test_a_pair_that_is_not_exact_says_so() -> None:
    assert "both chips exact in one run" in page() and "NOT exact" not in page()
    assert "NOT exact" in page(exact=False) and "both chips exact" not in page(exact=False)


def test_a_line_to_mclr_is_drawn_with_its_jumper_where_there_is_one() -> None:
    text = page('wire = "RA1"', 'wire = "RA1"\nrestart = "RA4"')
    first, second = text.split("Every pin")[1].split("<b>chip 2</b>")
    assert "and RA4 of the second chip through a jumper" in first and "MCLR of the first chip" in second
    assert "RA4 resets chip 1" in text and "Open the jumper while chip1 is programmed" in text
    assert "jumper" not in page()


def ends(drawing: ElementTree.Element, kind: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """Where a line begins and ends."""
    (path,) = (each.get("d", "") for each in drawing.iter("path") if each.get("class") == kind)
    x, y, *_ = map(float, re.findall(r"[\d.]+", path))
    verticals, horizontals = re.findall(r"V([\d.]+)", path), re.findall(r"H([\d.]+)", path)
    return (x, y), (float(horizontals[-1]), float(verticals[-1]))


@pytest.mark.parametrize(
    ("change", "to", "left"),
    [("", "", (True, False)), ('wire = "RA1"', 'wire = "RA2"', (True, True))],
)
def test_the_wire_leaves_and_reaches_its_pins_beside_their_labels(
    change: str, to: str, left: tuple[bool, bool]
) -> None:
    drawing = ElementTree.fromstring(re.search(r"<svg viewBox.*?</svg>", page(change, to), re.S)[0])
    pin = to.split('"')[1] if to else "RA1"
    for at, chip, label, side in zip(
        ends(drawing, "line wire"), drawing.findall("g"), ("RB0 shoulder", f"{pin} wire"), left, strict=True
    ):
        begin = float(re.search(r"translate\(([\d.]+)", chip.get("transform", ""))[1])
        (row,) = (each for each in chip.findall("g") if label in [text.text for text in each.findall("text")])
        x, y = map(float, re.findall(r"[\d.]+", row.get("transform", "")))
        assert at[1] == y
        away = (begin + x - at[0]) * (1 if side else -1)
        assert 0 < away - 20 - 5 * len(label) < 60, "it is beyond the label, and near it"
