// Open, save and share.
import { $, download, el } from "./dom.js";
import { ask } from "./server.js";

export class Dialogs {
  constructor(studio, { picture, section }) {
    Object.assign(this, { studio, picture, section, dialog: $("#dialog") });
    this.dialog.addEventListener("click", (event) => { if (event.target === this.dialog) this.dialog.close(); });
  }
  show(title, ...content) {
    this.dialog.replaceChildren(el("div", { class: "head" }, el("h2", { id: "dialog-title" }, title), el("button", { class: "quiet", "aria-label": "Close", onclick: () => this.dialog.close() }, "×")), el("div", { class: "content" }, ...content));
    if (!this.dialog.open) this.dialog.showModal();
  }

  async openDesign() {
    const { studio } = this;
    const { files } = await ask("/api/start").catch(() => studio);
    const pick = async (load) => {
      if (studio.unsaved && studio.name && !confirm(`Leave ${studio.name} without saving? This cannot be undone.`)) return;
      try { await load(); this.dialog.close(); } catch (error) { alert(error.message); }
    };
    const cards = studio.templates.map((name) => el("button", { onclick: () => pick(async () => studio.open((await ask(`/api/template/${encodeURIComponent(name)}`)).text)) },
      el("img", { src: `templates/${name}.webp`, alt: "", loading: "lazy", width: 320, height: 240, onerror: (event) => { event.target.style.visibility = "hidden"; } }), el("div", {}, el("strong", {}, name), el("small", {}, studio.summaries[name]))));
    const own = files.length ? [el("h3", {}, `Design files in ${studio.folder}`), el("div", { class: "files" }, ...files.map((name) => el("button", { onclick: () => pick(async () => { const { text, sha } = await ask(`/api/file/${encodeURIComponent(name)}`); studio.open(text, { name, seen: sha }); }) }, name)))] : [];
    const link = el("input", { type: "text", placeholder: "Paste a link that holds a design", "aria-label": "Link", style: false });
    const file = el("input", { type: "file", accept: ".toml", "aria-label": "Other design file", onchange: () => pick(async () => studio.open(await file.files[0].text(), { saved: "" })) });
    this.show("Open a design", ...own, el("h3", {}, "Start from a template"), el("div", { class: "gallery" }, ...cards), el("h3", {}, "Other sources"),
      el("div", { class: "share" }, link, el("button", { onclick: () => pick(async () => studio.open(await this.unpacked(new URLSearchParams(link.value.split("#")[1] ?? "").get("design") ?? ""), { saved: "" })) }, "Open link"), file));
  }

  save() {
    const { studio } = this;
    if (studio.name) { this.saved(studio.name); return; }
    const name = el("input", { type: "text", value: `${studio.designName ?? "design"}.toml`, "aria-label": "File name" });
    const go = () => this.saved(name.value.endsWith(".toml") ? name.value : `${name.value}.toml`).then(() => this.dialog.close());
    name.addEventListener("keydown", (event) => { if (event.key === "Enter") go(); });
    this.show("Save the design", el("div", { class: "share" }, el("p", {}, `Into ${studio.folder}`), name, el("button", { class: "primary", onclick: go }, "Save")));
    name.select();
  }
  async saved(name, over = false) {
    try { await this.studio.save(name, over); } catch (error) {
      if (error.status !== 409) alert(error.message);
      else if (!over && confirm(`${name} lies there already with other content. Save over it?`)) return this.saved(name, true);
    }
  }

  async share() {
    const { studio } = this;
    const link = `${location.origin}${location.pathname}#design=${await packed(studio.text)}`;
    const field = el("input", { type: "text", readonly: true, value: link, "aria-label": "Link that holds the design", onfocus: (event) => event.target.select() });
    const copy = el("button", { class: "primary", onclick: async () => { field.select(); await (navigator.clipboard?.writeText(link) ?? Promise.reject()).then(() => { copy.textContent = "Copied"; }).catch(() => document.execCommand("copy")); } }, "Copy link");
    const save = async (made) => { const { name, blob } = await made; download(`${studio.designName}-${name}`, blob); };
    this.show("Share", el("div", { class: "share" }, field, copy, el("p", {}, `The link holds the whole design (${(link.length / 1000).toFixed(1)} kB) and no token. Who gets it opens it with: sbafab studio "LINK"`),
      el("span", {}, "Picture of the view above"), el("button", { onclick: () => save(this.picture()) }, "Picture"),
      el("span", {}, "Picture of the section"), el("button", { onclick: () => save(this.section.picture()) }, "Section"),
      el("span", {}, "Design file with its comments"), el("button", { onclick: () => download(`${studio.designName}.toml`, studio.text, "application/toml") }, "Design file")));
  }
  async unpacked(words) {
    const raw = Uint8Array.from(atob(words.replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
    const text = await new Response(new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate-raw"))).text();
    if (!text) throw new Error("The link holds no design; copy the complete link.");
    return text;
  }
}
async function packed(text) {
  const squeezed = new Uint8Array(await new Response(new Blob([text]).stream().pipeThrough(new CompressionStream("deflate-raw"))).arrayBuffer());
  return btoa(String.fromCharCode(...squeezed)).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}
