"""A second PIC16F84, written for clarity alone: one object, one cycle at a time, nothing foreseen or skipped.

Everything counts as the chip does, tick by tick, where the simulator computes from anchors; so that the two
agree only if both are right. Times are DS30430's: inputs and timers change as a cycle begins, flags are
sampled in Q1, registers are read in Q2 and written in Q4.
"""

from __future__ import annotations

from servogen.pic.image import Image
from servogen.pic.isa import decode

LOW, HIGH, UNDRIVEN = 0, 1, 2
MCLR = 13
C, DC, Z, PD, TO, RP0 = 0x01, 0x02, 0x04, 0x08, 0x10, 0x20
GIE, EEIE, T0IE, INTE, RBIE, T0IF, INTF, RBIF = 0x80, 0x40, 0x20, 0x10, 0x08, 0x04, 0x02, 0x01
RBPU, INTEDG, T0CS, T0SE, PSA = 0x80, 0x40, 0x20, 0x10, 0x08
EEIF, WRERR, WREN, WR, RD = 0x10, 0x08, 0x04, 0x02, 0x01


class Chip:
    def __init__(
        self,
        image: Image,
        *,
        watchdog_cycles: int = 18_000,
        eeprom_cycles: int = 4_000,
        ra4_pull_up: bool = False,
        start_up: int = 256,
        tmr0_phase: int = 0,
        stimuli: list[tuple[int, int, int]] | None = None,
    ) -> None:
        self.flash = image.program
        config = 0x3FFF if image.config is None else image.config
        self.watchdog_cycles = watchdog_cycles if config & 4 else None
        self.start_up = 0 if config & 3 == 3 else start_up
        self.eeprom_cycles = eeprom_cycles
        self.ra4_pull_up = ra4_pull_up
        self.stimuli = list(stimuli or [])
        self.now = 0
        self.busy_until = 0
        """The cycle in which the next instruction may begin."""
        self.sampled: int | None = None
        self.no_sample_before = 0
        self.asleep = self.held = False
        self.pc = self.w = self.fsr = self.pclath = self.intcon = self.eedata = self.eeadr = self.eecon1 = 0
        self.status, self.option = TO | PD, 0xFF
        self.ram = [0] * 68
        self.written = [False] * 68
        self.read_unwritten: set[int] = set()
        self.stack, self.depth = [0] * 8, 0
        self.sp = 0
        self.wraps = 0
        self.eeprom = [image.eeprom.get(i, 0xFF) for i in range(64)]
        self.latch, self.tris = [0] * 13, [1] * 13
        self.outside: list[int | None] = [None] * 13
        self.pins = [self.level(pin) for pin in range(13)]
        self.old_b = self.pins[5:]
        self.shown = [UNDRIVEN] * 13
        self.edges: list[tuple[int, int, int]] = []
        self.tmr0 = self.prescaler = 0
        self.standing_until = -1
        """The last cycle in which TMR0 is read as written, though its clock came."""
        self.tmr0_phase = tmr0_phase
        self.settling = range(0)
        """The cycles in which a new clock of TMR0 does not count yet."""
        self.external_tick: int | None = None
        self.wdt_zero = 0
        self.ee_step, self.ee_step_at = 0, 0
        self.ee_done: int | None = None
        self.ee_writing = (0, 0)
        self.resets = {"mclr": 0, "mclr_in_sleep": 0, "watchdog": 0}
        self.interrupts = 0
        self.wakes = {"watchdog": 0, "interrupt": 0}
        self.deepest = 0

    # --- time -------------------------------------------------------------------------------------

    def run(self, until: int) -> None:
        """Run until a cycle at or after `until` in which an instruction (or a cycle of rest) may begin."""
        while self.now < until or (self.now < self.busy_until and not self.asleep and not self.held):
            self.cycle()

    def cycle(self) -> None:
        """One instruction cycle."""
        self.begin()
        self.act()
        self.now += 1

    def act(self) -> None:
        """Sample the flags, and begin an instruction if one is due."""
        if not self.held and not self.asleep and self.now >= self.no_sample_before:
            if self.sampled is None and self.intcon & GIE and self.requested():
                self.sampled = self.now
            if self.now >= self.busy_until:
                if self.sampled is not None and self.sampled < self.now:
                    self.enter_interrupt()
                if self.now >= self.busy_until:
                    self.busy_until = self.now + self.execute()

    def begin(self) -> None:
        """What the start of a cycle brings, in the simulator's documented order."""
        if self.now > 0:
            self.clock_tmr0()
        self.option_in_force = self.option
        while self.stimuli and self.stimuli[0][0] <= self.now:
            self.apply(*self.stimuli.pop(0)[1:])
        if not self.held:
            if self.ee_done == self.now:
                self.finish_eeprom()
            if self.external_tick == self.now:
                self.external_tick = None
                if self.now > self.standing_until:
                    self.count_tmr0()
                    if self.rolled:
                        self.intcon |= T0IF
            if self.watchdog_cycles and self.now - self.wdt_zero == self.watchdog_cycles:
                self.wdt_zero = self.now
                self.watchdog_period()
        if self.asleep and not self.held and self.requested():
            self.wakes["interrupt"] += 1
            self.wake()
        self.announce_overflow()

    def wake(self) -> None:
        self.asleep = False
        self.wdt_zero = self.now
        if self.option & PSA:
            self.prescaler = 0
        self.busy_until = self.no_sample_before = self.now + self.start_up
        self.sampled = None

    # --- TMR0, prescaler, watchdog: DS35007 sections 5 and 6.10 -----------------------------------

    def timer_clocked(self) -> bool:
        """Whether the instruction clock counts in this cycle."""
        return not (self.option & T0CS or self.asleep or self.held or self.now < self.no_sample_before)

    def clock_tmr0(self) -> None:
        """The tick that the last cycle gave."""
        self.rolled = False
        if self.ticking and self.counts_in(self.now):
            self.count_tmr0()

    def counts_in(self, cycle: int) -> bool:
        return cycle > self.standing_until and cycle not in self.settling

    ticking = False
    rolled = False

    def ratio(self) -> int:
        return 1 if self.option & PSA else 2 << (self.option & 7)

    def count_tmr0(self) -> None:
        self.rolled = False
        if not self.option_in_force & PSA:
            self.prescaler = (self.prescaler + 1) % 256
            if self.prescaler % (2 << (self.option_in_force & 7)):
                return
        self.tmr0 = (self.tmr0 + 1) % 256
        self.rolled = self.tmr0 == 0

    option_in_force = 0xFF

    def announce_overflow(self) -> None:
        """T0IF is set three oscillator periods before the register rolls over: DS30430 figure 6-4, note 4."""
        self.ticking = self.timer_clocked()
        counts = self.ticking and self.counts_in(self.now + 1)
        if counts and self.tmr0 == 0xFF and (self.prescaler + 1) % self.ratio() == 0:
            self.intcon |= T0IF

    def watchdog_period(self) -> None:
        if self.option & PSA:
            self.prescaler = (self.prescaler + 1) % 256
            if self.prescaler % (1 << (self.option & 7)):
                return
        if self.asleep:
            self.status &= ~(TO | PD)
            self.wakes["watchdog"] += 1
            self.wake()
        else:
            self.status = self.status & 7 | PD
            self.resets["watchdog"] += 1
            self.reset()
            self.busy_until = self.now + 1

    def watchdog_at(self) -> int | None:
        """The cycle in which it times out if nothing clears it."""
        if self.watchdog_cycles is None:
            return None
        division = 1 << (self.option & 7) if self.option & PSA else 1
        return self.wdt_zero + (division - self.prescaler % division) * self.watchdog_cycles

    # --- resets: DS35007 tables 6-3 and 6-4 -------------------------------------------------------

    def reset(self) -> None:
        self.pc = self.pclath = 0
        self.option = 0xFF
        self.asleep = False
        self.no_sample_before = self.standing_until = self.now
        self.settling = range(0)
        self.sampled = None
        self.external_tick = None
        self.prescaler = 0
        self.wdt_zero = self.now
        self.sp = self.depth = 0
        self.eecon1 = WRERR if self.ee_done is not None else self.eecon1 & WRERR
        self.ee_done, self.ee_step = None, 0
        self.tris = [1] * 13
        self.show()
        self.look(self.now)
        self.intcon &= RBIF
        self.mismatch()

    def apply(self, pin: int, level: int) -> None:
        if pin == MCLR:
            if level == 0 and not self.held:
                self.held = True
                self.resets["mclr_in_sleep" if self.asleep else "mclr"] += 1
                self.status = self.status & 7 | TO if self.asleep else self.status & (7 | TO | PD)
                self.reset()
            elif level == 1 and self.held:
                self.held = False
                self.wdt_zero = self.now
                self.busy_until = self.now + 1
        else:
            self.outside[pin] = None if level == UNDRIVEN else level
            self.look(self.now)

    # --- pins: DS35007 section 4 ------------------------------------------------------------------

    def drives(self, pin: int) -> bool:
        return not self.tris[pin] and not (pin == 4 and self.latch[pin])

    def level(self, pin: int) -> int:
        outside = self.outside[pin]
        if self.drives(pin):
            return self.latch[pin]
        if outside is not None:
            return outside
        return int((pin >= 5 and not self.option & RBPU) or (pin == 4 and self.ra4_pull_up))

    def look(self, at: int) -> None:
        """The pins take their levels, and the inputs that watch them see it."""
        before, self.pins = self.pins, [self.level(pin) for pin in range(13)]
        counted_edge = before[4] != self.pins[4] and self.pins[4] == (0 if self.option & T0SE else 1)
        if counted_edge and self.option & T0CS and not self.asleep and not self.held:
            self.external_tick = at + 1
        if before[5] != self.pins[5] and self.pins[5] == (1 if self.option & INTEDG else 0):
            self.intcon |= INTF
        self.mismatch()

    def mismatch(self) -> None:
        if any(self.tris[5 + b] and self.pins[5 + b] != self.old_b[b] for b in (4, 5, 6, 7)):
            self.intcon |= RBIF

    def show(self) -> None:
        for pin in range(13):
            level = self.latch[pin] if self.drives(pin) else UNDRIVEN
            if pin == 4 and not self.tris[4] and self.latch[4] and self.ra4_pull_up:
                level = HIGH
            if level != self.shown[pin]:
                self.shown[pin] = level
                self.edges.append((self.now, pin, level))

    # --- interrupts: DS35007 section 6.8 ----------------------------------------------------------

    def requested(self) -> bool:
        pairs = ((T0IE, T0IF), (INTE, INTF), (RBIE, RBIF))
        by_intcon = any(self.intcon & enable and self.intcon & flag for enable, flag in pairs)
        return by_intcon or bool(self.intcon & EEIE and self.eecon1 & EEIF)

    def enter_interrupt(self) -> None:
        assert self.sampled is not None
        self.push(self.pc)
        self.pc = 4
        self.intcon &= ~GIE
        self.busy_until = self.sampled + 3
        self.sampled = None
        self.interrupts += 1

    # --- EEPROM: DS35007 section 3 ----------------------------------------------------------------

    def finish_eeprom(self) -> None:
        cell, byte = self.ee_writing
        if cell < 64:
            self.eeprom[cell] = byte
        self.eecon1 = self.eecon1 & ~WR | EEIF
        self.ee_done = None

    def write_eecon1(self, value: int) -> None:
        started = False
        if value & WR and not self.eecon1 & WR:
            in_time = self.ee_step == 2 and self.now == self.ee_step_at + 1
            started = bool(in_time and self.eecon1 & WREN)
            self.ee_step = 0
        if started:
            self.ee_done = self.now + 1 + self.eeprom_cycles
            self.ee_writing = (self.eeadr, self.eedata)
        if value & RD:
            self.eedata = self.eeprom[self.eeadr] if self.eeadr < 64 else 0
        self.eecon1 = value & (EEIF | WRERR | WREN) | self.eecon1 & WR | (WR if started else 0)

    def write_eecon2(self, value: int) -> None:
        if value == 0xAA and self.ee_step == 1 and self.now == self.ee_step_at + 2:
            self.ee_step = 2
        else:
            self.ee_step = 1 if value == 0x55 else 0
        self.ee_step_at = self.now

    # --- registers: DS35007 section 2.3 -----------------------------------------------------------

    def where(self, f: int) -> int:
        """The address with its bank in bit 7; INDF through FSR (section 2.5)."""
        return self.fsr if f == 0 else f | (0x80 if self.status & RP0 else 0)

    def read(self, f: int) -> int:
        address = self.where(f)
        low, bank1 = address & 0x7F, address >= 0x80
        if 0x0C <= low <= 0x4F:
            if not self.written[low - 0x0C]:
                self.read_unwritten.add(low)
            return self.ram[low - 0x0C]
        if low == 6 and not bank1:
            self.old_b = self.pins[5:]
        values = {
            1: self.option if bank1 else self.tmr0,
            2: (self.pc + 1) & 0xFF,
            3: self.status,
            4: self.fsr,
            5: number(self.tris[:5] if bank1 else self.pins[:5]),
            6: number(self.tris[5:] if bank1 else self.pins[5:]),
            8: self.eecon1 if bank1 else self.eedata,
            9: 0 if bank1 else self.eeadr,
            0x0A: self.pclath,
            0x0B: self.intcon,
        }
        return values.get(low, 0)

    def write(self, f: int, value: int, flags_protected: bool) -> None:
        address = self.where(f)
        low, bank1 = address & 0x7F, address >= 0x80
        if 0x0C <= low <= 0x4F:
            self.ram[low - 0x0C] = value
            self.written[low - 0x0C] = True
        elif low == 3:
            kept = TO | PD | (C | DC | Z if flags_protected else 0)
            self.status = value & ~kept | self.status & kept
        elif low == 4:
            self.fsr = value
        elif low == 0x0A:
            self.pclath = value & 0x1F
        elif low == 0x0B:
            self.intcon = value
            self.mismatch()
        elif low == 1 and bank1:
            self.set_option(value)
        elif low == 1:
            self.tmr0 = value
            self.standing_until = self.now + 3
            if not self.option & PSA:
                self.prescaler = 0
        elif low in (5, 6) and bank1:
            self.set_tris(low, value)
        elif low in (5, 6):
            self.set_port(low, value)
        elif low == 8 and bank1:
            self.write_eecon1(value)
        elif low == 8:
            self.eedata = value
        elif low == 9 and bank1:
            self.write_eecon2(value)
        elif low == 9:
            self.eeadr = value

    def set_option(self, value: int) -> None:
        changed = (self.option ^ value) & (T0CS | PSA | (0 if value & PSA else 7))
        self.option = value
        if changed and not value & T0CS:
            start = self.settling.start if self.now + 1 in self.settling else self.now + 2
            stop = self.now + 2 + self.tmr0_phase
            self.settling = range(start, max(stop, self.settling.stop))
        if not value & T0CS:
            self.external_tick = None
        self.look(self.now + 1)

    def set_port(self, port: int, value: int) -> None:
        if port == 5:
            self.latch[:5] = bits(value, 5)
        else:
            self.latch[5:] = bits(value, 8)
            self.old_b = self.pins[5:]
        self.show()
        self.look(self.now + 1)

    def set_tris(self, port: int, value: int) -> None:
        if port == 5:
            self.tris[:5] = bits(value, 5)
        else:
            self.tris[5:] = bits(value, 8)
        self.show()
        self.look(self.now + 1)

    # --- stack: DS35007 section 2.4.1 ---------------------------------------------------------------

    def push(self, address: int) -> None:
        self.stack[self.sp] = address
        self.sp = (self.sp + 1) % 8
        self.wraps += self.depth == 8
        self.depth = min(8, self.depth + 1)
        self.deepest = max(self.deepest, self.depth)

    def pop(self) -> int:
        self.sp = (self.sp - 1) % 8
        self.wraps += self.depth == 0
        self.depth = max(0, self.depth - 1)
        return self.stack[self.sp]

    # --- instructions: DS35007 section 7 ----------------------------------------------------------

    def flag(self, bit: int, on: bool) -> None:
        self.status = self.status | bit if on else self.status & ~bit

    def execute(self) -> int:
        """The instruction at the program counter; how many cycles it takes."""
        word = self.flash.get(self.pc % 1024)
        here = self.pc
        decoded = decode(0x3FFF if word is None else word)
        name = decoded.instruction.mnemonic if decoded else "NOP"
        method = getattr(self, f"do_{name.lower()}", None)
        if method is None:
            return self.on_file(name, decoded.f, decoded.d, decoded.b)  # type: ignore[union-attr]
        cycles = method(decoded)
        if self.pc == here and cycles != 2:
            self.pc = (here + 1) % 0x2000
        return cycles

    def on_file(self, name: str, f: int, d: int, b: int) -> int:
        """The instructions that read or write a file register."""
        old_w = self.w
        protects = name not in ("MOVWF", "SWAPF", "DECFSZ", "INCFSZ", "BCF", "BSF", "BTFSC", "BTFSS")
        is_pcl = self.where(f) & 0x7F == 2
        following = (self.pc + 1) % 0x2000
        skipped = (self.pc + 2) % 0x2000
        if name in ("MOVWF", "CLRF"):
            d, v = 1, 0
        else:
            v = self.read(f)
        if name in ("BTFSC", "BTFSS"):
            skip = (v >> b) % 2 == (name == "BTFSS")
            self.pc = skipped if skip else following
            return 2 if skip else 1
        if name in ("BCF", "BSF"):
            d = 1
        result = self.result(name, v, old_w, b)
        skip = name in ("DECFSZ", "INCFSZ") and result == 0
        self.pc = following
        if not d:
            self.w = result
        elif is_pcl:
            self.pc = self.pclath * 256 + result
            return 2
        else:
            self.write(f, result, protects)
        if skip:
            self.pc = skipped
            return 2
        return 1

    def result(self, name: str, v: int, w: int, b: int) -> int:
        """The value, with its flags set."""
        if name == "MOVWF":
            return w
        if name == "BCF":
            return v & (255 - 2**b)
        if name == "BSF":
            return v | 2**b
        if name == "SWAPF":
            return v % 16 * 16 + v // 16
        if name == "DECFSZ":
            return (v - 1) % 256
        if name == "INCFSZ":
            return (v + 1) % 256
        if name == "RLF":
            carry = self.status & C
            self.flag(C, v >= 128)
            return v * 2 % 256 + carry
        if name == "RRF":
            carry = self.status & C
            self.flag(C, v % 2 == 1)
            return v // 2 + 128 * carry
        if name == "ADDWF":
            return self.add(v, w)
        if name == "SUBWF":
            return self.subtract(v, w)
        simple = {
            "ANDWF": v & w,
            "CLRF": 0,
            "COMF": 255 - v,
            "DECF": (v - 1) % 256,
            "INCF": (v + 1) % 256,
            "IORWF": v | w,
            "MOVF": v,
            "XORWF": v ^ w,
        }
        self.flag(Z, simple[name] == 0)
        return simple[name]

    def add(self, a: int, b: int) -> int:
        self.flag(C, a + b > 255)
        self.flag(DC, a % 16 + b % 16 > 15)
        self.flag(Z, (a + b) % 256 == 0)
        return (a + b) % 256

    def subtract(self, a: int, b: int) -> int:
        """a - b: C and DC are borrows, inverted."""
        self.flag(C, a >= b)
        self.flag(DC, a % 16 >= b % 16)
        self.flag(Z, a == b)
        return (a - b) % 256

    def into_w(self, value: int, *, zero: bool = True) -> int:
        self.w = value
        if zero:
            self.flag(Z, value == 0)
        return 1

    def do_nop(self, _) -> int:  # type: ignore[no-untyped-def]
        return 1

    def do_clrw(self, _) -> int:  # type: ignore[no-untyped-def]
        return self.into_w(0)

    def do_movlw(self, i) -> int:  # type: ignore[no-untyped-def]
        return self.into_w(i.k, zero=False)

    def do_addlw(self, i) -> int:  # type: ignore[no-untyped-def]
        return self.into_w(self.add(self.w, i.k))

    def do_sublw(self, i) -> int:  # type: ignore[no-untyped-def]
        return self.into_w(self.subtract(i.k, self.w))

    def do_andlw(self, i) -> int:  # type: ignore[no-untyped-def]
        return self.into_w(self.w & i.k)

    def do_iorlw(self, i) -> int:  # type: ignore[no-untyped-def]
        return self.into_w(self.w | i.k)

    def do_xorlw(self, i) -> int:  # type: ignore[no-untyped-def]
        return self.into_w(self.w ^ i.k)

    def jump(self, k: int) -> int:
        self.pc = self.pclath // 8 * 2048 + k
        return 2

    def do_goto(self, i) -> int:  # type: ignore[no-untyped-def]
        return self.jump(i.k)

    def do_call(self, i) -> int:  # type: ignore[no-untyped-def]
        self.push((self.pc + 1) % 0x2000)
        return self.jump(i.k)

    def do_return(self, _) -> int:  # type: ignore[no-untyped-def]
        self.pc = self.pop()
        return 2

    def do_retlw(self, i) -> int:  # type: ignore[no-untyped-def]
        self.w = i.k
        return self.do_return(i)

    def do_retfie(self, i) -> int:  # type: ignore[no-untyped-def]
        self.intcon |= GIE
        return self.do_return(i)

    def do_clrwdt(self, _) -> int:  # type: ignore[no-untyped-def]
        self.status |= TO | PD
        return self.clear_watchdog()

    def clear_watchdog(self) -> int:
        self.wdt_zero = self.now + 1
        if self.option & PSA:
            self.prescaler = 0
        return 1

    def do_sleep(self, _) -> int:  # type: ignore[no-untyped-def]
        if self.requested():
            return 1
        self.status = self.status & ~PD | TO
        self.asleep = True
        return self.clear_watchdog()

    def do_option(self, _) -> int:  # type: ignore[no-untyped-def]
        self.set_option(self.w)
        return 1

    def do_tris(self, i) -> int:  # type: ignore[no-untyped-def]
        self.set_tris(i.f, self.w)
        return 1


def bits(value: int, count: int) -> list[int]:
    return [value >> i & 1 for i in range(count)]


def number(levels: list[int]) -> int:
    return sum(level << i for i, level in enumerate(levels))
