// An assembly under pressure: every actuator by its own fast stack, and what stands on its top goes along.
import { Balloons } from "./balloons.js";
import { el, plain } from "./dom.js";
import { tone } from "./graphics.js";
import { turned } from "./meshes.js";
import { COARSE, FINE, measured, meshOf } from "./motion_drawing.js";
import { PartMeshes, geometryOf, paintOf } from "./parts_scene.js";
import { Playing, PoseView, angleAt } from "./play_loop.js";
import { listen, tab } from "./server.js";
import { HERE, back, placed, placement, raised, times } from "./space.js";
import { Stage3D } from "./stage3d.js";

// ms after which parts that no hand moves are at rest.
const RESTS = 2500;
// kPa at which a part stands when it is first shown, and the most that a grip is given.
const FIRST = 5, FIRST_GRIP = 10, MOST_GRIP = 110;
const TRUST = {
  stack: "Each actuator is an elastic stack with its design's calibration; the parts that it carries move with its tip, without weight.",
  grip: "Grips are lenses of inextensible film, equally high at any pressure.",
  all: "Contact between parts is ignored here; contacts and loads on the tips are under Prediction. Supply tubes, and lines through a moving arm, are left out.",
};

export class PartsMotion extends PoseView {
  title = "Motion";
  constructor(studio) {
    super(studio);
    this.surface = el("div", { class: "surface" });
    this.side = el("div", { class: "side" });
    this.element = el("div", { class: "view" }, el("div", { class: "motion" }, this.surface, this.side), el("div", { class: "stale-mark" }, "Updating"));
    Object.assign(this, { movers: new Map(), kept: new Map() });
    this.build();
    this.meshes = new PartMeshes(studio);
    this.stage = Stage3D.on(this.surface, { up: 16, things: () => [...this.meshes.things, ...this.bodies()] }, "The figures beside it are complete.");
    this.mesh = meshOf(this.stage?.software ? COARSE : FINE);
    studio.on("parts", () => { this.text = null; if (!this.element.hidden) this.load(); });
    studio.on("opened", () => { this.kept.clear(); this.fitted = false; });
    studio.on("part", () => { if (this.stage && this.text) { this.meshes.paint(); this.stage.draw(); } });
    studio.on("theme", () => { if (this.stage && this.text) { this.meshes.paint(); this.shape(); this.draw(); } });
  }
  // Whether a hand moves it, so that what takes seconds waits.
  get moving() { return !this.element.hidden && performance.now() - (this.moved ?? -RESTS) < RESTS; }
  show() { this.stage?.resize(); if (!this.text) this.load(); }

  build() {
    this.knobs = el("div", { role: "group", "aria-label": "Pressures" });
    this.playing = new Playing(() => this.round());
    this.values = el("div", { "aria-live": "off" });
    this.trust = el("div", { class: "trust", role: "status" });
    this.side.append(el("h3", {}, "Pressure, kPa"), this.knobs, el("div", { class: "group" }, this.playing.button, el("button", { onclick: () => this.set(() => 0) }, "Vent")), el("h3", {}, "Reading"), this.values, this.trust);
  }

