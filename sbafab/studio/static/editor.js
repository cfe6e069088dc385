// The design file as text: numbered lines, keys in colour, the line of an error marked.
import { $, el } from "./dom.js";

export class Editor {
  constructor(studio) {
    this.studio = studio;
    this.area = el("textarea", { spellcheck: "false", autocapitalize: "off", autocomplete: "off", wrap: "off", "aria-label": "Design file, TOML" });
    this.back = el("pre", { "aria-hidden": "true" });
    this.gutter = el("div", { class: "gutter", "aria-hidden": "true" });
    this.error = el("div", { class: "editor-error", role: "alert", hidden: true });
    $("#toml").append(el("div", { class: "editor" }, el("div", { class: "inner" }, this.gutter, el("div", { class: "text" }, this.back, this.area))), this.error);
    this.area.addEventListener("input", () => { this.paint(); clearTimeout(this.timer); this.timer = setTimeout(() => studio.write(this.area.value, "editor"), 120); });
    this.area.addEventListener("keydown", (event) => {
      if (event.key !== "Tab" || event.shiftKey) return;
      // Tab leaves the text, as everywhere on the page; Escape first is not needed.
    });
    studio.on("text", (from) => { if (from !== "editor") this.show(studio.text); });
    studio.on("failed", (answer) => this.mark(answer));
    studio.on("design", () => this.mark(null));
  }
  show(text) {
    if (this.area.value === text) return;
    const { selectionStart, selectionEnd, scrollTop } = this.area;
    this.area.value = text;
    this.area.setSelectionRange(selectionStart, selectionEnd);
    this.area.scrollTop = scrollTop;
    this.paint();
  }
  mark(answer) {
    this.bad = null;
    this.error.hidden = !answer;
    if (answer) {
      this.error.textContent = answer.message;
      const line = /line (\d+)/.exec(answer.message);
      if (line) this.bad = Number(line[1]);
      else if (answer.field) this.bad = lineOf(this.area.value, answer.field);
    }
    this.paint();
  }
  paint() {
    const lines = this.area.value.split("\n");
    this.gutter.textContent = lines.map((_, i) => i + 1).join("\n");
    this.back.replaceChildren(...lines.flatMap((line, i) => {
      const parts = coloured(line);
      const made = i + 1 === this.bad ? [el("span", { class: "line-bad" }, ...parts, parts.length ? "" : " ")] : parts;
      return i ? ["\n", ...made] : made;
    }));
  }
}

const TOKEN = /(#.*$)|(^\s*\[[^\]]*\]+)|(^\s*[A-Za-z0-9_."'-]+(?=\s*=))|("(?:[^"\\]|\\.)*"|'[^']*')|(\b(?:true|false)\b|[-+]?\b\d[\d_.eE+-]*)/g;
const CLASSES = ["t-c", "t-t", "t-k", "t-s", "t-n"];
function coloured(line) {
  const parts = [];
  let end = 0;
  for (const found of line.matchAll(TOKEN)) {
    if (found.index > end) parts.push(line.slice(end, found.index));
    const kind = found.slice(1).findIndex((text) => text !== undefined);
    parts.push(el("span", { class: CLASSES[kind] }, found[0]));
    end = found.index + found[0].length;
    if (kind === 0) break;
  }
  if (end < line.length) parts.push(line.slice(end));
  return parts;
}

export function lineOf(text, key) {
  let table = "";
  const lines = text.split("\n");
  for (let i = 0; i < lines.length; i++) {
    const head = /^\s*\[+\s*([^\]#]+?)\s*\]+/.exec(lines[i]);
    if (head) table = head[1].trim() + ".";
    const own = /^\s*([A-Za-z0-9_.-]+)\s*=/.exec(lines[i]);
    if (own && table + own[1] === key) return i + 1;
  }
  return null;
}
