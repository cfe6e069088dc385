// The form from the schema: every key with unit, meaning, default and range; errors at the field.
import { $, el, plain } from "./dom.js";
import { pathOf } from "./shapes.js";
import { assemblySections, assemblyShape } from "./assembly_form.js";

const TITLES = { "": "Design", tpe: "TPE", ptfe: "PTFE" };
const title = (word) => TITLES[word] ?? word.replaceAll("_", " ").replace(/^./, (c) => c.toUpperCase());
const OPEN = ["stack", "chamber", "lumen", "bond", "mask"];

export class Form {
  constructor(studio) {
    this.studio = studio;
    this.form = $("#form");
    this.help = $("#help");
    this.rows = new Map();
    this.form.addEventListener("submit", (event) => event.preventDefault());
    $("#filter").addEventListener("input", () => this.filter());
    studio.on("design", () => { this.build(); this.fill(); this.mark(null); });
    studio.on("text", (from) => { if (from === "opened") this.family = undefined; });
    studio.on("parts", () => { if (this.build()) this.fill(); });
    studio.on("failed", (answer) => { this.build(); this.mark(answer); });
    studio.on("opened", () => this.mark(null));
    this.explain(null);
  }

  build() {
    const { family, text } = this.studio;
    if (family === "assembly") return this.buildAssembly(keysIn(text));
    if (family === this.family) return false;
    this.family = family;
    this.rows.clear();
    const fields = this.studio.families[family];
    if (!fields) {
      this.form.replaceChildren(el("p", { class: "fallback" }, `Choose a template, or write family = "${Object.keys(this.studio.families)[0]}" in the text.`));
      return false;
    }
    const sections = new Map();
    for (const field of fields) {
      const table = field.key.split(".").slice(0, -1).join(".");
      if (!sections.has(table)) sections.set(table, []);
      sections.get(table).push(field);
    }
    this.form.replaceChildren(this.families(), ...[...sections].map(([table, own]) => this.section({ table, fields: own, open: !table || OPEN.includes(table) })));
    this.filter();
    return true;
  }
  // Parts come and go, and so do their sections; those that were opened or shut stay so.
  buildAssembly(present) {
    const shape = assemblyShape(this.studio, present);
    if (shape === this.family) return false;
    // A part that is new stands open; of another design nothing is known yet.
    const known = typeof this.family === "string" && this.family.startsWith("[");
    const before = new Map([...(known ? this.form : el("div")).querySelectorAll("details")].map((details) => [details.dataset.table, details.open]));
    const focused = document.activeElement?.name, { scrollTop } = this.form;
    this.family = shape;
    this.rows.clear();
    this.form.replaceChildren(...assemblySections(this.studio, present).map((one) => one.add ?? this.section({ ...one, open: before.get(one.table) ?? (before.size > 0 || one.open) })));
    if (focused && this.rows.has(focused)) this.rows.get(focused).control.focus();
    this.form.scrollTop = scrollTop;
    this.filter();
    return true;
  }
  section({ table, words, small, fields, head, open }) {
    const said = words ?? (table ? table.split(".").map(title).join(" / ") : "Design");
    const details = el("details", { open }, el("summary", {}, said, small ? el("small", {}, small) : null, el("span", { class: "count" })), head, ...fields.map((field) => this.row(field)));
    details.dataset.table = table;
    return details;
  }

  families() {
    return el("div", { class: "families", role: "group", "aria-label": "Family" }, ...Object.keys(this.studio.families).map((name) => {
      const { title: words, symbol, meaning } = this.studio.cards[name];
      const drawing = el("svg", { viewBox: "0 0 54 40", "aria-hidden": "true" }, el("path", { d: symbol, fill: "var(--tpe)", stroke: "var(--tpe-line)", "stroke-width": 1 }));
      return el("button", { type: "button", "aria-pressed": String(name === this.family), title: `family = "${name}": ${meaning}`, onclick: () => this.become(name) }, drawing, words);
    }));
  }
  // Another family keeps what both know.
  become(name) {
    if (name === this.family) return;
    const known = this.studio.families[name].map((field) => field.key);
    const other = [...this.present].filter((key) => key !== "family" && !known.includes(key));
    // A table that the other family lacks goes whole.
    const drop = new Set(other.map((key) => { const table = key.split(".")[0]; return known.some((own) => own.startsWith(`${table}.`)) ? key : table; }));
    this.studio.edit([["family", `"${name}"`], ...[...drop].map((key) => [key, null])]);
  }

