"""Small programs with their schedules, and certificates of them that the prover has not made.

A certificate is made of the states that the checker itself comes to; `forget` may widen them.
"""

from __future__ import annotations

import hashlib
import json
import lzma
from collections.abc import Callable
from typing import Any

import numpy as np

from servogen.checker import chip, layout
from servogen.checker.certificate import CELLS, NUMBERS, Certificate, fingerprint, read_certificate
from servogen.checker.certificate import WIDTH as STATE_WIDTH
from servogen.checker.check import Checker, Refused
from servogen.checker.plan import Place, read_plan
from servogen.pic.assembler import assemble
from servogen.pic.device import device
from servogen.pic.image import Image

PERIOD, WIDTH, SEEN_FRAMES = 2000, 300, 3
Forget = Callable[[chip.Ints], None]


def delay(cycles: int) -> str:
    """Instructions that take so many cycles and use 0x20."""
    text = ""
    while cycles >= 4:
        turns = min(255, (cycles - 1) // 3)
        text += f" movlw {turns}\n movwf 0x20\n decfsz 0x20,f\n goto $-1\n"
        cycles -= 3 * turns + 1
    return text + " nop\n" * cycles


SET_UP = """ list p=16f84
 radix dec
 __config 0x3ff1
 org 0
 clrf 5
 clrf 6
 bsf 3,5
 clrf 6
 bcf 3,5
 clrf 0x21
frame bsf 6,0
"""


def image_of(text: str) -> Image:
    return assemble(text + " end\n", "test.asm", device("PIC16F84")).image


def plain_program(
    config: str = "0x3ff1", width: int = WIDTH, clear: str = "nop", first: str = "clrf 5", after: str = ""
) -> Image:
    """One servo, and nothing else; `first` is the first instruction, `after` follows the frame's."""
    text = SET_UP.replace("0x3ff1", config).replace("clrf 5", first)
    text += delay(width - 1) + f" bcf 6,0\n {clear}\n"
    return image_of(text + delay(PERIOD - width - 4) + " goto frame\n" + after)


def button_program(read: str = "btfss 5,4", seen: int = SEEN_FRAMES) -> Image:
    """One servo whose pulses end when RA4 was read low in so many frames in a row."""
    sample = f""" {read}
 goto pressed
 clrf 0x21
 nop
 nop
 nop
 goto join
pressed incf 0x21,f
 movlw {seen}
 xorwf 0x21,w
 btfsc 3,2
 goto off
join"""
    rest = delay(PERIOD - WIDTH - 11) + " goto frame\noff" + delay(PERIOD // 2) + " goto off\n"
    return image_of(SET_UP + delay(WIDTH - 1) + " bcf 6,0\n" + sample + rest)


def schedule(buttons: dict[str, Any] | None = None, width: int = WIDTH) -> bytes:
    data: dict[str, Any] = {
        "version": 1,
        "device": "PIC16F84",
        "clock_hz": 4_000_000,
        "period_cycles": PERIOD,
    }
    data["channels"] = [{"name": "servo", "pin": "RB0", "servo": "any"}]
    if buttons:
        data["buttons"] = buttons
    data |= {"lead_in": [], "loop": [{"frames": 1, "pulses": [[0, width]]}]}
    return json.dumps(data).encode()


STOP = {"start": None, "stop": {"pin": "RA4", "level": 0}, "pulses": "off", "pressed_frames": SEEN_FRAMES}


class Maker(Checker):
    """Lists each state that it comes to."""

    forget: Forget
    listed: chip.Ints

    def make(self, forget: Forget) -> Certificate:
        """Return a certificate with these states."""
        self.forget, self.listed = forget, self.states
        self._follow(self.power_up())
        number = 0
        while number < len(self.listed):  # it grows meanwhile
            self._follow(self.started(self.listed[number : number + 1]))
            number += 1
        return self._claim()

    def _claim(self) -> Certificate:
        nothing = self._plan.inputs.power_up  # in a state after the last pulse, the place says nothing
        places = [place if place.memory else Place(nothing) for place in self.places]
        return Certificate("", "", 0, {}, frozenset(), places, self.listed[:, :STATE_WIDTH])

    def compare(self, rows: chip.Ints) -> None:
        for row in rows:
            self._listed = []
            self.states = self.started(self.known(self._claim()))
            try:
                super().compare(row[None])
            except Refused:
                listed = row.copy()
                listed[layout.CYCLE] = 0
                self.forget(listed)
                self.listed = np.concatenate([self.listed, listed[None]])


def certify(image: Image, plan_text: bytes, cuts: list[int], forget: Forget = lambda s: None) -> bytes:
    """Return a certificate of `image`; raises Refused if it does not do what the schedule says."""
    plan = read_plan(plan_text, "schedule.json")
    none = np.zeros((0, STATE_WIDTH), dtype=np.int64)
    claim = Maker(image, plan, Certificate("", "", 0, {}, frozenset(cuts), [], none)).make(forget)
    states = claim.states
    columns = {
        name: {"delta": np.diff([0, *states[:, slot].tolist()]).tolist()}
        for name, (slot, _) in (*CELLS.items(), *NUMBERS.items())
        if name != "write_left" or states[:, slot].any()
    }
    data = {
        "format": 2,
        "image": fingerprint(image),
        "schedule": hashlib.sha256(plan_text).hexdigest(),
        "clock_hz": plan.clock_hz,
        "held": {},
        "assumptions": [],
        "cuts": cuts,
        "count": len(states),
        "places": claim.places,
        "columns": columns,
    }
    return pack(data)


def pack(data: dict[str, Any]) -> bytes:
    return lzma.compress(json.dumps(data).encode())


def unpack(packed: bytes) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(lzma.decompress(packed))
    return data


def reread(data: dict[str, Any]) -> Certificate:
    return read_certificate(pack(data), "certificate")
