// The design being edited and what is known of it; views listen, none keeps a copy.
import { ask, listen, tab } from "./server.js";
import { recall, remember, uniqueName } from "./dom.js";

const SETTLE = 500;
const MOST_HISTORY = 200;
const DRAFT_DAYS = 14;

export class Studio {
  constructor(started) {
    Object.assign(this, started);
    this.given = started.text;
    this.name = null;
    this.text = "";
    this.savedText = "";
    this.seen = null;
    this.pending = new Map();
    this.history = [];
    this.place = -1;
    this.shapes = new Map();
    this.laminate = null;
    this.parts = null;
    this.surfaces = new Map();
    this.pickedParts = [];
    this.back = null;
    this.values = null;
    this.family = null;
    this.findings = [];
    this.running = [];
    this.prediction = null;
    this.error = null;
    this.stale = { laminate: true, rules: true, figures: true };
    this.picked = null;
    this.hovered = null;
    this.cut = null;
    this.reference = null;
    this.inflated = { pressure_kpa: 10, load_g: 1.2 };
    this.latency = { geometry: [], figures: [], deck: [], all: [] };
    this.listeners = new Map();
    this.flight = null;
    this.draftKey = "sbafab-draft:" + (sessionStorage.getItem("sbafab-tab") ?? freshTab());
  }

  on(names, heard) {
    for (const name of names.split(" ")) {
      if (!this.listeners.has(name)) this.listeners.set(name, []);
      this.listeners.get(name).push(heard);
    }
  }
  emit(name, what) {
    for (const heard of this.listeners.get(name) ?? []) heard(what);
  }

  // What is opened: a text with the file it came from (or none) and what lies on disk.
  open(text, { name = null, seen = null, saved = text, back = null } = {}) {
    Object.assign(this, { text, name, seen, savedText: saved, back, prediction: null, nets: null, picked: null, pickedParts: [], cut: null });
    this.keepBack();
    this.pending.clear();
    this.history = [text];
    this.place = 0;
    this.emit("opened");
    this.emit("text", "opened");
    this.ask();
    this.watch();
    this.keep();
  }
  get unsaved() { return this.current !== this.savedText; }
  get current() { return this.text; }

  // Changes keys: [[key, TOML literal or null]]; the server writes them into the text.
  edit(edits) {
    for (const [key, value] of edits) this.pending.set(key, value);
    this.changed();
  }
  write(text, from) {
    if (text === this.text && !this.pending.size) return;
    this.text = text;
    this.pending.clear();
    this.emit("text", from);
    this.changed();
    this.settle();
  }
  changed() {
    this.changedAt = performance.now();
    for (const part of Object.keys(this.stale)) this.stale[part] = true;
    clearTimeout(this.elasticTimer);
    this.elastic?.abort();
    this.emit("stale");
    this.ask();
  }

  // A step of the history, once the hand rests; a drag, which holds it, is one step.
  settle() {
    clearTimeout(this.settling);
    // What is not in the text yet belongs to the same step.
    if (!this.holding) this.settling = setTimeout(() => (this.pending.size ? this.settle() : this.commit()), SETTLE);
    this.keep();
  }
  commit() {
    clearTimeout(this.settling);
    if (this.history[this.place] === this.text) return;
    this.history.splice(this.place + 1, Infinity, this.text);
    if (this.history.length > MOST_HISTORY) this.history.shift();
    this.place = this.history.length - 1;
    this.emit("history");
  }
  step(by) {
    this.commit();
    const next = this.history[this.place + by];
    if (next === undefined) return;
    this.place += by;
    this.text = next;
    this.pending.clear();
    // An answer to what is undone would bring it back.
    this.flight?.abort.abort();
    this.flight = null;
    this.emit("text", "history");
    this.emit("history");
    this.changed();
    this.keep();
  }

  // A draft in the browser's store, so that a reload loses nothing.
  keep() {
    const { name, text, savedText, seen, folder } = this;
    remember(this.draftKey, { name, text, savedText, seen, folder, at: Date.now() });
    this.emit("kept");
  }
  // What a part was opened from waits in the store as well, as long as it has work that is not saved.
  keepBack() {
    const { back, folder } = this, key = this.draftKey + ":back";
    if (back && back.text !== back.savedText) remember(key, { ...back, folder, at: Date.now() });
    else localStorage.removeItem(key);
  }
  draft() {
    const own = recall(this.draftKey, null);
    return own && own.folder === this.folder ? own : null;
  }
  // The newest unsaved text of a tab that was closed.
  orphan() {
    let best = null;
    for (const key of Object.keys(localStorage).filter((key) => key.startsWith("sbafab-draft:"))) {
      const found = recall(key, null);
      if (!found || Date.now() - found.at > DRAFT_DAYS * 864e5) localStorage.removeItem(key);
      else if (key !== this.draftKey && found.folder === this.folder && found.text !== found.savedText && (!best || found.at > best.at)) best = { ...found, key };
    }
    return best;
  }

  body() {
    return { tab, text: this.text, edits: [...this.pending], name: this.name, has: [...this.shapes.keys(), ...this.surfaces.keys()] };
  }

