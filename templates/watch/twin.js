// Bodies and contacts: a run of the twin that the server recorded, shown at the chip's moment.
// In: the message of servogen/watch/recorded_twin.py, lengths in tenths of a millimetre.

const COLOURS = ["#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22", "#17becf"];
const NAMED = { "tab:blue": "#1f77b4", "0.35": "#595959" };
const mm = value => `${+(value / 10).toFixed(1)} mm`;
const metres = point => point.map(value => value / 1e4);

export class Twin {
  constructor(places, record, changed) {
    this.places = places;
    places.record.addEventListener("click", record);
    places.show.addEventListener("change", changed);
  }
  start(model, robot) {
    Object.assign(this, { model, robot, run: null });
    this.places.area.hidden = !model.bodies;
    this.places.show.checked = false;
    this.places.show.disabled = true;
    this.say("");
    robot.bodies = null;
  }
  say(text) { if (this.places.text.textContent !== text) this.places.text.textContent = text; }
  take(run) {
    this.run = run;
    for (const line of run.lines) line.paint = NAMED[line.colour] || COLOURS[+line.colour.slice(1)];
    this.places.show.disabled = false;
    this.places.show.checked = true;
    this.places.show.dispatchEvent(new Event("change"));
  }
  // Give the robot's view the bodies of the moment.
  at(latest) {
    const { run, robot } = this;
    if (!run || !this.places.show.checked) {
      robot.bodies = null;
      if (run) this.say("");
      return;
    }
    const seconds = latest.cycle * this.model.cycle_us / 1e6, wanted = Math.round(seconds / run.picture_s);
    const frame = Math.max(0, Math.min(run.count - 1, wanted));
    const middle = run.floating ? [run.x[frame] / 1e4, run.y[frame] / 1e4] : [0, 0];
    const height = run.floating ? run.height[0] / 1e4 : 0;
    const here = ([x, y, z]) => [x - middle[0], y - middle[1], z - height];
    const down = run.legs.filter((_, leg) => run.force[frame][leg] > run.touch);
    robot.bodies = {
      lines: run.lines.map(line => ({ colour: line.paint, width: line.width, points: line.points[frame].map(point => here(metres(point))) })),
      feet: run.legs.map((_, leg) => ({ at: here(metres(run.feet[frame][leg])), force: run.force[frame][leg] })),
      touch: run.touch, origin: middle, ground: -height,
    };
    const said = ["recorded: a run of the twin from power-up"];
    if (latest.inputs !== undefined && latest.inputs !== run.inputs) said.push("without what was done by hand since: record it again");
    else if (wanted >= run.count) said.push(`it ends at ${(run.count * run.picture_s).toFixed(1)} s: record it again`);
    if (run.floating) said.push(`body at ${mm(run.x[frame])}, ${mm(run.y[frame])}, ${mm(run.height[frame])} high, turned by ${(run.yaw[frame] * 180 / Math.PI).toFixed(1)}°`);
    if (run.legs.length) said.push(`on the ground: ${down.join(" ") || "no foot"}`);
    this.say(`${said.join("; ")}. ${run.ground}.`);
  }
}