  row(field) {
    const id = "f-" + field.key.replaceAll(".", "-");
    const name = field.key.split(".").at(-1);
    const control = this.control(field, id);
    const label = el("label", { for: id, title: field.key }, field.label ?? title(name));
    const reset = el("button", { type: "button", class: "reset", title: "Back to the default", "aria-label": `${field.key} back to its default`, onclick: () => this.send(field, null) }, "×");
    const holder = el("div", { class: "field" + (field.unit ? " unit" : "") + (field.kind === "text" ? " text" : "") }, control, field.unit ? el("span", { class: "u" + (field.optional ? " auto" : ""), "aria-hidden": "true" }, field.unit) : null);
    if (field.unit) holder.style.setProperty("--unit", `${field.unit.length}ch`);
    const row = el("div", { class: "row" }, label, holder, reset);
    if (field.kind === "set") { holder.replaceWith(el("span")); row.append(control); }
    if (field.slider) row.append(this.slider(field, id));
    if (["number", "whole"].includes(field.kind)) this.scrub(label, field);
    row.addEventListener("focusin", () => this.explain(field));
    row.addEventListener("pointerenter", () => this.explain(field));
    this.rows.set(field.key, { field, row, control, range: $("input[type=range]", row) });
    return row;
  }
  control(field, id) {
    const described = { id, "aria-describedby": "help", "aria-label": `${field.key}${field.unit ? `, ${field.unit}` : ""}`, name: field.key };
    if (field.kind === "set") {
      return el("div", { class: "set", role: "group", "aria-label": field.key }, ...field.choices.map((choice) => el("label", {}, el("input", { type: "checkbox", value: choice, onchange: () => this.sendSet(field) }), choice)));
    }
    if (field.kind === "choice" || field.kind === "switch") {
      const choices = field.kind === "switch" ? ["true", "false"] : [...(field.optional ? [""] : []), ...field.choices];
      return el("select", { ...described, onchange: (event) => this.send(field, field.kind === "switch" || !event.target.value ? event.target.value || null : JSON.stringify(event.target.value)) }, ...choices.map((choice) => el("option", { value: choice }, field.kind === "switch" ? (choice === "true" ? "yes" : "no") : choice || "none")));
    }
    const input = el("input", { ...described, type: "text", spellcheck: "false", inputmode: ["number", "whole"].includes(field.kind) ? "decimal" : "text" });
    input.addEventListener("change", () => this.send(field, literal(field, input.value)));
    input.addEventListener("keydown", (event) => {
      if (event.key === "Enter") this.send(field, literal(field, input.value));
      const by = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      const now = Number(input.value || input.placeholder);
      if (!by || !Number.isFinite(now) || !["number", "whole"].includes(field.kind)) return;
      event.preventDefault();
      this.nudge(field, now + by * step(field, now) * (event.shiftKey ? 10 : 1));
    });
    return input;
  }
  slider(field, id) {
    const [min, max, by] = field.slider;
    return el("input", { type: "range", min, max, step: by, "aria-label": `${field.key} slider`, tabindex: -1, "data-for": id, oninput: (event) => this.nudge(field, Number(event.target.value)), onchange: () => this.studio.commit() });
  }
  // Dragging a label turns its number, as a knob would.
  scrub(label, field) {
    label.classList.add("scrub");
    label.addEventListener("pointerdown", (down) => {
      const { control } = this.rows.get(field.key);
      const start = Number(control.value || control.placeholder);
      if (!Number.isFinite(start) || down.button) return;
      label.setPointerCapture(down.pointerId);
      const by = step(field, start);
      let moved = false;
      const move = (event) => {
        const steps = Math.round((event.clientX - down.clientX) / 4);
        if (!steps && !moved) return;
        moved = true;
        this.nudge(field, start + steps * by);
      };
      const up = () => { label.removeEventListener("pointermove", move); if (moved) this.studio.commit(); else control.focus(); };
      label.addEventListener("pointermove", move);
      label.addEventListener("pointerup", up, { once: true });
      label.addEventListener("pointercancel", up, { once: true });
      down.preventDefault();
    });
  }
  nudge(field, value) {
    const least = field.least ?? -Infinity, most = field.most ?? Infinity;
    const kept = plain(Math.min(most, Math.max(least, value)), 4);
    const { control, range, row } = this.rows.get(field.key);
    control.value = kept;
    if (range) range.value = kept;
    row.classList.add("own");
    this.send(field, kept);
  }
  send(field, value) {
    const shown = this.shown?.get(field.key);
    if (value !== null && value === shown && !this.studio.pending.has(field.key)) return;
    if (value === "") value = null;
    this.studio.edit([[field.key, value]]);
  }
  sendSet(field) {
    const chosen = [...this.rows.get(field.key).row.querySelectorAll("input:checked")].map((box) => box.value);
    this.studio.edit([[field.key, chosen.length ? JSON.stringify(chosen) : null]]);
  }

