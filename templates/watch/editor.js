// The job file: checked while it is typed, saved, built; errors stand at their lines.
// Its text is one of three: on the disk (`saved`), built last (`made`), or only here; the page says which.

import { element } from "./chip.js";

const PAUSE_MS = 300;   // after the last key, before it is checked

export class Editor {
  // posed(poses) is told the poses of the job whenever it is found to be right, null while it is not known to be.
  constructor(places, send, posed) {
    this.posed = posed;
    this.places = places;
    this.send = send;
    this.saved = "";
    this.sent = null;   // the text that is being saved or built: it, not what was typed since, is on the disk then
    let timer = null;
    places.text.addEventListener("input", () => {
      clearTimeout(timer);
      timer = setTimeout(() => this.check(), PAUSE_MS);
      this.posed(null);
      this.number();
      this.mark();
    });
    places.text.addEventListener("scroll", () => { places.lines.scrollTop = places.text.scrollTop; });
    places.save.addEventListener("click", () => this.store("save"));
    places.build.addEventListener("click", () => this.store("build"));
    window.addEventListener("beforeunload", event => { if (this.changed) event.preventDefault(); });
  }
  get text() { return this.places.text.value; }
  get changed() { return !!this.opened && this.text !== this.saved; }
  check() { this.send({ do: "check", text: this.text }); }
  // Write the file, unless somebody else has since it was read; `over` is the text that may be overwritten.
  store(what, over = this.saved) {
    if (this.sent !== null) return;
    this.sent = this.text;
    this.say(what === "build" ? "building" : "saving");
    this.buttons();
    this.send({ do: what, text: this.sent, over });
  }
  open(message) {
    const kept = this.changed;
    if (message.saved && kept && message.text !== this.saved) {   // what was typed here stays, the other text is on the disk
      if (message.text !== this.text) this.differs(message.text);
      else this.stored(message.text);
      return;
    }
    if (message.saved && kept) return;
    this.opened = true;
    this.places.area.hidden = false;
    this.places.name.textContent = message.name;
    if (message.saved) this.saved = message.text;
    this.put(message.text);
    if (!message.saved || /^\s*\[motion\]/m.test(message.text)) this.check();
  }
  // Put a text in the place of the one here, as if it were typed over what differs: the browser's undo takes it back.
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
    this.number();
    this.mark();
  }
  // The file on the disk is another one than was read here.
  differs(text) {
    this.sent = null;
    this.buttons();
    const button = (label, click) => element("button", { type: "button", click: () => { click(); this.places.conflict.hidden = true; } }, label);
    this.places.conflict.replaceChildren("The file was changed outside of this window. ",
      button("take the file's text", () => { this.saved = text; this.put(text); this.check(); }), " ",
      button("keep this text and overwrite the file", () => this.store("save", text)));
    this.places.conflict.hidden = false;
    this.say("");
  }
  number(bad = new Map()) {
    const count = this.text.split("\n").length;
    this.places.lines.replaceChildren(...Array.from({ length: count }, (_, index) => element("span", bad.has(index + 1) ? { class: bad.get(index + 1) } : {}, `${index + 1}\n`)));
    this.places.lines.scrollTop = this.places.text.scrollTop;
  }
  mark() {
    this.places.state.textContent = this.changed ? "changed" : "saved";
    this.places.download.hidden = this.text !== this.made;   // a HEX file of another text is not this one's
  }
  buttons() { this.places.build.disabled = this.places.save.disabled = !this.good || this.sent !== null; }
  stored(text) {
    this.saved = text;
    this.mark();
  }
  checked(message) {
    if (message.saved) { this.stored(this.sent); this.sent = null; this.say(""); }
    if (message.failed) { this.sent = null; this.say(""); }
    const bad = new Map(message.diagnostics.filter(each => each.line).map(each => [each.line, each.severity]));
    this.number(bad);
    this.mark();
    this.places.problems.replaceChildren(...message.diagnostics.map(each => element("li", { class: each.severity },
      element("button", { type: "button", class: "plain", click: () => this.go(each) }, `${each.line ? `line ${each.line}: ` : ""}${each.key ? `${each.key}: ` : ""}${each.message}${each.hint ? ` (${each.hint})` : ""}`))));
    this.good = message.good;
    this.buttons();
    if (message.good && message.poses) this.posed(message.poses);
  }
  go(diagnostic) {
    const lines = this.text.split("\n"), start = lines.slice(0, (diagnostic.line || 1) - 1).reduce((sum, line) => sum + line.length + 1, 0) + (diagnostic.column || 1) - 1;
    this.places.text.focus();
    this.places.text.setSelectionRange(start, start);
  }
  say(text) { this.places.progress.textContent = text; }
  built(message) {
    this.made = this.sent;
    this.stored(this.sent);
    this.sent = null;
    this.buttons();
    this.say(message.exact ? `built: exact over ${message.frames} frames, ${message.words} words; ${message.distance}` : `built, but NOT exact: ${message.reasons.join("; ")}`);
    this.places.progress.dataset.exact = message.exact;
    const link = element("a", { href: URL.createObjectURL(new Blob([message.hex], { type: "text/plain" })), download: message.hex_name }, `download ${message.hex_name}`);
    this.places.download.replaceChildren(link);
    this.mark();
  }
}
