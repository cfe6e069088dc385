// Shapes of a design file drawn over the plan: points dragged, added and typed, edges bent to arcs, all snapping.
import { $, el, plain } from "./dom.js";
import { PanZoom, niceBar } from "./panzoom.js";
import { check, inkOf, svgBlob, text } from "./layers.js";
import { contains, pathOf } from "./shapes.js";
import { KINDS, apex, bend, bulgeThrough, corners, dependents, edgeWords, edges, guidesThrough, handles, hasCorners, inserted, kindOf, nearestOn, outline, outward, parts, snapped, snappedBulge, tableLiteral, targetsOf, without, withCorners, writes } from "./sketch.js";
import { JointsForm } from "./joints_form.js";
import { NewShape } from "./new_shape.js";

const GRIDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 5];
// Pixels within which a handle is taken, and a place snaps.
const NEAR = 9, SNAP = 6;
const HELP = "On the drawing: N and P step through the points, arrows move the point by the grid (with Shift ten times as far), I adds one, A bends or straightens the edge after it, Delete takes it out, Escape lets go. Alt while dragging does not snap; Shift takes a point of a seam, fold or port where one of the shape lies on it.";

export class Draw {
  title = "Draw";
  constructor(studio) {
    this.studio = studio;
    this.named = new Map();
    this.pick = el("select", { "aria-label": "Shape", onchange: () => this.choose(this.pick.value) });
    this.tools = {
      add: el("button", { title: "Add a point to the edge after the chosen point (I, or double-click an edge)", onclick: () => this.addPoint() }, "Add point"),
      arc: el("button", { title: "Bend or straighten the edge after the chosen point (A)", onclick: () => this.toggleArc() }, "Arc"),
      remove: el("button", { title: "Take the chosen point out (Delete)", onclick: () => this.removePoint() }, "Delete point"),
    };
    this.fresh = new NewShape(this);
    this.joints = new JointsForm(this);
    this.bar = el("div", { class: "draw-bar" }, el("label", {}, "Shape", this.pick), el("button", { id: "new-shape", "aria-expanded": "false", onclick: () => this.fresh.toggle() }, "New shape"), el("span", { class: "grow" }), el("div", { class: "group", role: "group", "aria-label": "Chosen point" }, ...Object.values(this.tools)));
    this.svg = el("svg", { role: "img", "aria-label": "Shape in plan" });
    this.surface = el("div", { class: "surface", role: "application", "aria-label": "Drawing; keys are listed beside it" }, this.svg);
    this.grid = el("select", { "aria-label": "Grid, mm", onchange: () => this.draw() }, ...GRIDS.map((step) => el("option", { value: step }, `${step} mm`)));
    this.grid.value = "0.5";
    this.snaps = Object.fromEntries([["grid", "Grid"], ["points", "Points"], ["edges", "Edges"], ["angles", "Angles"]].map(([name, words]) => [name, check(words, true, () => this.draw())]));
    this.others = check("Other layers", true, () => this.draw());
    this.side = el("div", { class: "side", role: "group", "aria-label": "Chosen shape" });
    this.element = el("div", { class: "view draw" }, el("div", { class: "frame" }, this.bar,
      el("div", { class: "stage-draw" }, this.surface, el("div", { class: "tools" }, el("span", {}, "Snap to"), this.snaps.grid.label, this.grid, this.snaps.points.label, this.snaps.edges.label, this.snaps.angles.label, this.others.label, el("button", { onclick: () => { this.eye.touched = false; this.eye.fit(); } }, "Fit")), el("div", { class: "stale-mark" }, "Updating")),
      this.side));
    this.eye = new PanZoom(this.surface, () => this.draw());
    for (const [name, act] of [["pointerdown", this.grab], ["dblclick", this.doubled], ["keydown", this.key]]) this.surface.addEventListener(name, (event) => act.call(this, event), { capture: true });
    this.surface.addEventListener("pointermove", (event) => this.point(event));
    this.surface.addEventListener("pointerleave", () => { this.snap = null; studio.hover(null); this.draw(); });
    this.surface.addEventListener("click", (event) => { if (!this.sketching && this.eye.dragged <= 3) this.chooseUnder(event); });
    studio.on("design", () => this.load());
    studio.on("shapes", (named) => this.heard(named));
    studio.on("opened", () => { this.eye.touched = false; Object.assign(this, { name: null, shapes: null, shape: null, corner: null, sketching: null, mark: null }); this.joints.moved = {}; this.fresh.close(); });
    studio.on("laminate", () => { if (studio.laminate) this.eye.bounds(studio.laminate.bounds, this.margin); });
    studio.on("laminate checked failed theme pick", () => this.draw());
    studio.on("design failed laminate", () => this.warn());
  }
  get present() { const { values } = this.studio; return Boolean(values?.shapes && values?.layers); }
  show() { this.load(); this.eye.margin = this.margin; this.eye.touched ? this.draw() : this.eye.fit(); }
  hide() { this.sketching = null; }
  // The plan stands clear of the tools, which take two rows on a phone.
  get margin() { return [34, 30, 40 + $(".tools", this.element).offsetHeight, 30]; }

