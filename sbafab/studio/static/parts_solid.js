// An assembly in space: parts in their places, drawn apart, cut open, picked by name.
import { el, plain } from "./dom.js";
import { Stage3D } from "./stage3d.js";
import { PartMeshes, paintOf, partWords } from "./parts_scene.js";

export class PartsSolid {
  title = "Solid";
  constructor(studio) {
    this.studio = studio;
    this.surface = el("div", { class: "surface" });
    this.list = partsList(studio);
    const range = (label, value, changed) => el("input", { type: "range", min: 0, max: 100, value, "aria-label": label, oninput: changed });
    this.explode = range("Explode", 0, () => this.arrange());
    this.depth = range("Depth of the cut", 50, () => this.cut());
    this.opened = el("button", { "aria-pressed": "false", onclick: () => { this.isCut = !this.isCut; this.opened.setAttribute("aria-pressed", String(this.isCut)); this.depth.disabled = !this.isCut; this.cut(); } }, "Cut");
    this.depth.disabled = true;
    const ways = [["Iso", [26, -34, 22]], ["Top", [0, -0.001, 1]], ["Front", [0, -1, 0.02]], ["Side", [1, 0, 0.02]]];
    this.element = el("div", { class: "view layers parts" }, this.list.element, this.surface,
      el("div", { class: "tools" }, el("label", {}, "Explode", this.explode), this.opened, this.depth),
      el("div", { class: "tools right-top", role: "group", "aria-label": "Camera" }, ...ways.map(([words, way]) => el("button", { onclick: () => this.stage?.whole(way) }, words))),
      el("div", { class: "stale-mark" }, "Updating"));
    this.meshes = new PartMeshes(studio);
    this.stage = Stage3D.on(this.surface, { up: 22, things: () => this.meshes.things }, "The parts and rules are listed beside it.");
    if (!this.stage) return;
    const { canvas } = this.stage;
    canvas.addEventListener("pointermove", (event) => { if (!event.buttons) this.point(event); });
    canvas.addEventListener("pointerleave", () => studio.hover(null));
    canvas.addEventListener("pointerdown", (event) => { this.down = [event.clientX, event.clientY]; });
    canvas.addEventListener("click", (event) => { if (Math.hypot(event.clientX - this.down[0], event.clientY - this.down[1]) < 4) { const part = this.hit(event); studio.pickParts(part ? [part.name] : []); } });
    studio.on("parts", () => this.update());
    studio.on("part", () => { this.meshes.paint(); this.said(); this.stage.draw(); });
    studio.on("theme", () => { this.meshes.paint(); this.stage.draw(); });
    studio.on("opened", () => { this.stage.touched = false; });
  }
  show() { this.stage?.resize(); if (this.behind) this.update(); }
  update() {
    if (!this.stage) return;
    this.behind = this.element.hidden;
    if (this.behind) return;
    this.meshes.update();
    this.arrange();
    this.said();
  }
  arrange() {
    this.meshes.arrange(0);
    this.meshes.arrange((this.explode.value / 100) * 0.7 * Math.max(...this.meshes.box().size));
    this.cut();
    this.stage.box = this.meshes.box();
    if (!this.stage.touched) this.stage.fit(this.stage.box);
    this.stage.draw();
  }
  // What stands before the plane is taken away; insides are painted flat, so that they read as cut faces.
  cut() {
    const { min, size } = this.meshes.box();
    this.meshes.plane = this.isCut && this.studio.parts ? [0, 1, 0, -min[1] - (this.depth.value / 100) * size[1]] : null;
    this.meshes.paint();
    this.stage.draw();
  }
  said() {
    const { parts, pickedParts } = this.studio;
    this.stage.canvas.setAttribute("aria-label", pickedParts.length ? `Assembly, ${pickedParts.join(", ")} picked` : `Assembly of ${parts?.length ?? 0} parts`);
  }
  hit(event) { return this.meshes.under(this.stage.ray(event)); }
  point(event) {
    const part = this.hit(event);
    this.studio.hover(null, part ? `${partWords(part)} · ${sizeWords(this.meshes, part)}` : "");
  }
  picture() { return this.stage.picture("assembly.png"); }
}

export function sizeWords(meshes, part) {
  const { size } = meshes.box((one) => one.name === part.name);
  return `${size.map((length) => plain(length, 1)).join(" × ")} mm over all`;
}

// The parts by name beside a view: a click picks one, in every view.
export function partsList(studio) {
  const element = el("div", { class: "patterns", role: "group", "aria-label": "Parts" });
  const draw = () => {
    const { parts, pickedParts } = studio;
    element.replaceChildren(el("h3", {}, "Parts"), ...(parts ?? []).map((part) => el("button", { "aria-pressed": String(pickedParts.includes(part.name)), title: partWords(part), onclick: () => studio.pickParts(pickedParts.includes(part.name) ? [] : [part.name]) },
      swatch(`var(${paintOf(part, parts)})`),
      el("span", {}, part.name, el("small", {}, part.design ? part.design.name : part.kind), el("small", {}, part.on ? `${part.at} of ${part.on}` : "stands alone")))));
  };
  studio.on("parts part theme", draw);
  return { element };
}
const swatch = (fill) => el("svg", { viewBox: "0 0 42 42", "aria-hidden": "true" }, el("rect", { x: 9, y: 9, width: 24, height: 24, rx: 5, fill, stroke: "var(--part-ink)" }));
