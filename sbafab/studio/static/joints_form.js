// Seams, folds and ports of drawn layers: their points on the drawing, their forms beside it; and the name of a shape.
import { el } from "./dom.js";
import { openPathOf } from "./shapes.js";
import { inward, kindOf, literal, parts, tableLiteral, writes } from "./sketch.js";

const NAME = /^[a-z][a-z0-9_-]{0,31}$/;
const TOOLS = ["laser", "hot-tip", "ultrasonic", "roller"];
const points = (list) => list.map((p) => p.join(" ")).join("; ");
const numbers = (text, least, most) => { const list = text.trim().split(/[\s,]+/).map(Number); return list.length >= least && list.length <= most && list.every(Number.isFinite) ? list : null; };
const readPoints = (least, most, each) => (text) => { const list = text.split(";").filter((part) => part.trim()).map((part) => numbers(part, 2, each)); return list.length >= least && list.length <= most && list.every(Boolean) ? list : null; };
const readLayers = (text) => { const list = numbers(text, 2, 2); return list?.every(Number.isInteger) ? list : null; };
// Columns of each kind: key, words, how a value is shown, how text is read (null: not taken), or what may be chosen.
const name = ["name", "Name", String, (text) => (NAME.test(text.trim()) ? text.trim() : null)];
const layers = ["layers", "Between layers", (pair) => pair.join(" "), readLayers];
const KINDS = {
  seams: { title: "Seams", one: "seam", columns: [name, layers, ["path", "Path: x y [bulge]; …, mm", points, readPoints(2, 1000, 3)], ["width", "Width, mm", String, (text) => { const w = numbers(text, 1, 1)?.[0]; return w > 0 ? w : null; }], ["tool", "Tool", TOOLS], ["kind", "Kind", ["lap", "fin"]]], fresh: (id, [x, y]) => ({ name: id, layers: [1, 2], path: [[x - 5, y], [x + 5, y]], width: 2, tool: "hot-tip" }) },
  folds: { title: "Folds", one: "fold", columns: [layers, ["line", "Line: x y; x y, mm", points, readPoints(2, 2, 2)]], fresh: (_, [x, y]) => ({ layers: [1, 2], line: [[x - 5, y], [x + 5, y]] }) },
  ports: { title: "Ports", one: "port", columns: [name, layers, ["at", "Place: x y, mm", (p) => p.join(" "), (text) => numbers(text, 2, 2)], ["kind", "Kind", ["place", "hole"]]], fresh: (id, p) => ({ name: id, layers: [1, 2], at: p }) },
};

// The key of each kind that holds its points.
const POINTS = { seams: "path", folds: "line", ports: "at" };

