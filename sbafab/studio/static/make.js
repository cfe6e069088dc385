// Generate with progress, look at what was made, play the cut, take it home as one zip.
import { $, el, plain } from "./dom.js";
import { Playing } from "./play_loop.js";
import { listen, tab } from "./server.js";

// ms of a sheet, and the least of a cut.
const SHEET = 6000, CUT = 16;

export class Make {
  title = "Make";
  constructor(studio) {
    this.studio = studio;
    this.go = el("button", { class: "primary", onclick: () => this.generate() }, "Generate");
    this.stop = el("button", { hidden: true, onclick: () => this.abort?.abort() }, "Cancel");
    this.keep = el("input", { type: "checkbox" });
    this.bar = el("progress", { max: 1, value: 0, hidden: true, "aria-label": "Progress" });
    this.said = el("p", { role: "status" });
    this.zip = el("a", { hidden: true, download: "", class: "button" }, "Download zip");
    this.list = el("div", { class: "list", role: "group", "aria-label": "Files" });
    this.stage = el("div", { class: "show" }, el("p", { class: "empty" }, "Generate runs the rules, then writes cut files, film sheets, press schedule, traveller, meshes and pictures: the same bytes as sbafab generate. A design that breaks a rule gets its findings and no cut file."));
    this.element = el("div", { class: "view" }, el("div", { class: "make" },
      el("div", { class: "head" }, this.go, this.stop, el("label", {}, this.keep, " into out/ of the folder"), this.bar, this.said, el("span", { class: "grow" }), this.zip),
      el("div", { class: "body" }, this.list, this.stage)));
    studio.on("text", () => { if (this.made && this.madeText !== studio.text) this.said.textContent = "The files are from an earlier state of the design; generate again."; });
    studio.on("opened", () => { this.made = null; this.list.replaceChildren(); this.zip.hidden = true; this.said.textContent = ""; });
  }
  async generate() {
    const { studio } = this;
    this.abort = new AbortController();
    this.go.disabled = true;
    this.stop.hidden = this.bar.hidden = false;
    this.bar.removeAttribute("value");
    this.said.textContent = "Starting";
    const text = studio.text;
    let done = false, made = null;
    try {
      await listen("/api/generate", { tab, text, edits: [], name: studio.name, keep: this.keep.checked }, (answer) => {
        if (answer.kind === "progress") {
          this.said.textContent = answer.what;
          if (answer.total > 1) { this.bar.max = answer.total; this.bar.value = answer.done; } else this.bar.removeAttribute("value");
        } else if (answer.kind === "made") { done = true; this.madeText = text; made = answer; }
        else if (answer.message) { done = true; this.said.textContent = answer.message; }
      }, this.abort.signal);
      if (made) this.show_(made);
      if (!done) this.said.textContent = "Cancelled; nothing was written";
    } catch (error) {
      this.said.textContent = error.name === "AbortError" ? "Cancelled; nothing was written" : error.message;
    }
    this.go.disabled = false;
    this.stop.hidden = this.bar.hidden = true;
  }
  show_(made) {
    this.made = made;
    const sheets = made.files.filter((file) => /^sheets\/.*\.svg$/.test(file));
    const broken = made.findings.filter((finding) => finding.verdict === "fail");
    this.said.textContent = made.failed ? `No cut file: ${broken.map((finding) => finding.rule).join(", ")} failed` : `${made.files.length} files of ${made.name}${this.keep.checked ? " in out/" : ""}`;
    this.zip.hidden = !made.files.length;
    this.zip.href = `/made/${made.key}.zip`;
    this.zip.download = `${made.name}.zip`;
    const groups = [["Sheets", sheets], ["Pages", made.files.filter((file) => file.endsWith(".html"))], ["Pictures", made.files.filter((file) => /^preview\//.test(file))],
      ["Files", made.files.filter((file) => /\.(json|csv|toml)$/.test(file))], ["Cut files", made.files.filter((file) => /^layers\/|^sheets\/.*\.(dxf|lbrn2)$/.test(file))], ["Meshes", made.files.filter((file) => /^mesh\//.test(file))]];
    this.list.replaceChildren(...groups.filter(([, files]) => files.length).flatMap(([words, files]) => [el("h3", {}, words), ...files.map((file) => el("button", { "aria-pressed": "false", "data-file": file, onclick: () => this.open(file) }, file.split("/").pop()))]));
    const first = sheets[0] ?? made.files.find((file) => file === "findings.html");
    if (first) this.open(first);
  }
  async open(file) {
    for (const button of this.list.querySelectorAll("button")) button.setAttribute("aria-pressed", String(button.dataset.file === file));
    const url = `/made/${this.made.key}/${file}`;
    if (/^sheets\/.*\.svg$/.test(file)) return this.sheet(await (await fetch(url)).text());
    if (file.endsWith(".html")) { this.stage.replaceChildren(el("iframe", { src: url, title: file, sandbox: "allow-scripts allow-modals" }), el("div", { class: "tools right-top" }, el("a", { href: url, target: "_blank", rel: "noopener" }, "Open to print"))); return; }
    if (/\.(svg|png)$/.test(file)) { this.stage.replaceChildren(el("img", { src: url, alt: file })); return; }
    if (/\.(json|csv|toml|dxf|lbrn2)$/.test(file)) { const words = await (await fetch(url)).text(); this.stage.replaceChildren(el("pre", { tabindex: 0 }, words.slice(0, 200000))); return; }
    this.stage.replaceChildren(el("p", { class: "empty" }, el("a", { href: url, download: file.split("/").pop() }, `Download ${file}`)));
  }
  // The sheet's own picture holds its contours in cutting order; the slider shows how far the beam is.
  sheet(words) {
    const source = new DOMParser().parseFromString(words, "image/svg+xml").documentElement;
    const [, , width, height] = source.getAttribute("viewBox").split(" ").map(Number);
    const svg = el("svg", { viewBox: `-2 -2 ${width + 4} ${height + 4}`, role: "img", "aria-label": "Film sheet" });
    const cuts = [];
    for (const group of source.querySelectorAll("g")) {
      const kind = group.id;
      for (const shape of group.children) {
        const copy = document.importNode(shape, true);
        copy.setAttribute("fill", "none");
        copy.setAttribute("stroke", kind === "REFERENCE" ? "var(--strong)" : kind === "ENGRAVE" ? "var(--faint)" : "var(--strong)");
        copy.setAttribute("stroke-width", 1);
        copy.setAttribute("vector-effect", "non-scaling-stroke");
        svg.append(copy);
        if (kind !== "REFERENCE") cuts.push({ copy, kind, long: 0 });
      }
    }
    const slider = el("input", { type: "range", min: 0, value: 0, step: 1, "aria-label": "Cut order", class: "order" });
    const where = el("output", {});
    this.playing?.stop();
    this.playing = new Playing(() => this.cutting(slider, paint));
    this.stage.replaceChildren(el("div", { class: "surface sheet" }, svg), el("div", { class: "tools" }, this.playing.button, el("label", {}, "Cut", slider), where));
    Object.assign(svg.style, { position: "absolute", inset: "8px 8px 52px", width: "calc(100% - 16px)", height: "calc(100% - 60px)" });
    slider.style.width = "min(40vw, 360px)";
    slider.max = cuts.length;
    slider.value = cuts.length;
    const colour = { CUT_INNER: "var(--accent)", CUT_OUTER: "var(--cut)", CUT_SHEET: "var(--waived)", ENGRAVE: "var(--ink)" };
    const words_ = { CUT_INNER: "hole", CUT_OUTER: "outline", CUT_SHEET: "sheet", ENGRAVE: "engraving" };
    const paint = () => {
      const now = Number(slider.value);
      cuts.forEach(({ copy, kind }, i) => {
        copy.setAttribute("stroke", i < now ? colour[kind] : "var(--strong)");
        copy.setAttribute("stroke-width", i === now - 1 && now < cuts.length ? 3 : 1.1);
      });
      where.textContent = now ? `${now} of ${cuts.length}: ${words_[cuts[now - 1].kind]}` : `0 of ${cuts.length}`;
    };
    slider.addEventListener("input", paint);
    paint();
  }
  // Moves the slider from cut to cut, from where it stands, and stops after the last.
  cutting(slider, paint) {
    const count = Number(slider.max), first = Number(slider.value) >= count ? 0 : Number(slider.value);
    const each = Math.max(CUT, SHEET / Math.max(1, count));
    return (elapsed) => {
      slider.value = first + Math.floor(elapsed / each);
      paint();
      if (Number(slider.value) >= count) this.playing.stop();
    };
  }
  hide() { this.playing?.stop(); }
  async picture() {
    const svg = $("svg", this.stage);
    const { svgBlob } = await import("./layers.js");
    return svg ? { name: "sheet.svg", blob: svgBlob(svg) } : null;
  }
}
export { plain };
