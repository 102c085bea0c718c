// The page: one socket to the server, what it says to the views, what the hands do to it.

import { ChipView } from "./chip.js";
import { Console } from "./console.js";
import { byId, element, Going, places, Tabs, write } from "./dom.js";
import { Editor } from "./editor.js";
import { Hands } from "./hands.js";
import { Links } from "./links.js";
import { Moment } from "./moment.js";
import { Plan } from "./plan.js";
import { SourceView } from "./source.js";
import { Twin } from "./twin.js";
import { Timeline } from "./timeline.js";
import { angleOf, RobotView, Servos, timeText, Waves } from "./viewer.js";

const SEEN = `waves of ${location.pathname}`;   // which part of the waves a tab shows when it is left
const PLACE = `window of ${location.pathname}`;   // where a tab keeps which window of the server's it is
const DOCK = "servogen dock";
const FOLLOW_MS = 100;   // between two drawings of the waves while it runs
const AGAIN_MS = 1000;   // between two tries to reach a server that has gone
const KEYS = {
  " ": "run", n: "next-instruction", N: "back-instruction", l: "next-line", L: "back-line", e: "next-edge",
  E: "back-edge", f: "next-frame", F: "back-frame", d: "difference",
};

class Page {
  constructor() {
    this.model = this.latest = this.hands = this.chip = this.source = this.waves = this.servos = null;
    this.followed = this.asked = this.painted = 0;
    this.handPose = null;
    this.seen = window.watched = { pictures: 0, latest: null };   // for whoever measures
    this.send = message => {
      if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
    };
    this.loading = new Going(text => write(byId("status"), text));
    this.links = new Links();
    this.plan = new Plan();
    this.moment = new Moment(this.send, (text, kind) => this.say(text, kind));
    this.editor = this.seen.editor = new Editor(places({
      text: "job-text", lines: "job-lines", bands: "job-bands", state: "job-state", preview: "preview",
      problems: "job-problems", save: "save", build: "build", conflict: "job-conflict",
      progress: "build-progress", download: "download",
    }), this.send, {
      posed: answer => this.posed(answer),
      pointed: (line, clicked) =>
        this.pointed(line === null ? null : this.links.atLine(line), clicked ? "text" : ""),
    });
    this.timeline = new Timeline(places({
      area: "timeline-area", list: "timeline", move_s: "pose-move", hold_s: "pose-hold",
      pause_s: "pose-pause", earlier: "pose-earlier", later: "pose-later", set: "pose-set",
      remove: "pose-remove",
    }), {
      change: change => this.change(change),
      chosen: (pose, index) => this.chosen(pose, index),
      pointed: index => this.pointed(index, ""),
    });
    this.links.shown = () => this.linked();
    this.twin = new Twin(places({ area: "twin", show: "twin-show", text: "twin-text" }), on => {
      this.send({ do: "bodies", on });
      this.picture();
    });
    this.textTabs = new Tabs(byId("text-tabs"));
    this.toolTabs = new Tabs(byId("tool-tabs"));
    this.listen();
    this.connect();
  }
  listen() {
    const click = (id, action) => byId(id).addEventListener("click", action);
    click("zoom-in", () => this.waves.zoom(0.5, this.latest?.cycle));
    click("zoom-out", () => this.waves.zoom(2, this.latest?.cycle));
    click("which", () => {
      this.waves.which = 1 - this.waves.which;
      write(byId("which"), this.waves.which ? "cursor B" : "cursor A");
      byId("which").setAttribute("aria-pressed", !!this.waves.which);
    });
    click("explained", () => { byId("explanation").hidden = true; this.relay(); });
    click("dock", () => this.dock(!byId("views").classList.contains("beside"), true));
    this.dock((localStorage.getItem(DOCK) ?? (window.innerWidth >= 1700 ? "beside" : "")) === "beside");
    byId("chip-number").addEventListener("change", () => {
      this.send({ do: "chip", number: +byId("chip-number").value });
    });
    byId("lane").addEventListener("change", () => {
      this.waves.choose(byId("lane").value === "" ? null : +byId("lane").value);
    });
    byId("breakpoint-form").addEventListener("submit", event => {
      event.preventDefault();
      this.send({ do: "breakpoint", text: byId("breakpoint").value, on: true });
    });
    // Escape is the emergency stop wherever the focus is; a button is held down as long as the key.
    const stop = (event, down) => {
      if (event.key === "Escape" && this.hands?.emergency(down)) event.preventDefault();
    };
    document.addEventListener("keydown", event => { if (!event.repeat) stop(event, true); });
    document.addEventListener("keyup", event => stop(event, false));
    document.addEventListener("keydown", event => this.press(event));
    const resized = () => { this.relay(); this.robot?.paint(); };
    new ResizeObserver(() => requestAnimationFrame(resized)).observe(byId("seen"));
    setInterval(() => { if (this.pending) this.ask(); }, 60);
  }
  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.matches("input, textarea, select, button, a, summary")) return;
    if (event.target === document.body && this.hands?.steer(event)) return;
    const control = byId(KEYS[event.key] || "");
    if (!control) return;
    event.preventDefault();
    if (!control.disabled) control.click();
  }
  // Have chip and hands beside the robot, or below the text.
  dock(beside, kept = false) {
    byId("views").classList.toggle("beside", beside);
    byId("dock").setAttribute("aria-pressed", beside);
    if (kept) localStorage.setItem(DOCK, beside ? "beside" : "below");
    this.relay();
    this.robot?.paint();
  }
  relay() {
    if (!this.waves?.data) return;
    this.waves.lay();
    this.waves.paint();
  }
  connect() {
    this.socket = new WebSocket(`${location.href.replace(/^http/, "ws").replace(/[?#].*$/, "")}socket`);
    this.socket.addEventListener("open", () => {
      this.lost(false);
      // A server that was started again knows no window: this is where it was.
      const { cycle = 0, breakpoints = [] } = this.latest || {};
      this.send({ window: sessionStorage.getItem(PLACE) || "", cycle, breakpoints });
    });
    this.socket.addEventListener("message", event => this.receive(JSON.parse(event.data)));
    this.socket.addEventListener("close", () => {
      this.lost(true);
      setTimeout(() => this.connect(), AGAIN_MS);
    });
  }
  // Say that the server has gone: nothing on the page would do anything.
  lost(gone) {
    document.body.classList.toggle("gone", gone);
    byId("views").inert = byId("time").inert = gone;
    byId("link").hidden = !gone;
    const here = this.model?.runs ? ` --at-cycle ${this.latest?.cycle ?? 0}` : "";
    const said = "The server does not answer. This page goes on here as soon as it does. If it has ended,"
      + ` servogen watch ${this.model?.name ?? ""}${here} opens a new page at this moment;`
      + " text that is not saved is only here.";
    write(byId("link"), gone ? said : "");
    if (!gone) return;
    this.editor.lost();
    this.waiting = false;
    document.title = `no server · ${this.model?.name ?? "servogen"}`;
  }
  receive(message) {
    const take = {
      window: () => sessionStorage.setItem(PLACE, message.name),
      status: () => this.status(message),
      model: () => this.start(message),
      theorem: () => write(byId("theorem"), message.text),
      now: () => this.show(message),
      going: () => this.moment.going(message.share),
      waves: () => { this.waiting = false; this.waves.take(message); },
      problem: () => this.problem(message),
      explanation: () => this.explained(message.lines),
      bodies: () => { this.twin.take(message); this.picture(); },
      "bodies-model": () => { this.twin.model(message.model, message.text); this.picture(); },
      editor: () => this.editor.open(message),
      differs: () => this.editor.differs(message.text),
      checked: () => this.editor.checked(message),
      stopped: () => this.editor.stopped(message),
      built: () => this.editor.built(message),
    }[message.is];
    take?.();
  }
  // What the server is doing.
  status({ text, failed }) {
    write(byId("status"), text);
    if (text && !failed) this.loading.begin(text);
    else this.loading.end();
    byId("status").classList.toggle("bad", !!failed);
  }
  problem(message) {
    if (["check", "save", "build"].includes(message.about)) this.editor.lost();
    if (message.about === "breakpoint") this.breakpointSaid(message.text);
    else this.say(message.text, "bad");
  }
  say(text, kind = "") {
    write(byId("said"), text);
    byId("said").className = kind;
  }
  explained(lines) {
    byId("explanation").lastElementChild.replaceChildren(...lines.map(text => element("p", {}, text)));
    byId("explanation").hidden = false;
    this.relay();
  }
  start(model) {
    this.model = model;
    document.title = `${model.name} · servogen`;
    write(byId("name"), model.name);
    byId("time").hidden = byId("views").hidden = false;
    this.handPose = null;
    write(byId("theorem"), "");
    this.plan.clear();
    this.links.use(model);
    this.servos = model.robot ? new Servos(model.robot) : null;
    byId("robot-area").hidden = !model.robot;
    if (model.robot) {
      if (this.robot) this.robot.use(model.robot);
      else this.robot = this.seen.robot = new RobotView(byId("robot"), model.robot);
      this.twin.start(model, this.robot);
    }
    const options = this.options(model);
    const loaded = !this.waves;
    if (loaded) this.waves = this.seen.waves = new Waves(byId("waves"), model, options);
    else this.waves.use(model, options);
    this.moment.use(model, this.waves);
    if (loaded) this.lookAgain();
    this.compared();
    this.graded(model.graded);
    this.tools(model);
    if (this.answer) this.posed(this.answer);   // it has another ghost beside this model
    this.ask();
  }
  // Show the part of the waves, and the cursors, that were seen before the page was loaded again.
  lookAgain() {
    window.addEventListener("pagehide", () => {
      const { begin, end, cursors } = this.waves;
      sessionStorage.setItem(SEEN, JSON.stringify({ begin, end, cursors }));
    });
    const seen = JSON.parse(sessionStorage.getItem(SEEN));
    if (!seen) return;
    this.waves.show(seen.begin, seen.end);
    seen.cursors.forEach((cycle, which) => { if (cycle !== null) this.waves.place(which, cycle); });
  }
  // The chip, its source, the hands: of this model alone.
  tools(model) {
    const job = this.editor.opened;
    this.source?.end();
    this.hands?.end();
    this.serial?.end();
    this.chip = this.source = null;
    byId("chips").hidden = !model.chip;
    if (model.chip) byId("chip-number").value = model.chip;
    byId("views").classList.toggle("plain", !job && !model.runs);
    byId("job-bar").hidden = byId("job-state").hidden = !job;
    const texts = [...(job ? ["tab-job"] : []), ...(model.runs ? ["tab-source"] : [])];
    if (texts.length) this.textTabs.offer(texts);
    if (model.runs) this.toolTabs.offer(["tab-hands", "tab-chip", "tab-memory", "tab-serial"]);
    else byId("tools").hidden = true;
    if (model.runs) {
      if (!job && !this.chosenTool) this.toolTabs.choose("tab-chip");
      this.chosenTool = true;
      this.chip = new ChipView(model, places({
        package: "package", registers: "registers", peripherals: "peripherals", variables: "variables",
        ram: "ram", stack: "stack", eeprom: "eeprom", warnings: "warnings",
      }), pin => this.send({ do: "explain", pin }));
      this.source = new SourceView(model, places({ source: "source", instructions: "instructions" }),
        (text, on) => this.send({ do: "breakpoint", text, on }));
      write(byId("tab-source"), model.marks.length ? `source (${model.marks.length} warned)` : "source");
    }
    this.hands = new Hands(model, places({
      pose: "pose", sliders: "sliders", record: "record", follow: "follow", buttons: "buttons",
      emergency: "emergency", walk: "walk", pin: "pin", high: "pin-high", low: "pin-low", free: "pin-free",
    }), this.send, {
      record: angles => this.send({ do: "record", text: this.editor.text, angles }),
      walk: way => { this.send({ do: "walk", way }); if (!this.latest?.running) this.moment.run(true); },
      shown: angles => { this.handPose = angles; this.picture(); },
    });
    this.serial = new Console(model, places({
      form: "serial-form", pin: "serial-pin", baud: "baud", kind: "serial-kind", bytes: "bytes",
      read: "serial-read", idle: "serial-idle", listen: "listen-pin", listenBaud: "listen-baud",
      transcript: "transcript",
    }), this.send, pin => this.decode(pin));
  }
  options(model) {
    const pin = name => model.pins.indexOf(name);
    const rows = model.channels.map(channel => {
      const servo = model.robot?.servos.find(each => each.pin === channel.pin);
      return { name: channel.name, pin: channel.pin, colour: servo?.colour, servo };
    });
    if (model.serial) {
      rows.push({ name: "serial in", pin: pin(model.serial.pin) });
      if (model.serial.answers) rows.push({ name: "serial out", pin: pin(model.serial.answers) });
    }
    if (model.bus) {
      rows.push({ name: "SCL", pin: pin(model.bus.scl) }, { name: "SDA", pin: pin(model.bus.sda) });
    }
    for (const each of model.inputs) rows.push({ name: each.name, pin: pin(each.pin) });
    return {
      rows,
      idle: model.runs ? model.pins.map((_, pin) => pin).filter(pin => model.pins[pin].startsWith("RB")) : [],
      room: () => (window.innerWidth > 900 ? byId("waves").parentElement.clientHeight : 0),
      laid: waves => this.labels(waves),
      changed: () => this.ask(),
      seek: cycle => this.send({ do: "seek", cycle }),
      cursors: () => this.moment.marks(+byId("moment").max, this.latest?.intervened ?? null),
      readout: text => write(byId("readout"), text),
      bands: (begin, end) => this.links.spans(this.links.linked, begin, end),
      hovered: (place, clicked) =>
        this.pointed(place && this.links.atCycle(place.cycle), clicked ? "waves" : ""),
      preview: (row, cycle) => this.plan.width(row.servo, this.links.frame(cycle), model),
      describe: (row, width) => {
        const us = width * model.cycle_us, { servo } = row;
        if (!servo) return timeText(us);
        const unit = servo.continuous ? " °/s" : "°";
        return `${+us.toFixed(2)} µs ${(angleOf(servo, us) * 180 / Math.PI).toFixed(1)}${unit}`;
      },
    };
  }
  // The names beside the waves are buttons: why is the pin as it is?
  labels(waves) {
    const said = JSON.stringify([waves.rows.map(row => [row.pin, row.name]), waves.row, waves.label]);
    if (said === this.labelled) return;
    this.labelled = said;
    const button = (row, index) => {
      const pin = this.model.names[row.pin], why = `? why is ${pin} as it is`;
      const title = `${row.name}: why is ${pin} as it is?`, click = () => this.send({ do: "explain", pin });
      const made = element("button", { type: "button", "aria-label": why, title, click }, "?");
      made.style.top = `${waves.top(index)}px`;
      made.style.width = `${waves.label}px`;
      made.style.height = `${waves.row}px`;
      return made;
    };
    byId("labels").replaceChildren(...(this.model.runs ? waves.rows.map(button) : []));
    const option = row => element("option", { value: row.pin }, row.name);
    byId("lane").replaceChildren(element("option", { value: "" }, "all pins"), ...waves.all.map(option));
    byId("lane").value = waves.only ?? "";
  }
  // Show a line of the chip that is decoded in the waves.
  decode(pin) {
    const { rows } = this.waves.options;
    if (pin !== null && !rows.some(row => row.pin === pin)) rows.push({ name: this.model.names[pin], pin });
    this.ask();
  }
  // A pose that the pointer is on, in the text, on the timeline or in the waves; a click goes to it.
  pointed(index, from) {
    this.links.hover(index);
    if (!from || index === null) return;
    this.timeline.selected = index;
    this.timeline.mark();
    if (from === "waves" && this.links.line(index)) this.editor.reveal(this.links.line(index));
  }
  chosen(pose, index) {
    this.hands?.pose(pose.angles);
    if (this.links.line(index)) this.editor.reveal(this.links.line(index));
    const begin = this.links.next(index, this.waves?.begin ?? 0);
    if (begin !== null && begin <= this.latest?.reach && !this.latest.running) {
      const span = this.waves.end - this.waves.begin;
      this.waves.show(begin - span / 8, begin + span * 7 / 8);
    }
  }
  linked() {
    const { linked } = this.links, now = this.latest ? this.links.atCycle(this.latest.cycle) : null;
    const bands = {};
    for (const [kind, index] of [["now", now], ["linked", linked]]) {
      const line = index === null ? null : this.links.line(index);
      if (line) bands[kind] = [line, this.links.poses[index].lines];
    }
    this.editor.band(this.plan.known ? bands : {});
    this.timeline.point(now, linked);
    this.waves?.paint();
  }
  // The job of the text was planned, or (null) is being changed.
  posed(answer) {
    this.answer = answer;
    this.timeline.show(answer?.poses ?? null);
    if (!answer) { this.plan.known = false; return; }
    this.links.read(answer.poses);
    const [first] = answer.poses, untouched = document.activeElement !== this.editor.places.text;
    if (first && this.model && !this.opened && untouched) {
      this.editor.reveal(first.line);   // what moves the robot is in sight at once
    }
    this.opened = !!this.model;
    this.plan.take(answer, this.model, this.editor);
    this.linked();
    this.picture();
  }
  change(change) {
    const angles = change.kind === "angles" ? { angles: this.hands?.angles } : {};
    this.send({ do: "pose", text: this.editor.text, ...change, ...angles });
  }
  // A program of a class: the task, why it was not passed, and the way back.
  graded(grade) {
    byId("graded").hidden = byId("task").hidden = !grade;
    if (!grade) return;
    byId("to-film").hidden = !grade.film;
    if (grade.film) byId("to-film").href = `../../${encodeURIComponent(grade.film)}`;
    write(byId("task-text"), grade.task);
    byId("task-reasons").replaceChildren(...grade.reasons.map(reason => element("li", {}, reason)));
    write(byId("difference"), "to what is wrong");
  }
  // What the comparison with the schedule says: of the run as it is now, or why it says nothing.
  compared() {
    const { model } = this, difference = model.first_difference, since = this.latest?.intervened ?? null;
    const untouched = since === null || (difference !== null && difference < since);
    const at = (cycle, step) => timeText(cycle * model.cycle_us, step);
    byId("difference").disabled = difference === null || !untouched;
    const right = difference === null, found = () => `first difference at ${at(difference, 100)}`;
    const own = () => `you intervened at ${at(since, 1e5)}: not compared from there`;
    const more = ({ reasons }) => (reasons.length > 1 ? ` (and ${reasons.length - 1} more)` : "");
    const verdicts = [
      [model.graded?.passed, "good", "passed", () => ""],
      [model.graded, "bad", "NOT passed", () => `${model.graded.reasons[0]}${more(model.graded)}`],
      [!untouched, "open", "not compared", own],
      [model.verdict && right, "good", "agrees", () => model.verdict],
      [model.verdict, "bad", "does NOT agree", () => model.verdict],
      [!model.compared, "", "", () => ""],
      [right, "good", "exact", () => "one run: exact, every edge as scheduled"],
      [true, "bad", "NOT exact", found],
    ];
    const [, kind, word, text] = verdicts.find(([holds]) => holds), said = text();
    write(byId("difference-text"), said);
    write(byId("verdict"), word);
    byId("verdict").className = `badge ${kind}`;
    byId("verdict").hidden = !word;
    byId("theorem").hidden = !untouched;
  }
  // The widths in µs of the servos' pulses, or of what the schedule asks for at the moment.
  widthsOf(message) {
    return this.model.robot.servos.map(servo => message.widths[servo.pin] * this.model.cycle_us);
  }
  // What the ghost shows: the hand's pose, the plan of the text if it is another one, or what is scheduled.
  ghost(cycle) {
    const { model, servos } = this;
    if (this.handPose && !model.serial) return this.handPose;
    if (!model.robot || model.origin === null || this.latest.planned === false) return null;
    const frame = this.links.frame(cycle), other = this.plan.angles(frame ?? 0, model);
    if (other) return other.map((angle, index) => angle ?? servos.angles[index]);
    if (frame === null) return null;
    let left = frame;
    for (const [frames, pulses] of [...model.schedule.lead_in, ...model.schedule.loop]) {
      const asked = index => pulses[index][1] * model.schedule_cycle_us;
      const angle = (servo, index) => (pulses[index] ? angleOf(servo, asked(index)) : servos.angles[index]);
      if (left < frames) return model.robot.servos.map(angle);
      left -= frames;
    }
    return null;
  }
  show({ waves: seen, received, ...message }) {
    const { model, servos } = this;
    this.latest = this.seen.latest = { ...this.latest, ...message };
    this.moment.going(null);
    if (received) this.serial.received(received);
    if (seen) this.waves.take(seen, true);
    this.compared();
    if (servos) {
      const widths = this.widthsOf(message);
      const held = servo => (servo.continuous ? 0 : message.held[servo.pin] * model.cycle_us);
      const last = () => model.robot.servos.map((servo, index) => widths[index] || held(servo));
      if (!message.running) servos.jump(last());
      this.hands.follow(widths);
    }
    const time = performance.now();
    if (!message.running || time - this.followed > FOLLOW_MS) {   // drawing the waves is what costs most
      this.followed = time;
      this.linked();
      if (message.running) this.waves.mark(message.cycle);   // what is in sight then is the server's choice
      else this.waves.follow(message.cycle, false);
    }
    this.chip?.showLevels(message.levels);
    if (message.chip) {
      this.chip?.show(message.chip, message.cycle);
      this.source?.show(message.chip);
    }
    if ("stopped" in message) this.breakpoints(message.breakpoints);
    this.moment.show(this.latest);
    this.picture();
    if (!message.running) this.ask();
  }
  // Paint at the display's rate: between two messages the servos go on as fast as they can.
  picture() {
    if (this.painting || !this.latest) return;
    this.painting = true;
    requestAnimationFrame(time => {
      this.painting = false;
      this.seen.pictures++;
      const passed = Math.min(0.1, (time - this.painted) / 1000), { latest, servos } = this;
      this.painted = time;
      if (this.robot && servos && latest) {
        if (latest.running) servos.follow(this.widthsOf(latest), passed * (latest.speed ?? 10));
        this.robot.show(servos.angles, this.ghost(latest.cycle), servos.pose);
      }
      if (latest?.running) this.picture();
    });
  }
  // Ask for the edges that are in sight, not more often than they can be looked at; while it runs they come.
  ask() {
    if (!this.waves || !this.latest) return;
    const time = performance.now();
    this.pending = this.waiting && time - this.asked < 2000;
    if (this.pending) return;
    this.asked = time;
    this.waiting = true;
    this.send({ do: "waves", begin: Math.floor(this.waves.begin), end: Math.ceil(this.waves.end) });
  }
  // Beside the field: what is wrong with it, which stays there to be mended.
  breakpointSaid(text) {
    write(byId("breakpoint-said"), text);
    byId("breakpoint").setAttribute("aria-invalid", !!text);
  }
  breakpoints(texts) {
    if (texts.includes(byId("breakpoint").value.trim())) {
      byId("breakpoint").value = "";
      this.breakpointSaid("");
    }
    if (texts.join("\n") === this.stops) return;
    this.stops = texts.join("\n");
    this.source?.breakpoints(texts);
    const remove = text => {
      const click = () => this.send({ do: "breakpoint", text, on: false });
      const attributes = { type: "button", class: "plain", "aria-label": `remove ${text}`, click };
      return element("button", attributes, "remove");
    };
    const row = text => element("li", {}, element("code", {}, text), " ", remove(text));
    byId("breakpoints").replaceChildren(...texts.map(row));
  }
}

new Page();
