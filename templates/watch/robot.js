// The robot in three dimensions: the points of its legs, arm or base at given angles, painted on a canvas.
// In: the model that servogen/report/robot_model.py writes, in metres and radians. A part of viewer.js.

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
  const points = servo.angles.map((value, index) => [value, servo.widths_us[index]]);
  const order = points.sort((a, b) => a[0] - b[0]);
  let index = 1;
  while (index < order.length - 1 && angle > order[index][0]) index++;
  const [before, after] = [order[index - 1], order[index]];
  return before[1] + (angle - before[0]) / (after[0] - before[0]) * (after[1] - before[1]);
}

// Fits a canvas to its place on the page and clears it: its size in CSS pixels, a brush, its style's colours.
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
  const dark = window.matchMedia("(prefers-color-scheme: dark)").matches;
  if (!dark || !/^#[0-9a-f]{6}$/.test(colour)) return colour;
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
  const down = [0, 0, leg.bc * Math.cos(beta)];
  const c = b.map((value, axis) => value - leg.bc * Math.sin(beta) * forward[axis] - down[axis]);
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
    const shifted = (point, length) => point.map((value, axis) => value + length * z[axis]);
    points.push(end.modified ? shifted(to, -along) : shifted(from, along), to);
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
  const placed = (row, [x, y, z]) => m[row] * x + m[row + 1] * y + m[row + 2] * z + m[row + 3];
  return points.map(point => [0, 4, 8].map(row => placed(row, point)));
}

