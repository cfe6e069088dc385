// The films in space: lifted apart, cut open, picked one by one.
import { el } from "./dom.js";
import { PLAIN, tone } from "./graphics.js";
import { Mesh, prism, turned } from "./meshes.js";
import { Box, met, raised, shifted } from "./space.js";
import { Stage3D } from "./stage3d.js";
import { polygons, spans } from "./shapes.js";
import { layerWords } from "./state.js";

// A round mark, 0.7 mm across.
const BALL = turned(Array.from({ length: 13 }, (_, i) => { const turn = (Math.PI * i) / 12; return [0.35 * Math.sin(turn), -0.35 * Math.cos(turn)]; }), 16);

export class Solid {
  title = "Solid";
  constructor(studio) {
    this.studio = studio;
    this.surface = el("div", { class: "surface" });
    const range = (label, value, changed) => {
      const input = el("input", { type: "range", min: 0, max: 100, value, "aria-label": label, oninput: changed });
      return { input, label: el("label", {}, label, input) };
    };
    this.explode = range("Explode", 42, () => this.arrange());
    this.opened = el("button", { "aria-pressed": "false", onclick: () => { this.isCut = !this.isCut; this.opened.setAttribute("aria-pressed", String(this.isCut)); this.plane(); } }, "Cut");
    this.masks = el("button", { "aria-pressed": "true", onclick: () => { this.noMasks = !this.noMasks; this.masks.setAttribute("aria-pressed", String(!this.noMasks)); this.arrange(); } }, "Masks");
    this.picker = el("input", { type: "range", min: 0, max: 1, value: 0, "aria-label": "Layer", oninput: () => { const layer = studio.layer(Number(this.picker.value)); studio.pick(layer ?? null); } });
    this.pickedWords = el("output", {}, "all");
    this.alone = el("button", { "aria-pressed": "false", title: "Show layers up to the picked one only", onclick: () => { this.upTo = !this.upTo; this.alone.setAttribute("aria-pressed", String(this.upTo)); this.arrange(); } }, "Up to");
    const views = [["Iso", [26, -34, 22]], ["Top", [0, -0.001, 1]], ["Side", [0, -1, 0.02]]];
    this.element = el("div", { class: "view" }, this.surface,
      el("div", { class: "tools" }, this.explode.label, this.opened, this.masks, el("label", {}, "Layer", this.picker, this.pickedWords), this.alone),
      el("div", { class: "tools right-top", role: "group", "aria-label": "Camera" }, ...views.map(([words, way]) => el("button", { onclick: () => this.stage?.whole(way) }, words))),
      el("div", { class: "stale-mark" }, "Updating"));
    Object.assign(this, { films: [], faces: [], prisms: new Map() });
    this.stage = Stage3D.on(this.surface, { up: 22, things: () => [...this.films, ...this.faces, this.mark && this.ball()] }, "Section and Layers show the same design.");
    if (!this.stage) return;
    const { canvas } = this.stage;
    canvas.addEventListener("pointermove", (event) => { if (!event.buttons) this.point(event); });
    canvas.addEventListener("pointerleave", () => studio.hover(null));
    canvas.addEventListener("pointerdown", (event) => { this.down = [event.clientX, event.clientY]; });
    canvas.addEventListener("click", (event) => { if (Math.hypot(event.clientX - this.down[0], event.clientY - this.down[1]) < 4) studio.pick(this.hit(event)); });
    studio.on("laminate", () => this.update());
    studio.on("cut", () => this.plane());
    studio.on("hover pick", () => this.light());
    studio.on("opened", () => { this.stage.touched = false; this.mark = null; });
    studio.on("theme", () => this.update());
  }
  show() { this.stage?.resize(); if (this.behind) this.update(); }

