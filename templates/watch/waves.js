// The pins over time, painted on a canvas: zoom, two cursors, what the schedule asks for, differences in red.
// Times are cycles. What the pins did comes as pulses, packed: the time from the rise before, the width, the
// pin; other changes as edges, packed: the time from the edge before, then 4 * pin + level.
// A part of viewer.js, behind robot.js.

const HEAD = 24, ROW = 30, ROWS = [22, 320];   // pixels: the least and the greatest height of a row that fits
const DASH = 3, SHORTEST_TEXT = 24, MIN_SPAN = 8, LABEL = 7.7;   // the label: so many times the text's size

export function unpack(packed, begin) {
  const edges = [];
  for (let index = 0, cycle = begin; index < packed.length; index += 2) {
    cycle += packed[index];
    edges.push({ cycle, pin: packed[index + 1] >> 2, level: packed[index + 1] & 3 });
  }
  return edges;
}

export function unpackPulses(packed, begin) {
  const pulses = [];
  for (let index = 0, rise = begin; index < packed.length; index += 3) {
    rise += packed[index];
    pulses.push({ pin: packed[index + 2], rise, width: packed[index + 1] });
  }
  return pulses;
}

// The changes of level to be painted: those of pulses, as far as a window has them, and of pins that begin or
// cease to float.
export function edgesOf(pulses, floating, begin, end) {
  const edges = [];
  for (const { pin, rise, width } of pulses) {
    if (rise >= begin) edges.push({ cycle: rise, pin, level: 1 });
    if (rise + width < end) edges.push({ cycle: rise + width, pin, level: 0 });
  }
  // Behind a pulse's end at the same cycle, where sorting keeps them; driven high, a pin rises already.
  edges.push(...floating.filter(edge => edge.level !== 1));
  return edges.sort((before, after) => before.cycle - after.cycle);
}

// A time in words, to a precision that fits a step of so many µs.
export function timeText(us, step = 1) {
  if (step >= 1e5) return `${+(us / 1e6).toFixed(3)} s`;
  if (step >= 100) return `${+(us / 1e3).toFixed(3)} ms`;
  return `${+us.toFixed(2)} µs`;
}

// Edges or pulses, each pin's in a list of its own.
function byPin(items) {
  const lanes = new Map();
  for (const item of items) {
    if (!lanes.has(item.pin)) lanes.set(item.pin, []);
    lanes.get(item.pin).push(item);
  }
  return lanes;
}

