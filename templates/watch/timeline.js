// The poses of a job in a row, as wide as they last: chosen, moved, removed, held longer or shorter, by mouse
// and keys. In: the poses of the planned job. Out: requests to change its text, which comes back with them.

import { element } from "./dom.js";

const BLOCK = 44, LEAST = 4;   // pixels: of a pose that takes no time, and of a second at least
const STEP_S = 0.1;

const seconds = pose => (pose.move_s || 0) + pose.hold_s + pose.pause_s;
const rounded = value => Math.round(Math.max(0, value) / STEP_S) * STEP_S;
const text = value => `${+value.toFixed(3)} s`;

export class Timeline {
  // change(what) asks for a change of the text, chosen(pose, index) shows one, pointed(index) is told the one
  // that the pointer is on.
  constructor(places, { change, chosen, pointed }) {
    Object.assign(this, { places, change, chosen, pointed });
    this.poses = [];
    this.blocks = [];
    this.selected = 0;
    places.list.addEventListener("keydown", event => { if (this.press(event)) event.preventDefault(); });
    for (const key of ["move_s", "hold_s", "pause_s"]) {
      const seconds = () => (places[key].value === "" ? null : Math.max(0, +places[key].value));
      places[key].addEventListener("change", () => this.time(key, seconds()));
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
    if (this.dragging) { this.waiting = poses; return; }   // the block in the hand stays
    this.poses = poses;
    this.selected = Math.max(0, Math.min(this.selected, poses.length - 1));
    this.places.area.hidden = !poses.length;
    let begin = 0;
    this.blocks = poses.map((pose, index) => {
      const name = pose.name || `${index + 1}`;
      const handle = element("span", { class: "handle", "aria-hidden": "true" });
      const title = `${name}, from ${text(begin)}; drag it to another place, its end to another time`;
      const said = [element("b", {}, name), " ", element("span", {}, text(pose.hold_s)), handle];
      const block = element("div", { role: "option", id: `pose-${index}`, class: "pose", title }, ...said);
      begin += seconds(pose);
      block.addEventListener("pointerdown", event => this.drag(event, index, event.target === handle));
      block.addEventListener("pointerenter", () => this.pointed(index));
      block.addEventListener("pointerleave", () => this.pointed(null));
      return block;
    });
    this.places.list.replaceChildren(...this.blocks);
    const free = this.places.list.clientWidth - (BLOCK + 2) * poses.length - 8;
    this.scale = Math.max(LEAST, free / Math.max(0.1, begin));
    const width = pose => `${BLOCK + seconds(pose) * this.scale}px`;
    poses.forEach((pose, index) => { this.blocks[index].style.width = width(pose); });
    this.mark();
  }
  // Mark the pose that the chip is in, and the one that the pointer is on somewhere.
  point(now, linked) {
    this.blocks.forEach((block, index) => {
      block.classList.toggle("now", index === now);
      block.classList.toggle("linked", index === linked);
    });
  }
  mark() {
    const pose = this.poses[this.selected];
    this.blocks.forEach((block, index) => block.setAttribute("aria-selected", index === this.selected));
    if (!pose) return;
    this.places.list.setAttribute("aria-activedescendant", `pose-${this.selected}`);
    for (const key of ["move_s", "hold_s", "pause_s"]) {
      if (document.activeElement !== this.places[key]) this.places[key].value = pose[key] ?? "";
    }
    this.places.earlier.disabled = this.selected === 0;
    this.places.later.disabled = this.selected === this.poses.length - 1;
    this.places.remove.disabled = this.poses.length === 1;
  }
  choose(index) {
    this.selected = Math.max(0, Math.min(this.poses.length - 1, index));
    this.mark();
    this.blocks[this.selected].scrollIntoView({ block: "nearest", inline: "nearest" });
    this.chosen(this.poses[this.selected], this.selected);
  }
  press(event) {
    const pose = this.poses[this.selected], way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (way && event.shiftKey) this.move(this.selected + way);
    else if (way) this.choose(this.selected + way);
    else if (event.key === "Home") this.choose(0);
    else if (event.key === "End") this.choose(this.poses.length - 1);
    else if (event.key === "Enter") this.choose(this.selected);
    else if (event.key === "+") this.time("hold_s", rounded(pose.hold_s + STEP_S));
    else if (event.key === "-") this.time("hold_s", rounded(pose.hold_s - STEP_S));
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
    const pose = this.poses[this.selected];   // what the next key goes on from
    if (value !== null) this.poses[this.selected] = { ...pose, [key]: value };
  }
  // A pose is dragged to another place, or its right end to another time.
  drag(event, index, end) {
    const block = this.blocks[index], from = event.clientX, pose = this.poses[index];
    this.dragging = true;
    this.waiting = null;
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
      for (const [name, listener] of listeners) block.removeEventListener(name, listener);
      block.style.translate = "";
      this.dragging = false;
      const stayed = moved.type === "pointercancel" || Math.abs(moved.clientX - from) < 4;
      if (stayed) { this.show(this.waiting || this.poses); return; }
      if (end) { this.time("hold_s", held(moved)); return; }
      const others = this.blocks.filter(each => each !== block);
      const middle = ({ x, width }) => x + width / 2;
      this.move(others.filter(each => middle(each.getBoundingClientRect()) < moved.clientX).length);
    };
    const listeners = [["pointermove", onMove], ["pointerup", onUp], ["pointercancel", onUp]];
    for (const [name, listener] of listeners) block.addEventListener(name, listener);
  }
}
