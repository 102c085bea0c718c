// The chip: its package with live pins, registers, RAM by name, stack, EEPROM, peripherals.

import { element, write } from "./dom.js";

const hex = (value, digits) => value.toString(16).toUpperCase().padStart(digits, "0");
const REGISTERS = [
  "PORTA", "TRISA", "PORTB", "TRISB", "TMR0", "OPTION_REG", "INTCON", "STATUS", "FSR", "PCLATH", "EEDATA",
  "EEADR", "EECON1",
];
const INTCON = ["RBIF", "INTF", "T0IF", "RBIE", "INTE", "T0IE", "EEIE", "GIE"];
const LEVELS = { 0: "driven low", 1: "driven high", l: "input, reads 0", h: "input, reads 1" };

export class ChipView {
  constructor(model, places, explain) {
    this.model = model;
    this.places = places;
    this.buildPackage(explain);
    this.variables = model.variables.filter(each => !each.name.endsWith("(temporary)"));
  }
  buildPackage(explain) {
    const names = this.model.package, half = names.length / 2;
    this.pins = new Map();
    const button = pin => {
      const number = this.model.pins.indexOf(pin.name);
      const servo = this.model.robot?.servos.find(each => each.pin === number);
      const label = element("span", { class: "pin-name" }, pin.name, servo ? ` ${servo.name}` : "");
      const dot = element("span", { class: "dot" }, String(pin.number));
      if (number < 0) return element("div", { class: "pin fixed" }, dot, label);
      const click = () => explain(pin.name);
      const made = element("button", { type: "button", class: "pin", click }, dot, label);
      this.pins.set(number, made);
      return made;
    };
    const left = element("div", { class: "side left" }, ...names.slice(0, half).map(button));
    const right = element("div", { class: "side right" }, ...names.slice(half).reverse().map(button));
    this.places.package.replaceChildren(left, element("div", { class: "body" }, this.model.device), right);
  }
  showLevels(levels) {
    if (levels === this.levels) return;
    this.levels = levels;
    for (const [number, made] of this.pins) {
      made.dataset.level = levels[number];
      made.title = `${this.model.pins[number]}: ${LEVELS[levels[number]]}. Why?`;
    }
  }
  show(chip, cycle) {
    this.showRegisters(chip, cycle);
    this.showRam(chip);
    const { stack, eeprom, warnings } = this.places;
    write(stack, chip.stack.length ? chip.stack.map(address => `0x${hex(address, 3)}`).join("  ") : "empty");
    const between = index => (index % 16 ? " " : index ? "\n" : "");
    const cell = (byte, index) => between(index) + byte.toUpperCase();
    write(eeprom, chip.eeprom.match(/../g).map(cell).join(""));
    const said = chip.warnings.map(each => each.text);
    if (said.join() !== this.said) warnings.replaceChildren(...said.map(text => element("li", {}, text)));
    this.said = said.join();
  }
  showRegisters(chip, cycle) {
    const { registers } = chip, named = REGISTERS.filter(name => name in registers);
    const rows = named.map(name => [name, `0x${hex(registers[name], 2)}`]);
    this.fill(this.places.registers, [["PC", `0x${hex(chip.pc, 3)}`], ["W", `0x${hex(chip.w, 2)}`], ...rows]);
    const option = registers.OPTION_REG, psa = option & 8, rate = 1 << ((option & 7) + (psa ? 0 : 1));
    const flags = INTCON.filter((_, bit) => registers.INTCON >> bit & 1).reverse().join(" ") || "none";
    const ms = Math.max(0, chip.watchdog_at - cycle) * this.model.cycle_us / 1000;
    const resets = Object.entries(chip.resets).filter(([, count]) => count);
    const counts = option & 32 ? "counts RA4" : "counts cycles";
    this.fill(this.places.peripherals, [
      ["timer", `TMR0 ${registers.TMR0}, ${counts}${psa ? "" : `, 1:${rate}`}`],
      ["prescaler", `${chip.prescaler}${psa ? `, of the watchdog, 1:${rate}` : ", of the timer"}`],
      ["watchdog", chip.watchdog_at === null ? "off" : `times out in ${ms.toFixed(2)} ms`],
      ["INTCON", flags],
      ["interrupts", `${chip.interrupts} taken`],
      ["state", chip.asleep ? "asleep or in reset" : "running"],
      ["resets", resets.map(([cause, count]) => `${count} ${cause.replaceAll("_", " ")}`).join(", ")],
    ]);
  }
  fill(place, rows) {
    if (place.rows.length !== rows.length) {
      const row = name => element("tr", {}, element("th", { scope: "row" }, name), element("td"));
      place.replaceChildren(...rows.map(([name]) => row(name)));
    }
    rows.forEach(([name, value], index) => {
      const [head, cell] = place.rows[index].cells;
      write(head, name);
      cell.classList.toggle("changed", cell.textContent !== "" && cell.textContent !== value);
      write(cell, value);
    });
  }
  showRam(chip) {
    const { ram_first: first } = this.model;
    const byteAt = address => parseInt(chip.ram.substr(2 * (address - first), 2), 16);
    const rows = this.variables.map(each => {
      const bytes = Array.from({ length: each.bytes }, (_, index) => byteAt(each.address + index));
      const value = bytes.reduceRight((sum, byte) => sum * 256 + byte, 0);
      return [each.name, each.bytes <= 4 ? `${value}` : bytes.map(byte => hex(byte, 2)).join(" ")];
    });
    this.fill(this.places.variables, rows);
    const written = new Set(chip.written);
    const between = index => (!index ? " ".repeat(12) : (index + first) % 16 === 0 ? "\n" : " ");
    const shown = (byte, index) => between(index) + (written.has(index + first) ? byte.toUpperCase() : "··");
    write(this.places.ram, chip.ram.match(/../g).map(shown).join(""));
  }
}
