// Nets in colour: the voids of every gap, as a stack or gap by gap, with what is open, short or stray at its place.
import { el, plain } from "./dom.js";
import { PanZoom, niceBar } from "./panzoom.js";
import { svgBlob, text } from "./layers.js";
import { area, contains, pathOf, polygons } from "./shapes.js";

const KINDS = { open: "Open", short: "Short", leak: "Leak", "dead-end": "Dead end", stray: "Stray void" };
// The stack is drawn from its front right, each gap a sheet over the one below.
const LEAN = 0.42, FLAT = 0.5;

export class Nets {
  title = "Nets";
  constructor(studio) {
    this.studio = studio;
    this.gap = 0;
    this.net = null;
    this.list = el("div", { class: "patterns", role: "group", "aria-label": "Gaps between films" });
    this.svg = el("svg", { role: "img", "aria-label": "Nets" });
    this.surface = el("div", { class: "surface" }, this.svg);
    this.legend = el("div", { class: "tools", role: "group", "aria-label": "Nets" });
    this.faults = el("div", { class: "faults", role: "list", "aria-label": "Faults of nets" });
    this.element = el("div", { class: "view layers nets" }, this.list, this.surface, this.faults, this.legend, el("div", { class: "stale-mark" }, "Updating"));
    this.eye = new PanZoom(this.surface, () => this.draw());
    this.surface.addEventListener("pointermove", (event) => this.point(event));
    this.surface.addEventListener("pointerleave", () => studio.hover(null));
    studio.on("opened", () => { Object.assign(this, { gap: 0, net: null, fault: null }); this.eye.touched = false; });
    studio.on("nets", () => this.update());
    studio.on("laminate", () => { if (!studio.laminate) this.clear(); });
    studio.on("theme", () => this.draw());
  }
  get map() { return this.studio.laminate && this.studio.nets; }
  show() { this.update(); this.eye.touched ? this.draw() : this.eye.fit(); }
  clear() { for (const box of [this.list, this.svg, this.faults, this.legend]) box.replaceChildren(); }

  update() {
    const { map } = this;
    if (!map || this.element.hidden) return;
    if (this.gap > map.gaps.length) this.gap = 0;
    if (!(this.net in map.colours)) this.net = null;
    const [x0, y0, x1, y1] = this.map.laminate.bounds, span = Math.max(x1 - x0, y1 - y0) * 1.04, box = `${(x0 + x1) / 2 - span / 2} ${-(y0 + y1) / 2 - span / 2} ${span} ${span}`;
    const button = (gap, words, small, areas) => el("button", { "aria-pressed": String(gap === this.gap), onclick: () => this.choose(gap) },
      el("svg", { viewBox: box, "aria-hidden": "true" }, ...areas.map((one) => el("path", { d: pathOf(this.studio.shape(one.shape)), transform: "scale(1 -1)", fill: one.colour, "fill-rule": "evenodd" }))), el("span", {}, words, el("small", {}, small)));
    this.list.replaceChildren(el("h3", {}, "Gaps between films"), button(0, "All, as a stack", `${map.gaps.length} gaps`, map.areas),
      ...map.gaps.map((gap) => { const bad = map.faults.filter((fault) => levels(map, fault).includes(gap.interface)).length; return button(gap.interface, `Gap ${gap.interface}`, `layers ${gap.layers[0]} and ${gap.layers.at(-1)}${bad ? ` · ${bad} fault${bad > 1 ? "s" : ""}` : ""}`, map.areas.filter((one) => one.interface === gap.interface)); }).reverse());
    this.legend.replaceChildren(...Object.entries(map.colours).map(([name, colour]) => el("button", { class: "net", "aria-pressed": String(name === this.net), title: "Show this net alone", onclick: () => { this.net = this.net === name ? null : name; this.update(); } }, el("span", { class: "swatch", style: false, "data-colour": colour }), name)), el("button", { onclick: () => { this.eye.touched = false; this.eye.fit(); } }, "Fit"));
    for (const swatch of this.legend.querySelectorAll(".swatch")) swatch.style.background = swatch.dataset.colour;
    this.faults.replaceChildren(...this.lines());
    this.eye.bounds(this.bounds(), this.gap ? [30, 30, 64, 30] : [24, 70, 64, 70]);
    this.draw();
  }
  lines() {
    const { map } = this;
    if (!map.declared) return [el("p", {}, "This design declares no nets; each chamber is shown as one. Name what is to be joined under [nets] in the text, and the rules compare it with the voids.")];
    if (!map.faults.length) return [el("p", {}, "Voids join what the nets name, and nothing else.")];
    return map.faults.map((fault, i) => el("div", { role: "listitem" }, el("button", { class: "finding", "data-verdict": "fail", "data-kind": fault.kind, "aria-current": i === this.fault ? "true" : false, onclick: () => this.goto(i) }, el("span", { class: "number" }, String(i + 1)), el("span", { class: "rule" }, `${KINDS[fault.kind] ?? fault.kind}${fault.nets.length ? `: ${fault.nets.join(" and ")}` : ""}`), el("span", { class: "measured" }, fault.interface ? `gap ${fault.interface}` : `layer ${fault.layers.join(", ")}`), el("span", { class: "why" }, fault.message))));
  }
  choose(gap) {
    this.gap = gap;
    this.eye.touched = false;
    this.update();
    this.eye.fit();
  }
  // A fault at its place, in its gap.
  goto(i) {
    const { map } = this, fault = map.faults[i];
    this.fault = i;
    this.gap = levels(map, fault)[0] ?? 0;
    this.update();
    const [x0, , x1] = this.map.laminate.bounds;
    this.eye.goto(...fault.at, Math.max(4, (x1 - x0) / 2.5));
  }
  gotoPlace(x, y, layers) {
    const i = this.map?.faults.findIndex((fault) => Math.hypot(fault.at[0] - x, fault.at[1] - y) < 0.01 && fault.layers.some((layer) => layers.includes(layer))) ?? -1;
    if (i >= 0) this.goto(i);
  }

