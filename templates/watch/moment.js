// Time: run and steps, the slider with what is marked on it, a field to go to a moment, how far it still is.

import { byId, element, write } from "./dom.js";

const SPEEDS = [
  [1e-5, "1/100 000"], [1e-4, "1/10 000"], [1e-3, "1/1000"], [1e-2, "1/100"], [0.1, "1/10"], [1, "real time"],
  [10, "10 ×"], [null, "full speed"],
];
const REAL_TIME = 5;
const UNITS = { h: 3600e6, min: 60e6, s: 1e6, ms: 1e3, us: 1, "µs": 1 };
const STEPS = ["frame", "edge", "line", "instruction"];
const AROUND_US = 2000;   // of a difference, shown on both sides

// The cycle that a text means: "4.9 s", "1:30" (minutes), "20:00:00" (hours), "20 h", "frame 12", "cycle 9".
export function cycleOf(text, model) {
  const said = text.trim().toLowerCase().replace(",", ".");
  const clock = said.match(/^(?:(\d+):)?(\d+):(\d+(?:\.\d*)?)$/);
  const named = said.match(/^(cycle|frame)\s*(\d+)$/);
  const amount = said.match(/^(\d+(?:\.\d*)?)\s*(h|min|s|ms|us|µs)?$/);
  const cycles = us => Math.round(us / model.cycle_us);
  if (clock) return cycles(1e6 * ((+(clock[1] || 0) * 60 + +clock[2]) * 60 + +clock[3]));
  if (named?.[1] === "cycle") return +named[2];
  if (named) return Math.round((model.origin || 0) + named[2] * model.period);
  return amount ? cycles(amount[1] * UNITS[amount[2] || "s"]) : null;
}

// A moment in words: hours and minutes where it has any.
export function clockText(us) {
  const s = us / 1e6, h = Math.floor(s / 3600), min = Math.floor(s / 60) % 60;
  if (s < 60) return `${s.toFixed(6)} s`;
  const rest = (s % 60).toFixed(6).padStart(9, "0");
  return h ? `${h}:${String(min).padStart(2, "0")}:${rest}` : `${min}:${rest}`;
}

export class Moment {
  constructor(send, say) {
    Object.assign(this, { send, say, latest: null });
    this.run = this.run.bind(this);
    const click = (id, action) => byId(id).addEventListener("click", action);
    click("run", () => this.run(!this.latest?.running));
    click("begin", () => send({ do: "seek", cycle: 0 }));
    click("difference", () => this.difference());
    byId("difference").disabled = true;   // until there is something to compare
    for (const what of STEPS) {
      click(`back-${what}`, () => send({ do: "step", what, count: -1 }));
      click(`next-${what}`, () => send({ do: "step", what, count: 1 }));
    }
    SPEEDS.forEach(([, text], index) => byId("speed").append(element("option", { value: index }, text)));
    byId("speed").value = REAL_TIME;
    byId("speed").addEventListener("change", () => this.run(!!this.latest?.running));
    byId("moment").addEventListener("input", () => send({ do: "seek", cycle: +byId("moment").value }));
    byId("go-form").addEventListener("submit", event => {
      event.preventDefault();
      const text = byId("go").value, cycle = cycleOf(text, this.model);
      byId("go").setAttribute("aria-invalid", cycle === null);
      if (cycle === null) this.say(`'${text}' is not a time: 4.9 s, 1:30, 20:00:00, 20 h, frame 12`, "bad");
      else send({ do: "seek", cycle });
    });
  }
  run(running) { this.send({ do: "run", running, speed: SPEEDS[byId("speed").value][0] }); }
  difference() {
    const { first_difference: at, cycle_us: us } = this.model;
    this.send({ do: "seek", cycle: at + 1 });
    this.waves.show(at - AROUND_US / us, at + AROUND_US / us);
  }
  use(model, waves) {
    Object.assign(this, { model, waves });
    const needless = model.runs ? [] : ["line", "instruction"];
    for (const what of STEPS) {
      for (const way of ["back", "next"]) byId(`${way}-${what}`).disabled = needless.includes(what);
    }
  }
  show(message) {
    this.latest = message;
    if ("stopped" in message) {
      write(byId("run"), message.running ? "pause" : "run");
      byId("run").setAttribute("aria-pressed", message.running);
      const speed = SPEEDS.findIndex(([each]) => each === message.speed);
      if (document.activeElement !== byId("speed")) byId("speed").value = speed;
      byId("behind").hidden = !message.behind;
      if (message.stopped) this.say(`stopped at ${message.stopped}`);
      else if (message.running) this.say("");
    }
    const { cycle } = message, { cycle_us: us, origin, period } = this.model;
    const number = origin === null ? -1 : Math.floor((cycle - origin) / period);
    write(byId("now"), `${clockText(cycle * us)}, cycle ${cycle}${number < 0 ? "" : `, frame ${number}`}`);
    const slider = byId("moment");
    slider.max = Math.max(this.model.end ?? message.reach, 1);
    if (document.activeElement !== slider || message.running) slider.value = cycle;
    slider.setAttribute("aria-valuetext", clockText(cycle * us));
    this.marks(+slider.max, message.intervened ?? null);
  }
  // The marks on the slider: where edges differ, the first intervention, the cursors.
  marks(max, intervened) {
    const [a, b] = this.waves.cursors, { first_difference: first, differences } = this.model;
    const marks = differences.map(([from, to]) => ["", from, to]);
    for (const [kind, at] of [["", first], ["intervened", intervened], ["cursor", a], ["cursor", b]]) {
      if (at !== null) marks.push([kind, at, at]);
    }
    const there = marks.filter(([, from]) => from <= max), said = JSON.stringify([max, there]);
    if (said === this.marked) return;
    this.marked = said;
    byId("marks").replaceChildren(...there.map(([kind, from, to]) => {
      const made = element("i", kind ? { class: kind } : {});
      made.style.left = `${100 * from / max}%`;
      made.style.minWidth = `${100 * (Math.min(to, max) - from) / max}%`;
      return made;
    }));
  }
  // The way to a far moment: what part of it is done; null: it is there.
  going(share) {
    byId("going").hidden = share === null;
    if (share !== null) byId("going").value = share;
  }
}