  // One request at a time: a drag shows every state it can, and never waits for the rules.
  ask() {
    this.wanted = true;
    if (this.flight && !this.flight.shown) return;
    this.flight?.abort.abort();
    this.send();
  }
  async send() {
    this.wanted = false;
    const sent = [...this.pending];
    const flight = (this.flight = { abort: new AbortController(), shown: false, at: this.changedAt ?? performance.now() });
    this.running = [];
    this.emit("busy", true);
    try {
      await listen("/api/live", this.body(), (answer) => this.heard(answer, flight, sent), flight.abort.signal);
    } catch (error) {
      if (error.name !== "AbortError") this.fail({ kind: "lost", message: error.status ? error.message : "the studio does not answer; start sbafab studio again, and this page goes on" });
    }
    if (this.flight !== flight) return;
    this.flight = null;
    this.emit("busy", false);
    if (this.wanted) this.ask();
  }
  heard(answer, flight, sent) {
    if (this.flight !== flight) return;
    const hears = {
      text: () => this.heardText(answer.text, sent),
      design: () => {
        Object.assign(this, { values: answer.values, family: answer.family, designName: answer.name, parts: null });
        this.error = null;
        this.emit("design");
      },
      assembly: () => {
        const seen = this.laminate !== null;
        Object.assign(this, { values: answer.values, family: "assembly", designName: answer.name, laminate: null, error: null });
        this.emit("design");
        if (seen) this.emit("laminate");
      },
      parts: () => this.heardParts(answer, flight),
      shapes: () => {
        for (const [key, shape] of Object.entries(answer.shapes)) this.shapes.set(key, shape);
        this.named = answer.named;
        this.emit("shapes", answer.named);
      },
      laminate: () => this.heardLaminate(answer, flight),
      prediction: () => {
        // What an assembly does takes seconds; until then the figures before are shown as such.
        const old = this.prediction;
        this.prediction = answer.figures.length ? answer : { ...answer, before: old?.before ?? old };
        this.heardFigures(null);
        this.time("figures", flight);
        this.askElastic();
      },
      unpredicted: () => this.heardFigures(answer.message),
      nets: () => {
        for (const [key, shape] of Object.entries(answer.shapes)) this.shapes.set(key, shape);
        this.nets = { ...answer, laminate: this.laminate };
        this.emit("nets");
      },
      rule: () => {
        this.running.push(answer);
        this.emit("rule", answer);
        if (answer.rule === "registration-worst-case") this.time("deck", flight);
      },
      checked: () => {
        this.findings = this.running.flatMap((answer) => answer.findings);
        this.stale.rules = this.wanted;
        this.time("all", flight);
        this.emit("checked");
        this.emit("stale");
      },
      superseded: () => {},
    };
    (hears[answer.kind] ?? (() => this.fail(answer)))();
    if (["laminate", "error", "defect", "crashed", "parts"].includes(answer.kind)) {
      flight.shown = true;
      if (this.wanted) this.ask();
    }
  }
  heardText(text, sent) {
    for (const [key, value] of sent) if (this.pending.get(key) === value) this.pending.delete(key);
    if (text === this.text) return;
    this.text = text;
    this.emit("text", "edits");
    this.settle();
  }
  heardLaminate(answer, flight) {
    for (const [key, shape] of Object.entries(answer.shapes)) this.shapes.set(key, shape);
    this.laminate = { ...answer, bonds: interfaces(answer.layers) };
    this.drop();
    this.stale.laminate = this.wanted;
    if (!this.cut || !this.cut.moved) this.cut = firstCut(answer);
    this.emit("laminate");
    this.emit("stale");
    requestAnimationFrame(() => setTimeout(() => this.time("geometry", flight)));
  }
  // An assembly's parts and their places; a surface comes once.
  heardParts(answer, flight) {
    for (const [key, surface] of Object.entries(answer.surfaces)) this.surfaces.set(key, surface);
    this.parts = answer.parts;
    if (this.surfaces.size > 60) for (const key of this.surfaces.keys()) if (!answer.parts.some(({ surface }) => surface === key)) this.surfaces.delete(key);
    this.pickedParts = this.pickedParts.filter((name) => answer.parts.some((part) => part.name === name));
    this.stale.laminate = this.wanted;
    this.emit("parts");
    this.emit("stale");
    requestAnimationFrame(() => setTimeout(() => this.time("geometry", flight)));
  }
  heardFigures(refusal) {
    this.noFigures = refusal;
    this.stale.figures = this.wanted;
    this.emit("figures");
    this.emit("stale");
  }
  drop() {
    // Shapes of states long gone.
    if (this.shapes.size < 400) return;
    const used = new Set([...[this.laminate, this.reference?.laminate].filter(Boolean).flatMap(shapeKeys), ...Object.values(this.named ?? {}), ...(this.nets?.areas ?? []).map(({ shape }) => shape), ...(this.nets?.gaps ?? []).map(({ contact }) => contact)]);
    for (const key of this.shapes.keys()) if (!used.has(key)) this.shapes.delete(key);
  }
  time(what, flight) {
    this.latency[what].push(performance.now() - flight.at);
    this.emit("timing");
  }
  fail(answer) {
    this.error = answer;
    this.emit("failed", answer);
    this.emit("stale");
  }
  // What takes seconds comes once the hand rests, and not while the actuator is being moved.
  askElastic(after = 1500) {
    clearTimeout(this.elasticTimer);
    this.elastic?.abort();
    this.elasticTimer = setTimeout(async () => {
      if (this.moving?.()) { this.askElastic(); return; }
      if (this.stale.figures || this.stale.laminate) return;
      const own = (this.elastic = new AbortController());
      try {
        await listen("/api/elastic", { ...this.body(), pose: this.inflated }, (answer) => {
          if (own.signal.aborted || this.stale.figures) return;
          if (answer.kind === "prediction") {
            this.prediction = answer;
            if (this.reference?.text === this.text) this.reference.prediction = answer;
          }
          else if (answer.message && this.prediction) this.prediction = { ...this.prediction, refused: answer.message };
          this.emit("figures");
        }, own.signal);
      } catch { /* the closed formulas stay */ }
    }, after);
  }

