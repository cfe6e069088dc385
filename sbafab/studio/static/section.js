// The laminate cut by the plane of the section, to scale or with its height exaggerated.
import { css, el, plain } from "./dom.js";
import { PanZoom, niceBar } from "./panzoom.js";
import { shared, spans, without } from "./shapes.js";
import { layerWords, roleWords } from "./state.js";

export class Section {
  title = "Section";
  constructor(studio) {
    this.studio = studio;
    this.canvas = el("canvas", { role: "img", "aria-label": "Section" });
    this.surface = el("div", { class: "surface" }, this.canvas);
    this.height = el("input", { type: "range", min: 0, max: 100, value: 100, "aria-label": "Height exaggeration", oninput: () => { this.auto = false; this.refit(); } });
    this.shown = el("output", {}, "");
    this.auto = true;
    this.true = el("button", { "aria-pressed": "false", onclick: () => { this.auto = false; this.height.value = 0; this.refit(); } }, "True");
    this.fitted = el("button", { "aria-pressed": "true", onclick: () => { this.auto = true; this.refit(); } }, "Exaggerated");
    this.element = el("div", { class: "view" }, this.surface,
      el("div", { class: "tools" }, this.true, this.fitted, el("label", {}, "Height", this.height, this.shown), el("button", { onclick: () => { this.mark = null; this.eye.touched = false; studio.cut = null; studio.recut(); }, title: "Through the first chamber and its inlet, whole" }, "Reset")),
      el("div", { class: "stale-mark" }, "Updating"));
    this.stretch = 1;
    this.eye = new PanZoom(this.surface, () => this.draw(), { stretch: () => this.stretch });
    this.surface.addEventListener("pointermove", (event) => this.point(event));
    this.surface.addEventListener("pointerleave", () => studio.hover(null));
    this.surface.addEventListener("click", (event) => { if (this.eye.dragged <= 3) { const found = this.under(event); if (found?.layer) studio.pick(found.layer); } });
    studio.on("laminate cut nets", () => this.update());
    studio.on("hover pick theme", () => this.draw());
    studio.on("opened", () => { this.eye.touched = false; this.mark = null; });
    new ResizeObserver(() => this.refit(true)).observe(this.surface);
  }
  show() { this.update(); }

  update() {
    const { laminate, cut } = this.studio;
    if (!laminate || !cut) { this.rows = []; this.draw(); return; }
    const known = new Map();
    const of = (key) => {
      if (!known.has(key)) known.set(key, spans(this.studio.shape(key), cut.x, cut.y, cut.u, cut.v));
      return known.get(key);
    };
    const across = (index) => of(laminate.patterns[laminate.layers[index - 1].pattern].shape);
    this.rows = laminate.layers.map((layer) => ({ layer, spans: across(layer.index) }));
    this.bonds = laminate.bonds.map((bond) => ({ bond, spans: bonded(bond.layers, across) }));
    this.voids = this.netted ? this.studio.nets.areas.map((one) => ({ one, bond: laminate.bonds[one.interface - 1], spans: of(one.shape) })).filter(({ bond }) => bond?.gap) : [];
    const ends = this.rows.flatMap((row) => row.spans.flat());
    this.low = ends.length ? Math.min(...ends) : -1;
    this.high = ends.length ? Math.max(...ends) : 1;
    this.refit(true);
  }
  // Nets are coloured where a design declares them, and where they are those of the laminate that is shown.
  get netted() { const { nets, laminate } = this.studio; return Boolean(nets?.declared && nets.laminate === laminate); }
  refit(quiet = false) {
    const { laminate } = this.studio;
    if (!laminate || !this.surface.clientWidth || this.low === undefined) return;
    // As wide as the whole actuator, so that a section beside its middle is drawn as high.
    const [x0, y0, x1, y1] = laminate.bounds;
    const across = (this.surface.clientWidth - 220) / Math.max(this.high - this.low, x1 - x0, y1 - y0);
    const most = Math.max(1, (this.surface.clientHeight - 96) / laminate.thickness / across);
    if (this.auto) this.height.value = 100;
    const before = this.stretch;
    this.stretch = this.auto ? most : Math.max(1, most ** (this.height.value / 100));
    this.shown.textContent = `${plain(this.stretch, this.stretch < 10 ? 1 : 0)}×`;
    this.fitted.setAttribute("aria-pressed", String(this.auto));
    this.true.setAttribute("aria-pressed", String(this.stretch === 1));
    if (!quiet && before !== this.stretch) this.eye.touched = false;
    this.eye.bounds([this.low, 0, this.high, laminate.thickness], [26, 180, 58, 30]);
    this.draw();
  }

