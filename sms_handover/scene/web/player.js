"use strict";
/* Plays the runs of the page: time, buttons, labels, and the time shared with the page around this one. */

const EVENT_SHOWN = 4; // s of simulation time for which what came of a grasp is shown
const element = (id) => document.getElementById(id);

class Player {
  constructor(data) {
    this.runs = data.runs.map((run) => new RunBody(run));
    this.live = Boolean(data.live); // the end moves, and playback continues there
    this.t = this.start;
    this.playing = false;
    this.runs.forEach((run) => run.place(this.t));
    this.picture = new Picture(element("picture"), this.runs);
    this.picture.drawn = () => this.placeLabels();
    this.arrangements = this.listArrangements();
    this.connect();
    this.arrange(0);
    this.takeTheme();
    this.seek(this.live ? this.end : data.start);
    if (this.live) this.play();
  }

  get start() { return Math.min(...this.runs.map((run) => run.motion.start)); }

  get end() { return Math.max(...this.runs.map((run) => run.motion.end)); }

  /** Add new data of a live run; a viewer at its end stays there. */
  extend(data) {
    const following = this.playing && this.t >= this.end;
    this.runs[0].extend(data);
    this.offerPlans();
    this.drawBar();
    if (following) this.seek(this.end); else this.show();
    this.picture.ask();
  }

  /** Overlaid, side by side, each alone. */
  listArrangements() {
    const alone = this.runs.map((run) => ({ name: run.name, tiles: [[run]] }));
    if (this.runs.length === 1) return alone;
    const rest = this.runs.slice(1).map((run) => run.name).join(", ");
    return [
      { name: `${this.runs[0].name} over ${rest}`, tiles: [this.runs] },
      { name: "side by side", tiles: this.runs.map((run) => [run]) },
      ...alone,
    ];
  }