export class Waves {
  // options: rows [{name, pin, colour, servo}]; describe(row, width in cycles) is what a pulse means;
  // room() is the height that the rows share, if they do; bands(begin, end) are spans of time to be marked;
  // preview(row, cycle) is the width in cycles that another plan asks for; hovered(place, clicked).
  constructor(canvas, model, options) {
    this.canvas = canvas;
    this.begin = 0;
    this.end = Math.round(model.period * 4);
    this.now = 0;
    this.cursors = [null, null];
    this.which = 0;   // the cursor that a click places
    this.hover = null;
    this.only = null;   // the pin that alone is shown
    this.width = canvas.clientWidth;
    this.text = 12;
    this.use(model, options);
    this.listen();
  }
  // Show another version of what is watched, at the same place.
  use(model, options) {
    this.model = model;
    this.options = options;
    this.data = null;
    this.all = [];
    this.only = null;
    this.maxSpan = Math.round(model.cycles_per_second * (options.maxSeconds || 4));
  }
  get rows() { return this.all.filter(row => this.only === null || row.pin === this.only); }
  get label() { return Math.round(LABEL * this.text); }
  us(cycles) { return cycles * this.model.cycle_us; }
  show(begin, end) {
    const span = Math.max(MIN_SPAN, Math.min(this.maxSpan, end - begin));
    this.begin = Math.max(0, Math.round(begin));
    this.end = this.begin + Math.round(span);
    this.options.changed?.();
    this.paint();
  }
  zoom(factor, around = (this.begin + this.end) / 2) {
    this.show(around - (around - this.begin) * factor, around + (this.end - around) * factor);
  }
  // Keep the moment in sight: while running it stays near the right end.
  follow(now, running) {
    this.now = now;
    const span = this.end - this.begin, late = running && now > this.begin + 0.9 * span;
    if (now < this.begin || now > this.end || late) this.show(now - 0.75 * span, now + 0.25 * span);
    else this.paint();
  }
  mark(now) { this.now = now; this.paint(); }
  // Show one pin alone, as high as there is room; null: all of them.
  choose(pin) {
    this.only = pin;
    this.lay();
    this.paint();
  }
  // Take the pulses and edges of a window of time; `followed`: while it runs, the window is the server's.
  take(packed, followed = false) {
    const edges = name => unpack(packed[name], packed.begin);
    if (followed) [this.begin, this.end] = [packed.begin, packed.end];
    const lists = ["floating", "wanted", "differing", "inputs"].map(name => [name, edges(name)]);
    const pulses = unpackPulses(packed.pulses, packed.begin);
    this.set({ ...packed, pulses, ...Object.fromEntries(lists) });
    if (!followed) this.paint();   // what follows is painted with the moment
  }
  set(data) {
    this.data = data;
    const edges = edgesOf(data.pulses, data.floating, data.begin, data.seen);
    const { pulses, wanted, differing, inputs } = data;
    this.lanes = { pulses: byPin(pulses), edges: byPin(edges), wanted: byPin(wanted),
                   differing: byPin(differing), inputs: byPin(inputs) };
    const named = new Map((this.options.rows || []).map(row => [row.pin, row]));
    const name = pin => ({ name: this.model.names[pin], pin });
    for (const { pin } of [...edges, ...inputs]) if (!named.has(pin)) named.set(pin, name(pin));
    for (const row of this.all) if (!named.has(row.pin) && !row.idle) named.set(row.pin, row);
    const idle = named.size ? [] : (this.options.idle || []).map(pin => ({ ...name(pin), idle: true }));
    this.all = [...named.values(), ...idle];
    this.lay();
  }
  // Give the canvas the height of its rows.
  lay() {
    const count = Math.max(1, this.rows.length), room = this.options.room?.();
    const [least, most] = ROWS.map(height => height * this.text / 12);
    this.row = room ? Math.floor(Math.max(least, Math.min(most, (room - HEAD - 6) / count))) : ROW;
    const height = `${HEAD + this.row * count + 6}px`;
    if (this.canvas.style.height !== height) this.canvas.style.height = height;
    this.options.laid?.(this);
  }
  top(index) { return HEAD + this.row * index; }
  x(cycle) { return this.label + (cycle - this.begin) / (this.end - this.begin) * (this.width - this.label); }
  cycleAt(x) {
    const share = (x - this.label) / Math.max(1, this.canvas.clientWidth - this.label);
    return Math.round(this.begin + share * (this.end - this.begin));
  }
  // The row at a place of the canvas, and the level there from `begin` to `end`, null where not seen.
  at(x, y) {
    const row = this.rows[Math.floor((y - HEAD) / this.row)];
    if (!row || !this.data || x < this.label) return null;
    const cycle = this.cycleAt(x), edges = this.lanes.edges.get(row.pin) || [];
    const next = edges.findIndex(edge => edge.cycle > cycle), index = next < 0 ? edges.length : next;
    const level = index ? edges[index - 1].level : this.data.before[row.pin];
    return { row, cycle, level, begin: edges[index - 1]?.cycle ?? null, end: edges[index]?.cycle ?? null };
  }
  listen() {
    const canvas = this.canvas, fingers = new Map();
    let held = null;
    const apart = () => {
      const [one, other] = [...fingers.values()];
      return { span: Math.max(8, Math.abs(one - other)), middle: this.cycleAt((one + other) / 2) };
    };
    const hold = event => {
      held = { x: event.offsetX, begin: this.begin, end: this.end, moved: fingers.size > 1 };
      if (fingers.size === 2) held.pinched = apart().span;
    };
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      this.zoom(event.deltaY < 0 ? 0.7 : 1 / 0.7, this.cycleAt(event.offsetX));
    }, { passive: false });
    canvas.addEventListener("pointerdown", event => {
      fingers.set(event.pointerId, event.offsetX);
      canvas.setPointerCapture(event.pointerId);
      hold(event);
    });
    canvas.addEventListener("pointermove", event => {
      this.hover = [event.offsetX, event.offsetY];
      if (fingers.has(event.pointerId)) fingers.set(event.pointerId, event.offsetX);
      if (fingers.size === 2) {
        const { span, middle } = apart();
        this.zoom(held.pinched / span, middle);
        held.pinched = span;
      } else if (held && (held.moved || Math.abs(event.offsetX - held.x) > 3)) {
        held.moved = true;
        const across = Math.max(1, canvas.clientWidth - this.label);
        const way = (event.offsetX - held.x) / across * (held.end - held.begin);
        this.show(held.begin - way, held.end - way);
      } else {
        this.options.hovered?.(this.at(...this.hover), false);
        this.paint();
      }
    });
    canvas.addEventListener("pointerup", event => {
      if (held && !held.moved && event.offsetX > this.label) {
        this.place(event.shiftKey ? 1 : this.which, this.cycleAt(event.offsetX));
        this.options.hovered?.(this.at(event.offsetX, event.offsetY), true);
      }
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, event => {
      fingers.delete(event.pointerId);
      held = null;
      for (const [, x] of fingers) hold({ offsetX: x });
    });
    canvas.addEventListener("pointerleave", () => {
      this.hover = null;
      this.options.hovered?.(null, false);
      this.paint();
    });
    canvas.addEventListener("dblclick", event => this.options.seek?.(this.cycleAt(event.offsetX)));
    canvas.addEventListener("keydown", event => {
      const span = this.end - this.begin, cursor = event.shiftKey ? 1 : 0;
      const around = this.cursors[0] ?? this.now;
      const moves = {
        "+": () => this.zoom(0.5, around), "=": () => this.zoom(0.5, around), "-": () => this.zoom(2, around),
        ArrowLeft: () => this.show(this.begin - span / 4, this.end - span / 4),
        ArrowRight: () => this.show(this.begin + span / 4, this.end + span / 4),
        a: () => this.place(0, this.now), b: () => this.place(1, this.now),
        "[": () => this.place(cursor, (this.cursors[cursor] ?? this.now) - 1),
        "]": () => this.place(cursor, (this.cursors[cursor] ?? this.now) + 1),
      };
      if (!moves[event.key]) return;
      moves[event.key]();
      event.preventDefault();
      event.stopPropagation();
    });
  }
  place(which, cycle) {
    this.cursors[which] = Math.max(0, cycle);
    this.paint();
    this.options.cursors?.(this.cursors);
  }
  paint() {
    const { width, height, brush, ink } = cleared(this.canvas);
    if (!width) return;
    const text = +ink("--canvas-px") || 12;
    if (text !== this.text) { this.text = text; this.lay(); }
    this.width = width;   // asking the page for it at each edge costs more than the edge
    brush.font = `${this.text}px system-ui, sans-serif`;
    brush.save();
    brush.beginPath();
    brush.rect(this.label, 0, width - this.label, height);
    brush.clip();
    for (const [begin, end] of this.options.bands?.(this.begin, this.end) || []) {
      brush.fillStyle = ink("--band");
      brush.fillRect(this.x(begin), HEAD - 6, this.x(end) - this.x(begin), height);
    }
    this.paintTime(brush, width, height, ink);
    if (this.data) this.rows.forEach((row, index) => this.paintRow(brush, row, this.top(index), ink));
    this.paintMarks(brush, height, ink);
    brush.restore();
    brush.textAlign = "left";
    brush.fillStyle = ink("--soft");
    if (!this.rows.length) brush.fillText("no pin is driven here", this.label + 8, HEAD + 16);
    this.rows.forEach((row, index) => {
      const top = this.top(index) + (this.row >= 2.2 * this.text ? 1.1 : 1.4) * this.text;
      brush.fillStyle = legible(row.colour || ink("--ink"));
      brush.fillText(row.name, 4, top, this.label - 22);
      if (this.row < 2.2 * this.text) return;
      brush.fillStyle = ink("--soft");
      const pin = this.model.names[row.pin];
      if (pin && pin !== row.name) brush.fillText(pin, 4, top + 1.08 * this.text, this.label - 22);
    });
    this.options.readout?.(this.words());
  }
  paintMarks(brush, height, ink) {
    const mark = (cycle, colour, text, thick = 1.5) => {
      if (cycle === null || cycle < this.begin || cycle > this.end) return;
      const x = this.x(cycle);
      brush.strokeStyle = brush.fillStyle = colour;
      brush.lineWidth = thick;
      brush.beginPath(); brush.moveTo(x, 0); brush.lineTo(x, height); brush.stroke();
      brush.textAlign = "left";
      brush.fillText(text, x + 3, this.text - 2);
    };
    const hovered = this.hover && this.hover[0] > this.label ? this.cycleAt(this.hover[0]) : null;
    mark(hovered, ink("--ghost-line"), "", 1);
    mark(this.now, ink("--now"), "");
    mark(this.cursors[0], ink("--cursor"), "A");
    mark(this.cursors[1], ink("--cursor"), "B");
  }
  paintTime(brush, width, height, ink) {
    const span = this.us(this.end - this.begin);
    const rough = span / Math.max(2, (width - this.label) / (9 * this.text));
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map(factor => factor * power).find(value => value >= rough);
    const upright = x => { brush.beginPath(); brush.moveTo(x, 16); brush.lineTo(x, height); brush.stroke(); };
    brush.fillStyle = ink("--soft");
    brush.strokeStyle = ink("--rule");
    brush.lineWidth = 1;
    brush.textAlign = "center";
    for (let number = Math.ceil(this.us(this.begin) / step); number * step <= this.us(this.end); number++) {
      const x = this.x(number * step / this.model.cycle_us), text = timeText(number * step, step);
      const half = brush.measureText(text).width / 2;
      upright(x);
      brush.fillText(text, Math.max(this.label + half, Math.min(width - half - 2, x)), this.text);
    }
    const { period, origin } = this.model;
    if (origin === null || (this.end - this.begin) / period > 100) return;
    brush.strokeStyle = ink("--frame");
    brush.setLineDash([4, 4]);
    let frame = Math.max(0, Math.ceil((this.begin - origin) / period));
    for (; origin + frame * period <= this.end; frame++) upright(this.x(origin + frame * period));
    brush.setLineDash([]);
  }
  paintRow(brush, row, top, ink) {
    const { data } = this, low = top + this.row - 6, high = top + 5;
    const colour = legible(row.colour || ink("--ink"));
    const line = (edges, start, from, to, dash, thick, stroke) => {
      brush.strokeStyle = stroke;
      brush.lineWidth = thick;
      brush.setLineDash(dash);
      brush.beginPath();
      let y = start === 1 ? high : low;
      brush.moveTo(this.x(from), y);
      brush.fillStyle = stroke;
      for (let index = 0; index < edges.length; index++) {
        const x = this.x(edges[index].cycle), next = edges[index].level === 1 ? high : low;
        const after = edges[index + 1], back = after && after.level !== edges[index].level;
        if (back && next !== y && this.x(after.cycle) - x < thick / 2) {
          brush.fillRect(x - thick / 2, high, thick, low - high);   // a bar costs less than two corners
          index++;
          continue;
        }
        brush.lineTo(x, y);
        brush.lineTo(x, next);
        y = next;
      }
      brush.lineTo(this.x(to), y);
      brush.stroke();
      brush.setLineDash([]);
    };
    const lane = name => (this.lanes[name].get(row.pin) || []).filter(edge => edge.cycle <= this.end);
    const wanted = lane("wanted"), driven = lane("edges"), given = lane("inputs");
    const dense = wanted.length * DASH > this.width - this.label;   // no dash fits between two edges
    const first = wanted[0]?.level === 1 ? 0 : 1, outside = data.inputs_before?.[row.pin] ?? 1;
    const dash = dense ? [] : [DASH, DASH];
    if (wanted.length) line(wanted, first, data.begin, data.end, dash, 1, ink("--ghost-line"));
    const drives = driven.length || data.before[row.pin] < 2 || !given.length;
    if (row.idle) {
      brush.fillStyle = ink("--soft");
      brush.textAlign = "left";
      brush.fillText("not driven", this.label + 8, (high + low) / 2 + this.text / 3);
    } else if (drives) line(driven, data.before[row.pin], data.begin, data.seen, [], 1.6, colour);
    if (given.length) line(given, outside, data.begin, data.seen, [], 1.6, ink("--input"));
    brush.strokeStyle = ink("--bad");
    brush.lineWidth = 3;
    for (const edge of lane("differing")) {
      const x = this.x(edge.cycle);
      brush.beginPath(); brush.moveTo(x, high - 3); brush.lineTo(x, low + 3); brush.stroke();
    }
    if (data.said?.[row.pin]) this.paintSaid(brush, data.said[row.pin], low, ink);
    else this.paintWidths(brush, row, high, low, ink);
  }
  // What is said on a line: a serial one's bytes, or the traffic of a bus; where they have no room, how many.
  paintSaid(brush, said, low, ink) {
    brush.textAlign = "left";
    const room = (index, from = index) => this.x(said[index + 1]?.[0] ?? this.end) - this.x(said[from][0]);
    const wide = text => brush.measureText(text).width + 4;
    const paint = (text, x) => {
      brush.fillStyle = ink("--field");
      brush.fillRect(x + 1, low - this.text - 2, wide(text), this.text + 2);
      brush.fillStyle = ink("--ink");
      brush.fillText(text, x + 3, low - 3);
    };
    for (let first = 0, last = 0; first < said.length; first = last = last + 1) {
      const apart = index => room(index) - (this.x(said[index][1]) - this.x(said[index][0])) > 3 * this.text;
      while (last < said.length - 1 && !apart(last)) last++;
      const burst = said.slice(first, last + 1), count = `${burst.length} bytes`;
      const texts = burst.map(([, , text], index) =>
        [text, text.replace(/ A$/, "")].find(each => wide(each) <= room(first + index)));
      if (texts.filter(Boolean).length < burst.length / 2) {
        if (wide(count) <= room(last, first)) paint(count, this.x(burst[0][0]));
      } else texts.forEach((text, index) => { if (text) paint(text, this.x(burst[index][0])); });
    }
  }
  // The width of each pulse, beside it and between the two lines; and where another plan would end it.
  paintWidths(brush, row, high, low, ink) {
    const { begin, seen } = this.data, pulses = this.lanes.pulses.get(row.pin) || [];
    const font = brush.font, middle = (high + low) / 2;
    const large = [1.5, 1.25, 1].map(size => Math.round(size * this.text));
    const sizes = large.filter(size => 2 * size < low - high);
    brush.textAlign = "left";
    for (const [index, { rise, width }] of pulses.entries()) {
      const fall = rise + width, end = this.x(fall);
      if (rise < begin || fall >= seen || end > this.width) continue;   // cut off by the window
      const next = pulses[index + 1] ? this.x(pulses[index + 1].rise) : this.width;
      if (next - end < SHORTEST_TEXT) continue;
      const other = this.options.preview?.(row, rise) ?? null;
      if (other !== null) {
        brush.fillStyle = ink("--band");
        const x = this.x(rise + other);
        brush.fillRect(Math.min(x, end), high, Math.abs(x - end), low - high);
        brush.fillStyle = ink("--open") || ink("--ink");
        brush.fillRect(x - 1, high, 2, low - high);
      }
      const say = cycles => this.options.describe?.(row, cycles) ?? timeText(this.us(cycles));
      const own = say(width), us = timeText(this.us(width));
      const from = Math.max(end, other === null ? 0 : this.x(rise + other));
      const long = other === null ? own : `${own} → ${say(other)}`;
      const short = other === null ? us : `${us} → ${timeText(this.us(other))}`;
      const tries = [...sizes.map(size => [size, long]), [this.text, long], [this.text, short]];
      const fits = tries.find(([size, text]) => {
        brush.font = `600 ${size}px system-ui, sans-serif`;
        return next - from > brush.measureText(text).width + 9;
      });
      if (!fits) continue;
      brush.fillStyle = ink("--ink");
      brush.fillText(fits[1], from + 5, middle + fits[0] / 3);
    }
    brush.font = font;
  }
  // What the pointer and the cursors say.
  words() {
    const parts = [], [a, b] = this.cursors, place = this.hover && this.at(...this.hover);
    const cycles = value => `${value} ${Math.abs(value) === 1 ? "cycle" : "cycles"}`;
    if (place) {
      const { row, level, begin, end, cycle } = place, known = begin !== null && end !== null;
      const width = known ? end - begin : 0;
      const meaning = level === 1 && row.servo ? this.options.describe(row, width) : timeText(this.us(width));
      const way = level === 1 ? "high" : level === 0 ? "low" : "not driven";
      const said = this.data.said?.[row.pin]?.find(([begin, end]) => begin <= cycle && cycle <= end);
      parts.push(`${row.name} ${way}${known ? ` for ${meaning}, ${cycles(width)}` : ""}`);
      if (said) parts.push(said[2]);
    }
    if (a !== null) parts.push(`A ${timeText(this.us(a))}, cycle ${a}`);
    if (b !== null) parts.push(`B ${timeText(this.us(b))}, cycle ${b}`);
    if (a !== null && b !== null) parts.push(`B − A ${timeText(this.us(b - a))}, ${cycles(b - a)}`);
    return parts.join("   ");
  }
}
