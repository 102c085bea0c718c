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

from servogen.checker import check, chip
from servogen.checker.certificate import (
    CELLS,
    MASKED,
    NO_IRQ,
    RANGES,
    STACK,
    Certificate,
    fingerprint,
    read_certificate,
)
from servogen.checker.check import Checker, Refused
from servogen.checker.plan import OVER, PINS, Place, read_plan
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


def plain_program(config: str = "0x3ff1", width: int = WIDTH, clear: str = "nop") -> Image:
    """One servo, and nothing else."""
    text = SET_UP.replace("0x3ff1", config) + delay(width - 1) + f" bcf 6,0\n {clear}\n"
    return image_of(text + delay(PERIOD - width - 4) + " goto frame\n")


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

    def make(self, forget: Forget) -> tuple[chip.Ints, list[Place]]:
        """Return the states and their places."""
        self.forget = forget
        self._follow(self._power_up())
        number = 0
        while number < len(self._states):  # it grows meanwhile
            self._follow(self._states[number : number + 1])
            number += 1
        return self._states, [self._place_of[place] for place in self._states[:, check.PLACE]]

    def _compare(self, rows: chip.Ints) -> None:
        for row in rows:
            try:
                super()._compare(row[None])
            except Refused:
                settled = row.copy()
                chip.rebase(settled)
                listed = settled.copy()
                self.forget(listed)
                assert chip.within(settled, listed, chip.BYTES)
                self._at[listed[check.EXACT].tobytes()].append(len(self._states))
                self._states = np.concatenate([self._states, listed[None]])


def certify(image: Image, plan_text: bytes, cuts: list[int], forget: Forget = lambda s: None) -> bytes:
    """Return a certificate of `image`; raises Refused if it does not do what the schedule says."""
    plan = read_plan(plan_text, "schedule.json")
    claim = Certificate("", "", plan.clock_hz, {}, frozenset(cuts), 0, {})
    states, places = Maker(image, plan, claim).make(forget)
    rows = [_row(s, place, plan.start is not None) for s, place in zip(states, places, strict=True)]
    columns = {
        name: {"delta": np.diff([0, *(row[name] for row in rows)]).tolist()}
        for name in (*CELLS, *MASKED, *RANGES)
    }
    data = {
        "format": 1,
        "image": fingerprint(image),
        "schedule": hashlib.sha256(plan_text).hexdigest(),
        "clock_hz": plan.clock_hz,
        "held": {},
        "assumptions": [],
        "cuts": cuts,
        "count": len(rows),
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


def _row(s: chip.Ints, place: Place, start: bool) -> dict[str, int]:
    over = place.position == OVER
    row = {name: int(s[slot]) for name, slot in (*CELLS.items(), *MASKED.items())}
    row |= dict.fromkeys(RANGES, 0)
    row |= {name: int(s[chip.STACK + level]) * (level < s[chip.DEPTH]) for level, name in enumerate(STACK)}
    row |= {
        "pc": int(s[chip.PC]),
        "depth": int(s[chip.DEPTH]),
        "pclath": int(s[chip.PCLATH]),
        "option": int(s[chip.OPTION]),
        "tris": int(s[chip.TRISA] | s[chip.TRISB] << 5),
        "latch": int(s[chip.PORTA] & 0x1F | (s[chip.PORTB] & 0xFF) << 5),
        "latch_unknown": int(s[chip.PORTA] >> 8 | s[chip.PORTB] >> 8 << 5),
        "prescaler": chip.UNKNOWN if s[chip.PRESCALER] < 0 else int(s[chip.PRESCALER]),
        "watchdog_age": int(-s[chip.WDT_CLEARED]),
        "irq": NO_IRQ if s[chip.IRQ] == chip.NEVER else int(s[chip.IRQ]),
        "spec.phase": 2 if over else 1,
        "spec.time": 0 if over else int(-s[chip.FRAME]),
        "spec.heard": 0,
        "spec.wanted": 0,
        "spec.line_read": 0,
        "spec.start_sample": -1,
        "spec.stop_sample": -1,
    }
    if not over:
        row |= {f"spec.{name}": int(value) for name, value in place.position._asdict().items()}
        read = [pin for pin in range(len(PINS)) if place.sampled >> pin & 1]
        name = "spec.start_sample" if start else "spec.stop_sample"
        for pin in read:
            row[name] = place.levels >> pin & 1
    return row
