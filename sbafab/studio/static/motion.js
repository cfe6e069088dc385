// The actuator under pressure: poses from the fast stack, drawn as they come.
import { el, plain } from "./dom.js";
import { Balloons } from "./balloons.js";
import { PLAIN, tone } from "./graphics.js";
import { Mesh, cylinder, turned } from "./meshes.js";
import { COARSE, FINE, chart, measured, meshOf } from "./motion_drawing.js";
import { Playing, PoseView, angleAt } from "./play_loop.js";
import { listen, tab } from "./server.js";
import { Box, HERE, add, cross, distance, placement, scaled, shifted, unit } from "./space.js";
import { Stage3D } from "./stage3d.js";

const PER_MM = 0.003;

export class Motion extends PoseView {
  title = "Motion";
  constructor(studio) {
    super(studio);
    this.surface = el("div", { class: "surface" });
    this.side = el("div", { class: "side" });
    this.element = el("div", { class: "view" }, el("div", { class: "motion" }, this.surface, this.side));
    this.trace = [];
    this.build();
    this.stage = Stage3D.on(this.surface, { up: 10, things: () => this.things() }, "The figures beside it are complete.");
    this.mesh = meshOf(this.stage?.software ? COARSE : FINE);
    this.balloons = new Balloons(this.mesh);
    if (this.stage) this.grab();
    studio.on("laminate", () => { this.stack = null; if (!this.element.hidden) this.load(); });
    studio.on("opened", () => { this.fitted = false; });
    studio.on("theme", () => { if (this.stage && this.stack) { this.shape(); if (this.pose) this.draw(); } this.plots(); });
  }
  show() { this.stage?.resize(); if (!this.stack) this.load(); }

  build() {
    this.knobs = el("div", { role: "group", "aria-label": "Pressures" });
    this.playing = new Playing(() => this.round(), () => this.want());
    const gravity = el("input", { type: "checkbox", onchange: (event) => { this.gravity = event.target.checked; this.want(); } });
    const plate = el("input", { type: "checkbox", "aria-label": "Plate", onchange: (event) => { this.plated = event.target.checked; this.plateHeight.disabled = !this.plated; this.want(); } });
    this.plateHeight = el("input", { type: "range", min: 0, max: 40, step: 0.1, value: 12, disabled: true, "aria-label": "Height of the plate, mm", oninput: () => { this.plateOut.textContent = `${plain(Number(this.plateHeight.value), 1)} mm`; this.want(); } });
    this.plateOut = el("output", {}, "12 mm");
    const number = (label, value, changed) => el("input", { type: "text", inputmode: "decimal", value, "aria-label": label, oninput: changed });
    this.flow = number("Flow into each chamber, ml/min", "35", () => this.read());
    this.tubeLength = number("Length of the tube, mm", "150", () => this.fill(true));
    this.tubeDiameter = number("Inner diameter of the tube, mm", "0.635", () => this.fill(true));
    const tube = el("input", { type: "checkbox", onchange: (event) => { this.tubed = event.target.checked; this.fill(true); } });
    this.tubeRows = el("div", {}, el("label", { class: "knob" }, el("span", {}, "Length"), this.tubeLength, el("output", {}, "mm")), el("label", { class: "knob" }, el("span", {}, "Inside"), this.tubeDiameter, el("output", {}, "mm")));
    this.values = el("dl", { class: "reading", "aria-live": "off" });
    this.trust = el("div", { class: "trust", role: "status" });
    this.plot = el("div");
    this.side.append(el("h3", {}, "Pressure, kPa"), this.knobs, el("div", { class: "group" }, this.playing.button, el("button", { onclick: () => this.set(() => 0) }, "Vent")),
      el("h3", {}, "Loads"), el("label", { class: "knob" }, el("span", {}, plate, " Plate"), this.plateHeight, this.plateOut), el("label", {}, gravity, " Gravity, base level"), el("p", { class: "trust" }, "Drag the top of the actuator to pull it sideways."),
      el("h3", {}, "Supply"), el("label", {}, tube, " Air through a tube, in real time"), this.tubeRows,
      el("h3", {}, "Reading"), this.values, el("label", { class: "knob" }, el("span", {}, "Flow"), this.flow, el("output", {}, "ml/min")), this.trust, this.plot);
    this.tubeRows.hidden = true;
  }
  pressures() { return this.sliders?.map(({ input }) => Number(input.value)) ?? []; }
  set(of) { this.sliders.forEach(({ input, out }, i) => { input.value = of(i); out.textContent = `${plain(Number(input.value), 1)}`; }); this.want(); }

