// What a person does to the robot: sliders for the servos, buttons on pins, ways of a walk.

import { element, write } from "./dom.js";
import { angleOf, widthOf } from "./viewer.js";

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
    this.servos = model.robot ? model.robot.servos : [];
    this.angles = this.servos.map(servo => servo.neutral);
    this.touched = false;
    this.waiting = new Map();   // the newest position of each servo that its line is too busy for
    this.ended = new AbortController();   // takes its listeners off the parts of the page that stay
    this.pressed = new Map();   // the buttons that are held down: what lets each go
    for (const name of ["sliders", "buttons", "emergency", "walk", "pin"]) places[name].replaceChildren();
    this.sliders();
    this.buttons();
    this.walk();
    const release = () => { for (const up of [...this.pressed.values()]) up(); };
    this.on(window, "blur", release);
    this.on(document, "visibilitychange", () => { if (document.hidden) release(); });
  }
  on(place, event, action) { place.addEventListener(event, action, { signal: this.ended.signal }); }
  end() {
    for (const up of [...this.pressed.values()]) up();
    this.waiting.clear();
    this.ended.abort();
  }
  sliders() {
    this.places.pose.hidden = !this.servos.length || !(this.model.poses || this.model.serial);
    this.places.record.hidden = !this.model.poses;
    this.inputs = this.servos.map((servo, index) => {
      const [least, most] = servo.limits.map(degrees).map(end => end.toFixed(1)), id = `servo-${index}`;
      const input = element("input", { type: "range", id, min: least, max: most, step: "0.1" });
      const said = element("output", { for: id });
      const unit = servo.continuous ? " °/s" : "°", ends = `${+least} to ${+most}${unit}`;
      input.addEventListener("input", () => this.move(index, input.value * Math.PI / 180));
      const label = element("label", { for: id, title: ends }, servo.name, " ", element("small", {}, ends));
      this.places.sliders.append(element("div", { class: "slider" }, label, input, said));
      return [input, said];
    });
    this.servos.forEach((_, index) => this.put(index, this.angles[index]));
    this.on(this.places.record, "click", () => this.posed.record(this.angles));
    this.on(this.places.follow, "click", () => this.touch(false));
    this.places.follow.hidden = true;
  }
  // Show a servo at an angle: in degrees, and the pulse that commands it.
  put(index, angle, moves = true) {
    const servo = this.servos[index], [input, said] = this.inputs[index];
    this.angles[index] = angle;
    if (moves) input.value = degrees(angle);
    const unit = servo.continuous ? " °/s" : "°";
    write(said, `${degrees(angle).toFixed(1)}${unit}, ${+widthOf(servo, angle).toFixed(1)} µs`);
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
    angles.forEach((angle, index) => this.inputs[index] && this.put(index, angle));
    this.posed.shown(this.angles);
  }
  move(index, angle) {
    const servo = this.servos[index];
    this.touch();
    this.put(index, angle, false);
    if (this.model.serial) {
      const ends = servo.limits.map(limit => widthOf(servo, limit)).sort((a, b) => a - b);
      const position = Math.round((widthOf(servo, angle) - ends[0]) / (ends[1] - ends[0]) * POSITIONS);
      this.command(index, Math.max(0, Math.min(POSITIONS, position)));
    }
    this.posed.shown(this.angles);
  }
  // Send the newest position of a servo, no more often than its line carries one.
  command(index, position) {
    this.waiting.set(index, position);
    if (this.busy) return;
    const next = () => {
      this.busy = this.waiting.size > 0;
      if (!this.busy) return;
      for (const [servo, value] of this.waiting) this.send({ do: "servo", servo, position: value });
      this.waiting.clear();
      setTimeout(next, COMMAND_MS);
    };
    next();
  }
  // Put the sliders where the pulses are, until a hand has moved one.
  follow(widths) {
    if (this.touched) return;
    widths.forEach((width, index) => { if (width) this.put(index, angleOf(this.servos[index], width)); });
  }
  // Each button is held down as long as the pointer or the key; the emergency stop is always in sight.
  buttons() {
    for (const each of this.model.inputs) {
      const stop = each.name === "stop", text = stop ? "emergency stop" : each.name;
      const made = element("button", { type: "button", class: stop ? "stop" : "" }, text);
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
      for (const end of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) {
        made.addEventListener(end, () => set(false));
      }
      made.addEventListener("keydown", ofKey(true));
      made.addEventListener("keyup", ofKey(false));
      if (stop) this.stop = set;
      if (stop) made.title = "held down as long as the mouse, or Escape";
      this.places[stop ? "emergency" : "buttons"].append(made);
    }
    if (!this.model.runs) return;
    const names = [...this.model.pins, "MCLR"];
    this.places.pin.append(...names.map(name => element("option", { value: name }, name)));
    for (const [place, level] of [["high", 1], ["low", 0], ["free", 2]]) {
      this.on(this.places[place], "click", () => this.send({ do: "pin", pin: this.places.pin.value, level }));
    }
  }
  // The ways of a robot that walks on command: buttons, and arrow keys while nothing else takes them.
  walk() {
    const { walk } = this.model;
    this.places.walk.hidden = !walk;
    if (!walk) return;
    const made = way => {
      const pressed = way === walk.stop, click = () => this.go(way);
      return element("button", { type: "button", "aria-pressed": pressed, click }, way);
    };
    this.ways = new Map([...walk.ways, walk.stop].map(way => [way, made(way)]));
    this.ways.get(walk.stop).classList.add("stop");
    const said = element("span", { class: "soft" }, `arrow keys walk, Escape stops: codes on ${walk.pin}`);
    this.places.walk.append(...[...this.ways.values()].slice(0, -1), said);
    this.places.emergency.append(this.ways.get(walk.stop));
    const steers = event => { if (this.steer(event)) event.stopPropagation(); };
    for (const place of ["walk", "emergency"]) this.on(this.places[place], "keydown", steers);
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
}