  draw() {
    const { canvas, eye, studio } = this, { laminate } = studio;
    const w = this.surface.clientWidth, h = this.surface.clientHeight, ratio = devicePixelRatio || 1;
    if (!w || !h) return;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) Object.assign(canvas, { width: Math.round(w * ratio), height: Math.round(h * ratio) });
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, w, h);
    if (!laminate || !this.rows?.length) return;
    const colour = { tpe: css("--tpe"), tpeLine: css("--tpe-line"), ptfe: css("--ptfe"), ptfeLine: css("--ptfe-line"), bond: css("--bond"), ink: css("--ink"), soft: css("--soft"), faint: css("--faint"), select: css("--select"), canvas: css("--canvas") };
    pen.font = `11px ${css("--sans")}`;
    const box = (s0, s1, z0, z1) => { const [x0, y0] = eye.px(s0, z1), [x1, y1] = eye.px(s1, z0); return [x0, y0, x1 - x0, Math.max(0.5, y1 - y0)]; };
    for (const { bond, spans: own } of this.bonds) {
      pen.fillStyle = colour.bond;
      for (const [a, b] of own) if (bond.gap) pen.fillRect(...box(a, b, bond.z, bond.z + bond.gap));
    }
    let last = Infinity;
    for (const { layer, spans: own } of this.rows) {
      const thick = layer.thickness * eye.scale * this.stretch;
      const inset = layer.mask && thick > 5 ? 0.16 * layer.thickness : 0;
      const lit = studio.hovered?.index === layer.index || studio.picked?.index === layer.index;
      pen.fillStyle = layer.mask ? colour.ptfe : colour.tpe;
      pen.strokeStyle = lit ? colour.select : layer.mask ? colour.ptfeLine : colour.tpeLine;
      pen.lineWidth = lit ? 2 : thick > 3 ? 0.8 : 0.4;
      for (const [a, b] of own) {
        const at = box(a, b, layer.z + inset, layer.z + layer.thickness - inset);
        pen.fillRect(...at);
        if (thick > 2 || lit) pen.strokeRect(...at);
      }
      // A name where there is room for it.
      const [x, y] = eye.px(this.high, layer.z + layer.thickness / 2);
      if ((last - y >= 12 || lit) && own.length) {
        pen.fillStyle = lit ? colour.select : layer.mask ? colour.ptfeLine : colour.tpeLine;
        pen.fillText(`${layer.index} ${layer.material} ${roleWords(layer)}`, x + 14, y + 4);
        pen.fillStyle = colour.faint;
        pen.fillRect(eye.px(own.at(-1)[1], 0)[0] + 3, y, Math.max(0, x + 10 - eye.px(own.at(-1)[1], 0)[0] - 3), 0.5);
        last = y;
      }
    }
    for (const { one, bond, spans: within } of this.voids ?? []) {
      pen.fillStyle = one.colour; pen.strokeStyle = css("--fail"); pen.lineWidth = 1.5;
      for (const [a, b] of within) {
        const at = box(a, b, bond.z + bond.gap * 0.3, bond.z + bond.gap * 0.7);
        pen.fillRect(...at);
        if (one.nets.length > 1) pen.strokeRect(...at);
      }
    }
    this.axes(pen, colour, w, h);
    if (this.mark) {
      const [x, y] = eye.px(...this.mark);
      pen.strokeStyle = colour.select; pen.lineWidth = 2;
      pen.beginPath(); pen.arc(x, y, 12, 0, 7); pen.stroke();
    }
    canvas.setAttribute("aria-label", `Section, ${laminate.layers.length} layers, ${plain(laminate.thickness)} mm high, drawn ${this.shown.textContent} higher`);
  }
  axes(pen, colour, w, h) {
    const { eye } = this;
    const step = niceBar(eye.scale), x = w - 16 - step * eye.scale;
    pen.strokeStyle = colour.soft; pen.fillStyle = colour.ink; pen.lineWidth = 1;
    pen.beginPath(); pen.moveTo(x, h - 21.5); pen.lineTo(x, h - 16.5); pen.lineTo(x + step * eye.scale, h - 16.5); pen.lineTo(x + step * eye.scale, h - 21.5); pen.stroke();
    pen.textAlign = "center"; pen.fillText(`${step} mm`, x + (step * eye.scale) / 2, h - 24); pen.textAlign = "left";
    const up = eye.scale * this.stretch, tall = niceBar(up, 60);
    pen.beginPath(); pen.moveTo(17.5, 18.5); pen.lineTo(12.5, 18.5); pen.lineTo(12.5, 18.5 + tall * up); pen.lineTo(17.5, 18.5 + tall * up); pen.stroke();
    pen.fillText(`${tall} mm`, 20, 22 + (tall * up) / 2);
  }
  under(event) {
    if (!this.rows) return null;
    const box = this.surface.getBoundingClientRect();
    const [s, z] = this.eye.at(event.clientX - box.left, event.clientY - box.top);
    const row = this.rows.find(({ layer }) => z >= layer.z && z <= layer.z + layer.thickness);
    const span = row?.spans.find(([a, b]) => s >= a && s <= b);
    if (span) return { layer: row.layer, span, s, z };
    const joint = this.bonds.find(({ bond }) => bond.gap && z >= bond.z && z <= bond.z + bond.gap);
    const filled = joint?.spans.find(([a, b]) => s >= a && s <= b);
    return filled ? { bond: joint.bond, span: filled, s, z } : { s, z };
  }
  point(event) {
    const found = this.under(event);
    if (!found) return;
    const place = `s ${plain(found.s, 2)}, z ${plain(found.z, 3)} mm`;
    if (found.layer) this.studio.hover(found.layer, `${layerWords(found.layer)} · ${plain(found.span[1] - found.span[0], 3)} mm wide here · ${place}`);
    else if (found.bond) this.studio.hover(null, `Bond of layers ${found.bond.layers[0]} and ${found.bond.layers.at(-1)}, ${plain(found.span[1] - found.span[0], 3)} mm wide here · ${place}`);
    else this.studio.hover(null, place);
  }
  goto(layers, x, y) {
    const { laminate, cut } = this.studio;
    const own = layers.map((index) => laminate.layers[index - 1]).filter(Boolean);
    this.studio.moveCut({ ...cut, x, y });
    if (!own.length) return;
    const z0 = Math.min(...own.map((layer) => layer.z)), z1 = Math.max(...own.map((layer) => layer.z + layer.thickness));
    this.mark = [0, (z0 + z1) / 2];
    this.eye.goto(0, (z0 + z1) / 2, Math.max(1.5, (z1 - z0) * this.stretch * 2));
  }
  async picture() { return { name: "section.png", blob: await new Promise((done) => this.canvas.toBlob(done)) }; }
}

// Along the plane two films bond where both are and no mask lies between them.
export function bonded([below, ...rest], across) {
  const above = rest.at(-1);
  return rest.slice(0, -1).reduce((left, mask) => without(left, across(mask)), shared(across(below), across(above)));
}