  // What an assembly is inflated with: kPa in all its actuators, g at their tips.
  inflate(asked) { this.inflated = { ...this.inflated, ...asked }; this.askElastic(0); }

  // A look at the file on disk whenever it changes.
  async watch() {
    this.watching?.abort();
    if (!this.name) return;
    const own = (this.watching = new AbortController());
    while (!own.signal.aborted) {
      try {
        await listen(`/api/watch/${encodeURIComponent(this.name)}`, undefined, ({ sha }) => this.onDisk(sha), own.signal);
      } catch (error) { if (error.name === "AbortError") return; }
      await new Promise((done) => setTimeout(done, 1500));
    }
  }
  async onDisk(sha) {
    if (sha === this.seen || sha === "") return;
    const found = await ask(`/api/file/${encodeURIComponent(this.name)}`).catch(() => null);
    if (!found || found.sha === this.seen) return;
    if ((this.unsaved || this.pending.size) && found.text !== this.text) { this.emit("conflict", found); return; }
    this.take(found);
  }
  take(found) {
    this.seen = found.sha;
    this.savedText = found.text;
    this.write(found.text, "disk");
    this.keep();
    this.emit("saved");
  }
  async save(name, over = false) {
    this.commit();
    const same = name === this.name;
    const { sha } = await ask("/api/save", { name, text: this.text, seen: over ? null : same ? this.seen : "" });
    Object.assign(this, { name, seen: sha, savedText: this.text });
    if (!same) this.watch();
    this.keep();
    this.emit("saved");
  }

  pin() {
    this.reference = this.reference ? null : {
      name: this.designName, family: this.family, text: this.text, laminate: this.laminate, values: this.values,
      parts: this.parts, surfaces: new Map(this.surfaces), findings: this.findings, prediction: this.prediction,
    };
    this.emit("reference");
  }
  layer(index) { return this.laminate?.layers[index - 1]; }
  pickParts(names) { this.pickedParts = names; this.emit("part"); }
  pick(layer) { this.picked = layer; this.emit("pick"); }
  hover(layer, words = "") {
    if (layer === this.hovered && words === this.hoverWords) return;
    this.hovered = layer;
    this.hoverWords = words;
    this.emit("hover", words);
  }
  recut() { this.cut = firstCut(this.laminate); this.emit("cut"); }
  moveCut(cut) { this.cut = { ...cut, moved: true }; this.emit("cut"); }
  shape(key) { return this.shapes.get(key) ?? []; }
}

export const shapeKeys = (laminate) => Object.values(laminate.patterns).map((pattern) => pattern.shape);

// Between every two films that follow each other, bottom to top: which layers meet there, masks between them included.
function interfaces(layers) {
  const found = [];
  let met = [];
  for (const layer of layers) {
    met.push(layer);
    if (layer.mask) continue;
    if (met.length > 1 && !met[0].mask) found.push({ interface: found.length + 1, layers: met.map(({ index }) => index), z: met[0].z + met[0].thickness, gap: layer.z - met[0].z - met[0].thickness });
    met = [layer];
  }
  return found;
}

function freshTab() {
  const id = uniqueName();
  sessionStorage.setItem("sbafab-tab", id);
  return id;
}

// The plane through the first chamber's axis and its inlet.
function firstCut(laminate) {
  const inlet = laminate.inlets[0], chamber = laminate.chambers[0];
  const bore = laminate.bores.find((found) => found.chamber === chamber?.name);
  const [x, y] = bore?.centre ?? chamber?.centres[0] ?? [0, 0];
  const [u, v] = inlet?.chamber === chamber?.name ? inlet.direction : [1, 0];
  return { x, y, u, v, moved: false };
}

export const roleWords = (layer) => layer.role.replace("-", " ");
export function layerWords(layer) {
  const balloon = layer.balloon ? `, balloon ${layer.balloon}` : "";
  return `Layer ${layer.index} ${layer.material} ${roleWords(layer)}${balloon}, ${layer.pattern}`;
}
