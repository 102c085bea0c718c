// What a person does to the robot: sliders for the servos, buttons on pins, bytes on the serial line.

import { element } from "./chip.js";
import { angleOf, widthOf } from "./robot.js";

const POSITIONS = 254;
const COMMAND_MS = 30;   // between two commands of a slider that is dragged
const WAY_OF_KEY = { ArrowUp: "forward", ArrowDown: "back", ArrowLeft: "left", ArrowRight: "right" };
const degrees = angle => angle * 180 / Math.PI;

// Made anew for each version of what is watched: pins, levels, servos and ways are those of its model alone.
export class Hands {
  constructor(model, places, send, posed) {
    this.model = model;
    this.places = places;
    this.send = send;
    this.posed = posed;
    this.angles = model.robot ? model.robot.servos.map(servo => servo.neutral) : [];
    this.touched = false;
    this.ended = new AbortController();   // takes its listeners off the parts of the page that stay
    this.pressed = new Map();   // the buttons that are held down: what lets each go
    for (const place of [places.sliders, places.buttons, places.walk, places.pin, places.serialPin]) place.replaceChildren();
    this.sliders();
    this.buttons();
    this.walk();
    this.console();
    const release = () => { for (const up of [...this.pressed.values()]) up(); };
    this.on(window, "blur", release);
    this.on(document, "visibilitychange", () => { if (document.hidden) release(); });
  }
  on(place, event, action) { place.addEventListener(event, action, { signal: this.ended.signal }); }
  end() {
    for (const up of [...this.pressed.values()]) up();
    this.waiting?.clear();
    this.ended.abort();
  }
  sliders() {
    const servos = this.model.robot ? this.model.robot.servos : [];
    this.places.pose.hidden = !servos.length || !(this.model.poses || this.model.serial);
    this.places.record.hidden = !this.model.poses;
    this.inputs = servos.map((servo, index) => {
      const ends = servo.limits.map(degrees), id = `servo-${index}`;
      const input = element("input", { type: "range", id, min: ends[0].toFixed(1), max: ends[1].toFixed(1), step: "0.1" });
      input.value = degrees(this.angles[index]);
      const said = element("output", { for: id });
      input.addEventListener("input", () => this.move(index, input.value * Math.PI / 180, said));
      this.places.sliders.append(element("div", { class: "slider" }, element("label", { for: id }, servo.name), input, said));
      said.textContent = `${(+input.value).toFixed(1)}${servo.continuous ? " °/s" : "°"}`;
      return [input, said];
    });
    this.on(this.places.record, "click", () => this.posed.record(this.angles));
    this.on(this.places.follow, "click", () => this.touch(false));
    this.places.follow.hidden = true;
  }
  // From now on the sliders are where the hand puts them; `follow` gives them back to the chip.
  touch(touched = true) {
    this.touched = touched;
    this.places.follow.hidden = !touched;
    if (!touched) this.posed.shown(null);
  }
  // Put the sliders where a pose has the servos.
  pose(angles) {
    this.touch();
    this.inputs.forEach(([input, said], index) => {
      this.angles[index] = angles[index];
      input.value = degrees(angles[index]);
      said.textContent = `${degrees(angles[index]).toFixed(1)}${this.model.robot.servos[index].continuous ? " °/s" : "°"}`;
    });
    this.posed.shown(this.angles);
  }
  move(index, angle, said) {
    const servo = this.model.robot.servos[index];
    this.angles[index] = angle;
    this.touch();
    said.textContent = `${degrees(angle).toFixed(1)}${servo.continuous ? " °/s" : "°"}`;
    if (this.model.serial) {
      const width = widthOf(servo, angle), ends = servo.limits.map(limit => widthOf(servo, limit)).sort((a, b) => a - b);
      const position = Math.round((width - ends[0]) / (ends[1] - ends[0]) * POSITIONS);
      this.command(index, Math.max(0, Math.min(POSITIONS, position)));
    }
    this.posed.shown(this.angles);
  }
  // Send the newest position of a servo, no more often than its line carries one.
  command(index, position) {
    this.waiting ||= new Map();
    const idle = !this.waiting.size;
    this.waiting.set(index, position);
    if (!idle) return;
    const next = () => {
      if (!this.waiting.size) return;
      for (const [servo, value] of this.waiting) this.send({ do: "servo", servo, position: value });
      this.waiting.clear();
      setTimeout(next, COMMAND_MS);
    };
    setTimeout(next, 0);
  }
  // Put the sliders where the pulses are, until a hand has moved one.
  follow(widths) {
    if (this.touched) return;
    this.inputs.forEach(([input, said], index) => {
      const servo = this.model.robot.servos[index], width = widths[index];
      if (!width) return;
      this.angles[index] = angleOf(servo, width);
      input.value = degrees(this.angles[index]);
      said.textContent = `${degrees(this.angles[index]).toFixed(1)}${servo.continuous ? " °/s" : "°"}`;
    });
  }
  buttons() {
    for (const each of this.model.inputs) {
      const made = element("button", { type: "button", class: each.name === "stop" ? "stop" : "" }, each.name === "stop" ? "emergency stop" : each.name);
      const set = down => {
        if (down === this.pressed.has(made)) return;
        if (down) this.pressed.set(made, () => set(false));
        else this.pressed.delete(made);
        made.classList.toggle("pressed", down);
        this.send({ do: "pin", pin: each.pin, level: down ? each.pressed : 1 - each.pressed });
      };
      const ofKey = down => event => { if (event.key === " " || event.key === "Enter") set(down); };
      // While the pointer is captured, its end comes here wherever it is; a touch that scrolls ends so, too.
      made.addEventListener("pointerdown", event => {
        set(true);
        if (event.pointerId) made.setPointerCapture(event.pointerId);   // 0: no pointer, but a script
      });
      for (const end of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) made.addEventListener(end, () => set(false));
      made.addEventListener("keydown", ofKey(true));
      made.addEventListener("keyup", ofKey(false));
      if (each.name === "stop") this.stop = set;
      this.places.buttons.append(made);
    }
    this.places.area.hidden = !this.model.runs;
    if (!this.model.runs) return;
    for (const name of [...this.model.pins, "MCLR"]) this.places.pin.append(element("option", { value: name }, name));
    for (const [place, level] of [[this.places.high, 1], [this.places.low, 0], [this.places.free, 2]])
      this.on(place, "click", () => this.send({ do: "pin", pin: this.places.pin.value, level }));
  }
  // The ways of a robot that walks on command: buttons, and arrow keys while nothing else takes them.
  walk() {
    const { walk } = this.model;
    this.places.walk.hidden = !walk;
    if (!walk) return;
    this.ways = new Map([...walk.ways, walk.stop].map(way => [way, element("button", { type: "button", class: way === walk.stop ? "stop" : "", "aria-pressed": way === walk.stop, click: () => this.go(way) }, way)]));
    this.places.walk.append(...this.ways.values(), element("span", { class: "soft" }, `arrow keys walk, Escape stops: codes on ${walk.pin}`));
    this.on(this.places.walk, "keydown", event => { if (this.steer(event)) event.stopPropagation(); });
  }
  go(way) {
    for (const [name, made] of this.ways) made.setAttribute("aria-pressed", name === way);
    this.posed.walk(way);
  }
  // Hold the emergency stop down while Escape is; return whether the robot has one, a button or a command.
  emergency(down) {
    if (this.stop) this.stop(down);
    else if (down && this.ways) this.go(this.model.walk.stop);
    return !!(this.stop || this.ways);
  }
  // Take a key that steers; return whether it does.
  steer(event) {
    const way = WAY_OF_KEY[event.key];
    if (!this.ways?.has(way)) return false;
    event.preventDefault();
    if (!event.repeat) this.go(way);
    return true;
  }
  console() {
    const { serial } = this.model;
    this.places.serial.hidden = !this.model.runs;
    if (!this.model.runs) return;
    for (const name of this.model.pins) this.places.serialPin.append(element("option", { value: name }, name));
    if (serial) { this.places.serialPin.value = serial.pin; this.places.baud.value = serial.baud; }
    this.on(this.places.serialForm, "submit", event => {
      event.preventDefault();
      const text = this.places.bytes.value.trim();
      const plain = /^([0-9a-f]{1,2}\s+)*[0-9a-f]{1,2}$/i.test(text);
      const bytes = plain ? text.split(/\s+/).map(byte => parseInt(byte, 16)) : [...new TextEncoder().encode(text)];
      this.send({ do: "serial", pin: this.places.serialPin.value, baud: +this.places.baud.value, bytes });
      this.places.sent.prepend(element("li", {}, bytes.map(byte => byte.toString(16).toUpperCase().padStart(2, "0")).join(" ")));
    });
  }
}
