// The page: one socket to the server, what it says to the views, what the hands do to it.

import { ChipView, element } from "./chip.js";
import { Editor } from "./editor.js";
import { Hands } from "./hands.js";
import { angleOf, RobotView, Servos } from "./robot.js";
import { Twin } from "./twin.js";
import { Timeline } from "./timeline.js";
import { timeText, Waves } from "./waves.js";

const $ = id => document.getElementById(id);
const PLACE = `window of ${location.pathname}`;   // where a tab keeps which window of the server's it is
const FOLLOW_MS = 100;   // between two drawings of the waves while it runs
const AROUND_US = 2000;   // of a difference, shown on both sides
const SPEEDS = [[1e-5, "1/100 000"], [1e-4, "1/10 000"], [1e-3, "1/1000"], [1e-2, "1/100"], [0.1, "1/10"], [1, "real time"], [10, "10 ×"], [null, "as fast as it goes"]];

let socket = null, model = null, robot = null, servos = null, waves = null, chip = null, hands = null, latest = null;
let twin = null, followed = 0, asked = 0, waiting = false, handPose = null;
window.watched = { pictures: 0, latest: null };   // for whoever measures

const send = message => { if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message)); };
const editor = new Editor({ area: $("job"), name: $("job-name"), text: $("job-text"), lines: $("job-lines"), state: $("job-state"), problems: $("job-problems"), save: $("save"), build: $("build"), conflict: $("job-conflict"), progress: $("build-progress"), download: $("download") }, send, poses => timeline.show(poses));
const timeline = new Timeline(
  { area: $("timeline-area"), list: $("timeline"), move_s: $("pose-move"), hold_s: $("pose-hold"), pause_s: $("pose-pause"), earlier: $("pose-earlier"), later: $("pose-later"), set: $("pose-set"), remove: $("pose-remove") },
  change => send({ do: "pose", text: $("job-text").value, ...change, ...(change.kind === "angles" ? { angles: hands?.angles } : {}) }),
  pose => hands?.pose(pose.angles),
);

function connect() {
  socket = new WebSocket(`${location.href.replace(/^http/, "ws").replace(/[?#].*$/, "")}socket`);
  socket.addEventListener("open", () => { $("link").textContent = ""; send({ window: sessionStorage.getItem(PLACE) || "" }); });
  socket.addEventListener("message", event => receive(JSON.parse(event.data)));
  socket.addEventListener("close", () => { $("link").textContent = "The server has ended: start servogen watch again."; setTimeout(connect, 2000); });
}

const RECEIVE = {
  window: message => sessionStorage.setItem(PLACE, message.name),
  status: message => { $("status").textContent = message.text; $("status").classList.toggle("bad", !!message.failed); },
  model: start,
  now: show,
  waves: message => { waiting = false; waves.take(message); },
  problem: message => (message.about === "breakpoint" ? breakpointSaid : say)(message.text, "bad"),
  explanation: message => { $("explanation").replaceChildren(...message.lines.map(text => element("p", {}, text))); $("explanation").hidden = false; },
  bodies: message => { twin.take(message); picture(); },
  "bodies-model": message => { twin.model(message.model, message.text); picture(); },
  editor: message => editor.open(message),
  differs: message => editor.differs(message.text),
  checked: message => editor.checked(message),
  building: message => editor.say(message.text),
  built: message => editor.built(message),
};

function receive(message) { RECEIVE[message.is]?.(message); }

function say(text, kind = "") {
  $("said").textContent = text;
  $("said").className = kind;
}

