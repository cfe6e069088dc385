// An assembly in plan and elevation, drawn to scale: parts named and dimensioned, no perspective.
import { el, plain } from "./dom.js";
import { PanZoom, niceBar } from "./panzoom.js";
import { along, check, spread, text } from "./layers.js";
import { PartMeshes, paintOf, partWords } from "./parts_scene.js";
import { areaOf, contoursOf } from "./parts_section.js";
import { partsList, sizeWords } from "./parts_solid.js";
import { Painter, lightsOf } from "./graphics.js";
import { Camera, add, cross, scaled } from "./space.js";

// Which axes lie across and up (0 is x), from where one looks, and the way that is up.
export const WAYS = {
  Top: { across: 0, up: 1, from: [0, 0, 1], head: [0, 1, 0] },
  Front: { across: 0, up: 2, from: [0, -1, 0], head: [0, 0, 1] },
  Side: { across: 1, up: 2, from: [1, 0, 0], head: [0, 0, 1] },
};
const FAR = 1500;

// A camera without perspective where an eye is, square on to the assembly, and its light over the left shoulder, so that faces that lean are told from flat ones.
export function aimed(way, eye, box) {
  const { across, up, from, head } = WAYS[way], target = [...box.middle];
  [target[across], target[up]] = [eye.x, eye.y];
  const camera = new Camera({ eye: add(target, from, FAR), target, up: head, half: [eye.width / eye.scale / 2, eye.height / eye.scale / 2], near: 1, far: 2 * FAR });
  return { camera, lights: lightsOf(1.9, "#c8ced6", { from: add(add(scaled(from, 2), head), cross(head, from), -0.7), strength: 1.6 }) };
}

