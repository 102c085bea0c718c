// The robot in three dimensions: the points of its legs, arm or base at given angles, painted on a canvas.
// In: the model that servogen/report/robot_model.py writes, in metres and radians.

const GRID_M = 0.05, GRID_LINES = 5;   // of the ground below recorded bodies
const DEPTH_CUE = 0.5;   // how much fainter the farthest line is

// The shaft's angle that a pulse of so many µs commands; beyond the calibration the nearest line goes on.
export function angleOf(servo, width) {
  const widths = servo.widths_us, angles = servo.angles;
  let index = 1;
  while (index < widths.length - 1 && width > widths[index]) index++;
  const share = (width - widths[index - 1]) / (widths[index] - widths[index - 1]);
  return angles[index - 1] + share * (angles[index] - angles[index - 1]);
}

// The pulse width in µs that commands an angle.
export function widthOf(servo, angle) {
  const order = servo.angles.map((value, index) => [value, servo.widths_us[index]]).sort((a, b) => a[0] - b[0]);
  let index = 1;
  while (index < order.length - 1 && angle > order[index][0]) index++;
  const [before, after] = [order[index - 1], order[index]];
  return before[1] + (angle - before[0]) / (after[0] - before[0]) * (after[1] - before[1]);
}

// Fits a canvas to its place on the page and clears it: its size in CSS pixels, a brush, the colours of its style.
export function cleared(canvas) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (width && (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio))) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const brush = canvas.getContext("2d"), style = getComputedStyle(canvas);
  brush.setTransform(ratio, 0, 0, ratio, 0, 0);
  brush.clearRect(0, 0, width, height);
  return { width, height, brush, ink: name => style.getPropertyValue(name).trim() };
}

// A colour of the palette, lighter on a dark page.
export function legible(colour) {
  if (!/^#[0-9a-f]{6}$/.test(colour) || !window.matchMedia("(prefers-color-scheme: dark)").matches) return colour;
  const parts = [1, 3, 5].map(at => parseInt(colour.slice(at, at + 2), 16));
  return `rgb(${parts.map(part => Math.round(part + (255 - part) * 0.35)).join(" ")})`;
}

function product(a, b) {
  const made = new Array(16).fill(0);
  for (let row = 0; row < 4; row++)
    for (let column = 0; column < 4; column++)
      for (let k = 0; k < 4; k++) made[4 * row + column] += a[4 * row + k] * b[4 * k + column];
  return made;
}

function screw(axis, angle, way) {   // turn about x (0) or z (2), then move along it
  const c = Math.cos(angle), s = Math.sin(angle);
  return axis === 0
    ? [1, 0, 0, way, 0, c, -s, 0, 0, s, c, 0, 0, 0, 0, 1]
    : [c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, way, 0, 0, 0, 1];
}

const origin = frame => [frame[3], frame[7], frame[11]];

function legCorners(leg, [alpha, beta]) {
  const outward = [-Math.sin(alpha), Math.cos(alpha), 0], forward = [Math.cos(alpha), Math.sin(alpha), 0];
  const b = outward.map(value => leg.ab * value);
  const c = b.map((value, axis) => value - leg.bc * Math.sin(beta) * forward[axis] - (axis === 2 ? leg.bc * Math.cos(beta) : 0));
  const d = c.map((value, axis) => value + leg.cd * outward[axis]);
  return [[0, 0, 0], b, c, d, [d[0], d[1], d[2] - leg.df]];
}

function armCorners(end, joints) {
  let frame = end.base;
  const points = [[0, 0, 0], origin(frame)];
  for (const row of end.rows) {
    const moved = row.joint === null ? 0 : row.ratio * joints[row.joint];
    const theta = row.theta + (row.turning ? moved : 0), d = row.d + (row.turning ? 0 : moved);
    const turn = screw(2, theta, d), tilt = screw(0, row.alpha, row.a);
    const after = end.modified ? product(product(frame, tilt), turn) : product(product(frame, turn), tilt);
    const from = origin(frame), to = origin(after), way = to.map((value, axis) => value - from[axis]);
    const z = end.modified ? [after[2], after[6], after[10]] : [frame[2], frame[6], frame[10]];
    const along = way.reduce((sum, value, axis) => sum + value * z[axis], 0);
    points.push(end.modified ? to.map((value, axis) => value - along * z[axis]) : from.map((value, axis) => value + along * z[axis]), to);
    frame = after;
  }
  points.push(origin(product(frame, end.tool)));
  return points;
}

// The corners of a leg or an arm, from its base to its foot or tool, for the angles of all servos.
export function cornersOf(end, angles) {
  const joints = end.joints.map(joint => (angles[joint.servo] - joint.zero) / joint.ratio);
  const points = end.leg ? legCorners(end.leg, joints) : armCorners(end, joints);
  const m = end.place;
  return points.map(([x, y, z]) => [0, 4, 8].map(row => m[row] * x + m[row + 1] * y + m[row + 2] * z + m[row + 3]));
}

// Where a base on wheels is after its wheels turned at these speeds for some seconds: an arc of a circle.
export function driven(base, [x, y, heading], speeds, seconds) {
  const [vx, vy, spin] = base.speeds.map(row => row.reduce((sum, value, wheel) => sum + value * speeds[base.wheels[wheel]], 0) * seconds);
  const chord = Math.abs(spin) < 1e-12 ? 1 : Math.sin(spin / 2) / (spin / 2), middle = heading + spin / 2;
  return [x + chord * (vx * Math.cos(middle) - vy * Math.sin(middle)), y + chord * (vx * Math.sin(middle) + vy * Math.cos(middle)), heading + spin];
}

// The corners of the convex hull of points, seen from above.
export function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = list => {
    const made = [];
    for (const point of list) {
      while (made.length > 1 && turn(made[made.length - 2], made[made.length - 1], point) <= 0) made.pop();
      made.push(point);
    }
    return made.slice(0, -1);
  };
  const turn = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
  return sorted.length < 3 ? sorted : [...half(sorted), ...half(sorted.reverse())];
}

