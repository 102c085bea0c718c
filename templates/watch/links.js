// A pose is one thing in three places: its line of the text, its block on the timeline, its pulses in the
// waves. What the pointer is on in one of them is marked in all; a click goes there.

export class Links {
  constructor() {
    this.poses = [];
    this.linked = null;
    this.shown = () => {};
  }
  // The motion that runs.
  use(model) {
    const frames = runs => runs.reduce((sum, [count]) => sum + count, 0), { schedule } = model;
    this.model = model;
    this.parts = model.parts && schedule && model.origin !== null ? model.parts : [];
    if (schedule) [this.leadIn, this.loop] = [frames(schedule.lead_in), frames(schedule.loop)];
  }
  // The poses of the text: their lines.
  read(poses) { if (poses) this.poses = poses; }
  line(index) { return this.poses[index]?.line ?? null; }
  atLine(line) {
    const index = this.poses.findIndex(pose => line >= pose.line && line < pose.line + pose.lines);
    return index < 0 ? null : index;
  }
  // The frame of the motion, from 0 to lead-in + loop, that a cycle is in; null before the first one.
  frame(cycle) {
    const frame = Math.floor((cycle - this.model.origin) / this.model.period);
    if (frame < 0) return null;
    return frame < this.leadIn ? frame : this.leadIn + (frame - this.leadIn) % this.loop;
  }
  atCycle(cycle) {
    if (!this.parts?.length) return null;
    const frame = this.frame(cycle);
    return frame === null ? null : this.parts.filter(([, begin]) => begin <= frame).at(-1)?.[0] ?? null;
  }
  // The spans of cycles between `begin` and `end` in which a pose is.
  spans(index, begin, end) {
    if (index === null || !this.parts?.length) return [];
    const { origin, period } = this.model, spans = [], whole = this.leadIn + this.loop;
    this.parts.forEach(([pose, first], part) => {
      if (pose !== index) return;
      const last = this.parts[part + 1]?.[1] ?? whole;
      const add = shift => spans.push([origin + (first + shift) * period, origin + (last + shift) * period]);
      if (first < this.leadIn) { add(0); return; }
      const round = Math.max(0, Math.floor(((begin - origin) / period - last) / this.loop));
      let shift = round * this.loop;
      for (; origin + (first + shift) * period < end; shift += this.loop) add(shift);
    });
    return spans.filter(([from, to]) => to > begin && from < end);
  }
  // The next time that a pose begins, at or after a cycle.
  next(index, cycle) {
    const far = cycle + (this.leadIn + 2 * this.loop) * this.model.period;
    const begins = this.spans(index, cycle, far).map(([from]) => from).filter(from => from >= cycle);
    return begins.length ? Math.min(...begins) : null;
  }
  hover(index) {
    if (index === this.linked) return;
    this.linked = index;
    this.shown();
  }
}
