// Two designs side by side with one zoom; what only one of them has is marked.
import { el, plain } from "./dom.js";
import { inStep } from "./panzoom.js";
import { pathOf } from "./shapes.js";
import { inkOf } from "./layers.js";
import { named, significant } from "./findings.js";

export class Compare {
  title = "Compare";
  constructor(studio) {
    this.studio = studio;
    this.role = el("select", { "aria-label": "Layer compared", onchange: () => this.draw() });
    this.halves = ["Before", "Now"].map((words, i) => {
      const svg = el("svg", { role: "img" }), name = el("h3", {}, words);
      const half = el("div", { class: "half" }, name, i ? this.role : null, svg);
      return { half, svg, name };
    });
    this.diffs = el("div", { class: "diffs" });
    this.element = el("div", { class: "view" }, el("div", { class: "surface compare" }, el("div", { class: "twin" }, ...this.halves.map(({ half }) => half)), this.diffs), el("div", { class: "stale-mark" }, "Updating"));
    this.eyes = inStep(this.halves, () => this.draw());
    studio.on("laminate reference figures checked theme", () => this.update());
  }
  show() { this.update(); }
  update() {
    const { reference, laminate } = this.studio;
    if (!reference || !laminate || this.element.hidden) return;
    const roles = kinds(laminate), before = kinds(reference.laminate), chosen = this.role.value;
    this.role.replaceChildren(...[...new Set([...roles.keys(), ...before.keys()])].map((name) => el("option", { value: name }, name)));
    if (chosen && [...this.role.options].some((option) => option.value === chosen)) this.role.value = chosen;
    const boxes = [reference.laminate.bounds, laminate.bounds];
    const box = [0, 1].map((i) => Math.min(...boxes.map((own) => own[i]))).concat([2, 3].map((i) => Math.max(...boxes.map((own) => own[i]))));
    this.eyes.forEach((eye) => eye.bounds(box, [34, 20, 20, 20]));
    this.halves[0].name.textContent = `Before: ${reference.name}`;
    this.halves[1].name.textContent = `Now: ${this.studio.designName}`;
    this.diffs.replaceChildren(differences(this.studio));
    this.draw();
  }
  draw() {
    const { reference, laminate } = this.studio;
    if (!reference || !laminate) return;
    const two = [reference.laminate, laminate].map((one) => ({ one, layer: kinds(one).get(this.role.value) }));
    const paths = two.map(({ one, layer }) => (layer ? pathOf(this.studio.shape(one.patterns[layer.pattern].shape)) : ""));
    this.halves.forEach(({ svg }, i) => {
      const eye = this.eyes[i], [ox, oy] = eye.px(0, 0), line = { "vector-effect": "non-scaling-stroke", "fill-rule": "evenodd" };
      svg.replaceChildren(el("g", { transform: `translate(${ox} ${oy}) scale(${eye.scale} ${-eye.scale})` },
        two[i].layer ? el("path", { d: paths[i], ...inkOf(two[i].layer), ...line }) : el("g"),
        // Even-odd of both shapes is what only one of them has.
        el("path", { d: paths[0] + paths[1], fill: "var(--ghost)", "fill-opacity": 0.45, ...line, class: "difference" }),
        el("path", { d: paths[1 - i], fill: "none", stroke: "var(--ghost)", "stroke-width": 1, "stroke-dasharray": "4 3", ...line })));
      svg.setAttribute("aria-label", `${i ? "Now" : "Before"}, ${this.role.value}`);
    });
  }
}
// The first layer of each kind, as both designs have it.
function kinds(laminate) {
  const found = new Map();
  for (const layer of laminate.layers) {
    const place = layer.balloon === 1 ? ", bottom" : layer.balloon === laminate.balloons ? ", top" : "";
    const name = `${layer.material} ${layer.role.replace("-", " ")}${place}`;
    if (!found.has(name)) found.set(name, layer);
  }
  return found;
}
function flat(table, prefix = "", found = new Map()) {
  for (const [key, value] of Object.entries(table ?? {})) {
    if (value && typeof value === "object" && !Array.isArray(value)) flat(value, `${prefix}${key}.`, found);
    else found.set(prefix + key, typeof value === "object" ? JSON.stringify(value) : String(value));
  }
  return found;
}
// What differs from the state that is kept: keys, rules, figures.
export function differences(studio) {
  const { reference, values, findings, prediction, laminate } = studio, rows = [];
  const head = (words) => rows.push(el("tr", {}, el("th", { colspan: 4, scope: "rowgroup" }, words)));
  const row = (name, a, b) => rows.push(el("tr", {}, el("td", {}, name), el("td", { class: "v" }, a), el("td", { class: "n" }, "→"), el("td", { class: "v" }, b)));
  const a = flat(reference.values), b = flat(values);
  const keys = [...new Set([...a.keys(), ...b.keys()])].filter((key) => a.get(key) !== b.get(key));
  head(keys.length ? "Keys" : "No key differs");
  for (const key of keys) row(key, a.get(key) ?? "–", b.get(key) ?? "–");
  if (laminate && laminate.thickness !== reference.laminate.thickness) row("thickness, mm", plain(reference.laminate.thickness), plain(laminate.thickness));
  const before = verdicts(reference.findings), now = verdicts(findings);
  const other = [...now.keys()].filter((name) => before.has(name) && before.get(name).words !== now.get(name).words);
  if (other.length) head("Rules");
  for (const name of other) row(now.get(name).label, before.get(name).words, now.get(name).words);
  const figures = new Map((reference.prediction?.figures ?? []).map((figure) => [named(figure), figure]));
  const moved = (prediction?.figures ?? []).filter((figure) => { const was = figures.get(named(figure)); return figure.design_with && was && significant(was.value) !== significant(figure.value); });
  if (moved.length) head("Prediction");
  for (const figure of moved) row(`${studio.family === "assembly" ? `${figure.group}: ` : ""}${figure.name}, ${figure.unit}${figure.measured ? ` (${figure.measured.sentence})` : ""}`, reached(figures.get(named(figure))), reached(figure));
  return el("table", { class: "figures" }, el("tbody", {}, ...rows));
}
// A figure with its 90 % interval.
function reached({ value, interval }) {
  return significant(value) + (interval ? ` (${interval.map((end) => significant(end)).join(" to ")})` : "");
}
// What each rule measured; one that measures several things, in their order.
function verdicts(findings) {
  const found = new Map();
  for (const { rule, design, verdict, measured, limit, unit } of findings) {
    const label = `${rule}${design ? ` of ${design}` : ""}${limit === null ? "" : `, limit ${plain(limit)} ${unit}`}`;
    let name = label;
    for (let i = 2; found.has(name); i++) name = `${label} ${i}`;
    found.set(name, { label, words: `${verdict} ${measured === null ? "" : plain(measured)}` });
  }
  return found;
}