  // The stack of this design; a map of its balloon takes a second or two, once a shape.
  async load() {
    const { studio } = this;
    if (studio.error || !studio.laminate) return;
    this.say("Computing the balloon of this design", false);
    const own = (this.loading = {});
    const text = studio.text;
    try {
      await listen("/api/motion", { tab, text, edits: [], name: studio.name, pose: {} }, (answer) => {
        if (this.loading !== own) return;
        if (answer.kind === "stack") this.start(answer, text);
        else if (answer.message) this.refuse(answer.message);
      });
    } catch (error) { this.refuse(error.message); }
  }
  refuse(message) {
    this.knobs.replaceChildren();
    this.sliders = [];
    this.values.replaceChildren();
    this.plot.replaceChildren();
    this.balloons.clear();
    this.stage?.draw();
    this.say(message, true);
  }
  start(stack, text) {
    const old = this.sliders?.map(({ input }) => input.value) ?? [];
    Object.assign(this, { stack, text });
    this.sliders = stack.axes.map((_, i) => {
      const name = this.studio.laminate.chambers[i]?.name ?? `chamber${i + 1}`;
      const out = el("output", {});
      const input = el("input", { type: "range", min: 0, max: stack.most_pressure, step: 0.1, value: old[i] ?? (i ? 0 : 5), "aria-label": `${name}, kPa`, oninput: () => { out.textContent = plain(Number(input.value), 1); this.want(); } });
      out.textContent = plain(Number(input.value), 1);
      return { input, out, row: el("label", { class: "knob" }, el("span", {}, name), input, out) };
    });
    this.knobs.replaceChildren(...this.sliders.map(({ row }) => row));
    this.plateHeight.min = Math.ceil(stack.flat_height * 10) / 10;
    this.plateHeight.max = Math.max(10, stack.levels.length * 2.6);
    if (this.stage) this.shape();
    this.fitted = false;
    this.want();
  }