// Where a base on wheels is after its wheels turned at these speeds for some seconds: an arc of a circle.
export function driven(base, [x, y, heading], speeds, seconds) {
  const turned = base.wheels.map(wheel => speeds[wheel] * seconds);
  const along = row => row.reduce((sum, value, wheel) => sum + value * turned[wheel], 0);
  const [vx, vy, spin] = base.speeds.map(along);
  const chord = Math.abs(spin) < 1e-12 ? 1 : Math.sin(spin / 2) / (spin / 2), middle = heading + spin / 2;
  const c = chord * Math.cos(middle), s = chord * Math.sin(middle);
  return [x + vx * c - vy * s, y + vx * s + vy * c, heading + spin];
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
    const still = (servo, index) => (servo.continuous ? 0 : this.angles[index]);
    return this.servos.map((servo, index) =>
      (!widths[index] || this.off.has(index) ? still(servo, index) : angleOf(servo, widths[index])));
  }
  follow(widths, seconds) {
    const goal = this.commanded(widths);
    this.angles = goal.map((angle, index) => {
      const reach = this.servos[index].speed * seconds, way = angle - this.angles[index];
      const moved = this.angles[index] + Math.max(-reach, Math.min(reach, way));
      return this.servos[index].continuous ? angle : moved;
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
    const joints = model.ends.flatMap(end => end.joints.map(joint => joint.servo));
    const bound = new Set([...joints, ...(model.base ? model.base.wheels : [])]);
    this.loose = model.servos.map((_, index) => index).filter(index => !bound.has(index));
    this.box = this.extent(model.servos.map(servo => servo.neutral));
  }
  extent(angles) {
    const { body, ends, base } = this.model;
    const outline = base ? base.outline.flat().map(([x, y]) => [x, y, 0]) : [];
    const points = [...body, ...ends.flatMap(end => cornersOf(end, angles)), ...outline];
    if (!points.length) return null;
    const low = [0, 1, 2].map(axis => Math.min(...points.map(point => point[axis])));
    const high = [0, 1, 2].map(axis => Math.max(...points.map(point => point[axis])));
    const size = Math.max(0.02, Math.hypot(...low.map((value, axis) => high[axis] - value)));
    return { middle: low.map((value, axis) => (value + high[axis]) / 2), size };
  }
  steer() {
    const canvas = this.canvas;
    let held = null;
    canvas.addEventListener("pointerdown", event => {
      held = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { held = null; });
    canvas.addEventListener("pointermove", event => {
      if (!held) return;
      this.turn((held[0] - event.clientX) * 0.01, (event.clientY - held[1]) * 0.01);
      held = [event.clientX, event.clientY];
    });
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      this.scale(event.deltaY < 0 ? 1.1 : 1 / 1.1);
    }, { passive: false });
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
    this.text = +ink("--canvas-px") || 12;
    if (this.box) this.paintRobot(brush, width, this.loose.length ? height * 0.62 : height, ink);
    if (this.loose.length) this.paintDials(brush, width, height, this.box ? height * 0.62 : 0, ink);
  }
  paintRobot(brush, width, height, ink) {
    const { middle, size } = this.box, scale = 0.82 * Math.min(width, height) / size * this.zoom;
    const [ca, sa] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
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
    const name = (text, at, colour) => {
      const [x, y] = seen(at);
      brush.font = `600 ${this.text}px system-ui, sans-serif`;
      brush.textAlign = "center";
      brush.fillStyle = colour;
      brush.fillText(text, x, y + 1.2 * this.text);
    };
    // An arrow on the ground plane of `from`, where the robot's front is.
    const front = (from, heading, length) => {
      const turned = (along, aside) => [
        from[0] + along * Math.cos(heading) - aside * Math.sin(heading),
        from[1] + along * Math.sin(heading) + aside * Math.cos(heading), from[2],
      ];
      const wing = aside => turned(0.75 * length, aside * length);
      const head = [wing(0.1), turned(length, 0), wing(-0.1)];
      line([turned(0, 0), turned(length, 0)], ink("--soft"), 2);
      line(head, ink("--soft"), 2);
      name("front", turned(1.1 * length, 0), ink("--soft"));
    };
    const draw = { seen, line, name, front };
    if (this.bodies) { this.paintBodies(brush, draw, ink); return; }
    const legs = this.model.ends.map(end => cornersOf(end, this.angles));
    const walks = (_, index) => this.model.ends[index].kind === "foot";
    const feet = legs.filter(walks).map(points => points.at(-1));
    if (feet.length > 2) {
      const ground = Math.min(...feet.map(foot => foot[2]));
      const standing = feet.filter(foot => foot[2] < ground + 0.004).map(([x, y]) => [x, y, ground]);
      const polygon = hull(standing);
      const closed = [...polygon, polygon[0]];
      if (polygon.length > 2) line(closed, ink("--stance"), 1.2, false, ink("--stance-fill"));
    }
    if (this.model.base) {
      const [x, y, heading] = this.pose, c = Math.cos(heading), s = Math.sin(heading);
      const moved = ([u, v]) => [x + u * c - v * s, y + u * s + v * c, 0];
      for (const shape of this.model.base.outline) line(shape.map(moved), ink("--robot"), 2);
      front([x, y, 0], heading, 0.35 * size);
      return;
    }
    for (const path of this.paths) line(path, ink("--soft"), 1);
    for (const trail of this.trails) if (trail.length > 1) line(trail, ink("--soft"), 1);
    if (this.ghost) for (const end of this.model.ends) line(cornersOf(end, this.ghost), ink("--ghost"), 6);
    const { body } = this.model;
    if (body.length) {
      line([...body, body[0]], ink("--robot"), 3, false, ink("--body-fill"));
      const high = Math.max(...body.map(([x]) => x));
      const mean = axis => body.reduce((sum, at) => sum + at[axis], 0) / body.length;
      front([high, mean(1), mean(2)], 0, 0.16 * size);
    }
    const far = legs.map(points => Math.max(...points.map(point => seen(point)[2])));
    const [low, high] = [Math.min(...far), Math.max(...far)];
    legs.map((points, index) => index).sort((a, b) => far[b] - far[a]).forEach(index => {
      brush.globalAlpha = 1 - DEPTH_CUE * (far[index] - low) / Math.max(1e-9, high - low);
      const end = this.model.ends[index];
      line(legs[index], this.colourOf(end), 4, true);
      brush.globalAlpha = 1;
      if (legs.length > 1) name(end.name, legs[index].at(-1), this.colourOf(end));
    });
  }
  // A leg or an arm has the colour of its first servo, in every view.
  colourOf(end) { return legible(this.model.servos[end.joints[0].servo].colour); }
  // The bodies of a recorded run, the ground below them, and how hard each foot presses on it.
  paintBodies(brush, { seen, line, name, front }, ink) {
    const { lines, feet, touch, origin, ground, heading } = this.bodies;
    const first = origin.map(value => -(value - GRID_M * Math.round(value / GRID_M)));
    for (let number = -GRID_LINES; number <= GRID_LINES; number++) {
      const [x, y] = first.map(value => value + number * GRID_M), end = GRID_LINES * GRID_M;
      line([[x, first[1] - end, ground], [x, first[1] + end, ground]], ink("--rule"), 1);
      line([[first[0] - end, y, ground], [first[0] + end, y, ground]], ink("--rule"), 1);
    }
    for (const foot of feet) if (foot.force > touch) {
      const [x, y] = seen(foot.at);
      brush.fillStyle = ink("--stance");
      const size = Math.sqrt(foot.force);
      brush.beginPath(); brush.ellipse(x, y, 4 + 3 * size, 2 + 1.5 * size, 0, 0, 7); brush.fill();
    }
    const colour = each => {
      const end = this.model.ends.find(one => one.name === each.leg);
      return end ? this.colourOf(end) : each.leg ? legible(each.colour) : ink("--robot");
    };
    for (const each of lines) line(each.points, colour(each), 1.6 * each.width, true);
    for (const each of lines) if (each.leg) name(each.leg, each.points.at(-1), colour(each));
    if (heading !== null) front([0, 0, 0], heading, 0.16 * this.box.size);
  }
  paintDials(brush, width, height, top, ink) {
    const count = this.loose.length;
    const across = Math.min(count, Math.max(1, Math.floor(width / (9 * this.text))));
    const down = Math.ceil(count / across);
    const cell = [width / across, (height - top) / down];
    // The horn is 1.15 radii long, and to the left and right of it stand 0° and 180°.
    const radius = Math.min(0.3 * cell[1], (cell[0] / 2 - 2.6 * this.text) / 1.3);
    this.loose.forEach((index, place) => {
      const servo = this.model.servos[index];
      const x = cell[0] * (place % across + 0.5), y = top + cell[1] * (Math.floor(place / across) + 0.45);
      brush.fillStyle = ink("--body-fill");
      brush.strokeStyle = ink("--robot");
      brush.lineWidth = 2;
      brush.beginPath(); brush.arc(x, y, radius, 0, 7); brush.fill(); brush.stroke();
      const horn = (angle, colour, thick) => {
        const turn = servo.continuous ? angle : angle - Math.PI;   // 0° to the left, 90° up
        brush.strokeStyle = colour;
        brush.lineWidth = thick;
        const end = [x + 1.15 * radius * Math.cos(turn), y + 1.15 * radius * Math.sin(turn)];
        brush.beginPath(); brush.moveTo(x, y); brush.lineTo(...end); brush.stroke();
      };
      if (!servo.continuous) this.paintScale(brush, x, y, radius, ink);
      if (this.ghost) horn(this.ghost[index], ink("--ghost"), 12);
      horn(this.angles[index], legible(servo.colour), 6);
      brush.fillStyle = ink("--ink");
      brush.font = `600 ${1.1 * this.text}px system-ui, sans-serif`;
      brush.textAlign = "center";
      const angle = `${(this.angles[index] * 180 / Math.PI).toFixed(1)}${servo.continuous ? " °/s" : "°"}`;
      brush.fillText(`${servo.name} ${angle}`, x, y + radius + 1.6 * this.text);
    });
  }
  // The scale of a dial: 0°, 90° and 180°.
  paintScale(brush, x, y, radius, ink) {
    brush.strokeStyle = brush.fillStyle = ink("--soft");
    brush.lineWidth = 1.5;
    brush.font = `${this.text}px system-ui, sans-serif`;
    for (let degrees = 0; degrees <= 180; degrees += 30) {
      const turn = degrees * Math.PI / 180 - Math.PI, [c, s] = [Math.cos(turn), Math.sin(turn)];
      brush.beginPath(); brush.moveTo(x + 0.9 * radius * c, y + 0.9 * radius * s);
      brush.lineTo(x + radius * c, y + radius * s); brush.stroke();
      if (degrees % 90) continue;
      brush.textAlign = degrees === 0 ? "right" : degrees === 180 ? "left" : "center";
      const down = degrees === 90 ? 0 : 0.35 * this.text;
      brush.fillText(`${degrees}°`, x + 1.32 * radius * c, y + 1.3 * radius * s + down);
    }
  }
}
