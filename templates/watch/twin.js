// Bodies and contacts: the physics on the server, which follows the chip's pulses in its own time.
// In: the messages of servogen/watch/live_bodies.py, lengths in tenths of a millimetre.

const COLOURS = ["#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22", "#17becf"];
const NAMED = { "tab:blue": "#1f77b4", "0.35": "#595959" };
const mm = value => `${+(value / 10).toFixed(1)} mm`;

export class Twin {
  constructor(places, turned) {
    this.places = places;
    places.show.addEventListener("change", () => { this.now = null; this.say(places.show.checked ? "starting the physics" : ""); this.give(); turned(places.show.checked); });
  }
  start(model, robot) {
    this.robot = robot;
    this.places.area.hidden = !model.has_bodies;
    this.model(model.bodies);
  }
  // Begin with what stays the same while the bodies move; null: there is no physics, for the reason in `text`.
  model(parts, text = "") {
    this.parts = parts;
    this.now = null;
    this.places.show.checked = !!parts;
    if (parts) for (const line of parts.lines) line.paint = NAMED[line.colour] || COLOURS[+line.colour.slice(1)];
    this.say(text);
    this.give();
  }
  say(text) { if (this.places.text.textContent !== text) this.places.text.textContent = text; }
  take(moment) {
    if (!this.parts || !this.places.show.checked) return;
    this.now = moment;
    this.give();
    this.describe();
  }
  // Give the robot's view the bodies of the latest moment.
  give() {
    const { parts, now, robot } = this;
    if (!parts || !now) { robot.bodies = null; return; }
    const middle = [now.pose[0] / 1e4, now.pose[1] / 1e4, parts.height];   // what the view turns about
    const points = (flat, begin, count) => Array.from({ length: count }, (_, index) => middle.map((value, axis) => flat[3 * (begin + index) + axis] / 1e4 - value));
    let begin = 0;
    const lines = parts.lines.map(line => {
      const at = points(now.points, begin, line.count);
      begin += line.count;
      return { colour: line.paint, width: line.width, points: at };
    });
    robot.bodies = {
      lines,
      feet: parts.legs.map((_, leg) => ({ at: points(now.points, parts.feet[leg], 1)[0], force: now.force[leg] })),
      touch: parts.touch, origin: middle.slice(0, 2), ground: -middle[2],
    };
  }
  describe() {
    const { parts, now } = this, said = [`bodies at ${now.seconds.toFixed(3)} s`];
    if (now.behind) said[0] += `, ${now.behind.toFixed(2)} s behind the pulses: the physics is slower than this speed, and catches up`;
    if (parts.floating) said.push(`body at ${mm(now.pose[0])}, ${mm(now.pose[1])}, ${mm(now.pose[2])} high, turned by ${(now.pose[3] * 180 / Math.PI).toFixed(1)}°`);
    const down = parts.legs.filter((_, leg) => now.force[leg] > parts.touch);
    if (parts.legs.length) said.push(`on the ground: ${down.join(" ") || "no foot"}`);
    if (parts.sensors) said.push("the job's sensors are not connected to this chip");
    said.push(`ground: ${parts.ground}`);
    this.say(said.join("; "));
  }
}
