// A film: pulses that were planned, simulated or captured, played on the robot and shown as waves, without a
// server. In: rows of pulses in µs. A row of the kind "planned" is what the others are held against.
// A part of viewer.js, behind robot.js and waves.js.

const SILENT_PERIODS = 2;   // after which a servo without a pulse is not driven
const OWN_ROW = 64;         // the number of the first row that is not a pin's own

// How many of the rising values are less than a time.
function before(values, time) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] < time) low = middle + 1;
    else high = middle;
  }
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
    const { data } = this, shown = this.seen.length ? this.seen : this.planned;
    const rows = shown.map(row => ({
      name: row.kind === "captured" ? "captured" : row.channel, pin: row.lane ?? row.pin, colour: row.colour,
      servo: data.robot?.servos.find(servo => servo.pin === row.pin),
    }));
    const model = {
      cycle_us: data.cycle_us, cycles_per_second: 1e6 / data.cycle_us, period: data.period / data.cycle_us,
      origin: this.planned.length ? 0 : null, names: data.pins,
    };
    this.waves = new Waves(this.places.waves, model, {
      rows,
      maxSeconds: data.end / 1e6,
      changed: () => this.cut(),
      seek: cycle => this.go(cycle * data.cycle_us),
      readout: text => {
        const { readout } = this.places;
        if (readout && readout.textContent !== text) readout.textContent = text;
      },
      describe: (row, width) => {
        const us = width * data.cycle_us, { servo } = row;
        if (!servo) return timeText(us);
        const unit = servo.continuous ? " °/s" : "°";
        return `${+us.toFixed(2)} µs ${(angleOf(servo, us) * 180 / Math.PI).toFixed(1)}${unit}`;
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
      const edge = (us, level) => `${us.toFixed(1)} ${level}`;
      const pulse = (each, rise, index) => [edge(rise, 1), edge(rise + each.width[index], 0)];
      const edges = each => new Set(each.rise.flatMap((rise, index) => pulse(each, rise, index)));
      const [asked, made] = [edges(plan), edges(row)];
      const only = (one, other) => [...one].filter(each => !other.has(each));
      for (const alone of [...only(asked, made), ...only(made, asked)]) {
        const [us, level] = alone.split(" ").map(Number);
        found.push({ cycle: us / this.data.cycle_us, pin: row.pin, level });
      }
    }
    return found;
  }
  // Give the waves what is in sight.
  cut() {
    const scale = this.data.cycle_us, levels = [];
    const begin = this.waves.begin * scale, end = this.waves.end * scale;
    const inSight = (rows, lane) => rows.flatMap(row => {
      const first = Math.max(0, before(row.rise, begin) - 1), last = before(row.rise, end), found = [];
      for (let index = first; index < last; index++) {
        const rise = row.rise[index], width = row.width[index], pin = lane(row);
        if (rise + width < begin) continue;
        if (rise < begin) levels[pin] = 1;
        found.push({ pin, rise: rise / scale, width: width / scale });
      }
      return found;
    });
    const pulses = inSight(this.seen, row => row.lane), planned = inSight(this.planned, row => row.pin);
    const shown = { begin: this.waves.begin, end: this.waves.end, seen: this.waves.end, before: levels };
    const wanted = edgesOf(planned, [], shown.begin, shown.end);
    this.waves.set({ ...shown, pulses, floating: [], wanted, differing: this.wrong, inputs: [] });
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
      box.addEventListener("change", () => {
        this.servos.off[box.checked ? "delete" : "add"](index);
        this.go(this.time);
      });
      label.append(box, ` ${servo.name}`);
      servos.append(label);
    });
  }
  // The widths of the pulses that are over; where the last one was long ago, 0, unless it is asked for.
  widths(rows, old = false) {
    return this.data.robot.servos.map(servo => {
      const row = rows.find(each => each.pin === servo.pin);
      const index = row ? before(row.rise, this.time) - 1 : -1;
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
    this.servos?.jump(this.widths(this.played, true));   // a servo stays where its last pulse put it
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
    const compared = this.played !== this.planned && this.planned.length > 0;
    const plan = compared ? this.servos.commanded(this.widths(this.planned)) : null;
    this.robot.show(this.servos.angles, plan, this.servos.pose);
  }
}
