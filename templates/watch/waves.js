// The pins over time, painted on a canvas: zoom, two cursors, what the schedule asks for, differences in red.
// Times are cycles. Edges come packed: the way from the edge before, then 4 * pin + level.

import { cleared, legible } from "./robot.js";

const LABEL = 92, ROW = 30, HEAD = 24, MIN_SPAN = 8;
const DASH = 3, SHORTEST_TEXT = 24;   // pixels

export function unpack(packed, begin) {
  const edges = [];
  for (let index = 0, cycle = begin; index < packed.length; index += 2) {
    cycle += packed[index];
    edges.push({ cycle, pin: packed[index + 1] >> 2, level: packed[index + 1] & 3 });
  }
  return edges;
}

// A time in words, to a precision that fits a step of so many µs.
export function timeText(us, step = 1) {
  if (step >= 1e5) return `${+(us / 1e6).toFixed(3)} s`;
  if (step >= 100) return `${+(us / 1e3).toFixed(3)} ms`;
  return `${+us.toFixed(2)} µs`;
}

// The bytes that an asynchronous line carries: start bit, eight bits (lowest first), stop bit; idle is high.
export function decodeSerial(edges, bit, begin, before, end) {
  const levelAt = cycle => {
    let level = before;
    for (const edge of edges) { if (edge.cycle > cycle) break; level = edge.level; }
    return level;
  };
  const bytes = [];
  let free = begin;
  for (const edge of edges) {
    if (edge.level !== 0 || edge.cycle < free) continue;
    if (edge.cycle + 9.5 * bit > end) break;
    let value = 0;
    for (let index = 0; index < 8; index++) if (levelAt(edge.cycle + (index + 1.5) * bit) === 1) value |= 1 << index;
    if (levelAt(edge.cycle + 9.5 * bit) === 1) bytes.push({ cycle: edge.cycle, end: edge.cycle + 10 * bit, value });
    free = edge.cycle + 9.5 * bit;
  }
  return bytes;
}

function byPin(edges) {
  const lanes = new Map();
  for (const edge of edges) lanes.has(edge.pin) ? lanes.get(edge.pin).push(edge) : lanes.set(edge.pin, [edge]);
  return lanes;
}

