// A film: pulses that were planned, simulated or captured, played on the robot and shown as waves, without a server.
// In: rows of pulses in µs. A row of the kind "planned" is what the others are held against.

import { angleOf, RobotView, Servos } from "./robot.js";
import { timeText, Waves } from "./waves.js";

const SILENT_PERIODS = 2;   // after which a servo without a pulse is not driven
const OWN_ROW = 64;         // the number of the first row that is not a pin's own

// How many of the rising values are less than a time.
function before(values, time) {
  let low = 0, high = values.length;
  while (low < high) { const middle = (low + high) >> 1; if (values[middle] < time) low = middle + 1; else high = middle; }
  return low;
}

export class Film {
  // places: robot, waves, play, moment, now, servos, readout (any but waves, play and moment may be missing)
  constructor(data, places) {
    this.data = data;
    this.places = places;
    this.time = data.moment ?? data.first[0];
    this.playing = false;
    this.planned = data.rows.filter(row => row.kind === "planned");
    this.seen = data.rows.filter(row => row.kind !== "planned");
    this.played = data.rows.filter(row => row.kind === "simulated");
    if (!this.played.length) this.played = this.planned;
    this.seen.forEach((row, index) => { row.lane = row.kind === "simulated" ? row.pin : OWN_ROW + index; });
    if (data.robot && places.robot) {
      this.servos = new Servos(data.robot);
      this.robot = new RobotView(places.robot, data.robot);
      places.robot.parentElement.hidden = false;
    }
    this.buildWaves();
    this.buildControls();
    this.waves.show(data.first[0] / data.cycle_us, data.first[1] / data.cycle_us);
    this.go(this.time);
  }
  buildWaves() {
    const { data } = this, lanes = this.seen.length ? this.seen.map(row => [row, row.lane]) : this.planned.map(row => [row, row.pin]);
    const rows = lanes.map(([row, lane]) => ({ name: row.kind === "captured" ? "captured" : row.channel, pin: lane, colour: row.colour, servo: data.robot?.servos.find(servo => servo.pin === row.pin) }));
    const model = { cycle_us: data.cycle_us, cycles_per_second: 1e6 / data.cycle_us, period: data.period / data.cycle_us, origin: this.planned.length ? 0 : null, pins: data.pins };
    this.waves = new Waves(this.places.waves, model, {
      rows,
      maxSeconds: data.end / 1e6,
      changed: () => this.cut(),
      seek: cycle => this.go(cycle * data.cycle_us),
      readout: text => { if (this.places.readout && this.places.readout.textContent !== text) this.places.readout.textContent = text; },
      describe: (row, width) => {
        const us = width * data.cycle_us;
        return row.servo ? `${+us.toFixed(2)} µs ${(angleOf(row.servo, us) * 180 / Math.PI).toFixed(1)}${row.servo.continuous ? " °/s" : "°"}` : timeText(us);
      },
    });
    this.wrong = this.played === this.planned ? [] : this.differences();
  }
  // The edges of simulated pulses that the plan does not have, and the plan's that were not made.
  differences() {
    const found = [];
    for (const row of this.played) {
      const plan = this.planned.find(each => each.pin === row.pin);
      if (!plan) continue;
      const edges = each => each.rise.flatMap((rise, index) => [`${rise.toFixed(1)} 1`, `${(rise + each.width[index]).toFixed(1)} 0`]);
      const [asked, made] = [new Set(edges(plan)), new Set(edges(row))];
      for (const edge of [...asked].filter(each => !made.has(each)).concat([...made].filter(each => !asked.has(each)))) {
        const [us, level] = edge.split(" ").map(Number);
        found.push({ cycle: us / this.data.cycle_us, pin: row.pin, level });
      }
    }
    return found;
  }
  // Give the waves what is in sight.
  cut() {
    const scale = this.data.cycle_us, begin = this.waves.begin * scale, end = this.waves.end * scale, levels = [];
    const edges = (rows, lane) => rows.flatMap(row => {
      const first = Math.max(0, before(row.rise, begin) - 1), last = before(row.rise, end), made = [];
      for (let index = first; index < last; index++) {
        const fall = row.rise[index] + row.width[index];
        if (row.rise[index] >= begin) made.push({ cycle: row.rise[index] / scale, pin: lane(row), level: 1 });
        else if (fall > begin) levels[lane(row)] = 1;
        if (fall >= begin) made.push({ cycle: fall / scale, pin: lane(row), level: 0 });
      }
      return made;
    });
    const before0 = edges(this.seen, row => row.lane);
    this.waves.set({ begin: this.waves.begin, end: this.waves.end, seen: this.waves.end, before: levels, edges: before0, wanted: edges(this.planned, row => row.pin), differing: this.wrong, inputs: [] });
  }
  buildControls() {
    const { play, moment, servos } = this.places;
    moment.max = this.data.end;
    moment.step = 1;
    moment.addEventListener("input", () => this.go(+moment.value));
    play.addEventListener("click", () => this.play(!this.playing));
    if (!servos || !this.servos) return;
    this.data.robot.servos.forEach((servo, index) => {
      const label = document.createElement("label"), box = document.createElement("input");
      box.type = "checkbox";
      box.checked = true;
      box.addEventListener("change", () => { this.servos.off[box.checked ? "delete" : "add"](index); this.go(this.time); });
      label.append(box, ` ${servo.name}`);
      servos.append(label);
    });
  }
  // The widths of the pulses that are over; where the last one was long ago, 0, unless it is asked for.
  widths(rows, old = false) {
    return this.data.robot.servos.map(servo => {
      const row = rows.find(each => each.pin === servo.pin), index = row ? before(row.rise, this.time) - 1 : -1;
      for (let at = index; at >= Math.max(0, index - 1); at--) {
        const fall = row.rise[at] + row.width[at];
        const heard = this.time - fall < SILENT_PERIODS * this.data.period || (old && !servo.continuous);
        if (fall <= this.time && heard) return row.width[at];
      }
      return 0;
    });
  }
  go(time) {
    this.time = Math.max(0, Math.min(this.data.end, time));
    if (this.servos) this.servos.jump(this.widths(this.played, true));   // a servo stays where its last pulse put it
    this.show();
  }
  play(playing) {
    this.playing = playing;
    this.places.play.textContent = playing ? "pause" : "play";
    this.places.play.setAttribute("aria-pressed", playing);
    let last = performance.now();
    const next = now => {
      if (!this.playing) return;
      const passed = Math.min(0.1, Math.max(0, now - last) / 1000);
      last = now;
      this.time += passed * 1e6;
      if (this.time >= this.data.end) this.time = this.data.loop ?? 0;
      if (this.servos) this.servos.follow(this.widths(this.played), passed);
      this.show();
      requestAnimationFrame(next);
    };
    if (playing) requestAnimationFrame(next);
  }
  show() {
    const { moment, now } = this.places;
    if (document.activeElement !== moment || this.playing) moment.value = this.time;
    if (now) now.textContent = `${(this.time / 1e6).toFixed(3)} s`;
    this.waves.follow(this.time / this.data.cycle_us, this.playing);
    if (!this.robot) return;
    const plan = this.played === this.planned || !this.planned.length ? null : this.servos.commanded(this.widths(this.planned));
    this.robot.show(this.servos.angles, plan, this.servos.pose);
  }
}