  // Plane and sheet: where a place of a gap lies in the drawing, mm, y up.
  get lift() { const [, y0, , y1] = this.map.laminate.bounds; return 0.7 * (y1 - y0); }
  at(gap, [x, y]) { return this.gap ? [x, y] : [x + LEAN * y, FLAT * y + (gap - 1) * this.lift]; }
  bounds() {
    const [x0, y0, x1, y1] = this.map.laminate.bounds;
    if (this.gap) return [x0, y0, x1, y1];
    const ends = [1, this.map.gaps.length].flatMap((gap) => [[x0, y0], [x1, y0], [x0, y1], [x1, y1]].map((p) => this.at(gap, p)));
    return [Math.min(...ends.map(([x]) => x)), Math.min(...ends.map(([, y]) => y)), Math.max(...ends.map(([x]) => x)), Math.max(...ends.map(([, y]) => y))];
  }
  px(gap, p) { return this.eye.px(...this.at(gap, p)); }

  draw() {
    const { map, studio } = this;
    if (!map || this.element.hidden || !this.surface.clientWidth) return;
    const gaps = this.gap ? map.gaps.filter((gap) => gap.interface === this.gap) : map.gaps;
    this.svg.replaceChildren(...gaps.flatMap((gap) => [this.sheet(gap), ...(this.gap ? [] : this.vias(gap))]), ...gaps.flatMap((gap) => [...this.titleOf(gap), ...this.ports(gap)]), ...this.faultMarks(gaps), ...this.scaleBar());
    this.svg.setAttribute("aria-label", `Nets of ${map.laminate.name}: ${Object.keys(map.colours).join(", ")}; ${map.faults.length} faults`);
  }
  sheet(gap) {
    const { eye, map, studio } = this, [ox, oy] = this.px(gap.interface, [0, 0]), s = eye.scale, line = { "vector-effect": "non-scaling-stroke", "fill-rule": "evenodd" };
    // What a short joins has the colours of all its nets.
    const colours = (one) => one.nets.map((name) => map.colours[name]), shorts = [...new Map(map.areas.filter((one) => one.nets.length > 1).map((one) => [one.nets.join(" "), colours(one)])).values()], wide = 9 / s;
    const stripes = shorts.map((all) => el("pattern", { id: `short-${all.join("").replaceAll("#", "")}`, patternUnits: "userSpaceOnUse", width: wide * all.length, height: wide * all.length, patternTransform: "rotate(45)" }, ...all.map((colour, i) => el("rect", { x: i * wide, y: 0, width: wide, height: wide * all.length, fill: colour }))));
    const fill = (one) => (one.nets.length > 1 ? `url(#short-${colours(one).join("").replaceAll("#", "")})` : one.colour);
    const pale = (one) => this.net !== null && !one.nets.includes(this.net);
    return el("g", { transform: this.gap ? `translate(${ox} ${oy}) scale(${s} ${-s})` : `matrix(${s} 0 ${LEAN * s} ${-FLAT * s} ${ox} ${oy})` },
      el("defs", {}, ...stripes),
      el("path", { d: pathOf(studio.shape(gap.contact)), fill: "var(--panel)", "fill-opacity": this.gap ? 1 : 0.82, stroke: "var(--faint)", "stroke-width": 1, ...line }),
      ...map.areas.filter((one) => one.interface === gap.interface).map((one) => el("path", { d: pathOf(studio.shape(one.shape)), class: "void", "data-nets": one.nets.join(" "), fill: fill(one), "fill-opacity": pale(one) ? 0.15 : 0.85, stroke: one.nets.length > 1 ? "var(--fail)" : one.colour, "stroke-width": one.nets.length > 1 ? 2.5 : 1, ...line }, el("title", {}, one.nets.length > 1 ? `short: ${one.nets.join(" and ")}` : one.nets[0] ?? "no net"))));
  }
  titleOf(gap) {
    if (this.gap) return [text(`Gap ${gap.interface}, between layers ${gap.layers[0]} and ${gap.layers.at(-1)}`, 14, 22)];
    const [x, y] = this.px(gap.interface, [this.map.laminate.bounds[0], this.map.laminate.bounds[1]]);
    return [text(`Gap ${gap.interface}`, x - 8, y + 2, "end", "var(--soft)")];
  }
  // Holes of the film over a gap that lead from one void into another.
  vias(gap) {
    const { map, studio } = this, over = map.gaps.find((one) => one.interface === gap.interface + 1);
    if (!over) return [];
    const holes = polygons(studio.shape(map.laminate.patterns[map.laminate.layers[over.layers[0] - 1].pattern].shape), 0.05).filter((points) => area(points) < 0);
    return holes.flatMap((points) => {
      const middle = points.reduce(([x, y], p) => [x + p[0] / points.length, y + p[1] / points.length], [0, 0]);
      const [below, above] = [gap, over].map((one) => map.areas.find((each) => each.interface === one.interface && contains(studio.shape(each.shape), ...middle)));
      if (!below || !above) return [];
      const [x0, y0] = this.px(gap.interface, middle), [x1, y1] = this.px(over.interface, middle);
      return [el("path", { class: "via", d: `M${x0} ${y0}L${x1} ${y1}`, stroke: below.colour, "stroke-width": 2.5, "stroke-dasharray": "5 3", "stroke-opacity": this.net === null || below.nets.includes(this.net) ? 1 : 0.15 }), el("circle", { cx: x0, cy: y0, r: 3, fill: below.colour, stroke: "var(--canvas)" })];
    });
  }
  ports(gap) {
    return this.places().filter(({ layers }) => layers[0] === gap.layers[0] && layers[1] === gap.layers.at(-1)).flatMap(({ name, at }) => {
      const [x, y] = this.px(gap.interface, at);
      return [el("circle", { cx: x, cy: y, r: 4, fill: "var(--canvas)", stroke: "var(--ink)", "stroke-width": 1.6, class: "port" }), text(name, x + 8, y - 6)];
    });
  }
  // Ports, and the first pocket of each chamber.
  places() {
    const { map, studio } = this;
    const pockets = map.laminate.chambers.flatMap(({ name, centres: [at] }) => {
      const there = map.areas.filter((one) => contains(studio.shape(one.shape), ...at)).sort((a, b) => a.interface - b.interface)[0];
      const gap = map.gaps.find((one) => one.interface === there?.interface);
      return gap ? [{ name, at, layers: [gap.layers[0], gap.layers.at(-1)] }] : [];
    });
    return [...map.ports, ...pockets];
  }
  faultMarks(gaps) {
    return this.map.faults.flatMap((fault, i) => levels(this.map, fault).filter((level) => gaps.some((gap) => gap.interface === level)).flatMap((level) => {
      const [x, y] = this.px(level, fault.at), words = `${i + 1} ${(KINDS[fault.kind] ?? fault.kind).toLowerCase()}`;
      return [el("circle", { cx: x, cy: y, r: i === this.fault ? 13 : 10, fill: "none", stroke: "var(--fail)", "stroke-width": 2.4, class: "fault-place", "data-kind": fault.kind }), text(words, x, y + 25, "middle", "var(--fail)")];
    }));
  }
  scaleBar() {
    if (!this.gap) return [];
    const step = niceBar(this.eye.scale), w = step * this.eye.scale, x = this.eye.width - w - 14;
    return [el("path", { d: `M${x} 25V30H${x + w}V25`, fill: "none", stroke: "var(--soft)" }), text(`${step} mm`, x + w / 2, 22, "middle")];
  }
  point(event) {
    if (!this.map || !this.gap) return;
    const box = this.surface.getBoundingClientRect(), [x, y] = this.eye.at(event.clientX - box.left, event.clientY - box.top);
    const there = this.map.areas.find((one) => one.interface === this.gap && contains(this.studio.shape(one.shape), x, y));
    this.studio.hover(null, `${there ? `${there.nets.length > 1 ? `short of ${there.nets.join(" and ")}` : there.nets.length ? `net ${there.nets[0]}` : "a void without a net"} · ` : ""}x ${plain(x, 2)}, y ${plain(y, 2)} mm`);
  }
  async picture() { return { name: "nets.svg", blob: svgBlob(this.svg) }; }
}

// The gaps at which a fault is drawn: its own, or those beside its layers.
function levels(map, fault) {
  if (fault.interface) return [fault.interface];
  return map.gaps.filter((gap) => [gap.layers[0], gap.layers.at(-1)].some((layer) => fault.layers.includes(layer))).map((gap) => gap.interface);
}