  want() {
    if (this.tubed) this.settled = false;
    clearTimeout(this.rest);
    this.rest = setTimeout(() => { this.curves = true; this.want(); }, 260);
    super.want();
  }
  request() {
    if (!this.stack) return null;
    const now = performance.now(), dt = Math.min(0.1, (now - (this.stepped ?? now)) / 1000) || 0.01;
    this.stepped = now;
    const tube = this.tubed ? { length: Number(this.tubeLength.value), diameter: Number(this.tubeDiameter.value), dt, restart: this.restart } : null;
    this.restart = false;
    const pose = { tube, pressures: this.pressures(), load: this.pull ?? [0, 0, 0], gravity: Boolean(this.gravity), plate: this.plated ? Number(this.plateHeight.value) : null, curves: this.curves };
    if (this.curves) clearTimeout(this.rest);
    else this.outside = false;
    this.curves = false;
    return { text: this.text, pose };
  }
  answer(answer) {
    if (answer.kind === "pose") this.arrived(answer);
    else if (answer.kind === "curves") { this.way = answer; this.outside = !answer.holds; this.readings(); }
    else if (answer.message) this.say(answer.message, true);
  }
  idle() { if (!this.tubed || this.settled) this.stepped = null; }
  arrived(pose) {
    const { stack } = this;
    // Asked for of a design that has changed since.
    if (!stack) return;
    if (pose.valves) this.settled = pose.valves.every((p, i) => Math.abs(p - pose.pressures[i]) < 0.01 + 0.002 * p);
    this.newest = pose;
    this.inFrame(() => {
      if (this.stack !== stack) return;
      // Through a tube the chambers follow their valves until they are as full.
      if (this.tubed && !this.settled && !this.element.hidden) super.want();
      this.take(this.newest);
    });
  }
  fill(restart) { this.restart = restart; this.tubeRows.hidden = !this.tubed; this.stepped = null; this.want(); }
  take(pose) {
    this.pose = pose;
    if (pose.valves?.join() !== this.valves) { this.valves = pose.valves?.join(); this.valvesAt = pose.time; }
    this.trace.push([performance.now() / 1000, pose.height, pose.bend, pose.volumes.reduce((sum, one) => sum + one, 0)]);
    while (this.trace.length > 2 && this.trace.at(-1)[0] - this.trace[0][0] > 8) this.trace.shift();
    this.paint();
  }
  readings() {
    if (!this.stack) return;
    this.read();
    this.plots();
  }
  read() {
    const { pose, stack } = this;
    if (!pose) return;
    const volume = pose.volumes.reduce((sum, one) => sum + one, 0), flow = Number(this.flow.value);
    const most = Math.max(...pose.volumes);
    const rows = [["Height", `${pose.height.toFixed(2)} mm`], ["Stroke", `${(pose.height - stack.flat_height).toFixed(2)} mm`], ["Bend", `${pose.bend.toFixed(1)}°`], ["Towards", pose.bend > 0.05 ? `${pose.direction.toFixed(0)}°` : "–"], ["Volume", `${volume.toFixed(1)} µl`], ["Force on plate", this.plated ? `${pose.force.toFixed(3)} N` : "–"], ["Fill time", flow > 0 ? `${((most / 1000 / flow) * 60).toFixed(2)} s` : "–"]];
    if (pose.valves) rows.push(["Chamber pressures", `${pose.pressures.map((p) => p.toFixed(1)).join(" · ")} kPa`], ["Since the valves changed", `${(pose.time - this.valvesAt).toFixed(2)} s${this.settled ? ", filled" : ""}`]);
    if (this.pull) rows.push(["Pull", `${(1000 * Math.hypot(...this.pull)).toFixed(1)} mN`]);
    this.values.replaceChildren(...rows.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]));
    const beside = measured(stack);
    if (!pose.stable) this.say(`The straight column is unstable: it would buckle. ${beside}`, true);
    else if (this.outside) this.say(`The balloons' map misses balloons computed at this pose by more than 3 %. ${beside}`, true);
    else this.say(`${beside} Poses are taken from the balloons' maps: straight heights lie within 0.1 % (pockets of 5 mm) or 1.1 % (10 mm) of the prediction, which computes the balloons themselves. Elastic films, static air, by the design's calibration. Fill time is that of the fullest chamber at this flow, without the resistance of a tube (see Supply). Walls are drawn as arcs of the film's length.`, false);
  }

  plots() {
    if (!this.pose) return;
    if (this.playing.on || this.tubed) {
      const t = this.trace.map((row) => row[0] - this.trace[0][0]), of = (i) => this.trace.map((row) => row[i]);
      this.plot.replaceChildren(el("h3", {}, "The last seconds"), ...[["Height, mm", 1], ["Bend, °", 2], ["Volume, µl", 3]].map(([words, i]) => chart(t, of(i), t.at(-1), of(i).at(-1), words, "s")));
      return;
    }
    if (!this.way?.pressure) return;
    const p = Math.max(...this.pose.pressures);
    this.plot.replaceChildren(el("h3", {}, "From 0 to these pressures"), chart(this.way.pressure, this.way.height, p, this.pose.height, "Height, mm"), chart(this.way.pressure, this.way.bend, p, this.pose.bend, "Bend, °"), chart(this.way.pressure, this.way.volume, p, this.pose.volumes.reduce((sum, one) => sum + one, 0), "Volume, µl"));
  }

  // The balloons on their base, and what acts on them: a plate, a pull, and the way that the tip has gone.
  things() {
    const { pose, plated, pull } = this;
    if (!pose || !this.balloons.film) return [];
    const tip = pose.origins.at(-1), select = tone("--select");
    return [...this.balloons.things(HERE), { mesh: this.base, side: 1, tint: tone("--strong") },
      plated && { mesh: this.plate, place: shifted([0, 0, Number(this.plateHeight.value) + 0.1]), side: 1, tint: tone("--accent"), opacity: 0.35 },
      ...(pull ? arrow(tip, scaled(pull, 1 / PER_MM)).map((part) => ({ ...part, look: PLAIN, tint: select })) : []),
      { mesh: this.trail, tint: select, opacity: 0.7 }];
  }
  shape() {
    const { stack, studio: { laminate } } = this;
    const walls = Object.values(laminate.patterns).filter(({ layers }) => laminate.layers[layers[0] - 1].role === "wall");
    const wall = walls.sort((a, b) => b.layers.length - a.layers.length)[0];
    this.balloons.shape(stack, { wall: wall && this.studio.shape(wall.shape), lumen: laminate.lumen });
    this.base = cylinder(stack.outline * 1.12, -0.62, -0.02);
    this.plate = cylinder(stack.outline * 1.6, -0.075, 0.075);
    this.tips = [];
    this.trail = new Mesh([], null, { joined: true });
  }
  draw() {
    const { pose, stack } = this;
    this.balloons.draw(pose);
    this.tips.push(...pose.origins.at(-1));
    if (this.tips.length > 900) this.tips.splice(0, 3);
    this.trail.points = new Float32Array(this.tips);
    this.trail.version++;
    if (!this.fitted) {
      const tall = Math.max(14, stack.levels.length * 1.9), wide = stack.outline * 1.5;
      this.stage.touched = false;
      this.stage.fit(new Box([-wide, -wide, -1], [wide, wide, tall]));
      this.fitted = true;
    }
    this.stage.canvas.setAttribute("aria-label", `Actuator, ${pose.height.toFixed(2)} mm high, bent ${pose.bend.toFixed(1)} degrees`);
    this.stage.draw();
  }
  // Hold the top and pull: a force on the tip along the way of the hand, gone when it lets go.
  grab() {
    const { canvas, camera } = this.stage;
    canvas.addEventListener("pointerdown", (down) => {
      if (!this.pose || down.button) return;
      const tip = this.pose.origins.at(-1), [x, y] = camera.seen(tip), box = canvas.getBoundingClientRect();
      const away = Math.hypot(((x + 1) / 2) * box.width + box.left - down.clientX, ((1 - y) / 2) * box.height + box.top - down.clientY);
      const scale = (distance(camera.eye, tip) * 2 * camera.half[1]) / box.height;
      if (away * scale > this.stack.outline * 0.8) return;
      // The camera stays where it is.
      down.preventDefault();
      canvas.setPointerCapture(down.pointerId);
      const [right, up] = camera.ways;
      const move = (event) => {
        this.pull = scaled(add(scaled(right, event.clientX - down.clientX), up, down.clientY - event.clientY), scale * PER_MM);
        this.want();
      };
      const end = () => { canvas.removeEventListener("pointermove", move); this.pull = null; this.want(); };
      canvas.addEventListener("pointermove", move);
      canvas.addEventListener("pointerup", end, { once: true });
      canvas.addEventListener("pointercancel", end, { once: true });
    }, { capture: true });
  }
  // Pressure that goes round the chambers; a single chamber breathes.
  round() {
    if (!this.sliders?.length) return null;
    const most = Math.max(5, ...this.pressures());
    return (elapsed) => {
      this.set((i) => (most * (1 + Math.cos(angleAt(elapsed) - (i * 2 * Math.PI) / this.sliders.length))) / 2);
      clearTimeout(this.rest);
    };
  }
  picture() { return this.stage.picture("motion.png"); }
}

// From a place along a way: a line, and a head of 1.2 by 0.7 mm at its end.
const HEAD = turned([[0, -1.2], [0.35, -1.2], [0, 0]], 12);
function arrow(from, way) {
  const end = add(from, way), to = unit(way), aside = unit(cross(to, Math.abs(to[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0])), ways = [aside, cross(to, aside), to];
  return [{ mesh: new Mesh([...from, ...end]) }, { mesh: HEAD, place: placement([0, 1, 2].map((i) => ways.map((one) => one[i])), end) }];
}