  connect() {
    const time = element("time");
    time.addEventListener("input", () => { this.pause(); this.seek(Number(time.value)); });
    time.addEventListener("keydown", (event) => this.step(event));
    element("play").addEventListener("click", () => this.toggle());
    element("view").addEventListener("change", (event) => this.picture.look(event.target.value));
    this.arrangements.forEach(({ name }, index) => element("runs").add(new Option(name, index)));
    element("arrange").hidden = this.runs.length === 1;
    element("runs").addEventListener("change", (event) => this.arrange(Number(event.target.value)));
    element("nearest").parentElement.hidden = !this.runs.some((run) => run.nearest);
    element("momentum").parentElement.hidden = !this.runs.some((run) => run.momentum);
    this.offerPlans();
    ["traces", "targets", "nearest", "momentum", "planned"].forEach((id) => element(id).addEventListener("change", () => this.showParts()));
    document.addEventListener("keydown", (event) => {
      if (event.key === " " && !["BUTTON", "SELECT"].includes(event.target.tagName)) { event.preventDefault(); this.toggle(); }
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.takeTheme());
    window.addEventListener("message", (event) => this.receive(event));
    this.drawBar();
  }

  /** Plans can be hidden once there are any. */
  offerPlans() { element("planned").parentElement.hidden = !this.runs.some((run) => run.planned.times.length); }

  /** The phases of the first run, to jump to, and marks for the grasps. */
  drawBar() {
    const { phases, events } = this.runs[0].data;
    const length = this.end - this.start || 1;
    Object.assign(element("time"), { min: this.start, max: this.end });
    element("phases").replaceChildren();
    element("marks").replaceChildren();
    this.phaseButtons = phases.map((phase, index) => {
      const end = index + 1 < phases.length ? phases[index + 1].start : this.end;
      const button = document.createElement("button");
      Object.assign(button, { type: "button", textContent: phase.name, tabIndex: -1, title: `${phase.name}, from ${phase.start} s` });
      button.style.flex = `${(end - phase.start) / length} 1 0`;
      button.addEventListener("click", () => this.seek(phase.start));
      element("phases").append(button);
      return button;
    });
    events.forEach((event) => {
      const mark = document.createElement("i");
      mark.style.left = `${(100 * (event.time - this.start)) / length}%`;
      element("marks").append(mark);
    });
  }

  arrange(index) {
    this.tiles = this.arrangements[index].tiles;
    this.picture.arrange(this.tiles);
    this.picture.look(element("view").value);
    this.makeLabels();
    this.show();
  }

  showParts() {
    this.runs.forEach((run) => {
      run.traceGroup.visible = element("traces").checked;
      run.targetGroup.visible = element("targets").checked;
      run.nearestGroup.visible = element("nearest").checked;
      run.momentumGroup.visible = element("momentum").checked;
      run.plannedGroup.visible = element("planned").checked;
    });
    this.picture.ask();
  }

  get theme() {
    const wanted = document.documentElement.dataset.theme;
    return wanted || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  }

  takeTheme() {
    this.picture.paint(this.theme);
    this.makeLabels();
    this.show();
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  play() {
    if (this.t >= this.end && !this.live) this.seek(this.start);
    this.playing = true;
    this.button();
    let before = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      const passed = Math.min(now - before, 250) / 1000; // s; no jump after the page was hidden
      before = now;
      if (this.t < this.end) this.seek(this.t + passed * Number(element("speed").value));
      if (this.t >= this.end && !this.live) this.pause(); else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  pause() {
    this.playing = false;
    this.button();
  }

  button() {
    element("play").classList.toggle("playing", this.playing);
    element("play").setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }

  /** The arrow keys on the time bar step by a tenth of a second, with shift by one second. */
  step(event) {
    const sign = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (!sign) return;
    event.preventDefault();
    this.seek(this.t + sign * (event.shiftKey ? 1 : 0.1));
  }

  /** Go to time t (s); with `notify` the parent page is informed. */
  seek(t, notify = true) {
    if (!Number.isFinite(t)) return;
    this.t = Math.min(Math.max(t, this.start), this.end);
    this.runs.forEach((run) => run.place(this.t));
    this.show();
    this.picture.ask();
    if (notify && window.parent !== window) window.parent.postMessage({ type: "time", t: this.t }, "*");
  }

  receive(event) {
    if (event.source !== window.parent || typeof event.data !== "object" || event.data === null) return;
    if (event.data.type === "time") this.seek(Number(event.data.t), false);
    if (event.data.type === "theme") {
      document.documentElement.dataset.theme = event.data.theme === "dark" ? "dark" : "light";
      this.takeTheme();
    }
  }

  show() {
    element("time").value = this.t;
    element("clock").textContent = `${this.t.toFixed(2)} / ${this.end.toFixed(0)} s`;
    const phase = this.runs[0].phase(this.t);
    this.phaseButtons.forEach((button, index) => button.classList.toggle("now", this.runs[0].data.phases[index] === phase));
    this.readOut(phase);
    this.showEvent();
  }

  /** Distance of each tool from its target, and displacement of the spacecraft. */
  readOut(phase) {
    const runs = this.tiles.flat();
    const mm = (a, b) => (a && b ? `${(1000 * a.distanceTo(b)).toFixed(1)} mm` : "–");
    const degrees = (a, b) => `${((180 / Math.PI) * a.angleTo(b)).toFixed(2)}°`;
    const at = (run, name) => (run.bodies[run.body(name)].visible ? run.position(name) : null);
    const rows = runs[0].data.arms.map((arm, index) => ({
      colour: COLOURS[this.theme].arms[index % 4],
      text: `${label(arm)}: tool to target`,
      values: runs.map((run) => mm(at(run, `${arm}_tool`), at(run, `${arm}/target`))),
    }));
    const { start } = COLOURS[this.theme];
    rows.push(
      { colour: start, text: "Base moved by", values: runs.map((run) => mm(run.bodies[0].position, run.startGroup.position)) },
      { colour: start, text: "Base turned by", values: runs.map((run) => degrees(run.bodies[0].quaternion, run.startGroup.quaternion)) },
    );
    if (runs.some((run) => run.nearest)) {
      const colour = runs[0].nearest?.known ? runs[0].nearest.colour : start;
      rows.push({ colour, text: "Least clearance", values: runs.map((run) => run.nearest?.text ?? "\u2013") });
    }
    if (runs.some((run) => run.momentum)) {
      const colour = COLOURS[this.theme].momentum;
      rows.push({ colour, text: "Angular momentum", values: runs.map((run) => run.momentum?.text ?? "\u2013") });
    }
    const table = document.createElement("table");
    if (runs.length > 1) {
      const head = table.createTHead().insertRow();
      ["", ...runs.map((run) => run.name)].forEach((text) => {
        head.append(Object.assign(document.createElement("th"), { textContent: text }));
      });
    }
    const content = table.createTBody();
    rows.forEach(({ colour, text, values }) => {
      const row = content.insertRow();
      const name = document.createElement("th");
      const dot = Object.assign(document.createElement("span"), { className: "dot" });
      dot.style.background = `#${colour.toString(16).padStart(6, "0")}`;
      name.append(dot, text);
      row.append(name);
      values.forEach((value) => { row.insertCell().textContent = value; });
    });
    const title = document.createElement("h1");
    title.textContent = phase ? phase.name : "";
    if (runs.length === 1) title.append(" ", Object.assign(document.createElement("small"), { textContent: runs[0].name }));
    element("readout").replaceChildren(title, table);
  }

  /** Show the outcome of the last grasp for a while. */
  showEvent() {
    const shown = new Map(); // text of an event, and the runs that had it
    this.tiles.flat().forEach((run) => run.data.events.forEach((event) => {
      if (event.time <= this.t && this.t < event.time + EVENT_SHOWN) {
        shown.set(event.text, [...(shown.get(event.text) || []), run.name]);
      }
    }));
    const text = [...shown].map(([what, runs]) => `${what} (${runs.join(", ")})`).join("\n");
    const place = element("event");
    place.classList.toggle("shown", text !== "");
    if (text && place.textContent !== text) place.textContent = text;
  }

  /** Labels of arms and deputy, once per tile. */
  makeLabels() {
    const css = (colour) => `#${colour.toString(16).padStart(6, "0")}`;
    this.labels = this.tiles.flatMap(([run], place) => [
      ...run.data.arms.map((arm, index) => ({ run, place, body: `${arm}_gripper`, text: label(arm), colour: COLOURS.light.arms[index % 4] })),
      { run, place, body: "deputy", text: "Deputy", colour: 0x0b7a53, below: true },
      ...(run.nearest ? [{ run, place, nearest: true, text: "", colour: 0 }] : []),
      ...(this.tiles.length > 1 ? [{ run, place, body: null, text: run.name, colour: 0x4a5666 }] : []),
    ]);
    element("labels").replaceChildren(...this.labels.map((item) => {
      item.node = Object.assign(document.createElement("span"), { textContent: item.text });
      item.node.style.background = css(item.colour);
      return item.node;
    }));
  }

  placeLabels() {
    this.labels.forEach(({ run, place, body, node, below, nearest }) => {
      if (nearest) { this.placeDistance(run, place, node); return; }
      if (body === null) { // the name of the run, at the foot of its tile
        const { width, height, right, down } = this.picture.tile();
        node.style.transform = `translate(${(right * place + width / 2).toFixed(1)}px, ${(down * place + height - 28).toFixed(1)}px)`;
        return;
      }
      const index = run.body(body);
      const seen = index >= 0 && run.bodies[index].visible ? this.picture.project(run.bodies[index].position, place) : null;
      node.hidden = !seen;
      if (seen) node.style.transform = `translate(${(seen.x + 14).toFixed(1)}px, ${(seen.y + (below ? 30 : -34)).toFixed(1)}px)`;
    });
  }

  /** The distance of the nearest bodies beside the line between them. */
  placeDistance(run, place, node) {
    const shown = run.nearest.known && element("nearest").checked;
    const seen = shown ? this.picture.project(run.nearest.middle, place) : null;
    node.hidden = !seen;
    if (!seen) return;
    node.textContent = `${run.nearest.name}: ${run.nearest.text}`;
    const inside = run.nearest.distance < 0;
    node.className = inside ? "distance inside" : "distance";
    node.style.background = "";
    const latest = this.picture.canvas.clientWidth - node.offsetWidth - 4; // px, so that the text is whole
    node.style.transform = `translate(${Math.max(0, Math.min(seen.x + 12, latest)).toFixed(1)}px, ${(seen.y + 10).toFixed(1)}px)`;
  }
}

/** A name for display: arm_a is Arm A. */
function label(name) {
  return name.replace(/_/g, " ").replace(/^./, (first) => first.toUpperCase()).replace(/ (\w)$/, (_, last) => ` ${last.toUpperCase()}`);
}
