// Patterns in plan: one at a time, dimensioned, true arcs; the line of the section can be dragged.
import { $, css, el, plain } from "./dom.js";
import { PanZoom, niceBar } from "./panzoom.js";
import { contains, nearest, pathOf } from "./shapes.js";
import { layerWords, roleWords } from "./state.js";

export class Layers {
  title = "Layers";
  constructor(studio) {
    this.studio = studio;
    this.list = el("div", { class: "patterns", role: "group", "aria-label": "Patterns" });
    this.svg = el("svg", { role: "img", "aria-label": "Pattern in plan" });
    this.surface = el("div", { class: "surface" }, this.svg);
    this.around = check("Neighbours", false, () => this.draw());
    this.sizes = check("Dimensions", true, () => this.draw());
    this.element = el("div", { class: "view layers" }, this.list, this.surface,
      el("div", { class: "tools" }, this.sizes.label, this.around.label, el("button", { onclick: () => { this.eye.touched = false; this.eye.fit(); } }, "Fit")),
      el("div", { class: "stale-mark" }, "Updating"));
    this.eye = new PanZoom(this.surface, () => this.draw());
    this.surface.addEventListener("pointerdown", (event) => this.grab(event), { capture: true });
    this.surface.addEventListener("pointermove", (event) => this.point(event));
    this.surface.addEventListener("pointerleave", () => studio.hover(null));
    studio.on("laminate", () => this.update());
    studio.on("pick", () => this.choose(studio.picked));
    studio.on("cut theme", () => this.draw());
    studio.on("opened", () => { this.eye.touched = false; this.pattern = null; this.mark = null; });
    studio.on("reference", () => this.draw());
  }
  show() { this.eye.touched ? this.draw() : this.eye.fit(); }

  update() {
    const { laminate } = this.studio;
    if (!laminate) { this.list.replaceChildren(); this.svg.replaceChildren(); return; }
    if (!laminate.patterns[this.pattern]) this.pattern = Object.keys(laminate.patterns)[0];
    const [x0, y0, x1, y1] = laminate.bounds, span = Math.max(x1 - x0, y1 - y0) * 1.04;
    const box = `${(x0 + x1) / 2 - span / 2} ${-(y0 + y1) / 2 - span / 2} ${span} ${span}`;
    const groups = new Map();
    for (const [name, pattern] of Object.entries(laminate.patterns)) {
      const first = laminate.layers[pattern.layers[0] - 1];
      if (!groups.has(first.material)) groups.set(first.material, []);
      groups.get(first.material).push(el("button", { "aria-pressed": String(name === this.pattern), title: `${name}: ${pattern.layers.length} layers`, onclick: () => { this.mark = null; this.studio.pick(laminate.layers[pattern.layers[0] - 1]); } },
        el("svg", { viewBox: box, "aria-hidden": "true" }, el("path", { d: pathOf(this.studio.shape(pattern.shape)), transform: "scale(1 -1)", ...inkOf(first), "stroke-width": span / 60, "fill-rule": "evenodd" })),
        el("span", {}, `${name} ${roleWords(first)}`, el("small", {}, `${pattern.layers.length}× · ${plain(pattern.area, 1)} mm²`))));
    }
    this.list.replaceChildren(...[...groups].flatMap(([material, buttons]) => [el("h3", {}, material), ...buttons]));
    this.eye.bounds(laminate.bounds, [30, 130, 92, 60]);
    this.draw();
  }
  choose(layer) {
    if (!layer || !this.studio.laminate) return;
    this.pattern = layer.pattern;
    this.layer = layer;
    this.update();
  }
  current() {
    const { laminate } = this.studio;
    const pattern = laminate?.patterns[this.pattern];
    if (!pattern) return null;
    const layer = this.layer?.pattern === this.pattern ? laminate.layers[this.layer.index - 1] : laminate.layers[pattern.layers[0] - 1];
    return { pattern, layer };
  }