  // What moves and how; the map of a balloon takes a second or two, once a shape.
  async load() {
    const { studio } = this, { text } = studio;
    if (studio.error || !studio.parts) return;
    const own = (this.loading = {});
    this.say("Computing the balloons of these designs", false);
    try {
      await listen("/api/motion", { tab, text, edits: [], name: studio.name, pose: {} }, (answer) => {
        if (this.loading !== own) return;
        if (answer.kind === "movers") this.start(answer.movers, text);
        else if (answer.message) this.say(answer.message, true);
      });
    } catch (error) { this.say(error.message, true); }
  }
  start(movers, text) {
    this.text = text;
    this.movers = new Map(movers.map((mover) => [mover.part, { ...mover, sliders: this.sliders(mover) }]));
    this.knobs.replaceChildren(...[...this.movers.values()].flatMap(({ part, message, sliders }) => [el("h4", {}, part), ...sliders.map(({ row }) => row), message ? el("p", { class: "trust beyond" }, message) : ""]));
    if (this.stage) { this.meshes.update(); this.shape(); this.draw(); }
    this.want();
  }
  sliders(mover) {
    const names = { stack: mover.chambers, grip: ["all stacks"], still: [] }[mover.is];
    return names.map((name, i) => {
      const key = `${mover.part} ${name}`, first = mover.is === "grip" ? FIRST_GRIP : i ? 0 : FIRST;
      const out = el("output", {}), told = () => { out.textContent = plain(Number(input.value), 1); this.kept.set(key, input.value); };
      const input = el("input", { type: "range", min: 0, max: mover.most_pressure ?? MOST_GRIP, step: 0.1, value: this.kept.get(key) ?? first, "aria-label": `${mover.part}, ${name}, kPa`, oninput: () => { told(); this.want(); } });
      told();
      return { input, told, row: el("label", { class: "knob" }, el("span", {}, name), input, out) };
    });
  }
  pressures({ sliders }) { return sliders.map(({ input }) => Number(input.value)); }
  set(of) {
    for (const mover of this.movers.values()) mover.sliders.forEach(({ input, told }, i) => { input.value = of(i, mover); told(); });
    this.want();
  }

  want() {
    this.moved = performance.now();
    // What takes seconds gives way to the hand.
    if (this.studio.prediction?.quick) this.studio.askElastic();
    super.want();
  }
  request() {
    if (!this.text) return null;
    this.asked = this.text;
    const stacks = [...this.movers.values()].filter((mover) => mover.is === "stack");
    return { text: this.text, pose: { parts: Object.fromEntries(stacks.map((mover) => [mover.part, this.pressures(mover)])) } };
  }
  answer(answer) {
    if (answer.kind === "poses") this.arrived(answer.poses, this.asked);
    else if (answer.message) this.say(answer.message, true);
  }
  arrived(poses, text) {
    this.newest = poses;
    this.inFrame(() => {
      if (this.text !== text) return;
      for (const [part, pose] of Object.entries(this.newest)) if (this.movers.has(part)) this.movers.get(part).pose = pose;
      this.paint();
    });
  }
  readings() {
    this.values.replaceChildren(...[...this.movers.values()].flatMap((mover) => [el("h4", {}, mover.part), el("dl", { class: "reading" }, ...rows(mover, this.pressures(mover)).flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)])), mover.is === "stack" && mover.pose ? el("p", { class: "more" }, measured(mover)) : ""]));
    const leaning = [...this.movers.values()].find(({ pose }) => pose && !pose.stable);
    this.say(leaning ? `${leaning.part} is unstable as a straight column: it would buckle` : this.trusted(), Boolean(leaning));
    this.stage?.canvas.setAttribute("aria-label", `Assembly in motion: ${[...this.movers.values()].flatMap((mover) => rows(mover, this.pressures(mover)).slice(0, 2).map(([name, value]) => `${mover.part} ${name.toLowerCase()} ${value}`)).join(", ")}`);
  }

  trusted() {
    const kinds = new Set([...this.movers.values()].map((mover) => mover.is));
    return Object.entries(TRUST).filter(([kind]) => kind === "all" || kinds.has(kind)).map(([, words]) => words).join(" ");
  }

  // What is drawn of each mover: balloons that a pose shapes, or a grip's, and the lumen round it.
  shape() {
    for (const mover of this.movers.values()) {
      const part = this.studio.parts.find(({ name }) => name === mover.part), paint = paintOf(part, this.studio.parts);
      if (mover.is === "stack") {
        mover.drawn = new Balloons(this.mesh);
        mover.drawn.shape(mover, { wall: mover.wall, lumen: mover.lumen, paint });
        mover.place = placement(mover.frame, mover.frame.map((row) => row[3]));
      } else if (mover.is === "grip") {
        const { solid, edges } = geometryOf(`grip:${mover.part}:${this.text}`, mover.surface);
        mover.full = { mesh: solid, edges, tint: tone(paint), ink: tone("--part-ink") };
        mover.lumenWall = mover.lumen ? { mesh: wallOf(mover, solid.box), tint: tone("--accent"), opacity: 0.16 } : null;
      }
    }
  }
  bodies() {
    return [...this.movers.values()].flatMap(({ pose, drawn, full, lumenWall, at = HERE, ...mover }) => {
      if (drawn) return pose ? drawn.things(times(at, mover.place)) : [];
      return full ? [this.pressures(mover)[0] > 0 && { ...full, place: at }, lumenWall && { ...lumenWall, place: at }] : [];
    });
  }
  draw() {
    const moved = new Map();
    for (const body of this.meshes.bodies) {
      const { part, own } = body, below = moved.get(part.on), mover = this.movers.get(part.name);
      const isMoving = Boolean(mover?.pose && mover.drawn), move = below?.lift && part.at === "top" ? times(below.move, below.lift) : below?.move ?? HERE;
      body.place = times(move, own);
      body.hidden = isMoving || (part.kind === "line" && part.at === "lumen" && Boolean(below?.lift));
      let lift = null;
      if (isMoving) {
        mover.drawn.draw(mover.pose);
        lift = times(mover.place, tipOf(mover.pose), raised(-mover.flat_height), back(mover.place));
      }
      if (mover) mover.at = isMoving ? move : body.place;
      moved.set(part.name, { move, lift });
    }
    if (!this.fitted && [...this.movers.values()].every(({ drawn, pose }) => !drawn || pose)) { this.stage.fit(this.reach()); this.fitted = true; }
    this.stage.draw();
  }
  // All that the parts may come to, so that the camera need not follow.
  reach() {
    const box = this.meshes.box();
    for (const { drawn, place, outline, levels, full, lumenWall, at } of this.movers.values()) {
      for (const one of [full, lumenWall]) for (const corner of one?.mesh.box.corners ?? []) box.grow(placed(at, corner));
      if (drawn) for (const [x, y, z] of [[-1, -1, 1], [1, 1, 1]]) box.grow(placed(place, [1.5 * outline * x, 1.5 * outline * y, Math.max(8, 1.5 * levels.length) * z]));
    }
    return box;
  }
  // Pressure that goes round the chambers of every arm; a single chamber breathes.
  round() {
    if (!this.text) return null;
    const most = new Map([...this.movers].map(([name, mover]) => [name, Math.max(5, ...this.pressures(mover))]));
    return (elapsed) => this.set((i, { part, is, sliders }) => (is === "grip" ? most.get(part) : (most.get(part) * (1 + Math.cos(angleAt(elapsed) - (i * 2 * Math.PI) / sliders.length))) / 2));
  }
  picture() { return this.stage.picture("assembly-motion.png"); }
}