// Servos that follow their pulses no faster than they can.
export class Servos {
  constructor(model) {
    this.servos = model.servos;
    this.angles = this.servos.map(servo => servo.continuous ? 0 : servo.neutral);
    this.pose = [0, 0, 0];
    this.base = model.base;
    this.off = new Set();
  }
  commanded(widths) {   // µs of each servo; 0: no pulse, so that it stays where it is
    return this.servos.map((servo, index) =>
      !widths[index] || this.off.has(index) ? (servo.continuous ? 0 : this.angles[index]) : angleOf(servo, widths[index]));
  }
  follow(widths, seconds) {
    const goal = this.commanded(widths);
    this.angles = goal.map((angle, index) => {
      const reach = this.servos[index].speed * seconds, way = angle - this.angles[index];
      return this.servos[index].continuous ? angle : this.angles[index] + Math.max(-reach, Math.min(reach, way));
    });
    if (this.base) this.pose = driven(this.base, this.pose, this.angles, seconds);
  }
  jump(widths) { this.angles = this.commanded(widths); }
}

export class RobotView {
  constructor(canvas, model) {
    this.canvas = canvas;
    this.azimuth = -0.9;
    this.elevation = 0.5;
    this.zoom = 1;
    this.use(model);
    this.steer();
  }
  // Show another version of the robot, from the same side.
  use(model) {
    this.model = model;
    this.angles = this.ghost = null;
    this.trails = model.ends.map(() => []);
    this.paths = [];
    const bound = new Set([...model.ends.flatMap(end => end.joints.map(joint => joint.servo)), ...(model.base ? model.base.wheels : [])]);
    this.loose = model.servos.map((_, index) => index).filter(index => !bound.has(index));
    this.box = this.extent(model.servos.map(servo => servo.neutral));
  }
  extent(angles) {
    const points = [...this.model.body, ...this.model.ends.flatMap(end => cornersOf(end, angles)), ...(this.model.base ? this.model.base.outline.flat().map(([x, y]) => [x, y, 0]) : [])];
    if (!points.length) return null;
    const low = [0, 1, 2].map(axis => Math.min(...points.map(point => point[axis])));
    const high = [0, 1, 2].map(axis => Math.max(...points.map(point => point[axis])));
    return { middle: low.map((value, axis) => (value + high[axis]) / 2), size: Math.max(0.02, Math.hypot(...low.map((value, axis) => high[axis] - value))) };
  }
  steer() {
    const canvas = this.canvas;
    let held = null;
    canvas.addEventListener("pointerdown", event => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { held = null; });
    canvas.addEventListener("pointermove", event => {
      if (!held) return;
      this.turn((held[0] - event.clientX) * 0.01, (event.clientY - held[1]) * 0.01);
      held = [event.clientX, event.clientY];
    });
    canvas.addEventListener("wheel", event => { event.preventDefault(); this.scale(event.deltaY < 0 ? 1.1 : 1 / 1.1); }, { passive: false });
    canvas.addEventListener("keydown", event => {
      const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
      if (turns[event.key]) this.turn(...turns[event.key]);
      else if (event.key === "+" || event.key === "-") this.scale(event.key === "+" ? 1.1 : 1 / 1.1);
      else return;
      event.preventDefault();
      event.stopPropagation();
    });
  }
  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.max(-0.2, Math.min(Math.PI / 2, this.elevation + elevation));
    this.paint();
  }
  scale(factor) { this.zoom = Math.max(0.2, Math.min(8, this.zoom * factor)); this.paint(); }
  // Paint the robot at the angles of its servos, and as a ghost at others.
  show(angles, ghost = null, pose = [0, 0, 0]) {
    this.angles = angles;
    this.ghost = ghost;
    this.pose = pose;
    this.model.ends.forEach((end, index) => {
      const corners = cornersOf(end, angles), trail = this.trails[index];
      trail.push(corners[corners.length - 1]);
      if (trail.length > 240) trail.shift();
    });
    this.paint();
  }
  paint() {
    if (!this.angles) return;
    const { width, height, brush, ink } = cleared(this.canvas);
    if (!width) return;
    brush.lineJoin = brush.lineCap = "round";
    if (this.box) this.paintRobot(brush, width, this.loose.length ? height * 0.62 : height, ink);
    if (this.loose.length) this.paintDials(brush, width, height, this.box ? height * 0.62 : 0, ink);
  }
  paintRobot(brush, width, height, ink) {
    const { middle, size } = this.box, scale = 0.82 * Math.min(width, height) / size * this.zoom;
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    const seen = point => {
      const [x, y, z] = point.map((value, axis) => value - middle[axis]);
      const across = x * -sa + y * ca, away = x * ca + y * sa;
      return [width / 2 + across * scale, height / 2 - (z * ce - away * se) * scale, away * ce + z * se];
    };
    const line = (points, colour, thick, marks = false, fill = null) => {
      const at = points.map(seen);
      brush.beginPath();
      at.forEach(([x, y], index) => index ? brush.lineTo(x, y) : brush.moveTo(x, y));
      if (fill) { brush.closePath(); brush.fillStyle = fill; brush.fill(); }
      brush.strokeStyle = colour;
      brush.lineWidth = thick;
      brush.stroke();
      if (!marks) return;
      brush.fillStyle = colour;
      for (const [x, y] of at) { brush.beginPath(); brush.arc(x, y, thick * 0.85, 0, 7); brush.fill(); }
    };
    if (this.bodies) { this.paintBodies(brush, seen, line, scale, ink); return; }
    const legs = this.model.ends.map(end => cornersOf(end, this.angles));
    const feet = this.model.ends.map((end, index) => end.kind === "foot" ? legs[index][legs[index].length - 1] : null).filter(Boolean);
    if (feet.length > 2) {
      const ground = Math.min(...feet.map(foot => foot[2]));
      const standing = feet.filter(foot => foot[2] < ground + 0.004).map(([x, y]) => [x, y, ground]);
      const polygon = hull(standing);
      if (polygon.length > 2) line([...polygon, polygon[0]], ink("--stance"), 1.2, false, ink("--stance-fill"));
    }
    if (this.model.base) {
      const [x, y, heading] = this.pose, c = Math.cos(heading), s = Math.sin(heading);
      for (const shape of this.model.base.outline) line(shape.map(([u, v]) => [x + u * c - v * s, y + u * s + v * c, 0]), ink("--robot"), 2);
      return;
    }
    for (const path of this.paths) line(path, ink("--soft"), 1);
    for (const trail of this.trails) if (trail.length > 1) line(trail, ink("--soft"), 1);
    if (this.ghost) for (const end of this.model.ends) line(cornersOf(end, this.ghost), ink("--ghost"), 6);
    if (this.model.body.length) line([...this.model.body, this.model.body[0]], ink("--robot"), 3, false, ink("--body-fill"));
    const far = legs.map(points => Math.max(...points.map(point => seen(point)[2])));
    const [low, high] = [Math.min(...far), Math.max(...far)];
    legs.map((points, index) => index).sort((a, b) => far[b] - far[a]).forEach(index => {
      brush.globalAlpha = 1 - DEPTH_CUE * (far[index] - low) / Math.max(1e-9, high - low);
      line(legs[index], legible(this.model.servos[this.model.ends[index].joints[0].servo].colour), 4, true);
      brush.globalAlpha = 1;
    });
  }
  // The bodies of a recorded run, the ground below them, and how hard each foot presses on it.
  paintBodies(brush, seen, line, scale, ink) {
    const { lines, feet, touch, origin, ground } = this.bodies;
    const first = origin.map(value => -(value - GRID_M * Math.round(value / GRID_M)));
    for (let number = -GRID_LINES; number <= GRID_LINES; number++) {
      const [x, y] = first.map(value => value + number * GRID_M), end = GRID_LINES * GRID_M;
      line([[x, first[1] - end, ground], [x, first[1] + end, ground]], ink("--rule"), 1);
      line([[first[0] - end, y, ground], [first[0] + end, y, ground]], ink("--rule"), 1);
    }
    for (const foot of feet) if (foot.force > touch) {
      const [x, y] = seen(foot.at);
      brush.fillStyle = ink("--stance");
      brush.beginPath(); brush.ellipse(x, y, 4 + 3 * Math.sqrt(foot.force), 2 + 1.5 * Math.sqrt(foot.force), 0, 0, 7); brush.fill();
    }
    for (const each of lines) line(each.points, legible(each.colour), 1.6 * each.width, true);
  }
  paintDials(brush, width, height, top, ink) {
    const count = this.loose.length, across = Math.min(count, Math.max(1, Math.floor(width / 110))), down = Math.ceil(count / across);
    const cell = [width / across, (height - top) / down], radius = 0.3 * Math.min(cell[0], cell[1]);
    this.loose.forEach((index, place) => {
      const servo = this.model.servos[index];
      const x = cell[0] * (place % across + 0.5), y = top + cell[1] * (Math.floor(place / across) + 0.45);
      brush.fillStyle = ink("--body-fill");
      brush.strokeStyle = ink("--robot");
      brush.lineWidth = 2;
      brush.beginPath(); brush.arc(x, y, radius, 0, 7); brush.fill(); brush.stroke();
      const horn = (angle, colour, thick) => {
        const turn = servo.continuous ? angle : angle - Math.PI;   // 0° to the left, 90° up, 180° to the right
        brush.strokeStyle = colour;
        brush.lineWidth = thick;
        brush.beginPath(); brush.moveTo(x, y); brush.lineTo(x + 1.25 * radius * Math.cos(turn), y + 1.25 * radius * Math.sin(turn)); brush.stroke();
      };
      if (this.ghost) horn(this.ghost[index], ink("--ghost"), 12);
      horn(this.angles[index], legible(servo.colour), 6);
      brush.fillStyle = ink("--ink");
      brush.font = "13px system-ui, sans-serif";
      brush.textAlign = "center";
      brush.fillText(`${servo.name} ${(this.angles[index] * 180 / Math.PI).toFixed(1)}${servo.continuous ? " °/s" : "°"}`, x, y + 1.25 * radius + 18);
    });
  }
}