  // One prism of height 1 a shape, shared by all layers of that shape.
  built(key) {
    if (!this.prisms.has(key)) this.prisms.set(key, prism(polygons(this.studio.shape(key), 0.02).filter((points) => points.length > 2)));
    return this.prisms.get(key);
  }
  update() {
    if (!this.stage) return;
    // A view that is not shown follows when it is.
    this.behind = this.element.hidden;
    if (this.behind) return;
    const { laminate } = this.studio;
    this.films = [];
    if (!laminate) { this.faces = []; this.stage.draw(); return; }
    const used = new Set(), inks = { tpe: tone("--tpe-line"), ptfe: tone("--ptfe-line") };
    for (const layer of laminate.layers) {
      const key = laminate.patterns[layer.pattern].shape, { solid, edges } = this.built(key), kind = layer.mask ? "ptfe" : "tpe";
      used.add(key);
      this.films.push({ layer, kind, mesh: solid, edges, ink: inks[kind] });
    }
    for (const key of this.prisms.keys()) if (!used.has(key) && this.prisms.size > 60) this.prisms.delete(key);
    this.picker.max = laminate.layers.length;
    this.arrange();
    this.light();
  }
  lift(layer) { return layer.z + (layer.index - 1) * this.gap; }
  arrange() {
    const { laminate } = this.studio;
    if (!laminate || !this.stage) return;
    const [x0, y0, x1, y1] = laminate.bounds;
    const k = this.explode.input.value / 100;
    // At the end of the slider the stack is about as high as wide.
    this.gap = (k * k * 1.15 * Math.max(x1 - x0, y1 - y0)) / Math.max(6, laminate.layers.length);
    const top = this.upTo && this.studio.picked ? this.studio.picked.index : Infinity;
    for (const film of this.films) {
      const { layer } = film;
      film.place = raised(this.lift(layer), layer.thickness);
      film.hidden = layer.index > top || (this.noMasks && layer.mask);
    }
    this.plane();
    this.stage.box = this.box();
    if (!this.stage.touched) this.stage.fit(this.stage.box);
    this.stage.draw();
  }
  box() {
    const { laminate } = this.studio;
    if (!laminate) return null;
    const [x0, y0, x1, y1] = laminate.bounds, last = laminate.layers.at(-1);
    return new Box([x0, y0, 0], [x1, y1, this.lift(last) + last.thickness]);
  }
  // The cut: what lies to the right of the section is taken away, and the cut faces are filled.
  plane() {
    if (!this.stage) return;
    const { laminate, cut } = this.studio, isCut = this.isCut && laminate && cut;
    this.faces = [];
    if (isCut) {
      const { x, y, u, v } = cut, kinds = { tpe: [[], []], ptfe: [[], []] }, known = new Map();
      for (const { hidden, layer, kind } of this.films) {
        if (hidden) continue;
        const key = laminate.patterns[layer.pattern].shape;
        if (!known.has(key)) known.set(key, spans(this.studio.shape(key), x, y, u, v));
        const z0 = this.lift(layer), z1 = z0 + layer.thickness;
        for (const [a, b] of known.get(key)) {
          const p = [x + a * u, y + a * v], q = [x + b * u, y + b * v];
          const [points, faces] = kinds[kind], i = points.length / 3;
          points.push(...p, z0, ...q, z0, ...q, z1, ...p, z1);
          faces.push(i, i + 1, i + 2, i, i + 2, i + 3);
        }
      }
      this.faces = Object.entries(kinds).map(([kind, [points, faces]]) => ({ mesh: new Mesh(points, faces), look: PLAIN, tint: tone(`--${kind}-line`) }));
    }
    for (const film of this.films) film.plane = isCut ? [-cut.v, cut.u, 0, cut.v * cut.x - cut.u * cut.y] : undefined;
    this.stage.draw();
  }
  ball() { return { mesh: BALL, place: shifted([this.mark[0], this.mark[1], this.lift(this.mark[2])]), look: PLAIN, tint: tone("--select"), opacity: 0.9, side: 1, above: true }; }
  light() {
    if (!this.stage) return;
    const { hovered, picked } = this.studio, lit = tone("--select"), plain = { tpe: tone("--tpe"), ptfe: tone("--ptfe") };
    for (const film of this.films) film.tint = [picked?.index, hovered?.index].includes(film.layer.index) ? lit : plain[film.kind];
    this.picker.value = picked?.index ?? 0;
    this.pickedWords.textContent = picked ? String(picked.index) : "all";
    if (this.upTo) this.arrange();
    this.stage.canvas.setAttribute("aria-label", picked ? `Solid, ${layerWords(picked)} picked` : `Solid of ${this.studio.laminate?.layers.length ?? 0} layers`);
    this.stage.draw();
  }
  hit(event) { return met(this.stage.ray(event), this.films.filter(({ hidden }) => !hidden))?.thing.layer ?? null; }
  point(event) {
    const layer = this.hit(event);
    this.studio.hover(layer, layer ? `${layerWords(layer)} · ${layer.thickness} mm thick` : "");
  }
  goto(layers, x, y) {
    const layer = this.studio.layer(layers[0]);
    if (!layer || !this.stage) return;
    this.gap ??= 0;
    this.mark = [x, y, layer];
    this.plane();
    this.stage.approach([x, y, this.lift(layer)], 26);
  }
  picture() { return this.stage.picture("solid.png"); }
}
