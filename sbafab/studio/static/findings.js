// What the rules found, as they are measured, and what the models predict.
import { $, el, plain } from "./dom.js";

// ms between two looks at a deck that runs; laying the list out oftener takes the time of what is measured.
const READABLE = 110;
const RANK = { fail: 0, warn: 1, waived: 2, pass: 3 };
// Rules that measure a share, as the command line words it.
const SHARES = { "pin-fit": "stretch", "registration-yield": "hold" };

export class Findings {
  constructor(studio, goto) {
    Object.assign(this, { studio, goto });
    this.list = el("div", { class: "body", role: "list", "aria-label": "Findings" });
    this.sum = el("span", { class: "sum" });
    this.block = el("div", { class: "section-block" }, el("h2", {}, "Rules", this.sum), this.list, el("div", { class: "stale-mark" }, "Checking"));
    this.figures = el("div", { class: "body" });
    this.unfolded = new Set();
    this.figuresBlock = el("div", { class: "section-block" }, el("h2", {}, "Prediction", el("span", { class: "sum", title: "Each quantity once, by the model to design with" }, "by the model to design with")), this.figures, el("div", { class: "stale-mark" }, "Updating"));
    this.figures.before(this.whole());
    $("#panel-findings").append(this.block, this.figuresBlock);
    // Rules that come in quick succession are shown together.
    studio.on("rule", () => { this.soon ??= setTimeout(() => this.draw(), READABLE); });
    studio.on("checked opened", () => this.draw());
    studio.on("figures reference", () => this.drawFigures());
    studio.on("design", () => { this.asked.hidden = studio.family !== "assembly"; });
    studio.on("failed", (answer) => { if (!answer.field) this.draw(); });
  }
  // What an assembly is asked for: one pressure in all its actuators, and a mass at the tips.
  whole() {
    const { studio } = this;
    const field = (name, label, unit) => el("label", {}, label, el("input", { type: "text", inputmode: "decimal", value: studio.inflated[name], "aria-label": `${label}, ${unit}`, onchange: (event) => studio.inflate({ [name]: Number(event.target.value.replace(",", ".") || NaN) }) }), unit);
    return (this.asked = el("div", { class: "whole-asked", hidden: true }, field("pressure_kpa", "All at", "kPa"), field("load_g", "Mass at the tips", "g")));
  }
  draw() {
    clearTimeout(this.soon);
    this.soon = null;
    const { studio } = this;
    // While the deck runs, a rule that was not measured again keeps its old line, pale.
    const fresh = new Map(studio.running.map((answer) => [answer.rule, answer.findings]));
    const old = studio.findings.filter((finding) => !fresh.has(finding.rule));
    const all = studio.stale.rules ? [...[...fresh.values()].flat(), ...old] : studio.findings;
    const sorted = all.map((finding) => ({ finding, waiting: studio.stale.rules && !fresh.has(finding.rule) })).sort((a, b) => RANK[a.finding.verdict] - RANK[b.finding.verdict]);
    const count = (verdict) => all.filter((finding) => finding.verdict === verdict).length;
    const said = [["fail", "failed"], ["warn", "warned"], ["waived", "waived"], ["pass", "passed"]].filter(([verdict]) => count(verdict)).map(([verdict, words]) => `${count(verdict)} ${words}`);
    this.sum.textContent = said.join(", ");
    this.list.replaceChildren(...sorted.map(({ finding, waiting }) => this.line(finding, waiting)));
  }
  line(finding, waiting) {
    const of = SHARES[finding.rule];
    const unit = of ? `% ${of}` : finding.unit;
    const [measured, limit] = [finding.measured, finding.limit].map((value) => (value === null || !of ? value : 100 * value));
    const size = measured === null ? "" : `${plain(measured, 3)}${limit === null ? "" : ` / ${plain(limit, 3)}`} ${unit.replace("mm2", "mm²").replace("mm3", "mm³")}`;
    return el("div", { role: "listitem" }, el("button", { class: "finding" + (waiting ? " waiting" : ""), "data-verdict": finding.verdict, "data-rule": finding.rule, "aria-label": `${finding.rule}${finding.design ? ` of ${finding.design}` : ""}: ${finding.verdict}. ${finding.message}`, onclick: (event) => this.open(finding, event.currentTarget) },
      el("span", { class: "dot" }), el("span", { class: "rule" }, finding.rule, finding.design ? el("small", {}, finding.design) : null), el("span", { class: "measured", title: "measured / limit" }, size), el("span", { class: "why" }, finding.message)));
  }
  open(finding, button) {
    for (const other of this.list.querySelectorAll("[aria-current]")) other.removeAttribute("aria-current");
    button.setAttribute("aria-current", "true");
    this.goto(finding);
  }

