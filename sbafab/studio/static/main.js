// The page: puts form, views and findings together, keys and dialogs.
import { $, css, download, el, icon, recall, remember } from "./dom.js";
import { ask, linkedDesign } from "./server.js";
import { Studio } from "./state.js";
import { Form } from "./form.js";
import { Editor } from "./editor.js";
import { Draw } from "./draw.js";
import { Nets } from "./nets.js";
import { Layers, svgBlob } from "./layers.js";
import { Section } from "./section.js";
import { Solid } from "./solid.js";
import { Findings } from "./findings.js";
import { Make } from "./make.js";
import { Motion } from "./motion.js";
import { Compare } from "./compare.js";
import { PartsSolid } from "./parts_solid.js";
import { PartsPlan } from "./parts_plan.js";
import { PartsMotion } from "./parts_motion.js";
import { PartsCompare } from "./parts_compare.js";
import { goBack } from "./assembly_form.js";
import { Dialogs } from "./dialogs.js";
import { onLoss } from "./graphics.js";

let studio, views, dialogs;
const upper = {};

async function start() {
  theme(recall("sbafab-theme", matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
  let started;
  try {
    started = await ask("/api/start");
  } catch (error) {
    document.body.replaceChildren(el("main", { class: "fallback" }, el("h1", {}, "sbafab studio"), el("p", { role: "alert" }, error.status ? error.message : "The studio does not answer. Start it again: sbafab studio")));
    return;
  }
  studio = new Studio(started);
  window.studio = studio;
  $("#notice").hidden = true;

  new Form(studio);
  new Editor(studio);
  views = { solid: new Solid(studio), layers: new Layers(studio), draw: new Draw(studio), nets: new Nets(studio), motion: new Motion(studio), parts: new PartsSolid(studio), plan: new PartsPlan(studio), swing: new PartsMotion(studio), make: new Make(studio), compare: new Compare(studio), beside: new PartsCompare(studio) };
  studio.motion = views.motion;
  Object.assign(studio, { drawing: views.draw, netMap: views.nets, solid: views.solid });
  onLoss((lost) => {
    if (lost) notice("The graphics driver stopped: pictures in space stand still until it is back.", true, [["Reload the page", () => location.reload()]], "graphics");
    else if ($("#notice").dataset.kind === "graphics") $("#notice").hidden = true;
  });
  studio.moving = () => !views.motion.element.hidden || views.swing.moving;
  const section = new Section(studio);
  $("#lower-stage").append(section.element);
  new Findings(studio, (finding) => goto(finding, section));
  tabs();
  dialogs = new Dialogs(studio, { picture: () => views[upper.shown].picture?.(), section });
  bar();
  marks(section);
  splitters();
  phone();
  keys();
  begin();
}

// What is shown first: a link's design, what the command named, work that a reload interrupted, or the gallery.
async function begin() {
  const draft = studio.draft();
  if (linkedDesign) {
    try { studio.open(await dialogs.unpacked(linkedDesign), { saved: "" }); history.replaceState(null, "", location.pathname); return; } catch { notice("The link holds no design; copy the complete link.", true); }
  }
  if (draft && draft.text !== draft.savedText) {
    const { name, text, savedText, seen } = draft;
    studio.open(text, { name, seen, saved: savedText });
    return;
  }
  if (studio.opened) await openFile(studio.opened).catch((error) => notice(error.message, true));
  else if (studio.given) studio.open(studio.given, { saved: "" });
  else if (studio.template) await openTemplate(studio.template).catch((error) => notice(error.message, true));
  else if (draft) { if (draft.name) await openFile(draft.name).catch(() => studio.open(draft.text)); else studio.open(draft.text); }
  else {
    await openTemplate("3dof-15mm");
    dialogs.openDesign();
  }
  const orphan = studio.orphan();
  if (orphan) notice(`Unsaved work on ${orphan.name ?? "a new design"} from ${new Date(orphan.at).toLocaleString()} is still here.`, false, [
    ["Open it", () => { studio.open(orphan.text, { name: orphan.name, seen: orphan.seen, saved: orphan.savedText }); localStorage.removeItem(orphan.key); }],
    ["Discard", () => localStorage.removeItem(orphan.key)],
  ]);
}
export async function openFile(name) {
  const { text, sha } = await ask(`/api/file/${encodeURIComponent(name)}`);
  studio.open(text, { name, seen: sha, saved: text });
}

async function openTemplate(name) {
  studio.open((await ask(`/api/template/${encodeURIComponent(name)}`)).text);
}

function tabs() {
  const bar = $("#upper .tabs");
  for (const [name, view] of Object.entries(views)) {
    bar.append(el("button", { role: "tab", id: `tab-${name}`, "aria-selected": "false", "aria-controls": `view-${name}`, tabindex: -1, onclick: () => show(name) }, view.title));
    Object.assign(view.element, { id: `view-${name}`, hidden: true });
    view.element.setAttribute("role", "tabpanel");
    view.element.setAttribute("aria-labelledby", `tab-${name}`);
    $("#upper-stage").append(view.element);
  }
  const low = el("button", { id: "low", class: "quiet", "aria-pressed": "true", title: "Section below", onclick: () => { const on = $("#views").classList.toggle("single"); low.setAttribute("aria-pressed", String(!on)); remember("sbafab-single", on); } }, "Section");
  if (recall("sbafab-single", innerWidth < 860)) { $("#views").classList.add("single"); low.setAttribute("aria-pressed", "false"); }
  bar.append(el("span", { class: "grow" }), low);
  for (const list of document.querySelectorAll("[role=tablist]")) list.addEventListener("keydown", (event) => {
    const all = [...list.querySelectorAll("[role=tab]:not([hidden])")], by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by || !all.includes(document.activeElement)) return;
    const next = all[(all.indexOf(document.activeElement) + by + all.length) % all.length];
    next.focus();
    next.click();
  });
  studio.on("design", suitTabs);
  suitTabs();
  studio.on("reference", () => {
    suitTabs();
    $("#pin").setAttribute("aria-pressed", String(Boolean(studio.reference)));
    $("#pin").textContent = studio.reference ? "End comparison" : "Compare";
    if (studio.reference) show("compare");
  });
  show(recall("sbafab-view", "solid") in views ? recall("sbafab-view", "solid") : "solid");
  const panels = { form: $("#form"), toml: $("#toml") };
  const side = (name) => {
    for (const [own, panel] of Object.entries(panels)) { panel.hidden = own !== name; $(`#tab-${own}`).setAttribute("aria-selected", String(own === name)); $(`#tab-${own}`).tabIndex = own === name ? 0 : -1; }
    $("#help").hidden = $("#filter").hidden = name !== "form";
    remember("sbafab-side", name);
  };
  for (const name of Object.keys(panels)) $(`#tab-${name}`).addEventListener("click", () => side(name));
  side(recall("sbafab-side", "form"));
}
// An assembly has views of its own; what stands in their place goes with a single design.
const INSTEAD = { solid: "parts", layers: "plan", motion: "swing", compare: "beside" };
const BACK = Object.fromEntries(Object.entries(INSTEAD).map(([single, whole]) => [whole, single]));
function suitTabs() {
  const whole = studio.family === "assembly", { reference } = studio;
  // Only what is of one kind stands side by side.
  const alike = reference && (reference.family === "assembly") === whole;
  const hidden = (name) => name in (whole ? INSTEAD : BACK) || (name === "draw" && (whole || !views.draw.present)) || (name === "nets" && whole) || (["compare", "beside"].includes(name) && !alike);
  for (const name of Object.keys(views)) $(`#tab-${name}`).hidden = hidden(name);
  if (upper.shown && hidden(upper.shown)) show(upper.shown);
}
function show(name) {
  const whole = studio.family === "assembly";
  name = (whole ? INSTEAD : BACK)[name] ?? name;
  if ($(`#tab-${name}`).hidden) name = whole ? "plan" : "layers";
  upper.shown = name;
  for (const [own, view] of Object.entries(views)) {
    view.element.hidden = own !== name;
    const tab = $(`#tab-${own}`);
    tab.setAttribute("aria-selected", String(own === name));
    tab.tabIndex = own === name ? 0 : -1;
    if (own !== name) view.hide?.();
  }
  // What needs the room takes the section's as well.
  $("#views").classList.toggle("whole", ["draw", "nets", "motion", "make", "compare", ...Object.keys(BACK)].includes(name));
  $("#low").hidden = $("#views").classList.contains("whole");
  views[name].show?.();
  if (!["compare", "beside"].includes(name)) remember("sbafab-view", name);
}

// A finding shows its place in the plan, in the section and in space.
function goto(finding, section) {
  if (studio.family === "assembly") return gotoParts(finding);
  const { layers, x, y, interface: number } = finding.where;
  const bond = studio.laminate?.bonds[number - 1];
  const own = layers.length ? layers : bond?.layers ?? [];
  if (!studio.laminate || !own.length || x === null) {
    if (own.length) studio.pick(studio.layer(own[0]));
    return;
  }
  phonePanel("views");
  const inside = own.find((index) => studio.layer(index)?.mask) ?? own[0];
  if (finding.rule === "nets") { show("nets"); views.nets.gotoPlace(x, y, own); return; }
  if (!["solid", "layers", "draw"].includes(upper.shown)) show("layers");
  if (upper.shown === "draw") views.draw.goto(x, y);
  views.layers.goto(studio.layer(inside), x, y);
  section.goto(own, x, y);
  views.solid.goto([inside], x, y);
}

// Of an assembly the parts that a finding is about are picked out.
function gotoParts({ design, parts }) {
  const named = (part) => (design ? part.design?.name === design : parts.includes(part.name));
  phonePanel("views");
  if (!["parts", "plan"].includes(upper.shown)) show("parts");
  studio.pickParts((studio.parts ?? []).filter(named).map(({ name }) => name));
}

function bar() {
  $("#undo").append(icon("undo"));
  $("#redo").append(icon("redo"));
  $("#theme").append(icon("theme"));
  $("#undo").addEventListener("click", () => studio.step(-1));
  $("#redo").addEventListener("click", () => studio.step(1));
  $("#theme").addEventListener("click", () => { theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"); studio.emit("theme"); });
  $("#open").addEventListener("click", () => dialogs.openDesign());
  $("#share").addEventListener("click", () => dialogs.share());
  $("#save").addEventListener("click", () => dialogs.save());
  $("#pin").addEventListener("click", () => studio.pin());
  $("#make").addEventListener("click", () => { phonePanel("views"); show("make"); });
  $("#back").addEventListener("click", () => goBack(studio));
  studio.on("told", (words) => notice(words));
  const state = () => {
    $("#back").hidden = !studio.back;
    if (studio.back) { $("#back").textContent = `‹ ${studio.back.title}`; $("#back").setAttribute("aria-label", `Back to ${studio.back.title}`); }
    $("#undo").disabled = studio.place <= 0 && studio.history[studio.place] === studio.text;
    $("#redo").disabled = studio.place >= studio.history.length - 1;
    $("#doc-name").textContent = studio.name ?? studio.designName ?? "New design";
    $("#doc-state").textContent = studio.name ? (studio.unsaved ? "edited, not saved" : "saved") : "not in a file";
    document.title = `${studio.unsaved ? "• " : ""}${studio.name ?? studio.designName ?? "New design"} – sbafab studio`;
  };
  studio.on("text history saved opened design kept", state);
  studio.on("conflict", (found) => notice(`${studio.name} was changed on disk, and here too.`, true, [
    ["Load the file", () => studio.take(found)],
    ["Keep mine", () => { studio.seen = found.sha; studio.savedText = found.text; studio.keep(); state(); }],
  ]));
  studio.on("failed", (answer) => { if (["lost", "crashed", "defect"].includes(answer.kind)) notice(answer.message, true); });
  studio.on("laminate checked", () => { if ($("#notice").dataset.kind === "bad" && !studio.error) $("#notice").hidden = true; });
}

function marks(section) {
  const stale = () => {
    const bad = studio.error !== null;
    const mark = (element, on) => {
      element.classList.toggle("stale", on);
      element.classList.toggle("bad", on && bad);
      const words = $(".stale-mark", element);
      if (words) words.textContent = bad ? "Last good design" : element.classList.contains("section-block") ? "Updating" : "Updating";
    };
    for (const view of [views.solid, views.layers, views.draw, views.nets, views.compare, views.parts, views.plan, views.swing, views.beside]) mark(view.element, studio.stale.laminate || bad);
    mark(section.element, studio.stale.laminate || bad);
    mark($("#panel-findings").children[0], studio.stale.rules || bad);
    mark($("#panel-findings").children[1], studio.stale.figures || bad);
  };
  studio.on("stale failed laminate parts checked figures", stale);
  studio.on("hover", (words) => { $("#hover").textContent = words; });
  studio.on("busy", (on) => { $("#busy").textContent = on ? "working" : ""; });
  studio.on("timing", () => {
    const last = (what) => studio.latency[what].at(-1);
    $("#timing").textContent = [["geometry", "views"], ["figures", "prediction"], ["deck", "rules"], ["all", "with yield"]].filter(([what]) => last(what)).map(([what, words]) => `${words} ${Math.round(last(what))} ms`).join("  ");
  });
}

function splitters() {
  const drag = (id, name, of) => {
    const bar = $(id), kept = recall(`sbafab${name}`, null), root = name === "--left" ? $("main") : $("#views");
    const set = (size) => { root.style.setProperty(name, size); remember(`sbafab${name}`, size); };
    if (kept) root.style.setProperty(name, kept);
    bar.addEventListener("pointerdown", (down) => {
      bar.setPointerCapture(down.pointerId);
      const move = (event) => set(of(event));
      bar.addEventListener("pointermove", move);
      bar.addEventListener("pointerup", () => bar.removeEventListener("pointermove", move), { once: true });
    });
    bar.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -24, ArrowRight: 24, ArrowUp: -24, ArrowDown: 24 }[event.key];
      if (!by) return;
      event.preventDefault();
      const box = bar.getBoundingClientRect();
      set(of({ clientX: box.left + by, clientY: box.top + by }));
    });
  };
  const within = (value, least, most) => Math.min(most, Math.max(least, value));
  drag("#split-left", "--left", (event) => `${within(event.clientX, 240, innerWidth * 0.45)}px`);
  drag("#split-low", "--low", (event) => { const box = $("#views").getBoundingClientRect(); return `${within(((box.bottom - event.clientY) / box.height) * 100, 12, 80)}%`; });
}