function start(message) {
  model = message;
  document.title = `${model.name} · servogen`;
  $("name").textContent = model.name;
  $("views").hidden = false;
  $("difference").disabled = model.first_difference === null;
  handPose = null;
  compared();
  servos = model.robot ? new Servos(model.robot) : null;
  $("robot-area").hidden = !model.robot;
  if (model.robot) {
    if (robot) robot.use(model.robot);
    else robot = new RobotView($("robot"), model.robot);
    window.watched.robot = robot;
    twin ||= new Twin({ area: $("twin"), show: $("twin-show"), text: $("twin-text") }, on => { send({ do: "bodies", on }); picture(); });
    twin.start(model, robot);
  }
  const rows = model.channels.map(channel => {
    const servo = model.robot?.servos.find(each => each.pin === channel.pin);
    return { name: channel.name, pin: channel.pin, colour: servo?.colour, servo };
  });
  if (model.serial) {
    const bit = model.cycles_per_second / model.serial.baud;
    rows.push({ name: "serial in", pin: model.pins.indexOf(model.serial.pin), serial: bit });
    if (model.serial.answers) rows.push({ name: "serial out", pin: model.pins.indexOf(model.serial.answers), serial: bit });
  }
  for (const each of model.inputs) rows.push({ name: each.name, pin: model.pins.indexOf(each.pin) });
  const options = {
    rows,
    changed: () => ask(),
    seek: cycle => send({ do: "seek", cycle }),
    readout: text => { if ($("readout").textContent !== text) $("readout").textContent = text; },
    describe: (row, width) => {
      const us = width * model.cycle_us, servo = row.servo;
      return servo ? `${+us.toFixed(2)} µs ${(angleOf(servo, us) * 180 / Math.PI).toFixed(1)}${servo.continuous ? " °/s" : "°"}` : timeText(us);
    },
  };
  if (waves) waves.use(model, options);
  else waves = window.watched.waves = new Waves($("waves"), model, options);
  $("chip-area").hidden = !model.runs;
  for (const id of ["back-instruction", "next-instruction", "back-line", "next-line"]) $(id).disabled = !model.runs;
  if (model.runs) chip = new ChipView(model, { package: $("package"), registers: $("registers"), peripherals: $("peripherals"), variables: $("variables"), ram: $("ram"), stack: $("stack"), eeprom: $("eeprom"), instructions: $("instructions"), source: $("source"), warnings: $("warnings") }, pin => send({ do: "explain", pin }));
  hands?.end();
  hands = new Hands(model, { area: $("hands"), pose: $("pose"), sliders: $("sliders"), record: $("record"), follow: $("follow"), buttons: $("buttons"), walk: $("walk"), pin: $("pin"), high: $("pin-high"), low: $("pin-low"), free: $("pin-free"), serial: $("serial"), serialForm: $("serial-form"), serialPin: $("serial-pin"), baud: $("baud"), bytes: $("bytes"), sent: $("sent") }, send, {
    record: angles => send({ do: "record", text: $("job-text").value, angles }),
    walk: way => { send({ do: "walk", way }); if (!latest.running) run(true); },
    shown: angles => { handPose = angles; picture(); },
  });
  ask(true);
}

// What the comparison with the schedule says: of the run as it is now, or why it says nothing.
function compared() {
  const difference = model.first_difference, since = latest?.intervened ?? null;
  const untouched = since === null || (difference !== null && difference < since);
  const first = () => `first difference at ${timeText(difference * model.cycle_us, 100)}`;
  $("difference").disabled = difference === null || !untouched;
  const said = !untouched ? `you intervened at ${timeText(since * model.cycle_us, 1e5)}: not compared from there`
    : model.verdict || (!model.compared ? "" : difference === null ? "every edge as scheduled" : first());
  if ($("difference-text").textContent !== said) $("difference-text").textContent = said;
}

// The widths in µs of the servos' pulses, or of what the schedule asks for at the moment.
const widthsOf = message => model.robot.servos.map(servo => message.widths[servo.pin] * model.cycle_us);

function ghost(cycle) {
  if (handPose && !model.serial) return handPose;
  if (!model.robot || model.origin === null || latest.planned === false) return null;
  let frame = Math.floor((cycle - model.origin) / model.period);
  const { lead_in, loop } = model.schedule, count = runs => runs.reduce((sum, [frames]) => sum + frames, 0);
  let runs = lead_in;
  if (frame >= count(lead_in)) { frame = (frame - count(lead_in)) % count(loop); runs = loop; }
  for (const [frames, pulses] of runs) {
    if (frame < frames) return model.robot.servos.map((servo, index) => pulses[index] ? angleOf(servo, pulses[index][1] * model.schedule_cycle_us) : servos.angles[index]);
    frame -= frames;
  }
  return null;
}

function show({ waves: seen, ...message }) {
  latest = window.watched.latest = { ...latest, ...message };
  if (seen) waves.take(seen, true);
  compared();
  if (servos) {
    const widths = widthsOf(message);
    if (!message.running) servos.jump(model.robot.servos.map((servo, index) => widths[index] || (servo.continuous ? 0 : message.held[servo.pin] * model.cycle_us)));
    hands.follow(widths);
  }
  const time = performance.now();
  if (!message.running || time - followed > FOLLOW_MS) {   // drawing the waves is what costs most
    followed = time;
    if (message.running) waves.mark(message.cycle);   // what is in sight then is the server's choice
    else waves.follow(message.cycle, false);
  }
  chip?.showLevels(message.levels);
  if (message.chip) chip?.show(message.chip, message.cycle);
  if ("stopped" in message) {
    $("run").textContent = message.running ? "pause" : "run";
    $("run").setAttribute("aria-pressed", message.running);
    if (document.activeElement !== $("speed")) $("speed").value = SPEEDS.findIndex(([speed]) => speed === message.speed);
    if (message.stopped) say(`stopped at ${message.stopped}`);
    else if (message.running) say("");
    breakpoints(message.breakpoints);
  }
  const us = message.cycle * model.cycle_us, frame = model.origin === null ? "" : `, frame ${Math.floor((message.cycle - model.origin) / model.period)}`;
  $("now").textContent = `${(us / 1e6).toFixed(6)} s, cycle ${message.cycle}${frame}`;
  const slider = $("moment");
  slider.max = Math.max(model.end ?? message.reach, 1);
  if (document.activeElement !== slider || message.running) slider.value = message.cycle;
  picture();
  ask(!message.running);
}

