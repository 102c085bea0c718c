// The source with line numbers: a click on one stops there; what the compiler and the chip warn of stands
// below its line; and the instructions.

import { element } from "./dom.js";

const MANY = 2000;   // lines of which each gets a button

export class SourceView {
  // stop(text, on) sets or removes a breakpoint.
  constructor(model, places, stop) {
    Object.assign(this, { model, places, stop, file: null, line: null, stops: [], live: "" });
    this.marks = model.marks;
    places.source.addEventListener("keydown", event => {
      if (event.key !== "b" || !this.line) return;
      this.toggle(this.line);
      event.preventDefault();
      event.stopPropagation();
    }, { signal: (this.ended = new AbortController()).signal });
    this.open(model.sources[0]);
  }
  end() { this.ended.abort(); }
  show(chip) {
    const marked = chip.warnings.filter(each => each.line), said = JSON.stringify(marked);
    if (said !== this.live) {
      this.live = said;
      this.marks = [...this.model.marks, ...marked];
      this.mark();
    }
    this.showInstructions(chip);
    this.here(...(chip.here || [null, null]));
  }
  showInstructions(chip) {
    const hex = value => value.toString(16).toUpperCase().padStart(3, "0");
    const row = (each, next) => element("li", next ? { class: "next", "aria-current": "step" } : {},
      `${hex(each.address)}  ${each.text}${each.line ? `   line ${each.line}` : ""}`);
    const rows = [...chip.executed.map(each => row(each, false)), row(chip.next, true)];
    this.places.instructions.replaceChildren(...rows);
  }
  // Show a file, or what there is instead.
  open(source) {
    if (!source) {
      this.places.source.textContent = "A HEX file has no source: the instructions are below.";
      return;
    }
    this.file = source.name;
    this.line = null;
    const lines = source.text.split("\n");
    this.lines = lines.map((text, index) => {
      const line = element("span", { class: "line", "data-line": index + 1 });
      if (lines.length < MANY) line.append(this.number(index + 1));
      line.append(`${text}\n`);
      return line;
    });
    this.places.source.replaceChildren(...this.lines);
    const label = `source ${source.name.split("/").pop()}; b stops at its line`;
    this.places.source.setAttribute("aria-label", label);
    this.mark();
    this.breakpoints(this.stops);
  }
  number(line) {
    const label = `stop at line ${line}`, click = () => this.toggle(line);
    const attributes = { type: "button", tabindex: -1, "aria-pressed": "false", "aria-label": label, click };
    return element("button", attributes, `${line}`);
  }
  get several() { return this.model.sources.length > 1; }
  text(line) { return this.several ? `${this.file}:${line}` : `line ${line}`; }
  toggle(line) { this.stop(this.text(line), !this.stops.includes(this.text(line))); }
  breakpoints(texts) {
    this.stops = texts;
    this.lines?.forEach((line, index) => {
      line.querySelector("button")?.setAttribute("aria-pressed", texts.includes(this.text(index + 1)));
    });
  }
  mark() {
    for (const line of this.lines || []) line.querySelectorAll(".mark").forEach(each => each.remove());
    for (const { file, line, text } of this.marks) {
      if (file === this.file) this.lines?.[line - 1]?.append(element("span", { class: "mark" }, text));
    }
  }
  here(file, line) {
    const source = this.model.sources.find(each => each.name === file);
    if (source && source.name !== this.file) this.open(source);
    if (line === this.line || !this.lines) return;
    this.lines[this.line - 1]?.classList.remove("here");
    this.line = line;
    const here = this.lines[line - 1], box = this.places.source;
    if (!here) return;
    here.classList.add("here");
    const shown = here.offsetTop >= box.scrollTop && here.offsetTop <= box.scrollTop + box.clientHeight - 40;
    if (!shown) box.scrollTop = here.offsetTop - box.clientHeight / 2;
  }
}
