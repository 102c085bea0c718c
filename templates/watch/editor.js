// The job file: checked while it is typed, saved, built and proven; errors stand at their lines.

import { element } from "./chip.js";

const PAUSE_MS = 300;   // after the last key, before it is checked

export class Editor {
  // posed(poses) is told the poses of the job whenever it is found to be right.
  constructor(places, send, posed) {
    this.posed = posed;
    this.places = places;
    this.send = send;
    this.saved = "";
    let timer = null;
    places.text.addEventListener("input", () => {
      clearTimeout(timer);
      timer = setTimeout(() => this.check(), PAUSE_MS);
      this.number();
      this.mark();
    });
    places.text.addEventListener("scroll", () => { places.lines.scrollTop = places.text.scrollTop; });
    places.save.addEventListener("click", () => send({ do: "save", text: places.text.value }));
    places.build.addEventListener("click", () => { this.say("building"); send({ do: "build", text: places.text.value }); });
  }
  check() { this.send({ do: "check", text: this.places.text.value }); }
  open(message) {
    if (this.opened && message.saved && this.places.text.value !== this.saved) return;   // a reload of the socket keeps what was typed
    this.opened = true;
    this.places.area.hidden = false;
    this.places.name.textContent = message.name;
    this.places.text.value = message.text;
    if (message.saved) this.saved = message.text;
    if (!message.saved || /^\s*\[motion\]/m.test(message.text)) this.check();
    this.number();
    this.mark();
  }
  number(bad = new Map()) {
    const count = this.places.text.value.split("\n").length;
    this.places.lines.replaceChildren(...Array.from({ length: count }, (_, index) => element("span", bad.has(index + 1) ? { class: bad.get(index + 1) } : {}, `${index + 1}\n`)));
    this.places.lines.scrollTop = this.places.text.scrollTop;
  }
  mark() { this.places.state.textContent = this.places.text.value === this.saved ? "saved" : "changed"; }
  checked(message) {
    if (message.saved) this.saved = this.places.text.value;
    this.mark();
    const bad = new Map(message.diagnostics.filter(each => each.line).map(each => [each.line, each.severity]));
    this.number(bad);
    this.places.problems.replaceChildren(...message.diagnostics.map(each => element("li", { class: each.severity },
      element("button", { type: "button", class: "plain", click: () => this.go(each) }, `${each.line ? `line ${each.line}: ` : ""}${each.key ? `${each.key}: ` : ""}${each.message}${each.hint ? ` (${each.hint})` : ""}`))));
    this.places.build.disabled = this.places.save.disabled = !message.good;
    if (!message.good) this.say("");
    else if (message.poses) this.posed(message.poses);
  }
  go(diagnostic) {
    const lines = this.places.text.value.split("\n"), start = lines.slice(0, (diagnostic.line || 1) - 1).reduce((sum, line) => sum + line.length + 1, 0) + (diagnostic.column || 1) - 1;
    this.places.text.focus();
    this.places.text.setSelectionRange(start, start);
  }
  say(text) { this.places.progress.textContent = text; }
  built(message) {
    this.saved = this.places.text.value;
    this.mark();
    this.say(message.proven ? `built and proven over ${message.frames} frames, ${message.words} words; ${message.distance}` : `built, but NOT proven: ${message.reasons.join("; ")}`);
    this.places.progress.dataset.proven = message.proven;
    const link = element("a", { href: URL.createObjectURL(new Blob([message.hex], { type: "text/plain" })), download: message.hex_name }, `download ${message.hex_name}`);
    this.places.download.replaceChildren(link);
  }
}