  drawFigures() {
    const { studio } = this, { prediction, reference, noFigures } = studio;
    if (noFigures) { this.figures.replaceChildren(el("p", { class: "fallback" }, noFigures)); return; }
    if (!prediction) return;
    const before = new Map((reference?.prediction?.figures ?? []).map((figure) => [named(figure), figure.value]));
    const row = (figure) => {
      const was = before.get(named(figure));
      const change = was === undefined || was === figure.value ? "" : `${figure.value > was ? "+" : "−"}${significant(Math.abs(figure.value - was))}`;
      const said = [...(figure.flags ?? []).map((flag) => flag.replaceAll("-", " ")), ...(figure.measured ? [figure.measured.sentence] : [])];
      const beside = said.length ? `(${said.join("; ")})` : "";
      const range = figure.interval ? el("small", { class: "beside", title: "90 % interval" }, `90 %: ${figure.interval.map((end) => significant(end)).join(" to ")}`) : null;
      return el("tr", { title: `${figure.model}. ${figure.trust}` }, el("td", {}, figure.name, range, beside ? el("small", { class: "beside" }, beside) : null), el("td", { class: "v" }, significant(figure.value)), el("td", { class: "n" }, figure.unit), reference ? el("td", { class: "d" }, change) : null);
    };
    const table = (figures) => {
      const groups = [...new Set(figures.map(({ group }) => group))];
      return el("table", { class: "figures" }, el("tbody", {}, ...groups.flatMap((group) => [el("tr", {}, el("th", { colspan: 4, scope: "rowgroup" }, group)), ...figures.filter((figure) => figure.group === group).map(row)])));
    };
    const { figures, left_out: left, quick, met = [], meets, refused, before: old } = prediction, whole = studio.family === "assembly", others = figures.filter((figure) => !figure.design_with);
    this.figures.replaceChildren(table(figures.filter((figure) => figure.design_with)),
      old?.figures.length ? el("div", { class: "of-before", role: "group", "aria-label": "Figures of the previous state" }, table(old.figures)) : "",
      ...met.map((words) => el("p", { class: `met${meets ? " beyond" : ""}` }, words)),
      refused ? el("p", { class: "met beyond" }, refused) : quick ? el("p", { class: "more" }, `${old?.figures.length ? "Figures of the previous state. " : ""}${later(whole)}`) : "",
      this.fold("others", `Other models of the same (${others.length})`, others.length, () => table(others)),
      this.fold("left", `Left out (${left.length})`, left.length, () => el("dl", { class: "left-out" }, ...left.flatMap(({ name, reason }) => [el("dt", {}, name), el("dd", {}, reason)]))));
  }
  // What is shown on demand; it stays open when the figures change.
  fold(name, words, count, content) {
    if (!count) return "";
    const details = el("details", { class: "more", open: this.unfolded.has(name), ontoggle: () => { this.unfolded[details.open ? "add" : "delete"](name); if (details.open && details.children.length < 2) details.append(content()); } }, el("summary", {}, words));
    if (this.unfolded.has(name)) details.append(content());
    return details;
  }
}
function later(whole) {
  return whole ? "The prediction of the inflated assembly follows when you stop editing." : "The elastic stack's figures follow when you stop editing.";
}
export const named = (figure) => figure.group + figure.name + figure.model;
export function significant(value) {
  if (value === 0) return "0";
  const digits = Math.max(0, 2 - Math.floor(Math.log10(Math.abs(value))));
  return Math.abs(value) >= 1e5 ? value.toExponential(2) : value.toFixed(Math.min(digits, 6));
}
