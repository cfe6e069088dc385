// Two assemblies side by side with one zoom; parts that differ in form or place are marked.
import { differences } from "./compare.js";
import { css, el } from "./dom.js";
import { inStep } from "./panzoom.js";
import { WAYS, aim, lightOf } from "./parts_plan.js";
import { PartMeshes, THREE } from "./parts_scene.js";

export class PartsCompare {
  title = "Compare";
  constructor(studio) {
    this.studio = studio;
    this.way = "Front";
    this.halves = ["Before", "Now"].map((words) => {
      const canvas = el("canvas", { role: "img" }), name = el("h3", {}, words);
      return { half: el("div", { class: "half" }, name, canvas), canvas, name };
    });
    this.buttons = Object.keys(WAYS).map((way) => el("button", { "aria-pressed": String(way === this.way), onclick: () => this.turn(way) }, way));
    this.diffs = el("div", { class: "diffs" });
    this.element = el("div", { class: "view" }, el("div", { class: "surface compare" }, el("div", { class: "twin" }, ...this.halves.map(({ half }) => half)), this.diffs),
      el("div", { class: "tools right-top", role: "group", "aria-label": "Seen from" }, ...this.buttons), el("div", { class: "stale-mark" }, "Updating"));
    studio.on("parts reference figures checked theme", () => this.update());
    studio.on("opened", () => { for (const eye of this.eyes ?? []) eye.touched = false; });
    try { this.renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true }); } catch {
      this.halves[1].half.append(el("p", { class: "fallback" }, "The drawings need WebGL, which this browser does not provide. The differences are listed below."));
      return;
    }
    this.camera = new THREE.OrthographicCamera();
    this.light = new THREE.DirectionalLight(0xffffff, 1.6);
    this.scene = new THREE.Scene();
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0xc8ced6, 1.9), this.light);
    this.eyes = inStep(this.halves, () => this.draw());
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
    if (!this.renderer) return;
    this.changed = changedParts(reference.parts, studio.parts);
    this.meshes = [reference, studio].map(({ parts, surfaces }) => {
      const meshes = new PartMeshes({ parts, surfaces, pickedParts: [], marked: this.changed });
      meshes.update();
      return meshes;
    });
    this.box = this.meshes[0].box().union(this.meshes[1].box());
    const { across, up } = WAYS[this.way];
    for (const eye of this.eyes) eye.bounds([this.box.min[across], this.box.min[up], this.box.max[across], this.box.max[up]], [44, 24, 24, 24]);
    this.draw();
  }
  draw() {
    if (!this.meshes || this.element.hidden) return;
    this.renderer.setClearColor(css("--canvas"));
    lightOf(this.light, this.way);
    this.halves.forEach(({ canvas }, i) => {
      const eye = this.eyes[i], ratio = Math.min(devicePixelRatio || 1, 2);
      if (!eye.width || !eye.height) return;
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(eye.width, eye.height, false);
      aim(this.camera, this.way, eye, this.box);
      this.scene.add(this.meshes[i].group);
      this.renderer.render(this.scene, this.camera);
      this.scene.remove(this.meshes[i].group);
      Object.assign(canvas, { width: this.renderer.domElement.width, height: this.renderer.domElement.height });
      canvas.getContext("2d").drawImage(this.renderer.domElement, 0, 0);
      const own = [...this.changed].join(", ");
      canvas.setAttribute("aria-label", `${i ? "Now" : "Before"}, from the ${this.way.toLowerCase()}${own ? `; these differ: ${own}` : "; no part differs"}`);
    });
  }
}
// Names of parts that only one of them has, or that differ in form or place.
export function changedParts(before, now) {
  const known = (parts) => new Map(parts.map((part) => [part.name, JSON.stringify([part.surface, part.rows, part.shift])]));
  const a = known(before), b = known(now);
  return new Set([...a.keys(), ...b.keys()].filter((name) => a.get(name) !== b.get(name)));
}