  draw() {
    const found = this.current();
    if (!found || !this.surface.clientWidth) return;
    const { pattern, layer } = found, { eye, studio } = this;
    const [ox, oy] = eye.px(0, 0);
    const world = el("g", { transform: `translate(${ox} ${oy}) scale(${eye.scale} ${-eye.scale})` });
    const shape = studio.shape(pattern.shape);
    const line = { "vector-effect": "non-scaling-stroke", "fill-rule": "evenodd" };
    if (this.around.box.checked) for (const other of [studio.layer(layer.index - 1), studio.layer(layer.index + 1)].filter(Boolean))
      world.append(el("path", { d: pathOf(studio.shape(studio.laminate.patterns[other.pattern].shape)), fill: "none", stroke: inkOf(other).stroke, "stroke-width": 1, "stroke-dasharray": "5 4", ...line }));
    world.append(el("path", { d: pathOf(shape), ...inkOf(layer), "stroke-width": 1.4, ...line, id: "shown-pattern" }));
    this.svg.replaceChildren(el("g", {}, ...this.grid()), world, ...this.axes(), ...(this.sizes.box.checked ? this.dimensions(pattern) : []), ...this.cutLine(), ...this.marked(), ...this.scale());
    this.svg.setAttribute("aria-label", `${layerWords(layer)}, ${pattern.layers.length} layers, ${plain(pattern.area, 2)} mm²`);
  }
  grid() {
    const { eye } = this, step = niceBar(eye.scale, 90), parts = [];
    const [x0, y1] = eye.at(0, 0), [x1, y0] = eye.at(eye.width, eye.height);
    for (let x = Math.ceil(x0 / step) * step; x < x1; x += step) parts.push(el("line", { x1: eye.px(x, 0)[0], x2: eye.px(x, 0)[0], y1: 0, y2: eye.height, stroke: "var(--grid)" }));
    for (let y = Math.ceil(y0 / step) * step; y < y1; y += step) parts.push(el("line", { y1: eye.px(0, y)[1], y2: eye.px(0, y)[1], x1: 0, x2: eye.width, stroke: "var(--grid)" }));
    return parts;
  }
  axes() {
    const [x, y] = this.eye.px(0, 0);
    return [el("path", { d: `M${x - 7} ${y}H${x + 7}M${x} ${y - 7}V${y + 7}`, stroke: "var(--faint)", fill: "none" })];
  }
  // Words at the right, each with a leader, overall sizes below and at the left: as on a drawing.
  dimensions(pattern) {
    const { eye } = this, [x0, y0, x1, y1] = pattern.bounds, parts = [];
    const [left, bottom] = eye.px(x0, y0), [right, top] = eye.px(x1, y1);
    parts.push(...along([left, bottom + 24], [right, bottom + 24], [left, bottom], [right, bottom], plain(x1 - x0, 2)));
    parts.push(...along([left - 24, bottom], [left - 24, top], [left, bottom], [left, top], plain(y1 - y0, 2)));
    const column = right + 26;
    const marks = pattern.marks.map((mark) => {
      if (mark.start) return { mark, to: eye.px(...(mark.start[0] > mark.end[0] ? mark.start : mark.end)) };
      if (mark.toward) return { mark, to: eye.px(...mark.toward) };
      const [cx, cy] = eye.px(...mark.centre), r = mark.radius * eye.scale;
      return { mark, to: [cx + r * 0.94, cy - r * 0.34] };
    }).sort((a, b) => a.to[1] - b.to[1]);
    const rows = spread(marks.map(({ to }) => to[1]), 18, 18, eye.height - 18);
    marks.forEach(({ mark, to }, i) => {
      if (mark.phantom) { const [cx, cy] = eye.px(...mark.centre); parts.push(el("circle", { cx, cy, r: mark.radius * eye.scale, fill: "none", stroke: "var(--faint)", "stroke-dasharray": "9 3 2 3" })); }
      if (mark.start) parts.push(el("path", { d: `M${eye.px(...mark.start).join(" ")}L${eye.px(...mark.end).join(" ")}`, stroke: "var(--soft)", "stroke-width": 1.5 }));
      parts.push(el("path", { d: `M${to.join(" ")}L${column - 12} ${rows[i]}H${column - 4}`, stroke: "var(--faint)", fill: "none" }), el("circle", { cx: to[0], cy: to[1], r: 2, fill: "var(--soft)" }), text(mark.words, column, rows[i] + 4));
    });
    return parts;
  }
  cutLine() {
    const { cut } = this.studio, { eye } = this;
    if (!cut) return [];
    const reach = (eye.width + eye.height) / eye.scale;
    const a = eye.px(cut.x - cut.u * reach, cut.y - cut.v * reach), b = eye.px(cut.x + cut.u * reach, cut.y + cut.v * reach);
    return [el("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1], stroke: "var(--cut)", "stroke-width": 1.2, "stroke-dasharray": "14 4 3 4" })];
  }
  marked() {
    if (!this.mark) return [];
    const [x, y] = this.eye.px(...this.mark);
    return [el("circle", { cx: x, cy: y, r: 13, fill: "none", stroke: "var(--select)", "stroke-width": 2, class: "place" }), el("path", { d: `M${x - 20} ${y}H${x - 7}M${x + 7} ${y}H${x + 20}M${x} ${y - 20}V${y - 7}M${x} ${y + 7}V${y + 20}`, stroke: "var(--select)", "stroke-width": 2 })];
  }
  scale() {
    const step = niceBar(this.eye.scale), w = step * this.eye.scale, x = this.eye.width - w - 14, y = this.eye.height - 16;
    return [el("path", { d: `M${x} ${y - 5}V${y}H${x + w}V${y - 5}`, fill: "none", stroke: "var(--soft)" }), text(`${step} mm`, x + w / 2, y - 7, "middle")];
  }

  grab(event) {
    const { cut } = this.studio;
    if (!cut || event.button || event.target.closest(".tools")) return;
    const [x, y] = this.place(event);
    const off = (x - cut.x) * cut.v - (y - cut.y) * cut.u;
    if (Math.abs(off) * this.eye.scale > 7) return;
    event.preventDefault();
    this.surface.setPointerCapture(event.pointerId);
    const turning = event.shiftKey;
    const move = (now) => {
      const [mx, my] = this.place(now);
      if (turning || now.shiftKey) {
        const t = Math.round((Math.atan2(my - cut.y, mx - cut.x) * 180) / Math.PI / 5) * 5 * Math.PI / 180;
        this.studio.moveCut({ ...this.studio.cut, u: Math.cos(t), v: Math.sin(t) });
      } else {
        const away = (mx - cut.x) * cut.v - (my - cut.y) * cut.u - off;
        this.studio.moveCut({ ...cut, x: cut.x + away * cut.v, y: cut.y - away * cut.u });
      }
    };
    this.surface.addEventListener("pointermove", move);
    this.surface.addEventListener("pointerup", () => this.surface.removeEventListener("pointermove", move), { once: true });
  }
  place(event) {
    const box = this.surface.getBoundingClientRect();
    return this.eye.at(event.clientX - box.left, event.clientY - box.top);
  }
  point(event) {
    const found = this.current();
    if (!found) return;
    const [x, y] = this.place(event), { cut } = this.studio, { layer, pattern } = found;
    const onCut = cut && Math.abs((x - cut.x) * cut.v - (y - cut.y) * cut.u) * this.eye.scale < 7;
    this.surface.style.cursor = onCut ? "move" : this.eye.pointers.size ? "grabbing" : "crosshair";
    const where = `x ${plain(x, 2)}, y ${plain(y, 2)} mm`;
    if (onCut) return this.studio.hover(null, "Section: drag to move, with Shift to turn");
    const shape = this.studio.shape(pattern.shape);
    const inside = contains(shape, x, y);
    const there = (index) => contains(this.studio.shape(this.studio.laminate.patterns[this.studio.layer(index).pattern].shape), x, y);
    const bond = inside && !layer.mask && this.studio.laminate.bonds.find(({ layers }) => (layers[0] === layer.index || layers.at(-1) === layer.index) && there(layers[0]) && there(layers.at(-1)) && !layers.slice(1, -1).some(there));
    this.studio.hover(inside ? layer : null, inside ? `${layerWords(layer)} · ${plain(nearest(shape, x, y), 2)} mm to its edge${bond ? ` · bonds ${bond.layers.map(String).join("–")}` : ""} · ${where}` : where);
  }
  goto(layer, x, y) {
    this.mark = [x, y];
    this.around.box.checked = true;
    this.studio.pick(layer);
    this.eye.goto(x, y, Math.max(4, (this.studio.laminate.bounds[2] - this.studio.laminate.bounds[0]) / 4));
  }
  async picture() { return { name: `${this.pattern}.svg`, blob: svgBlob(this.svg) }; }
}

export function inkOf(layer) { return layer.mask ? { fill: "var(--ptfe)", stroke: "var(--ptfe-line)" } : { fill: "var(--tpe)", stroke: "var(--tpe-line)" }; }
export const text = (words, x, y, anchor = "start", fill = "var(--ink)") => el("text", { x, y, "text-anchor": anchor, fill, "font-size": 12, "paint-order": "stroke", stroke: "var(--canvas)", "stroke-width": 3, "stroke-linejoin": "round" }, words);
export function check(words, on, changed) {
  const box = el("input", { type: "checkbox", onchange: changed });
  box.checked = on;
  return { box, label: el("label", {}, box, words) };
}
export function along(a, b, from, to, words) {
  const flat = a[1] === b[1];
  const tick = (p) => `M${p[0] - 3} ${p[1] + 3}L${p[0] + 3} ${p[1] - 3}`;
  const label = text(words, (a[0] + b[0]) / 2, (a[1] + b[1]) / 2 + (flat ? -4 : 0), "middle");
  if (!flat) label.setAttribute("transform", `rotate(-90 ${(a[0] + b[0]) / 2} ${(a[1] + b[1]) / 2}) translate(0 -5)`);
  const ends = flat ? `M${from[0]} ${from[1] + 5}V${a[1] + 5}M${to[0]} ${to[1] + 5}V${b[1] + 5}` : `M${from[0] - 5} ${from[1]}H${a[0] - 5}M${to[0] - 5} ${to[1]}H${b[0] - 5}`;
  return [el("path", { d: `M${a.join(" ")}L${b.join(" ")}${ends}${tick(a)}${tick(b)}`, stroke: "var(--faint)", fill: "none" }), label];
}
export function spread(wanted, gap, low, high) {
  const rows = [...wanted];
  for (let i = 0; i < rows.length; i++) rows[i] = Math.max(rows[i], i ? rows[i - 1] + gap : low);
  let most = high;
  for (let i = rows.length - 1; i >= 0; i--) { rows[i] = Math.min(rows[i], most); most = rows[i] - gap; }
  return rows;
}
// An SVG of its own: colours written out, size in pixels.
export function svgBlob(svg) {
  const copy = svg.cloneNode(true);
  const { width, height } = svg.getBoundingClientRect();
  for (const [name, value] of Object.entries({ xmlns: "http://www.w3.org/2000/svg", width, height, viewBox: `0 0 ${width} ${height}`, "font-family": "sans-serif" })) copy.setAttribute(name, value);
  copy.prepend(el("rect", { width, height, fill: css("--canvas") }));
  const words = new XMLSerializer().serializeToString(copy).replace(/var\((--[a-z-]+)\)/g, (_, name) => css(name));
  return new Blob([words], { type: "image/svg+xml" });
}
export { $ };
