// Two assemblies side by side with one zoom; parts that differ in form or place are marked.
import { differences } from "./compare.js";
import { el } from "./dom.js";
import { Painter } from "./graphics.js";
import { inStep } from "./panzoom.js";
import { WAYS, aimed } from "./parts_plan.js";
import { PartMeshes } from "./parts_scene.js";

export class PartsCompare {
  title = "Compare";
  constructor(studio) {
    this.studio = studio;
    this.way = "Front";
    this.halves = ["Before", "Now"].map((words) => {
      const name = el("h3", {}, words), half = el("div", { class: "half" }, name);
      return { half, name, painter: Painter.on(half, { role: "img" }, () => this.draw(), "The differences are listed below.") };
    });
    this.buttons = Object.keys(WAYS).map((way) => el("button", { "aria-pressed": String(way === this.way), onclick: () => this.turn(way) }, way));
    this.diffs = el("div", { class: "diffs" });
    this.element = el("div", { class: "view" }, el("div", { class: "surface compare" }, el("div", { class: "twin" }, ...this.halves.map(({ half }) => half)), this.diffs),
      el("div", { class: "tools right-top", role: "group", "aria-label": "Seen from" }, ...this.buttons), el("div", { class: "stale-mark" }, "Updating"));
    studio.on("parts reference figures checked theme", () => this.update());
    studio.on("opened", () => { for (const eye of this.eyes ?? []) eye.touched = false; });
    if (this.halves[0].painter) this.eyes = inStep(this.halves, () => this.draw());
  }
  show() { this.update(); }
  turn(way) {
    this.way = way;
    for (const button of this.buttons) button.setAttribute("aria-pressed", String(button.textContent === way));
    for (const eye of this.eyes ?? []) eye.touched = false;
    this.update();
  }
  update() {
    const { studio } = this, { reference } = studio;
    if (this.element.hidden || !reference?.parts || !studio.parts) return;
    this.halves[0].name.textContent = `Before: ${reference.name}`;
    this.halves[1].name.textContent = `Now: ${studio.designName}`;
    this.diffs.replaceChildren(differences(studio));
    if (!this.eyes) return;
    this.changed = changedParts(reference.parts, studio.parts);
    this.meshes = [reference, studio].map(({ parts, surfaces }) => {
      const meshes = new PartMeshes({ parts, surfaces, pickedParts: [], marked: this.changed });
      meshes.update();
      return meshes;
    });
    this.box = this.meshes[0].box().join(this.meshes[1].box());
    const { across, up } = WAYS[this.way];
    for (const eye of this.eyes) eye.bounds([this.box.min[across], this.box.min[up], this.box.max[across], this.box.max[up]], [44, 24, 24, 24]);
    this.draw();
  }
  draw() {
    if (!this.meshes || this.element.hidden) return;
    this.halves.forEach(({ painter }, i) => {
      const eye = this.eyes[i];
      if (!eye.width || !eye.height) return;
      painter.paint({ things: this.meshes[i].things, ...aimed(this.way, eye, this.box) });
      const own = [...this.changed].join(", ");
      painter.canvas.setAttribute("aria-label", `${i ? "Now" : "Before"}, from the ${this.way.toLowerCase()}${own ? `; these differ: ${own}` : "; no part differs"}`);
    });
  }
}
// Names of parts that only one of them has, or that differ in form or place.
export function changedParts(before, now) {
  const known = (parts) => new Map(parts.map((part) => [part.name, JSON.stringify([part.surface, part.rows, part.shift])]));
  const a = known(before), b = known(now);
  return new Set([...a.keys(), ...b.keys()].filter((name) => a.get(name) !== b.get(name)));
}
