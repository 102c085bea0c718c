// The job file: planned while it is typed, saved, built; errors stand at their lines.
// Its text is one of three: on the disk (`saved`), built last (`made`), or only here; the page says which.

import { element, Going, write } from "./dom.js";

const PAUSE_MS = 100;   // after the last key, before it is planned

export class Editor {
  // posed(answer) is told of the job whenever it is found to be right, null while it is not known to be;
  // pointed(line, clicked) the line that the pointer is on.
  constructor(places, send, { posed, pointed }) {
    Object.assign(this, { posed, pointed, places, send });
    this.saved = "";
    this.sent = null;   // what is being saved or built: it, not what was typed since, gets to the disk
    this.bands = {};
    this.asked = { number: 0, text: "" };   // the last question: an answer about an older text is not wanted
    this.planning = new Going(text => this.plan(text));
    this.writing = new Going(text => {
      this.stoppable = true;
      this.say(text);
      this.buttons();
    });
    places.text.addEventListener("input", () => {
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.check(), PAUSE_MS);
      this.posed(null);
      this.numberLines();
      this.mark();
    });
    places.text.addEventListener("scroll", () => this.scroll());
    places.text.addEventListener("pointermove", event => this.pointed(this.lineAt(event), false));
    places.text.addEventListener("pointerleave", () => this.pointed(null, false));
    places.text.addEventListener("click", event => this.pointed(this.lineAt(event), true));
    places.save.addEventListener("click", () => this.store("save"));
    places.build.addEventListener("click", () => {
      if (this.stoppable) this.send({ do: "stop" });
      else this.store("build");
    });
    window.addEventListener("beforeunload", event => { if (this.changed) event.preventDefault(); });
  }
  get text() { return this.places.text.value; }
  get changed() { return !!this.opened && this.text !== this.saved; }
  // Ask for the plan of the text as it is now; the server plans an older one no further.
  check() {
    clearTimeout(this.timer);
    this.planning.begin("planning");
    this.asked = { number: this.asked.number + 1, text: this.text };
    this.send({ do: "check", ...this.asked });
  }
  plan(text) { write(this.places.preview, text); }
  // Write the file, unless somebody else has since it was read; `over` is the text that may be overwritten.
  store(what, over = this.saved) {
    if (this.sent !== null) return;
    this.sent = this.text;
    this.say(what === "build" ? "building" : "saving");
    this.writing.begin(what === "build" ? "building" : "saving");
    this.buttons();
    this.send({ do: what, text: this.sent, over });
  }
  // The answer has come.
  written(text) {
    this.writing.end();
    this.sent = null;
    this.stoppable = false;
    this.say(text);
    this.buttons();
  }
  stopped({ saved }) {
    if (saved) this.stored(this.sent);
    this.written(saved ? "stopped: the text is saved, but not built" : "stopped: nothing is saved");
  }
  open(message) {
    const kept = this.changed;
    if (message.saved && kept && message.text !== this.saved) {   // what was typed here stays
      if (message.text !== this.text) this.differs(message.text);
      else this.stored(message.text);
    }
    if (message.saved && kept) {
      this.check();   // the server may be another one than was asked before
      return;
    }
    this.opened = true;
    if (message.saved) this.saved = message.text;
    this.put(message.text);
    this.check();
  }
  // Put a text in the place of the one here, as if it were typed over what differs: undo takes it back.
  put(text) {
    const area = this.places.text, old = area.value, limit = Math.min(old.length, text.length);
    let begin = 0, end = 0;
    while (begin < limit && old[begin] === text[begin]) begin++;
    while (end < limit - begin && old[old.length - 1 - end] === text[text.length - 1 - end]) end++;
    if (!old) area.value = text;
    else if (old !== text) {
      const focused = document.activeElement;
      area.focus({ preventScroll: true });
      area.setSelectionRange(begin, old.length - end);
      if (!document.execCommand("insertText", false, text.slice(begin, text.length - end))) area.value = text;
      if (focused === document.body) area.blur();
      else if (focused !== area) focused.focus({ preventScroll: true });
    }
    this.numberLines();
    this.mark();
  }
  // The file on the disk is another one than was read here.
  differs(text) {
    this.written("");
    const done = click => () => { click(); this.places.conflict.hidden = true; };
    const button = (label, click) => element("button", { type: "button", click: done(click) }, label);
    this.places.conflict.replaceChildren("The file was changed outside of this window. ",
      button("take the file's text", () => { this.saved = text; this.put(text); this.check(); }), " ",
      button("keep this text and overwrite the file", () => this.store("save", text)));
    this.places.conflict.hidden = false;
  }
  numberLines(bad = new Map()) {
    const line = number => element("span", bad.has(number) ? { class: bad.get(number) } : {}, `${number}\n`);
    const count = this.text.split("\n").length;
    this.places.lines.replaceChildren(...Array.from({ length: count }, (_, index) => line(index + 1)));
    this.scroll();
  }
  scroll() {
    this.places.lines.scrollTop = this.places.text.scrollTop;
    this.paintBands();
  }
  get lineHeight() { return parseFloat(getComputedStyle(this.places.text).lineHeight); }
  lineAt(event) { return Math.floor((event.offsetY + this.places.text.scrollTop - 8) / this.lineHeight) + 1; }
  // Mark lines: {kind: [first line, how many]}.
  band(bands) {
    if (JSON.stringify(bands) === JSON.stringify(this.bands)) return;
    this.bands = bands;
    this.paintBands();
  }
  paintBands() {
    this.places.bands.replaceChildren(...Object.entries(this.bands).map(([kind, [line, count]]) => {
      const made = element("i", { class: kind });
      made.style.top = `${8 + (line - 1) * this.lineHeight - this.places.text.scrollTop}px`;
      made.style.height = `${count * this.lineHeight}px`;
      return made;
    }));
  }
  mark() {
    write(this.places.state, this.changed ? "changed" : "saved");
    this.places.state.classList.toggle("changed", this.changed);
    this.places.download.hidden = this.text !== this.made;   // a HEX file of another text is not this one's
  }
  // What is being written may be stopped as soon as it takes long.
  buttons() {
    this.places.save.disabled = !this.good || this.sent !== null;
    this.places.build.disabled = this.sent === null ? !this.good : !this.stoppable;
    write(this.places.build, this.stoppable ? "stop" : "build");
  }
  // What was sent is on the disk; null: it was sent over a line that has ended, and is read again.
  stored(text) {
    if (text !== null) this.saved = text;
    this.mark();
  }
  checked(message) {
    const writes = message.saved || message.failed, about = writes ? this.sent : this.asked.text;
    if (message.saved) this.stored(this.sent);
    if (writes) this.written("");
    else if (message.number !== this.asked.number) return;
    else this.planning.end();
    if (about !== this.text) return;   // what was typed since is asked for
    const placed = message.diagnostics.filter(each => each.line);
    const bad = new Map(placed.map(each => [each.line, each.severity]));
    this.numberLines(bad);
    this.mark();
    const weight = each => ({ error: 0, warning: 1 }[each.severity] ?? 2);
    const sorted = [...message.diagnostics].sort((one, other) => weight(one) - weight(other));
    this.places.problems.replaceChildren(...sorted.map(each => this.problem(each)));
    this.good = message.good;
    this.buttons();
    if (message.good) this.posed(message);
    else this.plan("");
  }
  problem(each) {
    const place = `${each.line ? `line ${each.line}: ` : ""}${each.key ? `${each.key}: ` : ""}`;
    const said = `${place}${each.message}${each.hint ? ` (${each.hint})` : ""}`;
    const button = element("button", { type: "button", class: "plain", click: () => this.go(each) }, said);
    return element("li", { class: each.severity }, button);
  }
  go({ line = 1, column = 1 }) {
    const lines = this.text.split("\n").slice(0, (line || 1) - 1), area = this.places.text;
    const start = lines.reduce((sum, each) => sum + each.length + 1, 0) + (column || 1) - 1;
    area.focus();
    area.setSelectionRange(start, start);
    this.reveal(line);
  }
  // Have a line in sight.
  reveal(line) {
    const area = this.places.text, top = (line - 1) * this.lineHeight;
    const there = top >= area.scrollTop && top < area.scrollTop + area.clientHeight - 2 * this.lineHeight;
    if (!there) area.scrollTop = top - area.clientHeight / 2;
  }
  say(text) { this.places.progress.textContent = text; }
  built(message) {
    this.made = this.sent;
    this.stored(this.sent);
    const { exact, frames, words, distance, reasons } = message;
    this.written(exact ? `built: exact over ${frames} frames, ${words} words; ${distance}`
      : `built, but NOT exact: ${reasons.join("; ")}`);
    this.places.progress.dataset.exact = exact;
    const link = ([name, text]) => {
      const href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
      return [element("a", { href, download: name }, `download ${name}`), " "];
    };
    this.places.download.replaceChildren(...Object.entries(message.files).flatMap(link));
    this.mark();
    this.plan("");
  }
  // What was asked for is not answered: the server has gone, or has failed.
  lost() {
    this.planning.end();
    if (this.sent !== null) this.written("");
  }
}
