// The serial line: bytes to the chip as they were typed, and what comes back on a pin.

import { element, write } from "./dom.js";

const hex = byte => byte.toString(16).toUpperCase().padStart(2, "0");
const SUCH = { hex: "FF 00 7F", decimal: "255 0 127", text: "hello" };
const BYTES = 4000;   // that the transcript keeps of a direction before its oldest line goes

// The bytes that a text means, read as `kind`; or a sentence on what is wrong.
export function bytesOf(text, kind) {
  if (kind === "text") return [...new TextEncoder().encode(text)];
  const words = text.trim().split(/[\s,]+/).filter(Boolean);
  if (kind === "decimal") {
    const wrong = words.find(word => !/^\d{1,3}$/.test(word) || +word > 255);
    return wrong === undefined ? words.map(Number) : `'${wrong}' is not a number from 0 to 255`;
  }
  const pairs = words.flatMap(word => word.replace(/^0x/i, "").match(/^.$|..?/g) || ["?"]);
  const right = pair => /^[0-9a-f]{2}$/i.test(pair) || (/^[0-9a-f]$/i.test(pair) && words.includes(pair));
  const wrong = pairs.find(pair => !right(pair));
  if (wrong !== undefined) return `'${wrong}' is not a byte of two hex digits`;
  return pairs.map(pair => parseInt(pair, 16));
}

// Made anew for each version of what is watched.
export class Console {
  // listened(pin) is told which line is decoded.
  constructor(model, places, send, listened) {
    Object.assign(this, { model, places, send, listened, ended: new AbortController() });
    if (!model.runs) return;
    for (const place of [places.pin, places.listen]) {
      const chosen = place.value;
      place.replaceChildren(...model.pins.map(name => element("option", { value: name }, name)));
      if (model.pins.includes(chosen)) place.value = chosen;
    }
    places.listen.prepend(element("option", { value: "" }, "none"));
    places.listen.value = model.listening?.pin ?? "";
    if (model.listening) places.listenBaud.value = model.listening.baud;
    if (model.serial) {
      places.pin.value = model.serial.pin;
      places.baud.value = model.serial.baud;
    }
    for (const place of [places.bytes, places.kind]) this.on(place, "input", () => this.read());
    for (const place of [places.listen, places.listenBaud]) this.on(place, "change", () => this.listen());
    this.on(places.idle, "click", () => send({ do: "pin", pin: places.pin.value, level: 1 }));
    this.on(places.form, "submit", event => { event.preventDefault(); this.submit(); });
    this.read();
    this.listening();
  }
  on(place, event, action) { place.addEventListener(event, action, { signal: this.ended.signal }); }
  end() { this.ended.abort(); }
  read() {
    const kind = this.places.kind.value, bytes = bytesOf(this.places.bytes.value, kind);
    const sends = () => `sends ${[...bytes].map(hex).join(" ")}`;
    const read = bytes.length ? sends() : `read as ${kind}, such as ${SUCH[kind]}`;
    write(this.places.read, typeof bytes === "string" ? bytes : read);
    this.places.read.classList.toggle("bad", typeof bytes === "string");
    return typeof bytes === "string" ? [] : bytes;
  }
  submit() {
    const bytes = this.read();
    if (!bytes.length) return;
    this.send({ do: "serial", pin: this.places.pin.value, baud: +this.places.baud.value, bytes });
    this.add("to the chip", bytes);
  }
  listen() {
    const pin = this.places.listen.value, baud = +this.places.listenBaud.value;
    this.model.listening = pin ? { pin, baud } : null;
    this.send({ do: "listen", pin, baud });
    this.listening();
  }
  listening() {
    const { listening, pins } = this.model;
    this.listened(listening ? pins.indexOf(listening.pin) : null);
  }
  // Take bytes that came back.
  received(bytes) { this.add("from the chip", bytes); }
  add(way, bytes) {
    const shown = [...bytes].map(hex).join(" "), log = this.places.transcript;
    const text = bytes.map(byte => (byte > 31 && byte < 127 ? String.fromCharCode(byte) : "·")).join("");
    let last = log.lastElementChild;
    if (last?.dataset.way !== way || last.dataset.hex.length > BYTES) {
      last = element("div", { "data-way": way, "data-hex": "", "data-text": "" });
      log.append(last);
      while (log.childElementCount > 200) log.firstElementChild.remove();
    }
    last.dataset.hex = `${last.dataset.hex} ${shown}`.trim();
    last.dataset.text += text;
    last.textContent = `${way}: ${last.dataset.hex}   ${last.dataset.text}`;
    log.scrollTop = log.scrollHeight;
  }
}
