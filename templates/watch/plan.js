// The plan of the text as it is typed, which is not built yet: the ghost of the robot and of its pulses.

import { widthOf } from "./viewer.js";

export class Plan {
  constructor() { this.clear(); }
  clear() { this.rows = null; }
  // Take the answer about the text: its motion, frame by frame, unless it is the one that runs.
  take(answer, model, editor) {
    this.known = true;
    this.rows = null;
    const { motion } = answer;
    if (!motion || !model) { editor.plan(""); return; }
    const same = motion.servos.join() === (model.robot?.servos || []).map(servo => servo.name).join();
    const other = JSON.stringify(motion.runs) !== JSON.stringify(model.motion?.runs);
    const seconds = `${+(motion.frames * motion.period_s).toFixed(3)} s, ${motion.frames} frames`;
    if (!same) editor.plan(`planned: other servos, ${motion.servos.join(", ")}: build to see them`);
    else if (!other) editor.plan("");
    else {
      this.rows = motion.runs;
      Object.assign(this, { first: motion.loop_start, frames: motion.frames, begin: model.motion_begin });
      editor.plan(`planned: ${seconds}: the ghost shows it; build to run it`);
    }
  }
  // The angles in radians that it has in a frame of the motion that runs, null where a servo has no pulse.
  angles(frame, model) {
    if (!this.rows || frame === null) return null;
    let left = frame - this.begin;   // before it the engine leads in
    if (left < 0) return null;
    if (left >= this.frames) {
      const loop = this.frames - this.first;
      left = loop ? this.first + (left - this.first) % loop : this.frames - 1;
    }
    for (const [frames, angles] of this.rows) {
      if (left < frames) return model.robot.servos.map((_, index) => angles[index]);
      left -= frames;
    }
    return null;
  }
  // The width in cycles of a servo's pulse in a frame, where it is another one than runs; null: not known.
  width(servo, frame, model) {
    const angles = servo && frame !== null ? this.angles(frame, model) : null;
    const angle = angles?.[model.robot.servos.indexOf(servo)] ?? null;
    return angle === null ? null : Math.round(widthOf(servo, angle) / model.cycle_us);
  }
}