// Paint at the display's rate: between two messages the servos go on as fast as they can, at the chosen speed.
let painting = false, painted = 0;
function picture() {
  if (painting) return;
  painting = true;
  requestAnimationFrame(time => {
    painting = false;
    window.watched.pictures++;
    const passed = Math.min(0.1, (time - painted) / 1000);
    painted = time;
    if (robot && servos && latest) {
      if (latest.running) servos.follow(widthsOf(latest), passed * (latest.speed ?? 10));
      robot.show(servos.angles, ghost(latest.cycle), servos.pose);
    }
    if (latest?.running) picture();
  });
}

// Ask for the edges that are in sight, not more often than they can be looked at.
function ask(soon = false) {
  if (!waves || !latest) return;
  const time = performance.now();
  if (waiting && time - asked < 2000) { pending = true; return; }
  if (!soon && latest.running) return;   // they come by themselves
  asked = time;
  waiting = true;
  pending = false;
  send({ do: "waves", begin: Math.floor(waves.begin), end: Math.ceil(waves.end) });
}
let pending = false;
setInterval(() => { if (pending) ask(true); }, 60);

// Beside the field: what is wrong with it, which stays there to be mended.
function breakpointSaid(text) {
  $("breakpoint-said").textContent = text;
  $("breakpoint").setAttribute("aria-invalid", !!text);
}

function breakpoints(texts) {
  if (texts.includes($("breakpoint").value.trim())) { $("breakpoint").value = ""; breakpointSaid(""); }
  $("breakpoints").replaceChildren(...texts.map(text => element("li", {}, element("code", {}, text), " ", element("button", { type: "button", class: "plain", "aria-label": `remove ${text}`, click: () => send({ do: "breakpoint", text, on: false }) }, "remove"))));
}

const step = (what, count, pin) => send({ do: "step", what, count, ...(pin === undefined ? {} : { pin }) });
const run = running => send({ do: "run", running, speed: SPEEDS[$("speed").value][0] });
const CONTROLS = {
  run: () => run(!latest?.running),
  "back-frame": () => step("frame", -1), "next-frame": () => step("frame", 1),
  "back-edge": () => step("edge", -1), "next-edge": () => step("edge", 1),
  "back-line": () => step("line", -1), "next-line": () => step("line", 1),
  "back-instruction": () => step("instruction", -1), "next-instruction": () => step("instruction", 1),
  difference: () => { send({ do: "seek", cycle: model.first_difference + 1 }); const around = AROUND_US / model.cycle_us; waves.show(model.first_difference - around, model.first_difference + around); },
  begin: () => send({ do: "seek", cycle: 0 }),
  "zoom-in": () => waves.zoom(0.5, latest.cycle), "zoom-out": () => waves.zoom(2, latest.cycle),
};
for (const [id, action] of Object.entries(CONTROLS)) $(id).addEventListener("click", action);
SPEEDS.forEach(([, text], index) => $("speed").append(element("option", { value: index }, text)));
$("speed").value = 5;
$("speed").addEventListener("change", () => run(!!latest?.running));
$("moment").addEventListener("input", () => send({ do: "seek", cycle: +$("moment").value }));
$("breakpoint-form").addEventListener("submit", event => {
  event.preventDefault();
  send({ do: "breakpoint", text: $("breakpoint").value, on: true });
});

const KEYS = { " ": "run", n: "next-instruction", N: "back-instruction", l: "next-line", L: "back-line", e: "next-edge", E: "back-edge", f: "next-frame", F: "back-frame", d: "difference" };
// Escape is the emergency stop wherever the focus is; a button is held down as long as the key.
document.addEventListener("keydown", event => { if (event.key === "Escape" && !event.repeat && hands?.emergency(true)) event.preventDefault(); });
document.addEventListener("keyup", event => { if (event.key === "Escape") hands?.emergency(false); });
document.addEventListener("keydown", event => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, textarea, select, button, a, summary")) return;
  if (event.target === document.body && hands?.steer(event)) return;
  const control = KEYS[event.key];
  if (!control) return;
  event.preventDefault();
  if (!$(control).disabled) CONTROLS[control]();
});
window.addEventListener("resize", () => { waves?.paint(); robot?.paint(); });
connect();