function rows(mover, pressures) {
  const { pose } = mover;
  if (mover.is === "stack" && pose) return [["Height", `${pose.height.toFixed(2)} mm`], ["Bend", `${pose.bend.toFixed(1)}°`], ["Volume", `${pose.volumes.reduce((sum, one) => sum + one, 0).toFixed(1)} µl`]];
  if (mover.is !== "grip") return [];
  const [p] = pressures, inside = mover.room !== null, across = p > 0 ? (inside ? mover.lumen : mover.free) : mover.deflated;
  const found = [["Diameter", `${across.toFixed(2)} mm`]];
  if (inside) found.push(["Force of each stack on the wall", p > 0 ? `${(p * mover.push).toFixed(3)} N` : "–"]);
  else if (mover.lumen) found.push([`Wall of ${plain(mover.lumen, 2)} mm`, "not reached"]);
  return found;
}
// Where the last plate stands: its frame in the actuator's own.
function tipOf(pose) {
  const a = pose.axes.at(-1);
  return placement([a.slice(0, 3), a.slice(3, 6), a.slice(6, 9)], pose.origins.at(-1));
}
// The wall of a lumen, half as long again as what grips it.
function wallOf({ lumen }, { middle: [, , z], size: [, , long] }) { return turned([[lumen / 2, z - 0.75 * long], [lumen / 2, z + 0.75 * long]]); }
