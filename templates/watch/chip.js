// The chip: its package with live pins, registers, RAM by name, stack, EEPROM, peripherals, C line, instruction.

const hex = (value, digits) => value.toString(16).toUpperCase().padStart(digits, "0");
const REGISTERS = ["PORTA", "TRISA", "PORTB", "TRISB", "TMR0", "OPTION_REG", "INTCON", "STATUS", "FSR", "PCLATH", "EEDATA", "EEADR", "EECON1"];
const INTCON = ["RBIF", "INTF", "T0IF", "RBIE", "INTE", "T0IE", "EEIE", "GIE"];
const LEVELS = { 0: "driven low", 1: "driven high", l: "input, reads 0", h: "input, reads 1" };

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "click") made.addEventListener("click", value);
    else if (value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

export class ChipView {
  constructor(model, places, explain) {
    this.model = model;
    this.places = places;
    this.file = null;
    this.line = null;
    this.ram = "";
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
      const made = element("button", { type: "button", class: "pin", click: () => explain(pin.name) }, dot, label);
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
    this.showInstructions(chip);
    this.showSource(...(chip.here || [null, null]));
    this.places.stack.textContent = chip.stack.length ? chip.stack.map(address => `0x${hex(address, 3)}`).join("  ") : "empty";
    this.places.eeprom.textContent = chip.eeprom.match(/../g).map((byte, index) => (index % 16 ? " " : index ? "\n" : "") + byte.toUpperCase()).join("");
    this.places.warnings.replaceChildren(...chip.warnings.map(text => element("li", {}, text)));
  }
  showRegisters(chip, cycle) {
    const rows = [["PC", `0x${hex(chip.pc, 3)}`], ["W", `0x${hex(chip.w, 2)}`], ...REGISTERS.filter(name => name in chip.registers).map(name => [name, `0x${hex(chip.registers[name], 2)}`])];
    this.fill(this.places.registers, rows);
    const option = chip.registers.OPTION_REG, psa = option & 8, rate = 1 << ((option & 7) + (psa ? 0 : 1));
    const flags = INTCON.filter((_, bit) => chip.registers.INTCON >> bit & 1).reverse().join(" ") || "none";
    const left = chip.watchdog_at === null ? "off" : `times out in ${(Math.max(0, chip.watchdog_at - cycle) * this.model.cycle_us / 1000).toFixed(2)} ms`;
    this.fill(this.places.peripherals, [
      ["timer", `TMR0 ${chip.registers.TMR0}, ${option & 32 ? "counts RA4" : "counts cycles"}${psa ? "" : `, 1:${rate}`}`],
      ["prescaler", `${chip.prescaler}${psa ? `, of the watchdog, 1:${rate}` : ", of the timer"}`],
      ["watchdog", left],
      ["INTCON", flags],
      ["interrupts", `${chip.interrupts} taken`],
      ["state", chip.asleep ? "asleep or in reset" : "running"],
      ["resets", Object.entries(chip.resets).filter(([, count]) => count).map(([cause, count]) => `${count} ${cause.replaceAll("_", " ")}`).join(", ")],
    ]);
  }
  fill(place, rows) {
    if (place.rows.length !== rows.length) place.replaceChildren(...rows.map(([name]) => element("tr", {}, element("th", { scope: "row" }, name), element("td"))));
    rows.forEach(([, value], index) => {
      const cell = place.rows[index].cells[1];
      cell.classList.toggle("changed", cell.textContent !== "" && cell.textContent !== value);
      if (cell.textContent !== value) cell.textContent = value;
    });
  }
  showRam(chip) {
    const byteAt = address => parseInt(chip.ram.substr(2 * (address - this.model.ram_first), 2), 16);
    const rows = this.variables.map(each => {
      let value = 0;
      for (let index = each.bytes - 1; index >= 0 && each.bytes <= 4; index--) value = value * 256 + byteAt(each.address + index);
      const bytes = Array.from({ length: each.bytes }, (_, index) => byteAt(each.address + index));
      return [each.name, each.bytes <= 4 ? `${value}` : bytes.map(byte => hex(byte, 2)).join(" ")];
    });
    this.fill(this.places.variables, rows);
    const written = new Set(chip.written);
    this.places.ram.textContent = chip.ram.match(/../g).map((byte, index) => (index && (index + this.model.ram_first) % 16 === 0 ? "\n" : index ? " " : "    ".repeat(3).slice(0, 36)) + (written.has(index + this.model.ram_first) ? byte.toUpperCase() : "··")).join("");
  }
  showInstructions(chip) {
    const row = (each, marked) => element("li", marked ? { class: "next", "aria-current": "step" } : {}, `${hex(each.address, 3)}  ${each.text}${each.line ? `   line ${each.line}` : ""}`);
    this.places.instructions.replaceChildren(...chip.executed.map(each => row(each, false)), row(chip.next, true));
  }
  showSource(file, line) {
    const source = this.model.sources.find(each => each.name === file) || this.model.sources[0];
    if (!source) { this.places.source.textContent = "A HEX file has no source: the instructions are below."; return; }
    if (this.file !== source.name || !this.lines) {
      this.file = source.name;
      this.lines = source.text.split("\n").map((text, index) => element("span", { class: "line", "data-line": index + 1 }, text + "\n"));
      this.places.source.replaceChildren(...this.lines);
      this.places.source.setAttribute("aria-label", `source ${source.name.split("/").pop()}`);
    }
    if (line === this.line) return;
    this.lines[this.line - 1]?.classList.remove("here");
    this.line = line;
    const here = this.lines[line - 1];
    if (!here) return;
    here.classList.add("here");
    const box = this.places.source;
    if (here.offsetTop < box.scrollTop || here.offsetTop > box.scrollTop + box.clientHeight - 40) box.scrollTop = here.offsetTop - box.clientHeight / 2;
  }
}