function phonePanel(name) {
  document.body.dataset.panel = name;
  for (const button of document.querySelectorAll("nav.phone button")) button.dataset.panel === name ? button.setAttribute("aria-current", "true") : button.removeAttribute("aria-current");
}
function phone() {
  phonePanel("views");
  for (const button of document.querySelectorAll("nav.phone button")) button.addEventListener("click", () => phonePanel(button.dataset.panel));
}

function keys() {
  addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
    const does = { z: () => studio.step(event.shiftKey ? 1 : -1), y: () => studio.step(1), s: () => dialogs.save(), o: () => dialogs.openDesign(), Enter: () => show("make") }[event.key === "Z" ? "z" : event.key];
    if (!does || $("#dialog").open) return;
    event.preventDefault();
    does();
  });
  addEventListener("beforeunload", () => studio.keep());
}

function theme(name) {
  document.documentElement.dataset.theme = name;
  remember("sbafab-theme", name);
}
// What asks stays until it is answered; what only tells of a failure goes with it.
export function notice(words, bad = false, choices = [], kind = bad && !choices.length ? "bad" : "") {
  const bar = $("#notice"), close = () => { bar.hidden = true; };
  bar.dataset.kind = kind;
  bar.classList.toggle("bad", bad);
  bar.replaceChildren(el("span", {}, words), ...choices.map(([label, does]) => el("button", { onclick: () => { close(); does(); } }, label)), el("button", { class: "quiet", "aria-label": "Close", onclick: close }, "×"));
  bar.hidden = false;
}
export { css, download, svgBlob };

start();
