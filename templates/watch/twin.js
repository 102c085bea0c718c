// Bodies and contacts: the physics on the server, which follows the chip's pulses in its own time.
// In: the messages of servogen/watch/live_bodies.py, lengths in tenths of a millimetre.

import { write } from "./dom.js";

const mm = value => `${+(value / 10).toFixed(1)} mm`;

export class Twin {
  constructor(places, turned) {
    this.places = places;
    places.show.addEventListener("change", () => {
      this.now = null;
      this.say(places.show.checked ? "starting the physics" : "");
      this.give();
      turned(places.show.checked);
    });
  }
  start(model, robot) {
    this.robot = robot;
    this.places.area.hidden = !model.has_bodies;
    this.model(model.bodies);
  }
  // Begin with what stays the same while the bodies move; null: there is no physics, `text` says why.
  model(parts, text = "") {
    this.parts = parts;
    this.now = null;
    this.places.show.checked = !!parts;
    this.say(text);
    this.give();
  }
  say(text) { write(this.places.text, text); }
  take(moment) {
    if (!this.parts || !this.places.show.checked) return;
    this.now = moment;
    this.give();
    this.describe();
  }
  // Give the robot's view the bodies of the latest moment. The last lines are the legs, in their order.
  give() {
    const { parts, now, robot } = this;
    if (!parts || !now) { robot.bodies = null; return; }
    const middle = [now.pose[0] / 1e4, now.pose[1] / 1e4, parts.height];   // what the view turns about
    const point = (flat, index) => middle.map((value, axis) => flat[3 * index + axis] / 1e4 - value);
    const first = parts.lines.length - parts.legs.length;
    let begin = 0;
    const lines = parts.lines.map((line, index) => {
      const points = Array.from({ length: line.count }, (_, place) => point(now.points, begin + place));
      begin += line.count;
      return { leg: parts.legs[index - first], width: line.width, points };
    });
    robot.bodies = {
      lines,
      feet: parts.legs.map((_, leg) => ({ at: point(now.points, parts.feet[leg]), force: now.force[leg] })),
      touch: parts.touch, origin: middle.slice(0, 2), ground: -middle[2],
      heading: parts.floating ? now.pose[3] : null,
    };
  }
  describe() {
    const { parts, now } = this, said = [`bodies at ${now.seconds.toFixed(3)} s`], { pose } = now;
    if (now.behind) {
      said[0] += `, ${now.behind.toFixed(2)} s behind the pulses:`
        + " the physics is slower than this speed, and catches up";
    }
    if (parts.floating) {
      const turned = +(pose[3] * 180 / Math.PI).toFixed(1) || 0;  // not -0
      said.push(`body at ${mm(pose[0])}, ${mm(pose[1])}, ${mm(pose[2])} high, turned by ${turned}°`);
    }
    const down = parts.legs.filter((_, leg) => now.force[leg] > parts.touch);
    if (parts.legs.length) said.push(`on the ground: ${down.join(" ") || "no foot"}`);
    if (parts.sensors) said.push("the job's sensors are not connected to this chip");
    said.push(`ground: ${parts.ground}`);
    this.say(said.join("; "));
  }
}