export class PartsPlan {
  title = "Plan";
  constructor(studio) {
    this.studio = studio;
    this.way = "Top";
    this.list = partsList(studio);
    this.svg = el("svg", { role: "img", "aria-label": "Assembly in plan" });
    this.surface = el("div", { class: "surface" });
    this.sizes = check("Dimensions", true, () => this.draw());
    this.opened = el("button", { "aria-pressed": "false", onclick: () => this.open(!this.isCut) }, "Section");
    this.depth = el("input", { type: "range", min: 0, max: 100, step: 0.5, value: 50, disabled: true, "aria-label": "Depth of the section", oninput: () => this.cut() });
    this.depthOut = el("output", {});
    this.buttons = Object.keys(WAYS).map((way) => el("button", { "aria-pressed": String(way === this.way), onclick: () => this.turn(way) }, way));
    this.element = el("div", { class: "view layers parts" }, this.list.element, this.surface,
      el("div", { class: "tools" }, this.sizes.label, this.opened, this.depth, this.depthOut, el("button", { onclick: () => { this.eye.touched = false; this.eye.fit(); } }, "Fit")),
      el("div", { class: "tools right-top", role: "group", "aria-label": "Seen from" }, ...this.buttons),
      el("div", { class: "stale-mark" }, "Updating"));
    this.painter = Painter.on(this.surface, { "aria-hidden": "true" }, () => this.draw(), "The parts and rules are listed beside it.");
    if (!this.painter) return;
    this.surface.append(this.svg);
    this.meshes = new PartMeshes(studio);
    this.box = this.meshes.box();
    this.eye = new PanZoom(this.surface, () => this.draw());
    this.surface.addEventListener("pointermove", (event) => { if (!event.buttons) this.point(event); });
    this.surface.addEventListener("pointerleave", () => studio.hover(null));
    this.surface.addEventListener("click", (event) => { if (this.eye.dragged <= 3) { const part = this.under(event); studio.pickParts(part ? [part.name] : []); } });
    studio.on("parts", () => this.update());
    studio.on("part theme", () => { this.meshes.paint(); this.draw(); });
    studio.on("opened", () => { this.eye.touched = false; });
  }
  show() {
    if (!this.painter) return;
    if (this.behind) this.update();
    this.eye.touched ? this.draw() : this.eye.fit();
  }
  turn(way) {
    this.way = way;
    for (const button of this.buttons) button.setAttribute("aria-pressed", String(button.textContent === way));
    this.eye.touched = false;
    if (this.isCut) this.open(true);
    else this.frame();
  }
  // The section square to the way one looks: through the axis of what stands alone, where that lies about the middle.
  open(on) {
    this.isCut = on;
    this.opened.setAttribute("aria-pressed", String(on));
    this.depth.disabled = !on;
    if (on && !this.box.empty) {
      const { near, far } = this.range(), share = (0 - near) / (far - near);
      this.depth.value = share > 0.25 && share < 0.75 ? 100 * share : 50;
    }
    this.cut();
  }
  range() {
    const { from } = WAYS[this.way], axis = from.findIndex(Boolean), way = from[axis];
    const [near, far] = way > 0 ? [this.box.max[axis], this.box.min[axis]] : [this.box.min[axis], this.box.max[axis]];
    return { axis, way, near, far };
  }
  cut() {
    this.meshes.plane = null;
    this.loops = [];
    this.depthOut.textContent = "";
    if (this.isCut && !this.box.empty) {
      const { axis, way, near, far } = this.range(), value = near + (this.depth.value / 100) * (far - near);
      const { across, up, from } = WAYS[this.way];
      this.meshes.plane = [...scaled(from, -1), way * value];
      this.loops = this.meshes.bodies.map((body) => ({ part: body.part, loops: contoursOf(body, axis, value, across, up) })).filter(({ loops }) => loops.length);
      this.depthOut.textContent = `${"xyz"[axis]} ${plain(value, 1)}`;
    }
    this.meshes.paint();
    this.frame();
  }
  update() {
    if (!this.painter) return;
    this.behind = this.element.hidden;
    if (this.behind) return;
    this.meshes.update();
    this.box = this.meshes.box();
    this.cut();
  }
  frame() {
    const { across, up } = WAYS[this.way], box = (this.box = this.meshes.box());
    if (box.empty) { this.draw(); return; }
    this.anchors = this.meshes.bodies.map((body) => this.anchor(body));
    this.eye.bounds([box.min[across], box.min[up], box.max[across], box.max[up]], [56, 150, 92, 70]);
    this.draw();
  }
  // A place at which a part is seen, from its right end on; its middle where others hide it.
  anchor(body) {
    const { across, up, from } = WAYS[this.way], { part } = body, { min, size } = this.meshes.boxOf(body);
    const at = (s, t) => [min[across] + s * size[across], min[up] + t * size[up]];
    for (const s of [0.94, 0.8, 0.6]) for (const t of [0.5, 0.86, 0.14]) {
      const start = scaled(from, FAR), place = at(s, t);
      [start[across], start[up]] = place;
      if (this.meshes.under({ from: start, way: scaled(from, -1) }) === part) return { part, place, hidden: false };
    }
    return { part, place: at(0.5, 0.5), hidden: true };
  }
  draw() {
    const { eye, studio } = this;
    if (!eye.width || !eye.height) return;
    this.painter.paint({ things: this.meshes.things, ...aimed(this.way, eye, this.box) });
    this.svg.replaceChildren(...(studio.parts ? this.faces() : []), ...(studio.parts && this.sizes.box.checked ? [...this.overall(), ...this.names()] : []), ...this.scale());
    this.svg.setAttribute("aria-label", this.words());
  }
  // What the plane goes through, in the colours of the parts.
  faces() {
    const { parts, pickedParts } = this.studio;
    return (this.loops ?? []).map(({ part, loops }) => el("path", { d: loops.map((loop) => `M${loop.map(([u, v]) => this.eye.px(u, v).map((n) => n.toFixed(2)).join(" ")).join("L")}Z`).join(""), fill: `var(${pickedParts.includes(part.name) ? "--select" : paintOf(part, parts)})`, "fill-rule": "evenodd", stroke: "var(--ink)", "stroke-width": 1.2, class: "cut-face", "data-part": part.name }));
  }
  words() {
    const { across, up } = WAYS[this.way], { size } = this.box;
    return `Assembly of ${this.studio.parts?.length ?? 0} parts from the ${this.way.toLowerCase()}${this.isCut ? ` cut at ${this.depthOut.textContent} mm (${this.loops.map(({ part, loops }) => `${part.name} ${plain(areaOf(loops), 1)} mm²`).join(", ")})` : ""}${this.studio.parts?.length ? `, ${plain(size[across], 2)} by ${plain(size[up], 2)} mm` : ""}`;
  }
  overall() {
    const { eye, box } = this, { across, up } = WAYS[this.way];
    const [left, bottom] = eye.px(box.min[across], box.min[up]), [right, top] = eye.px(box.max[across], box.max[up]);
    return [...along([left, bottom + 24], [right, bottom + 24], [left, bottom], [right, bottom], plain(box.max[across] - box.min[across], 2)),
      ...along([left - 24, bottom], [left - 24, top], [left, bottom], [left, top], plain(box.max[up] - box.min[up], 2))];
  }
  // Names at the right, each with a leader to its part.
  names() {
    const { eye, box } = this, column = eye.px(box.max[WAYS[this.way].across], 0)[0] + 26;
    const marks = this.anchors.map(({ part, place, hidden }) => ({ part, hidden, to: eye.px(...place) })).sort((a, b) => a.to[1] - b.to[1]);
    const rows = spread(marks.map(({ to }) => to[1]), 18, 18, eye.height - 18);
    return marks.flatMap(({ part, hidden, to }, i) => [el("path", { d: `M${to.join(" ")}L${column - 12} ${rows[i]}H${column - 4}`, stroke: "var(--faint)", "stroke-dasharray": hidden && "3 3", fill: "none" }), el("circle", { cx: to[0], cy: to[1], r: 2, fill: "var(--soft)" }), text(part.name, column, rows[i] + 4)]);
  }
  scale() {
    const step = niceBar(this.eye.scale), w = step * this.eye.scale, x = this.eye.width - w - 14, y = this.eye.height - (this.eye.width < 560 ? 66 : 16);
    return [el("path", { d: `M${x} ${y - 5}V${y}H${x + w}V${y - 5}`, fill: "none", stroke: "var(--soft)" }), text(`${step} mm`, x + w / 2, y - 7, "middle")];
  }
  under(event) { return this.meshes.under(aimed(this.way, this.eye, this.box).camera.under(event, this.surface)); }
  point(event) {
    if (!this.studio.parts) return;
    const box = this.surface.getBoundingClientRect(), [u, v] = this.eye.at(event.clientX - box.left, event.clientY - box.top);
    const { across, up } = WAYS[this.way], part = this.under(event), where = `${"xyz"[across]} ${plain(u, 2)}, ${"xyz"[up]} ${plain(v, 2)} mm`;
    this.studio.hover(null, part ? `${partWords(part)} · ${sizeWords(this.meshes, part)} · ${where}` : where);
  }
  picture() {
    this.draw();
    return this.painter.picture("plan.png");
  }
}