export class JointsForm {
  // `moved`: rows as the hand has them, until the file's values have caught up.
  constructor(draw) { Object.assign(this, { draw, moved: {} }); }
  // What the file says, without what it leaves to defaults.
  rows(kind) { return (this.moved[kind] ?? this.draw.studio.values?.[kind] ?? []).map((row) => Object.fromEntries(Object.entries(row).filter(([, value]) => value !== null && value !== false))); }
  heard() { for (const kind of Object.keys(this.moved)) if (![...this.draw.studio.pending.keys()].some((key) => key.startsWith(`${kind}.`))) delete this.moved[kind]; }
  // What can be dragged, as handles of shapes are; a seam along a shape's boundary goes with the shape.
  handles() {
    return Object.entries(POINTS).flatMap(([kind, key]) => this.rows(kind).flatMap((row, i) => {
      if (!row[key]) return [];
      const list = kind === "ports" ? [row.at] : row[key], title = row.name ?? `${KINDS[kind].one} ${i + 1}`;
      const words = (j) => (kind === "ports" ? `port ${title}` : `${title}, point ${j + 1}`);
      return list.map((p, j) => ({
        id: `${kind}-${i}-${j}`, joint: kind, words: words(j), p: p.slice(0, 2),
        beside: [j - 1, j + 1].filter((n) => list[n]).map((n) => [list[n][0], list[n][1], words(n)]),
        move: (to) => { const next = [...inward({}, to), ...p.slice(2)]; this.moveTo(kind, i, key, kind === "ports" ? next : row[key].with(j, next)); },
      }));
    }));
  }
  moveTo(kind, i, key, value) {
    const { draw } = this, rows = this.rows(kind);
    if (JSON.stringify(rows[i][key]) === JSON.stringify(value)) return;
    this.moved[kind] = rows.with(i, { ...rows[i], [key]: value });
    // The plan stays where it is under the hand.
    draw.eye.touched = true;
    draw.studio.edit([[`${kind}.${i}.${key}`, literal(value)]]);
    draw.fill();
    draw.draw();
  }
  // Seams as wide as they are made, and the lines of folds, in mm.
  lines() {
    const seams = this.rows("seams").filter(({ path }) => path).map(({ path, width }) => el("path", { d: openPathOf(path), fill: "none", stroke: "var(--select)", "stroke-opacity": 0.22, "stroke-width": width, class: "joint-seam" }));
    const folds = this.rows("folds").map(({ line }) => el("path", { d: openPathOf(line), fill: "none", stroke: "var(--select)", "stroke-width": 1.4, "stroke-dasharray": "7 4", "vector-effect": "non-scaling-stroke", class: "joint-fold" }));
    return [...seams, ...folds];
  }
  // Ports are rings, points of seams and folds turned squares.
  marks() {
    return this.handles().map(({ id, joint, p }) => {
      const [x, y] = this.draw.eye.px(...p), common = { "data-handle": id, stroke: "var(--select)", "stroke-width": 1.6, fill: "var(--canvas)" };
      return joint === "ports" ? el("circle", { cx: x, cy: y, r: 5, ...common }) : el("path", { d: `M${x - 5} ${y}L${x} ${y - 5}L${x + 5} ${y}L${x} ${y + 5}Z`, ...common });
    });
  }
  write(kind, rows) { this.draw.studio.edit([[kind, rows.length ? `[\n${rows.map((row) => `  ${tableLiteral(row)},\n`).join("")}]` : null]]); }
  text(id, label, value, read, send) {
    const input = el("input", { type: "text", "aria-label": label, value, "data-field": id, maxlength: 20000 });
    input.addEventListener("change", () => {
      const taken = read(input.value);
      input.setAttribute("aria-invalid", String(taken === null));
      if (taken === null) { this.draw.studio.emit("told", `${label}: ${input.value.slice(0, 40)} is not taken; it was ${value}.`); input.value = value; return; }
      input.defaultValue = input.value;
      if (JSON.stringify(taken) !== JSON.stringify(read(value))) send(taken);
    });
    return input;
  }
  field(kind, i, row, [key, words, shown, read]) {
    const id = `${kind}-${i}-${key}`, label = `${KINDS[kind].one} ${i + 1}: ${words}`, send = (value) => this.draw.studio.edit([[`${kind}.${i}.${key}`, literal(value)]]);
    if (Array.isArray(shown)) return el("select", { "aria-label": label, "data-field": id, onchange: (event) => send(event.target.value) }, ...shown.map((value) => el("option", { value, selected: value === (row[key] ?? shown[0]) }, value)));
    return this.text(id, label, shown(row[key]), read, send);
  }
  block(kind) {
    const { title, one, columns, fresh } = KINDS[kind], rows = this.rows(kind), { draw } = this;
    const taken = new Set(rows.map((row) => row.name));
    let id = one;
    for (let n = 2; taken.has(id); n++) id = `${one}${n}`;
    const middle = draw.eye.at(draw.eye.width / 2, draw.eye.height / 2).map((value) => Math.round(value));
    return el("details", { open: rows.length > 0 && rows.length < 4, class: `joints-${kind}` }, el("summary", {}, `${title} (${rows.length})`),
      ...rows.flatMap((row, i) => [
        el("h3", {}, row.name ?? `${one} ${i + 1}`),
        ...columns.filter(([key]) => key !== "path" || row.path).map((column) => draw.line(column[1], this.field(kind, i, row, column))),
        ...(row.shape ? [draw.line("Along the boundary of", el("span", {}, row.shape))] : []),
        el("div", { class: "line" }, el("button", { onclick: () => this.write(kind, rows.filter((_, j) => j !== i)) }, `Delete ${one}`)),
      ]),
      el("div", { class: "line" }, el("button", { onclick: () => this.write(kind, [...rows, fresh(id, middle)]) }, `Add ${one}`)));
  }
  blocks() { return Object.keys(KINDS).map((kind) => this.block(kind)); }

  // Another name for the chosen shape, wherever the file names it.
  renaming() {
    const { draw } = this, old = draw.name;
    const read = (text) => { const next = text.trim(); return next === old || (NAME.test(next) && !(next in draw.shapes)) ? next : null; };
    return draw.line("Name", this.text("shape-name", "Name of the shape", old, read, (next) => this.rename(old, next)));
  }
  rename(old, next) {
    const { draw } = this, { values } = draw.studio, swap = (value) => (value === old ? next : value);
    const edits = [[`shapes.${next}`, tableLiteral(draw.shapes[old])]], shapes = {};
    for (const [other, shape] of Object.entries(draw.shapes)) {
      const kind = kindOf(shape), value = shape[kind];
      const after = parts(shape).includes(old) ? { ...shape, [kind]: Array.isArray(value) ? value.map(swap) : swap(value) } : shape;
      if (other !== old) edits.push(...writes(other, shape, after));
      shapes[swap(other)] = after;
    }
    for (const [list, rows] of [["layers", draw.layers], ["seams", values.seams ?? []]]) rows.forEach((row, i) => { if (row.shape === old) edits.push([`${list}.${i}.shape`, JSON.stringify(next)]); });
    if (values.body === old) edits.push(["body", JSON.stringify(next)]);
    Object.assign(draw, { shapes, name: next, shape: shapes[next] });
    draw.studio.edit([...edits, [`shapes.${old}`, null]]);
  }
}
