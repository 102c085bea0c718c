// What the modules of the page share: elements, and tabs of which one panel is shown.

export const byId = id => document.getElementById(id);
export function places(names) {
  return Object.fromEntries(Object.entries(names).map(([name, id]) => [name, byId(id)]));
}

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "click") made.addEventListener("click", value);
    else if (value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

export function write(place, text) {   // to write the same text again would be read out again
  if (place.textContent !== text) place.textContent = text;
}

// A list of tabs: the arrow keys choose one, a tab whose panel has nothing to show is not there.
export class Tabs {
  constructor(list, shown = () => {}) {
    this.shown = shown;
    this.tabs = [...list.querySelectorAll("[role=tab]")];
    for (const tab of this.tabs) tab.addEventListener("click", () => this.choose(tab.id));
    list.addEventListener("keydown", event => {
      const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key], there = this.tabs.filter(tab => !tab.hidden);
      if (!way || !event.target.matches("[role=tab]")) return;
      const next = there[(there.indexOf(event.target) + way + there.length) % there.length];
      this.choose(next.id);
      next.focus();
      event.preventDefault();
      event.stopPropagation();
    });
  }
  get chosen() { return this.tabs.find(tab => tab.getAttribute("aria-selected") === "true")?.id; }
  choose(id) {
    for (const tab of this.tabs) {
      const mine = tab.id === id;
      tab.setAttribute("aria-selected", mine);
      tab.tabIndex = mine ? 0 : -1;
      byId(tab.getAttribute("aria-controls")).hidden = !mine;
    }
    this.shown(id);
  }
  // Show these tabs only; where the chosen one is gone, or none was, the first of them is chosen.
  offer(ids) {
    const kept = this.tabs.find(tab => tab.getAttribute("aria-selected") === "true" && ids.includes(tab.id));
    for (const tab of this.tabs) tab.hidden = !ids.includes(tab.id);
    this.choose(kept ? kept.id : ids[0]);
  }
}

// Says every second what goes on, and for how long it has.
export class Going {
  constructor(say) { this.say = say; }
  begin(what) {
    const begin = performance.now();
    this.end();
    this.timer = setInterval(() => {
      this.say(`${what} (${Math.round((performance.now() - begin) / 1000)} s)`);
    }, 1000);
  }
  end() { clearInterval(this.timer); }
}
