// The form that adds a shape: its name, its kind with sizes that suit the view, and the layer that takes it.
import { el } from "./dom.js";
import { KINDS, parts } from "./sketch.js";

const OFFERED = ["sketch", "disc", "ring", "rectangle", "slot", "stadium", "union", "difference", "offset", "fillet"];
const WORDS = { ...KINDS, sketch: "Points that I click on the drawing", rectangle: "Rectangle", union: "Two shapes joined", difference: "One shape cut out of another" };

export class NewShape {
  open = false;
  constructor(draw) { this.draw = draw; }
  toggle() { this.open ? this.close() : this.show(); }
  close() {
    const was = this.open;
    this.open = false;
    this.button?.setAttribute("aria-expanded", "false");
    if (was) this.draw.fill();
  }
  show() {
    const { draw } = this, names = Object.keys(draw.shapes);
    this.open = true;
    this.button = document.querySelector("#new-shape");
    this.button.setAttribute("aria-expanded", "true");
    const name = el("input", { type: "text", "aria-label": "Name of the new shape", value: freeName(names), maxlength: 32 });
    const kind = el("select", { "aria-label": "Kind of the new shape", onchange: () => choose() }, ...OFFERED.map((one) => el("option", { value: one }, WORDS[one])));
    const first = el("select", { "aria-label": "First shape" }, ...names.map((one) => el("option", { value: one }, one)));
    const second = el("select", { "aria-label": "Second shape" }, ...names.map((one) => el("option", { value: one }, one)));
    first.value = draw.name;
    const layer = el("select", { "aria-label": "Layer that takes it" }, el("option", { value: "" }, "none yet"), ...draw.layers.map((row, i) => el("option", { value: i }, `${i + 1} ${row.role.replace("-", " ")}`)));
    const why = el("p", { class: "draw-why", role: "alert", hidden: true });
    const of = draw.line("Of", first), and = draw.line("And", second);
    const choose = () => { const made = parts({ [kind.value]: kind.value === "union" || kind.value === "difference" ? ["", ""] : "" }); of.hidden = !["union", "difference", "offset", "fillet"].includes(kind.value); and.hidden = made.length !== 2 || of.hidden; };
    const go = () => {
      const wanted = name.value.trim(), bad = !/^[a-z][a-z0-9_-]{0,31}$/.test(wanted) ? "A name begins with a small letter; small letters, digits, - and _ may follow." : names.includes(wanted) ? `There is a shape ${wanted} already; choose another name.` : "";
      why.hidden = !bad;
      why.textContent = bad;
      if (bad) { name.focus(); return; }
      const put = (shape) => draw.add(wanted, shape, layer.value === "" ? null : Number(layer.value));
      const kindName = kind.value;
      this.close();
      if (kindName === "sketch") draw.sketch((list) => put({ polygon: list }));
      else put(this.sized(kindName, first.value, second.value));
    };
    name.addEventListener("keydown", (event) => { if (event.key === "Enter") go(); });
    choose();
    draw.side.replaceChildren(el("div", { class: "new-shape" }, el("h3", {}, "New shape"), draw.line("Name", name), draw.line("Kind", kind), of, and, draw.line("Layer that takes it", layer), why, el("div", { class: "line" }, el("button", { onclick: () => this.close() }, "Cancel"), el("button", { class: "primary", onclick: go }, "Add shape"))));
    name.select();
    name.focus();
  }
  // About a quarter of what is seen, in its middle, on the grid.
  sized(kind, first, second) {
    const { eye, grid } = this.draw, step = Number(grid.value), on = (value) => Math.round(value / step) * step;
    const size = Math.max(4 * step, on(Math.min(eye.width, eye.height) / eye.scale / 4)), [x, y] = eye.at(eye.width / 2, eye.height / 2).map((value) => Number(on(value).toFixed(6)) || 0), half = Number((size / 2).toFixed(6)), whole = Number(size.toFixed(6)), narrow = Number(Math.max(step, on(size / 3)).toFixed(6));
    return {
      disc: { disc: whole, at: [x, y] }, ring: { ring: [whole, half], at: [x, y] }, stadium: { stadium: [narrow, whole], at: [x, y] },
      rectangle: { polygon: [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]] }, slot: { slot: [[x - half, y], [x + half, y]], width: narrow },
      union: { union: [first, second] }, difference: { difference: [first, second] }, offset: { offset: first, by: 1 }, fillet: { fillet: first, radius: 1 },
    }[kind];
  }
}

function freeName(names) {
  for (let i = 1; ; i++) if (!names.includes(`shape${i}`)) return `shape${i}`;
}
