// The actuator under pressure (filled in by the fast stack).
import { el } from "./dom.js";
export class Motion {
  title = "Motion";
  constructor(studio) { this.studio = studio; this.element = el("div", { class: "view" }, el("p", { class: "fallback" }, "…")); }
}