  // The file's shapes, unless the hand is quicker than the answers.
  load() {
    if (!this.present || this.dragging || [...this.studio.pending.keys()].some((key) => key.startsWith("shapes."))) return;
    this.joints.heard();
    this.shapes = this.studio.values.shapes;
    this.layers = this.studio.values.layers;
    const names = Object.keys(this.shapes);
    if (!names.includes(this.name)) this.name = names.find((name) => hasCorners(this.shapes[name])) ?? names.find((name) => handles(this.shapes[name]).length) ?? names[0];
    this.shape = this.shapes[this.name];
    if (this.corner !== null && this.corner >= corners(this.shape ?? {}).length) this.corner = null;
    this.options();
    // What is half typed stays.
    const typed = document.activeElement;
    if (!this.side.contains(typed) || typed.tagName !== "INPUT" || typed.value === typed.defaultValue) this.fill();
    this.draw();
  }
  heard(named) {
    this.named = new Map(Object.entries(named).map(([name, key]) => [name, key === null ? [] : this.studio.shape(key)]));
    this.targets = null;
    this.draw();
  }
  options() {
    const uses = (name) => { const of = this.layers.flatMap((layer, i) => (layer.shape === name ? [i + 1] : [])); return of.length ? `layer${of.length > 1 ? "s" : ""} ${of.join(", ")}` : ""; };
    this.pick.replaceChildren(...[["Layers", (name) => uses(name)], ["Shapes that others are made of", (name) => !uses(name)]].map(([label, belongs]) => el("optgroup", { label }, ...Object.keys(this.shapes).filter(belongs).map((name) => el("option", { value: name }, uses(name) ? `${name} (${uses(name)})` : name)))).filter((group) => group.children.length));
    this.pick.value = this.name;
  }
  choose(name) {
    if (!this.shapes?.[name]) return;
    Object.assign(this, { name, shape: this.shapes[name], corner: null, targets: null });
    this.pick.value = name;
    this.fill();
    this.draw();
  }

  // One change: shown at once, then written into the text; the rules follow.
  change(shape) {
    const edits = writes(this.name, this.shape, shape);
    if (!edits.length) return;
    this.shape = shape;
    this.shapes = { ...this.shapes, [this.name]: shape };
    // The plan stays where it is under the hand.
    this.eye.touched = true;
    this.studio.edit(edits);
    this.fill();
    this.draw();
  }
  // What the chosen shape does not carry along is there to snap to; all shapes where none moves.
  snapTargets(all = false) {
    if (!this.targets || this.targets.all !== all) {
      const moving = all ? new Set() : dependents(this.shapes, this.name);
      const still = [...this.named].filter(([name]) => !moving.has(name)).map(([name, contours]) => ({ words: name, contours }));
      const { points, lines } = targetsOf(still);
      points.push({ p: [0, 0], words: "origin" });
      for (const { name, centres, mouth } of this.studio.values?.chambers ?? []) points.push(...(centres ?? []).map((p) => ({ p, words: `centre of ${name}` })), ...(mouth ? [{ p: mouth, words: `mouth of ${name}` }] : []));
      this.targets = { points, lines, all };
    }
    return this.targets;
  }
  snapAt(p, event, neighbours, others = [], all = false) {
    if (event.altKey) return { p, words: "" };
    const { points, lines } = this.snapTargets(all), on = (name) => this.snaps[name].box.checked;
    return snapped(p, { reach: SNAP / this.eye.scale, points: on("points") ? [...points, ...others] : [], lines: on("edges") ? lines : [], guides: on("angles") ? guidesThrough(neighbours, true) : [], grid: on("grid") ? Number(this.grid.value) : 0 });
  }
  neighbours(i) {
    const list = corners(this.shape), count = list.length;
    return [...new Set([(i + count - 1) % count, (i + 1) % count])].filter((j) => j !== i).map((j) => [...outward(this.shape, [list[j].x, list[j].y]), `point ${j + 1}`]);
  }
  addPoint(i = this.corner ?? 0, share = 0.5) {
    if (!hasCorners(this.shape)) return;
    this.corner = i + 1;
    this.change(inserted(this.shape, i, share));
  }
  removePoint() {
    if (this.corner === null) return;
    const shape = without(this.shape, this.corner);
    if (!shape) { this.studio.emit("told", "A shape keeps three points, or two where an edge is an arc."); return; }
    this.corner = Math.min(this.corner, corners(shape).length - 1);
    this.change(shape);
  }
  toggleArc(i = this.corner ?? 0) { if (hasCorners(this.shape)) { this.corner = i; this.change(bend(this.shape, i, corners(this.shape)[i].b ? 0 : 1)); } }

