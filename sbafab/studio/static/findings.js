// What the rules found, as they are measured, and what the models predict.
import { $, el, plain } from "./dom.js";

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
    this.figuresBlock = el("div", { class: "section-block" }, el("h2", {}, "Prediction", el("span", { class: "sum" }, "formulas, elastic stack")), this.figures, el("div", { class: "stale-mark" }, "Updating"));
    $("#panel-findings").append(this.block, this.figuresBlock);
    // Rules that come in quick succession are shown together, once a frame.
    studio.on("rule", () => { this.frame ??= requestAnimationFrame(() => { this.frame = null; this.draw(); }); });
    studio.on("checked opened", () => this.draw());
    studio.on("figures reference", () => this.drawFigures());
    studio.on("failed", (answer) => { if (!answer.field) this.draw(); });
  }
  draw() {
    const { studio } = this;
    // While the deck runs, a rule that was not measured again keeps its old line, pale.
    const fresh = new Map(studio.running.map((answer) => [answer.rule, answer.findings]));
    const old = studio.findings.filter((finding) => !fresh.has(finding.rule));
    const all = studio.stale.rules ? [...[...fresh.values()].flat(), ...old] : studio.findings;
    const sorted = all.map((finding) => ({ finding, waiting: studio.stale.rules && !fresh.has(finding.rule) })).sort((a, b) => RANK[a.finding.verdict] - RANK[b.finding.verdict]);
    const count = (verdict) => all.filter((finding) => finding.verdict === verdict).length;
    const said = [["fail", "failed"], ["warn", "to heed"], ["waived", "waived"], ["pass", "hold"]].filter(([verdict]) => count(verdict)).map(([verdict, words]) => `${count(verdict)} ${words}`);
    this.sum.textContent = said.join(", ");
    this.list.replaceChildren(...sorted.map(({ finding, waiting }) => this.line(finding, waiting)));
    if (studio.unmeasured) this.list.append(el("div", { role: "listitem", class: "unmeasured" }, studio.unmeasured));
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
    const { prediction, reference, noFigures } = this.studio;
    if (noFigures) { this.figures.replaceChildren(el("p", { class: "fallback" }, noFigures)); return; }
    if (!prediction) return;
    const before = new Map((reference?.prediction?.figures ?? []).map((figure) => [figure.group + figure.name + figure.model, figure.value]));
    const rows = [];
    let group = null;
    for (const figure of prediction.figures) {
      if (figure.group !== group) { group = figure.group; rows.push(el("tr", {}, el("th", { colspan: 4, scope: "rowgroup" }, group))); }
      const was = before.get(figure.group + figure.name + figure.model);
      const change = was === undefined || was === figure.value ? "" : `${figure.value > was ? "+" : "−"}${significant(Math.abs(figure.value - was))}`;
      rows.push(el("tr", { title: `${figure.model}. ${figure.trust}` }, el("td", {}, figure.name), el("td", { class: "v" }, significant(figure.value)), el("td", { class: "n" }, figure.unit), reference ? el("td", { class: "d" }, change) : null));
    }
    this.figures.replaceChildren(el("table", { class: "figures" }, el("tbody", {}, ...rows)));
  }
}
export function significant(value) {
  if (value === 0) return "0";
  const digits = Math.max(0, 2 - Math.floor(Math.log10(Math.abs(value))));
  return Math.abs(value) >= 1e5 ? value.toExponential(2) : value.toFixed(Math.min(digits, 6));
}