  // Values of the file stand in ink, defaults in grey behind them.
  own(key) { return this.present?.has(key); }
  fill() {
    const { values, text } = this.studio;
    this.present = keysIn(text);
    this.shown = new Map();
    for (const [key, { field, row, control, range }] of this.rows) {
      const value = at(values, key), own = this.present.has(key);
      row.classList.toggle("own", own);
      if (field.kind === "set") {
        for (const box of control.querySelectorAll("input")) box.checked = (value ?? []).includes(box.value);
        continue;
      }
      const words = value === undefined || value === null ? "" : typeof value === "object" ? JSON.stringify(value).replaceAll(",", ", ") : String(value);
      if (control.tagName === "SELECT") control.value = words;
      else if (document.activeElement !== control || !this.studio.pending.has(key)) {
        const written = document.activeElement === control && own && Number(control.value) === Number(words);
        if (!written) control.value = own ? words : "";
        control.placeholder = words || (field.optional ? "automatic" : "");
      }
      this.shown.set(key, own ? literal(field, words) : undefined);
      if (range && document.activeElement !== range && typeof value === "number") range.value = value;
    }
    for (const details of this.form.querySelectorAll("details")) {
      const own = details.querySelectorAll(".row.own").length;
      $(".count", details).textContent = own ? `${own} set` : "";
    }
  }

  mark(answer) {
    for (const { row, control } of this.rows.values()) {
      row.classList.remove("bad");
      $(".why", row)?.remove();
      control.removeAttribute("aria-invalid");
    }
    $(".part-why", this.form)?.remove();
    const found = answer?.field && this.rows.get(answer.field);
    if (!found) {
      // What is wrong with a part as a whole stands at its head.
      const details = answer?.field && this.form.querySelector(`details[data-table="${CSS.escape(answer.field.split(".").slice(0, 2).join("."))}"]`);
      if (!details) return;
      details.open = true;
      $("summary", details).after(el("div", { class: "why part-why", role: "alert" }, answer.message));
      return;
    }
    const { row, control } = found;
    const written = valueIn(this.studio.text, answer.field);
    if (written !== null && control.tagName === "INPUT" && document.activeElement !== control) control.value = written;
    const id = control.id + "-why";
    row.classList.add("bad");
    row.append(el("div", { class: "why", id, role: "alert" }, answer.message));
    control.setAttribute("aria-invalid", "true");
    row.closest("details").open = true;
    if (!row.contains(document.activeElement)) row.scrollIntoView({ block: "nearest" });
  }

  explain(field) {
    if (!field) { this.help.replaceChildren("Point at a key for its description. Drag its name sideways to change the number; ↑ and ↓ step it."); return; }
    const range = field.least !== undefined && field.least !== null ? ` ${plain(field.least)} to ${field.most === undefined || field.most === null ? "any" : plain(field.most)}${field.unit ? " " + field.unit : ""}.` : "";
    const usual = field.default === null || field.default === undefined || field.default === "" ? "" : ` Default ${typeof field.default === "object" ? JSON.stringify(field.default) : field.default}.`;
    this.help.replaceChildren(el("code", {}, field.key), el("br"), field.meaning, el("span", { class: "range" }, usual + range));
  }

  filter() {
    const words = $("#filter").value.trim().toLowerCase();
    for (const { field, row } of this.rows.values()) row.hidden = words !== "" && !(field.key + " " + field.meaning).toLowerCase().includes(words);
    for (const details of this.form.querySelectorAll("details")) {
      details.hidden = [...details.querySelectorAll(".row")].every((row) => row.hidden);
      if (words) details.open = true;
    }
  }
}

const at = (table, key) => key.split(".").reduce((inner, part) => inner?.[part], table);

function step(field, now) {
  if (field.slider) return field.slider[2];
  if (field.kind === "whole") return 1;
  const size = Math.abs(now) || Math.abs(field.default) || 1;
  return 10 ** Math.floor(Math.log10(size) - 1);
}

// What a person typed, as TOML writes it.
function literal(field, words) {
  const text = words.trim();
  if (text === "") return null;
  if (field.kind === "text") return JSON.stringify(text);
  if (/^[[{"'].*/s.test(text) || text === "true" || text === "false") return text;
  if (/^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(text)) {
    const number = text.replace(/^\+/, "").replace(/^(-?)\./, "$10.").replace(/\.$/, "");
    return /^-?0\d/.test(number) ? String(Number(number)) : number;
  }
  return JSON.stringify(text);
}

// The dotted keys that a text sets; enough of TOML for what design files hold.
export function keysIn(text) {
  const found = new Set();
  let table = "";
  for (const line of text.split("\n")) {
    const head = /^\s*\[+\s*([^\]#]+?)\s*\]+/.exec(line);
    if (head) { table = head[1].replace(/["'\s]/g, "") + "."; continue; }
    const key = /^\s*([A-Za-z0-9_."'-]+)\s*=/.exec(line);
    if (key) found.add((table + key[1]).replace(/["'\s]/g, ""));
  }
  return found;
}
// The value that a text gives a key, as it is written there.
function valueIn(text, key) {
  let table = "";
  for (const line of text.split("\n")) {
    const head = /^\s*\[+\s*([^\]#]+?)\s*\]+/.exec(line);
    if (head) { table = head[1].trim() + "."; continue; }
    const own = /^\s*([A-Za-z0-9_.-]+)\s*=\s*("[^"]*"|'[^']*'|\[[^\]]*\]|[^#\s]+)/.exec(line);
    if (own && table + own[1] === key) return own[2].replace(/^["']|["']$/g, "");
  }
  return null;
}
export { at, pathOf };