  // The pointer: a handle is dragged, an edge chosen; elsewhere the plan moves.
  place(event) { const box = this.surface.getBoundingClientRect(); return this.eye.at(event.clientX - box.left, event.clientY - box.top); }
  under(event) {
    const [x, y] = this.place(event), reach = (event.pointerType === "touch" ? 2.2 : 1) * NEAR / this.eye.scale;
    const near = [...handles(this.shape ?? {}), ...this.joints.handles()].map((handle) => ({ handle, away: Math.hypot(handle.p[0] - x, handle.p[1] - y) })).filter(({ away }) => away <= reach);
    // A point lies over the middle of an edge; of a shape's and a seam's in one place Shift takes the seam's.
    near.sort((a, b) => (event.shiftKey ? !a.handle.joint - !b.handle.joint : 0) || (a.handle.edge !== undefined) - (b.handle.edge !== undefined) || a.away - b.away);
    if (near.length) return { handle: near[0].handle };
    const all = edges(outline(this.shape ?? {})).map((edge, i) => { const [px, py, share] = nearestOn(edge, x, y); return { edge: i, share, away: Math.hypot(px - x, py - y) }; }).filter(({ away }) => away <= reach * 0.7).sort((a, b) => a.away - b.away);
    return all[0] ?? null;
  }
  grab(event) {
    if (event.button || !this.shape) return;
    this.surface.focus({ preventScroll: true });
    if (this.sketching) { event.preventDefault(); this.sketchAt(event); return; }
    const hit = this.under(event);
    if (!hit) return;
    event.preventDefault();
    if (hit.handle === undefined) { this.corner = hasCorners(this.shape) ? hit.edge : null; this.fill(); this.draw(); return; }
    const { handle } = hit;
    this.corner = handle.corner ?? handle.edge ?? this.corner;
    this.fill();
    this.surface.setPointerCapture(event.pointerId);
    const start = this.shape, [x0, y0] = [event.clientX, event.clientY];
    this.dragging = false;
    const move = (now) => {
      if (!this.dragging && Math.hypot(now.clientX - x0, now.clientY - y0) < 3) return;
      if (!this.dragging) { this.dragging = true; this.studio.commit(); this.studio.holding = true; }
      this.drag(handle, start, now);
    };
    const up = () => {
      this.surface.removeEventListener("pointermove", move);
      const moved = this.dragging;
      Object.assign(this, { dragging: false, snap: null });
      this.studio.holding = false;
      if (moved) { this.studio.settle(); this.load(); }
      this.draw();
    };
    this.surface.addEventListener("pointermove", move);
    for (const end of ["pointerup", "pointercancel"]) this.surface.addEventListener(end, up, { once: true });
    this.draw();
  }
  drag(handle, start, event) {
    const p = this.place(event);
    if (handle.joint) {
      this.snap = this.snapAt(p, event, handle.beside, this.joints.handles().filter(({ id }) => id !== handle.id), true);
      handle.move(this.snap.p);
      this.words(this.snap.p, [handle.words, this.snap.words].filter(Boolean).join(" · "));
      return;
    }
    if (handle.edge !== undefined) {
      const edge = edges(outline(start))[handle.edge], chord = Math.hypot(edge.x1 - edge.x0, edge.y1 - edge.y0);
      const raw = bulgeThrough(edge, p), { b, words } = event.altKey ? { b: raw, words: "" } : snappedBulge(start, handle.edge, raw, (2 * NEAR) / this.eye.scale / chord);
      this.snap = { p: apex({ ...edge, b }), words };
      this.change(bend(start, handle.edge, b));
      this.words(this.snap.p, [edgeWords({ ...edge, b }), words].filter(Boolean).join(" · "));
      return;
    }
    this.snap = this.snapAt(p, event, handle.corner === undefined ? [] : this.neighbours(handle.corner));
    this.change(handle.move(this.snap.p));
    if (handle.size) this.snap = { ...this.snap, words: `${handle.words} ${this.sizeOf(handle)} mm` };
    this.words(this.snap.p, this.snap.words);
  }
  sizeOf({ id }) {
    const { disc, ring, width, stadium } = this.shape;
    return plain({ size: disc ?? width, outer: ring?.[0], inner: ring?.[1], width: stadium?.[0] ?? width, length: stadium?.[1] }[id] ?? 0, 3);
  }
  doubled(event) {
    const hit = this.shape && !this.sketching && this.under(event);
    if (!hit && !this.sketching) return;
    event.stopPropagation();
    event.preventDefault();
    if (hit && hasCorners(this.shape) && hit.handle?.corner === undefined && !hit.handle?.joint) this.addPoint(hit.edge ?? hit.handle.edge, hit.share ?? 0.5);
  }
  chooseUnder(event) {
    const [x, y] = this.place(event), reach = NEAR / this.eye.scale;
    if (!this.shape || this.under(event)) return;
    const at = (contours) => edges(contours).some((edge) => { const [px, py] = nearestOn(edge, x, y); return Math.hypot(px - x, py - y) <= reach; });
    const names = [...this.named].filter(([name, contours]) => name !== this.name && at(contours)).map(([name]) => name);
    // What has points of its own comes before what is made of it.
    const next = names.find((name) => handles(this.shapes[name]).length) ?? names[0];
    if (next) this.choose(next);
    else if (this.corner !== null) { this.corner = null; this.fill(); this.draw(); }
  }
  point(event) {
    if (this.dragging || !this.shapes) return;
    const p = this.place(event);
    if (this.sketching) { this.snap = this.sketchSnap(event); this.words(this.snap.p, this.snap.words); this.draw(); return; }
    const hit = this.eye.pointers.size ? null : this.under(event);
    this.surface.style.cursor = hit?.handle ? (hit.handle.edge === undefined ? "move" : "ns-resize") : hit ? "pointer" : this.eye.pointers.size ? "grabbing" : "crosshair";
    const inside = [...this.named].filter(([, contours]) => contains(contours, ...p)).map(([name]) => name);
    this.words(p, hit?.handle?.words ?? (hit ? `edge ${hit.edge + 1}, ${edgeWords(edges(outline(this.shape))[hit.edge])}` : inside.length ? `inside ${inside.join(", ")}` : ""));
  }
  words([x, y], words = "") { this.studio.hover(null, `x ${plain(x, 3)}, y ${plain(y, 3)} mm${words ? ` · ${words}` : ""}`); }