export class Waves {
  // rows: [{name, pin, colour, servo, serial}]; describe(row, width in cycles) is what a pulse means.
  constructor(canvas, model, options) {
    this.canvas = canvas;
    this.begin = 0;
    this.end = Math.round(model.period * 4);
    this.now = 0;
    this.cursors = [null, null];
    this.hover = null;
    this.width = canvas.clientWidth;
    this.use(model, options);
    this.listen();
  }
  // Show another version of what is watched, at the same place.
  use(model, options) {
    this.model = model;
    this.options = options;
    this.data = null;
    this.rows = [];
    this.maxSpan = Math.round(model.cycles_per_second * (options.maxSeconds || 4));
  }
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
    const span = this.end - this.begin;
    if (now < this.begin || now > this.end || (running && now > this.begin + 0.9 * span)) this.show(now - 0.75 * span, now + 0.25 * span);
    else this.paint();
  }
  mark(now) { this.now = now; this.paint(); }
  // Take the edges of a window of time; `followed`: while it runs, the window is the server's.
  take(packed, followed = false) {
    const edges = name => unpack(packed[name], packed.begin);
    if (followed) [this.begin, this.end] = [packed.begin, packed.end];
    this.set({ ...packed, edges: edges("edges"), wanted: edges("wanted"), differing: edges("differing"), inputs: edges("inputs") });
    if (!followed) this.paint();   // what follows is painted with the moment
  }
  set(data) {
    this.data = data;
    this.lanes = Object.fromEntries(["edges", "wanted", "differing", "inputs"].map(name => [name, byPin(data[name])]));
    const named = new Map((this.options.rows || []).map(row => [row.pin, row]));
    for (const edge of [...this.data.edges, ...this.data.inputs]) if (!named.has(edge.pin)) named.set(edge.pin, { name: this.model.pins[edge.pin] || "MCLR", pin: edge.pin });
    for (const row of this.rows) if (!named.has(row.pin)) named.set(row.pin, row);
    this.rows = [...named.values()];
    const height = `${HEAD + ROW * Math.max(1, this.rows.length) + 6}px`;
    if (this.canvas.style.height !== height) this.canvas.style.height = height;
  }
  x(cycle) { return LABEL + (cycle - this.begin) / (this.end - this.begin) * (this.width - LABEL); }
  cycleAt(x) { return Math.round(this.begin + (x - LABEL) / Math.max(1, this.canvas.clientWidth - LABEL) * (this.end - this.begin)); }
  listen() {
    const canvas = this.canvas;
    let held = null;
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      this.zoom(event.deltaY < 0 ? 0.7 : 1 / 0.7, this.cycleAt(event.offsetX));
    }, { passive: false });
    canvas.addEventListener("pointerdown", event => {
      held = { x: event.offsetX, begin: this.begin, end: this.end, moved: false };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", event => {
      this.hover = [event.offsetX, event.offsetY];
      if (held && Math.abs(event.offsetX - held.x) > 3) {
        held.moved = true;
        const way = (event.offsetX - held.x) / Math.max(1, canvas.clientWidth - LABEL) * (held.end - held.begin);
        this.show(held.begin - way, held.end - way);
      } else this.paint();
    });
    canvas.addEventListener("pointerup", event => {
      if (held && !held.moved && event.offsetX > LABEL) this.place(event.shiftKey ? 1 : 0, this.cycleAt(event.offsetX));
      held = null;
    });
    canvas.addEventListener("pointerleave", () => { this.hover = null; this.paint(); });
    canvas.addEventListener("dblclick", event => this.options.seek?.(this.cycleAt(event.offsetX)));
    canvas.addEventListener("keydown", event => {
      const span = this.end - this.begin, step = event.shiftKey ? 1 : 0;
      if (event.key === "+" || event.key === "=") this.zoom(0.5, this.cursors[0] ?? this.now);
      else if (event.key === "-") this.zoom(2, this.cursors[0] ?? this.now);
      else if (event.key === "ArrowLeft") this.show(this.begin - span / 4, this.end - span / 4);
      else if (event.key === "ArrowRight") this.show(this.begin + span / 4, this.end + span / 4);
      else if (event.key === "a" || event.key === "b") this.place(event.key === "a" ? 0 : 1, this.now);
      else if (event.key === "[" || event.key === "]") this.place(step, (this.cursors[step] ?? this.now) + (event.key === "[" ? -1 : 1));
      else return;
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
    this.width = width;   // asking the page for it at each edge costs more than the edge
    brush.font = "12px system-ui, sans-serif";
    brush.save();
    brush.beginPath();
    brush.rect(LABEL, 0, width - LABEL, height);
    brush.clip();
    this.paintTime(brush, width, height, ink);
    if (this.data) this.rows.forEach((row, index) => this.paintRow(brush, row, HEAD + ROW * index, ink));
    const mark = (cycle, colour, text) => {
      if (cycle === null || cycle < this.begin || cycle > this.end) return;
      const x = this.x(cycle);
      brush.strokeStyle = brush.fillStyle = colour;
      brush.lineWidth = 1.5;
      brush.beginPath(); brush.moveTo(x, 0); brush.lineTo(x, height); brush.stroke();
      brush.textAlign = "left";
      brush.fillText(text, x + 3, 10);
    };
    mark(this.now, ink("--now"), "");
    mark(this.cursors[0], ink("--cursor"), "A");
    mark(this.cursors[1], ink("--cursor"), "B");
    brush.restore();
    brush.textAlign = "left";
    brush.fillStyle = ink("--soft");
    if (!this.rows.length) brush.fillText("no pin is driven here", LABEL + 8, HEAD + 16);
    this.rows.forEach((row, index) => {
      brush.fillStyle = legible(row.colour || ink("--ink"));
      brush.fillText(row.name, 4, HEAD + ROW * index + 13, LABEL - 8);
      brush.fillStyle = ink("--soft");
      brush.fillText(this.model.pins[row.pin] === row.name ? "" : this.model.pins[row.pin] || "", 4, HEAD + ROW * index + 26, LABEL - 8);
    });
    this.options.readout?.(this.words());
  }
  paintTime(brush, width, height, ink) {
    const span = this.us(this.end - this.begin), rough = span / Math.max(2, (width - LABEL) / 110);
    const power = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 5, 10].map(factor => factor * power).find(value => value >= rough);
    brush.fillStyle = ink("--soft");
    brush.strokeStyle = ink("--rule");
    brush.lineWidth = 1;
    brush.textAlign = "center";
    for (let number = Math.ceil(this.us(this.begin) / step); number * step <= this.us(this.end); number++) {
      const x = this.x(number * step / this.model.cycle_us);
      brush.beginPath(); brush.moveTo(x, 16); brush.lineTo(x, height); brush.stroke();
      brush.fillText(timeText(number * step, step), x, 12);
    }
    const { period, origin } = this.model;
    if (origin === null || (this.end - this.begin) / period > 100) return;
    brush.strokeStyle = ink("--frame");
    brush.setLineDash([4, 4]);
    for (let frame = Math.max(0, Math.ceil((this.begin - origin) / period)); origin + frame * period <= this.end; frame++) {
      const x = this.x(origin + frame * period);
      brush.beginPath(); brush.moveTo(x, 16); brush.lineTo(x, height); brush.stroke();
    }
    brush.setLineDash([]);
  }
  paintRow(brush, row, top, ink) {
    const { data } = this, low = top + ROW - 6, high = top + 5, colour = legible(row.colour || ink("--ink"));
    const line = (edges, start, from, to, dash, thick, stroke) => {
      brush.strokeStyle = stroke;
      brush.lineWidth = thick;
      brush.setLineDash(dash);
      brush.beginPath();
      let y = start === 1 ? high : low;
      brush.moveTo(this.x(from), y);
      brush.fillStyle = stroke;
      for (let index = 0; index < edges.length; index++) {
        const x = this.x(edges[index].cycle), next = edges[index].level === 1 ? high : low, after = edges[index + 1];
        if (after && next !== y && after.level !== edges[index].level && this.x(after.cycle) - x < thick / 2) {
          brush.fillRect(x - thick / 2, high, thick, low - high);   // there and back: a bar costs less than two corners
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
    const dense = wanted.length * DASH > this.width - LABEL;   // no dash fits between two edges
    if (wanted.length) line(wanted, wanted[0].level === 1 ? 0 : 1, data.begin, data.end, dense ? [] : [DASH, DASH], 1, ink("--ghost-line"));
    if (driven.length || data.before[row.pin] < 2 || !given.length) line(driven, data.before[row.pin], data.begin, data.seen, [], 1.6, colour);
    if (given.length) line(given, data.inputs_before?.[row.pin] ?? 1, data.begin, data.seen, [], 1.6, ink("--input"));
    brush.strokeStyle = ink("--bad");
    brush.lineWidth = 3;
    for (const edge of lane("differing")) {
      const x = this.x(edge.cycle);
      brush.beginPath(); brush.moveTo(x, high - 3); brush.lineTo(x, low + 3); brush.stroke();
    }
    if (row.serial) this.paintBytes(brush, row, given.length ? given : driven, given.length ? data.inputs_before?.[row.pin] ?? 1 : data.before[row.pin], low, ink);
    else this.paintWidths(brush, row, driven, low, ink);
  }
  paintBytes(brush, row, edges, before, low, ink) {
    brush.fillStyle = ink("--ink");
    brush.textAlign = "left";
    for (const byte of decodeSerial(edges, row.serial, this.data.begin, before, this.data.seen)) {
      const text = byte.value.toString(16).toUpperCase().padStart(2, "0"), x = this.x(byte.cycle);
      if (this.x(byte.end) - x > 14) brush.fillText(text, x + 2, low - 3);
    }
  }
  paintWidths(brush, row, edges, low, ink) {
    brush.fillStyle = ink("--soft");
    brush.textAlign = "left";
    for (let index = 0; index + 1 < edges.length; index++) {
      const [rise, fall] = [edges[index], edges[index + 1]];
      if (rise.level !== 1 || this.x(fall.cycle) > this.width) continue;
      const next = edges[index + 2] ? this.x(edges[index + 2].cycle) : this.width;
      if (next - this.x(fall.cycle) < SHORTEST_TEXT) continue;
      const text = this.options.describe ? this.options.describe(row, fall.cycle - rise.cycle) : timeText(this.us(fall.cycle - rise.cycle));
      if (next - this.x(fall.cycle) > brush.measureText(text).width + 6) brush.fillText(text, this.x(fall.cycle) + 4, low - 2);
    }
  }
  // What the cursors and the pointer say.
  words() {
    const parts = [], [a, b] = this.cursors;
    if (a !== null) parts.push(`A ${timeText(this.us(a))}, cycle ${a}`);
    if (b !== null) parts.push(`B ${timeText(this.us(b))}, cycle ${b}`);
    if (a !== null && b !== null) parts.push(`B − A ${timeText(this.us(b - a))}, ${b - a} cycles`);
    return parts.join("   ");
  }
}
