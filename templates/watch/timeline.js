// The poses of a job in a row, as wide as they last: chosen, moved, removed, held longer or shorter, by mouse and keys.
// In: the poses of the checked job. Out: requests to change its text; the text comes back, and with it the poses.

import { element } from "./chip.js";

const BLOCK = 44, LEAST = 4;   // pixels: of a pose that takes no time, and of a second at least
const STEP_S = 0.1;

const seconds = pose => (pose.move_s || 0) + pose.hold_s + pose.pause_s;
const rounded = value => Math.round(Math.max(0, value) / STEP_S) * STEP_S;
const text = value => `${+value.toFixed(3)} s`;

export class Timeline {
  // change(what) asks for a change of the text, chosen(pose) shows one.
  constructor(places, change, chosen) {
    Object.assign(this, { places, change, chosen });
    this.poses = [];
    this.selected = 0;
    places.list.addEventListener("keydown", event => { if (this.press(event)) event.preventDefault(); });
    for (const key of ["move_s", "hold_s", "pause_s"]) {
      places[key].addEventListener("change", () => this.time(key, places[key].value === "" ? null : Math.max(0, +places[key].value)));
    }
    places.earlier.addEventListener("click", () => this.move(this.selected - 1));
    places.later.addEventListener("click", () => this.move(this.selected + 1));
    places.remove.addEventListener("click", () => this.remove());
    places.set.addEventListener("click", () => this.change({ kind: "angles", index: this.selected }));
  }
  // Show the poses of the job; null: the text has changed since and its poses are not known.
  show(poses) {
    this.places.area.classList.toggle("stale", !poses);
    if (!poses) return;
    this.poses = poses;
    this.selected = Math.max(0, Math.min(this.selected, poses.length - 1));
    this.places.area.hidden = !poses.length;
    let begin = 0;
    this.blocks = poses.map((pose, index) => {
      const name = pose.name || `${index + 1}`, handle = element("span", { class: "handle", "aria-hidden": "true" });
      const block = element("div", { role: "option", id: `pose-${index}`, class: "pose", title: `${name}, from ${text(begin)}` }, element("b", {}, name), " ", element("span", {}, text(pose.hold_s)), handle);
      begin += seconds(pose);
      block.addEventListener("pointerdown", event => this.drag(event, index, event.target === handle));
      return block;
    });
    this.places.list.replaceChildren(...this.blocks);
    this.scale = Math.max(LEAST, (this.places.list.clientWidth - (BLOCK + 2) * poses.length - 8) / Math.max(0.1, begin));
    poses.forEach((pose, index) => { this.blocks[index].style.width = `${BLOCK + seconds(pose) * this.scale}px`; });
    this.mark();
  }
  mark() {
    const pose = this.poses[this.selected];
    this.blocks.forEach((block, index) => block.setAttribute("aria-selected", index === this.selected));
    if (!pose) return;
    this.places.list.setAttribute("aria-activedescendant", `pose-${this.selected}`);
    for (const key of ["move_s", "hold_s", "pause_s"]) if (document.activeElement !== this.places[key]) this.places[key].value = pose[key] ?? "";
    this.places.earlier.disabled = this.selected === 0;
    this.places.later.disabled = this.selected === this.poses.length - 1;
    this.places.remove.disabled = this.poses.length === 1;
  }
  choose(index) {
    this.selected = Math.max(0, Math.min(this.poses.length - 1, index));
    this.mark();
    this.blocks[this.selected].scrollIntoView({ block: "nearest", inline: "nearest" });
    this.chosen(this.poses[this.selected]);
  }
  press(event) {
    const pose = this.poses[this.selected], way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (way && event.shiftKey) this.move(this.selected + way);
    else if (way) this.choose(this.selected + way);
    else if (event.key === "Home" || event.key === "End") this.choose(event.key === "Home" ? 0 : this.poses.length - 1);
    else if (event.key === "Enter") this.choose(this.selected);
    else if (event.key === "+" || event.key === "-") this.time("hold_s", rounded(pose.hold_s + (event.key === "+" ? STEP_S : -STEP_S)));
    else if (event.key === "Delete") this.remove();
    else return false;
    return true;
  }
  move(to) {
    if (to < 0 || to >= this.poses.length || to === this.selected) return;
    this.change({ kind: "move", index: this.selected, to });
    this.selected = to;
  }
  remove() { if (this.poses.length > 1) this.change({ kind: "remove", index: this.selected }); }
  time(key, value) {
    this.change({ kind: "time", index: this.selected, key, seconds: value });
    if (value !== null) this.poses[this.selected] = { ...this.poses[this.selected], [key]: value };   // what the next key goes on from
  }
  // A pose is dragged to another place, or its right end to another time.
  drag(event, index, end) {
    const block = this.blocks[index], from = event.clientX, pose = this.poses[index];
    this.choose(index);
    this.places.list.focus();
    event.preventDefault();
    block.setPointerCapture(event.pointerId);
    const held = moved => rounded(pose.hold_s + (moved.clientX - from) / this.scale);
    const onMove = moved => {
      if (!end) { block.style.translate = `${moved.clientX - from}px`; return; }
      block.style.width = `${BLOCK + (seconds(pose) - pose.hold_s + held(moved)) * this.scale}px`;
      block.children[1].textContent = text(held(moved));
    };
    const onUp = moved => {
      for (const [name, listener] of [["pointermove", onMove], ["pointerup", onUp], ["pointercancel", onUp]]) block.removeEventListener(name, listener);
      block.style.translate = "";
      if (moved.type === "pointercancel" || Math.abs(moved.clientX - from) < 4) { this.show(this.poses); return; }
      if (end) { this.time("hold_s", held(moved)); return; }
      const others = this.blocks.filter(each => each !== block);
      this.move(others.filter(each => { const box = each.getBoundingClientRect(); return box.x + box.width / 2 < moved.clientX; }).length);
    };
    for (const [name, listener] of [["pointermove", onMove], ["pointerup", onUp], ["pointercancel", onUp]]) block.addEventListener(name, listener);
  }
}