  // A new path, point by point; the first point, Enter or a double click closes it.
  sketch(done) {
    this.sketching = { list: [], done };
    this.surface.focus();
    this.draw();
  }
  sketchSnap(event) {
    const { list } = this.sketching, [first] = list, last = list.at(-1);
    return this.snapAt(this.place(event), event, last ? [[...last, "the last point"]] : [], list.length > 2 ? [{ p: first, words: "first point: closes the shape", closes: true }] : []);
  }
  sketchAt(event) {
    const { list } = this.sketching, { p } = this.sketchSnap(event);
    if (list.length > 2 && Math.hypot(p[0] - list[0][0], p[1] - list[0][1]) < 1e-6) { this.sketchEnd(); return; }
    if (!list.length || Math.hypot(p[0] - list.at(-1)[0], p[1] - list.at(-1)[1]) > 1e-6) list.push(p.map((value) => Number(value.toFixed(6))));
    this.draw();
  }
  sketchEnd() {
    const { list, done } = this.sketching;
    if (list.length < 3) { this.studio.emit("told", "A shape needs three points; click one more, or press Escape."); return; }
    this.sketching = null;
    this.snap = null;
    done(list);
  }

  key(event) {
    const { corner } = this, count = corners(this.shape ?? {}).length, step = Number(this.grid.value) * (event.shiftKey ? 10 : 1);
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const move = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] }[event.key];
    const does = this.sketching
      ? { Enter: () => this.sketchEnd(), Escape: () => { this.sketching = null; this.draw(); }, Backspace: () => { this.sketching.list.pop(); this.draw(); } }[event.key]
      : move && corner !== null ? () => this.nudge(move)
      : { n: () => this.at((corner ?? -1) + 1), p: () => this.at((corner ?? count) - 1), i: () => this.addPoint(), a: () => this.toggleArc(), Delete: () => this.removePoint(), Backspace: () => this.removePoint(), Escape: () => this.at(null) }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!does || (!count && !this.sketching)) return;
    event.preventDefault();
    event.stopPropagation();
    does();
  }
  at(corner) { const count = corners(this.shape).length; this.corner = corner === null ? null : (corner + count) % count; this.fill(); this.draw(); this.say(); }
  say() { if (this.corner === null) return; const { x, y } = corners(this.shape)[this.corner]; this.words([x, y], `point ${this.corner + 1}`); }
  nudge([dx, dy]) {
    const list = corners(this.shape), { x, y } = list[this.corner], p = outward(this.shape, [x, y]);
    const handle = handles(this.shape).find((one) => one.corner === this.corner);
    this.change(handle.move([p[0] + dx, p[1] + dy]));
    this.say();
  }

  // The panel beside: an error first, then points or sizes, place and use.
  warn() {
    const { error } = this.studio, box = $(".draw-why", this.side);
    if (box) { box.hidden = !error; box.textContent = error ? `Views and rules show the last good design, for now ${error.message}.` : ""; }
  }
  fill() {
    if (!this.shape) { this.side.replaceChildren(el("p", { class: "fallback" }, "This design names no shape yet.")); return; }
    const kind = kindOf(this.shape), before = document.activeElement, focused = before?.dataset?.field, { scrollTop } = this.side;
    for (const [name, button] of Object.entries(this.tools)) button.disabled = !hasCorners(this.shape) || (name !== "add" && this.corner === null);
    const bent = hasCorners(this.shape) && this.corner !== null && corners(this.shape)[this.corner]?.b;
    this.tools.arc.textContent = bent ? "Straighten" : "Arc";
    if (this.fresh.open) return;
    this.side.replaceChildren(el("p", { class: "draw-why", role: "alert", hidden: true }), el("div", {}, el("h3", {}, `${this.name}: ${KINDS[kind].toLowerCase()}`), this.joints.renaming(), ...(hasCorners(this.shape) ? this.table() : this.sizes(kind)), ...this.placing()), el("div", {}, ...this.uses(), el("p", { class: "keys" }, HELP)));
    this.warn();
    this.side.scrollTop = scrollTop;
    const now = focused && this.side.querySelector(`[data-field="${focused}"]`);
    if (now) {
      // What was selected stays selected, so that the next key replaces it.
      now.focus();
      now.setSelectionRange(before.selectionStart, before.selectionEnd === before.value.length ? now.value.length : before.selectionEnd);
    }
    this.side.querySelector("tr[aria-current]")?.scrollIntoView({ block: "nearest" });
  }
  field(id, label, value, send, { least = -Infinity, digits = 6 } = {}) {
    const input = el("input", { type: "text", inputmode: "decimal", "aria-label": label, value: plain(value, digits), "data-field": id });
    const take = () => {
      const typed = Number(input.value.replace(",", "."));
      if (input.value.trim() === "" || !Number.isFinite(typed) || typed <= least) { input.value = plain(value, digits); return; }
      input.defaultValue = input.value;
      if (typed !== Number(plain(value, digits))) send(typed);
    };
    input.addEventListener("change", take);
    input.addEventListener("keydown", (event) => { if (event.key === "Enter") take(); });
    return input;
  }
  table() {
    const list = corners(this.shape), degrees = (b) => (4 * Math.atan(b) * 180) / Math.PI;
    const rows = list.map((point, i) => {
      const put = (key) => (value) => this.change(withCorners(this.shape, list.with(i, { ...point, [key]: value })));
      const row = el("tr", { "aria-current": i === this.corner ? "true" : false, onfocusin: () => { if (this.corner !== i) { this.corner = i; this.markRow(); this.draw(); } } },
        el("td", {}, String(i + 1)), el("td", {}, this.field(`${i}-x`, `Point ${i + 1}, x, mm`, point.x, put("x"))), el("td", {}, this.field(`${i}-y`, `Point ${i + 1}, y, mm`, point.y, put("y"))),
        el("td", {}, this.field(`${i}-arc`, `Edge after point ${i + 1}, arc in degrees, 0 for straight`, degrees(point.b), (value) => this.change(bend(this.shape, i, Math.tan((Math.max(-358, Math.min(358, value)) * Math.PI) / 720))), { digits: 3 })));
      return row;
    });
    return [el("table", { class: "points" }, el("thead", {}, el("tr", {}, el("th", {}, ""), el("th", {}, "x, mm"), el("th", {}, "y, mm"), el("th", { title: "Angle of the arc to the next point: 0 straight, 180 half a circle, less than 0 bends to the other side" }, "Arc, °"))), el("tbody", {}, ...rows))];
  }
  markRow() {
    this.side.querySelectorAll(".points tbody tr").forEach((row, i) => (i === this.corner ? row.setAttribute("aria-current", "true") : row.removeAttribute("aria-current")));
    for (const [name, button] of Object.entries(this.tools)) button.disabled = !hasCorners(this.shape) || (name !== "add" && this.corner === null);
    this.tools.arc.textContent = this.corner !== null && corners(this.shape)[this.corner]?.b ? "Straighten" : "Arc";
  }
  line(label, ...controls) { return el("div", { class: "line" }, el("span", {}, label), ...controls); }
  sizes(kind) {
    const { shape } = this, put = (key) => (value) => this.change({ ...this.shape, [key]: value });
    const pair = (key, words) => words.map((label, i) => this.line(label, this.field(`${key}-${i}`, `${label}, mm`, shape[key][i], (value) => put(key)(shape[key].with(i, value)), { least: 0 })));
    const point = (key, label, value, send) => this.line(label, ...["x", "y"].map((axis, i) => this.field(`${key}-${axis}`, `${label}, ${axis}, mm`, value[i], (typed) => send(value.with(i, typed)))));
    const lines = {
      disc: () => [this.line("Diameter, mm", this.field("disc", "Diameter, mm", shape.disc, put("disc"), { least: 0 }))],
      ring: () => pair("ring", ["Outer diameter, mm", "Inner diameter, mm"]),
      stadium: () => pair("stadium", ["Width along x, mm", "Length along y, mm"]),
      slot: () => [...shape.slot.map((end, i) => point(`end${i}`, `End ${i + 1}: x, y, mm`, end, (p) => put("slot")(shape.slot.with(i, p)))), this.line("Width, mm", this.field("width", "Width, mm", shape.width, put("width"), { least: 0 }))],
      offset: () => [this.line("Grown by, mm", this.field("by", "Grown by, mm", shape.by, put("by")))],
      fillet: () => [this.line("Radius, mm", this.field("radius", "Radius, mm", shape.radius, put("radius"), { least: 0 }))],
      pattern: () => [this.line("Copies", this.field("count", "Copies", shape.count, (value) => put("count")(Math.max(1, Math.round(value))))), ...["round", "step"].filter((key) => shape[key]).map((key) => point(key, key === "round" ? "Round the point x, y, mm" : "Step x, y, mm", shape[key], put(key)))],
    }[kind]?.() ?? [];
    const of = parts(shape);
    const made = of.length ? [this.line(kind === "difference" ? "First shape, then those cut out" : "Made of", el("span", { class: "names" }, ...of.map((name) => el("button", { onclick: () => this.choose(name) }, name))))] : [];
    const points = kind === "ring" ? [] : this.asPoints();
    return [...lines, ...made, ...points];
  }
  // Any outline without holes can go on as points and arcs.
  asPoints() {
    const contours = handles(this.shape).length ? outline(this.shape) : this.named.get(this.name) ?? [];
    if (contours.length !== 1) return [];
    const [contour] = contours;
    const turned = () => this.change({ path: Array.from({ length: contour.length / 3 }, (_, i) => { const [x, y, b] = contour.slice(3 * i, 3 * i + 3); const p = [x, y].map((value) => Number(value.toFixed(6)) || 0); return b ? [...p, Number(b.toPrecision(15))] : p; }) });
    return [el("div", { class: "line" }, el("button", { title: "Replaces this shape by its outline as it is now; what it was made of no longer moves it", onclick: turned }, "Turn into points and arcs"))];
  }
  placing() {
    const { shape } = this, at = shape.at ?? [0, 0];
    return [el("h3", {}, "Place"), this.line("Moved by x, y, mm", ...["x", "y"].map((axis, i) => this.field(`at-${axis}`, `Moved by ${axis}, mm`, at[i], (value) => this.change({ ...this.shape, at: at.with(i, value) })))), this.line("Turned by, °", this.field("turned", "Turned by, degrees", shape.turned ?? 0, (value) => this.change({ ...this.shape, turned: value })))];
  }
  uses() {
    const users = Object.keys(this.shapes).filter((name) => parts(this.shapes[name]).includes(this.name));
    const names = Object.keys(this.shapes);
    const rows = this.layers.map((layer, i) => this.line(`${i + 1} ${layer.role.replace("-", " ")}`, el("select", { "aria-label": `Shape of layer ${i + 1}`, "data-field": `layer-${i}`, onchange: (event) => this.studio.edit([[`layers.${i}.shape`, JSON.stringify(event.target.value)]]) }, ...names.map((name) => el("option", { value: name, selected: name === layer.shape }, name)))));
    const idle = !users.length && !this.layers.some((layer) => layer.shape === this.name) && this.studio.values.body !== this.name;
    return [
      ...(users.length ? [el("h3", {}, "Part of"), el("div", { class: "line" }, el("span", { class: "names" }, ...users.map((name) => el("button", { onclick: () => this.choose(name) }, name))))] : []),
      ...(idle ? [el("div", { class: "line" }, el("span", {}, "No layer uses this shape."), el("button", { onclick: () => { const { name } = this; this.name = null; this.studio.edit([[`shapes.${name}`, null]]); } }, "Delete shape"))] : []),
      el("h3", {}, "Shape of each layer"), ...rows, ...this.joints.blocks(),
    ];
  }
  // A shape that the form beside has filled in.
  add(name, shape, layer) {
    this.shapes = { ...this.shapes, [name]: shape };
    this.studio.edit([[`shapes.${name}`, tableLiteral(shape)], ...(layer === null ? [] : [[`layers.${layer}.shape`, JSON.stringify(name)]])]);
    this.name = name;
    this.choose(name);
  }

  draw() {
    if (!this.surface.clientWidth || !this.shapes || this.element.hidden) return;
    const { eye, studio } = this;
    const [ox, oy] = eye.px(0, 0), moving = dependents(this.shapes, this.name), line = { "vector-effect": "non-scaling-stroke", "fill-rule": "evenodd" };
    const world = el("g", { transform: `translate(${ox} ${oy}) scale(${eye.scale} ${-eye.scale})` });
    for (const layer of studio.laminate ? Object.values(studio.laminate.patterns).map((pattern) => studio.layer(pattern.layers[0])) : []) {
      const uses = this.layers.some((row, i) => moving.has(row.shape) && studio.layer(i + 1)?.pattern === layer.pattern);
      if (!uses && !this.others.box.checked) continue;
      const { fill, stroke } = inkOf(layer);
      world.append(el("path", { d: pathOf(studio.shape(studio.laminate.patterns[layer.pattern].shape)), fill: uses ? fill : "none", "fill-opacity": 0.28, stroke, "stroke-opacity": uses ? 0.7 : 0.5, "stroke-width": 1, "stroke-dasharray": uses ? "none" : "5 4", ...line }));
    }
    const drawn = handles(this.shape ?? {}).length ? outline(this.shape) : this.named.get(this.name) ?? [];
    if (!this.sketching) world.append(el("path", { id: "drawn-shape", d: pathOf(drawn), fill: "var(--accent)", "fill-opacity": 0.1, stroke: "var(--accent)", "stroke-width": 2, ...line }));
    world.append(...this.joints.lines());
    this.svg.replaceChildren(el("g", {}, ...this.gridLines()), world, ...this.axes(), ...this.labels(drawn), ...this.handleMarks(), ...(this.sketching ? [] : this.joints.marks()), ...this.findingMarks(), ...this.sketchMarks(), ...this.snapMark(), ...this.errorMark(), ...this.scaleBar());
    this.svg.setAttribute("aria-label", `${this.name}: ${KINDS[kindOf(this.shape)] ?? ""}, ${corners(this.shape ?? {}).length} points`);
  }
  gridLines() {
    const { eye } = this, fine = Number(this.grid.value), step = this.snaps.grid.box.checked && fine * eye.scale >= 7 ? fine : niceBar(eye.scale, 60), lines = [];
    const [x0, y1] = eye.at(0, 0), [x1, y0] = eye.at(eye.width, eye.height);
    for (let i = Math.ceil(x0 / step); i * step < x1; i++) lines.push(el("line", { x1: eye.px(i * step, 0)[0], x2: eye.px(i * step, 0)[0], y1: 0, y2: eye.height, stroke: "var(--grid)" }));
    for (let i = Math.ceil(y0 / step); i * step < y1; i++) lines.push(el("line", { y1: eye.px(0, i * step)[1], y2: eye.px(0, i * step)[1], x1: 0, x2: eye.width, stroke: "var(--grid)" }));
    return lines;
  }
  axes() {
    const [x, y] = this.eye.px(0, 0);
    return [el("path", { d: `M0 ${y}H${this.eye.width}M${x} 0V${this.eye.height}`, stroke: "var(--faint)", "stroke-width": 0.6, "stroke-dasharray": "10 4 2 4", fill: "none" })];
  }
  // Lengths of the edges beside the chosen point.
  labels(drawn) {
    this.spots = [];
    if (this.corner === null || !hasCorners(this.shape)) return [];
    const all = edges(drawn), count = all.length;
    return [...new Set([this.corner, (this.corner + count - 1) % count])].map((i) => {
      const [ax, ay] = this.eye.px(...apex(all[i])), [x0, y0] = this.eye.px(all[i].x0, all[i].y0), [x1, y1] = this.eye.px(all[i].x1, all[i].y1), l = Math.hypot(x1 - x0, y1 - y0) || 1;
      // Beside the edge, to its right: outside where points go round counter-clockwise.
      const u = -(y1 - y0) / l, v = (x1 - x0) / l;
      this.spots.push([ax + u * 12, ay + v * 16 + 4]);
      const words = edgeWords(all[i]), room = 20 + 7 * words.length, beside = (u > 0.4 && ax + room > this.eye.width) || (u < -0.4 && ax < room) ? -1 : 1;
      return text(words, ax + beside * u * 12, ay + v * 16 + 4, beside * u > 0.4 ? "start" : beside * u < -0.4 ? "end" : "middle");
    });
  }
  handleMarks() {
    if (this.sketching) return [];
    return handles(this.shape ?? {}).map((handle) => {
      const [x, y] = this.eye.px(...handle.p), chosen = handle.corner !== undefined && handle.corner === this.corner, ink = chosen ? "var(--select)" : "var(--accent)";
      const common = { "data-handle": handle.id, stroke: ink, "stroke-width": 1.6, fill: chosen ? "var(--select)" : "var(--canvas)" };
      if (handle.edge !== undefined) return el("circle", { cx: x, cy: y, r: 3.4, ...common, "stroke-width": 1.2 });
      if (handle.size) return el("path", { d: `M${x - 5} ${y}L${x} ${y - 5}L${x + 5} ${y}L${x} ${y + 5}Z`, ...common });
      return el("rect", { x: x - 4.5, y: y - 4.5, width: 9, height: 9, rx: 1, ...common });
    });
  }
  // What the rules found wrong, at its place.
  findingMarks() {
    if (this.studio.stale.rules) return [];
    const bad = this.studio.findings.filter(({ verdict, where }) => verdict === "fail" && where.x !== null && where.x !== undefined);
    return bad.flatMap(({ rule, where }) => {
      const [x, y] = this.eye.px(where.x, where.y);
      let low = y + 4;
      while (this.spots.some((spot) => Math.abs(spot[0] - x) < 110 && Math.abs(spot[1] - low) < 13)) low += 14;
      this.spots.push([x, low]);
      return [el("circle", { cx: x, cy: y, r: 9, fill: "none", stroke: "var(--fail)", "stroke-width": 2, class: "finding-place", "data-rule": rule }), text(rule, x + 13, low, "start", "var(--fail)")];
    });
  }
  errorMark() {
    const at = /x (-?[\d.]+), y (-?[\d.]+)/.exec(this.studio.error?.message ?? "");
    if (!at) return [];
    const [x, y] = this.eye.px(Number(at[1]), Number(at[2].replace(/\.$/, "")));
    return [el("path", { d: `M${x - 8} ${y - 8}L${x + 8} ${y + 8}M${x + 8} ${y - 8}L${x - 8} ${y + 8}`, stroke: "var(--fail)", "stroke-width": 2.4, class: "error-place" })];
  }
  snapMark() {
    if (!this.snap) return [];
    const [x, y] = this.eye.px(...this.snap.p), right = x > this.eye.width - 190;
    return [el("circle", { cx: x, cy: y, r: 8, fill: "none", stroke: "var(--ghost)", "stroke-width": 1.6, class: "snap" }), ...(this.snap.words ? [text(this.snap.words, x + (right ? -13 : 13), y - 12, right ? "end" : "start", "var(--ghost)")] : [])];
  }
  sketchMarks() {
    if (!this.sketching) return [];
    const { list } = this.sketching, all = [...list, ...(this.snap ? [this.snap.p] : [])].map((p) => this.eye.px(...p));
    const words = list.length ? (list.length < 3 ? "Click the next point" : "Click the first point or press Enter to close it") : "Click the first point";
    return [...(all.length > 1 ? [el("path", { d: `M${all.map((p) => p.join(" ")).join("L")}`, fill: "none", stroke: "var(--accent)", "stroke-width": 2 })] : []), ...list.map((p) => { const [x, y] = this.eye.px(...p); return el("rect", { x: x - 4, y: y - 4, width: 8, height: 8, fill: "var(--canvas)", stroke: "var(--accent)", "stroke-width": 1.6 }); }), text(`${words}; Escape gives up.`, 14, 22)];
  }
  scaleBar() {
    const step = niceBar(this.eye.scale), w = step * this.eye.scale, x = this.eye.width - w - 14;
    return [el("path", { d: `M${x} 17V22H${x + w}V17`, fill: "none", stroke: "var(--soft)" }), text(`${step} mm`, x + w / 2, 14, "middle")];
  }
  goto(x, y) { this.eye.goto(x, y, Math.max(4, (this.studio.laminate.bounds[2] - this.studio.laminate.bounds[0]) / 3)); }
  async picture() { return { name: `${this.name}.svg`, blob: svgBlob(this.svg) }; }
}
