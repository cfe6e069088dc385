// The films in space: lifted apart, cut open, picked one by one.
import { el } from "./dom.js";
import { Stage3D, THREE } from "./stage3d.js";
import { area, polygons, spans } from "./shapes.js";
import { layerWords } from "./state.js";
import { css } from "./dom.js";

export class Solid {
  title = "Solid";
  constructor(studio) {
    this.studio = studio;
    this.surface = el("div", { class: "surface" });
    const range = (label, value, changed) => {
      const input = el("input", { type: "range", min: 0, max: 100, value, "aria-label": label, oninput: changed });
      return { input, label: el("label", {}, label, input) };
    };
    this.explode = range("Explode", 42, () => this.arrange());
    this.opened = el("button", { "aria-pressed": "false", onclick: () => { this.isCut = !this.isCut; this.opened.setAttribute("aria-pressed", String(this.isCut)); this.plane(); } }, "Cut");
    this.masks = el("button", { "aria-pressed": "true", onclick: () => { this.noMasks = !this.noMasks; this.masks.setAttribute("aria-pressed", String(!this.noMasks)); this.arrange(); } }, "Masks");
    this.picker = el("input", { type: "range", min: 0, max: 1, value: 0, "aria-label": "Layer", oninput: () => { const layer = studio.layer(Number(this.picker.value)); studio.pick(layer ?? null); } });
    this.pickedWords = el("output", {}, "all");
    this.alone = el("button", { "aria-pressed": "false", title: "Show layers up to the picked one only", onclick: () => { this.upTo = !this.upTo; this.alone.setAttribute("aria-pressed", String(this.upTo)); this.arrange(); } }, "Up to");
    const views = [["Iso", [26, -34, 22]], ["Top", [0, -0.001, 1]], ["Side", [0, -1, 0.02]]];
    this.element = el("div", { class: "view" }, this.surface,
      el("div", { class: "tools" }, this.explode.label, this.opened, this.masks, el("label", {}, "Layer", this.picker, this.pickedWords), this.alone),
      el("div", { class: "tools right-top", role: "group", "aria-label": "Camera" }, ...views.map(([words, way]) => el("button", { onclick: () => { this.stage.touched = false; this.stage.look(...way); this.stage.fit(this.box()); } }, words))),
      el("div", { class: "stale-mark" }, "Updating"));
    try {
      this.stage = new Stage3D(this.surface, { up: 22 });
    } catch {
      this.surface.append(el("p", { class: "fallback" }, "This view needs WebGL, which this browser does not provide. Section and Layers show the same design."));
      return;
    }
    this.clip = new THREE.Plane(new THREE.Vector3(1, 0, 0), 0);
    this.materials();
    this.group = new THREE.Group();
    this.caps = new THREE.Group();
    this.stage.scene.add(this.group, this.caps);
    this.geometries = new Map();
    this.stage.renderer.domElement.addEventListener("pointermove", (event) => { if (!event.buttons) this.point(event); });
    this.stage.renderer.domElement.addEventListener("pointerleave", () => studio.hover(null));
    this.stage.renderer.domElement.addEventListener("pointerdown", (event) => { this.down = [event.clientX, event.clientY]; });
    this.stage.renderer.domElement.addEventListener("click", (event) => { if (Math.hypot(event.clientX - this.down[0], event.clientY - this.down[1]) < 4) studio.pick(this.hit(event)); });
    studio.on("laminate", () => this.update());
    studio.on("cut", () => this.plane());
    studio.on("hover pick", () => this.light());
    studio.on("opened", () => { this.stage.touched = false; this.mark = null; });
    studio.on("theme", () => { this.materials(); this.stage.repaint(); this.update(); });
  }
  show() { this.stage?.resize(); if (this.behind) this.update(); }
  materials() {
    const make = (name) => {
      const material = new THREE.MeshLambertMaterial({ color: css(name), side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
      return material;
    };
    this.material = { tpe: make("--tpe"), ptfe: make("--ptfe"), lit: make("--select"), bond: make("--bond") };
    this.lines = { tpe: new THREE.LineBasicMaterial({ color: css("--tpe-line") }), ptfe: new THREE.LineBasicMaterial({ color: css("--ptfe-line") }) };
    this.setClip();
  }
  setClip() {
    const planes = this.isCut ? [this.clip] : [];
    if (this.material.tpe.clippingPlanes?.length === planes.length) return;
    for (const material of [...Object.values(this.material), ...Object.values(this.lines)]) { material.clippingPlanes = planes; material.needsUpdate = true; }
  }

  // One prism of height 1 a shape, shared by all layers of that shape.
  geometry(key) {
    if (this.geometries.has(key)) return this.geometries.get(key);
    const loops = polygons(this.studio.shape(key), 0.02).filter((points) => points.length > 2);
    const outers = loops.filter((points) => area(points) > 0), holes = loops.filter((points) => area(points) <= 0);
    const shapes = outers.map((points) => ({ points, shape: new THREE.Shape(points.map(([x, y]) => new THREE.Vector2(x, y))) }));
    for (const hole of holes) {
      const owner = shapes.find(({ points }) => within(points, hole[0])) ?? shapes[0];
      owner?.shape.holes.push(new THREE.Path(hole.map(([x, y]) => new THREE.Vector2(x, y))));
    }
    const solid = new THREE.ExtrudeGeometry(shapes.map(({ shape }) => shape), { depth: 1, bevelEnabled: false, curveSegments: 1 });
    const edge = [];
    for (const points of loops) for (let i = 0; i < points.length; i++) {
      const [x0, y0] = points[i], [x1, y1] = points[(i + 1) % points.length];
      edge.push(x0, y0, 1, x1, y1, 1, x0, y0, 0, x1, y1, 0);
    }
    const lines = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(edge, 3));
    const made = { solid, lines };
    this.geometries.set(key, made);
    return made;
  }
  update() {
    if (!this.stage) return;
    // A view that is not shown follows when it is.
    this.behind = this.element.hidden;
    if (this.behind) return;
    const { laminate } = this.studio;
    this.group.clear();
    if (!laminate) { this.caps.clear(); this.stage.draw(); return; }
    const used = new Set();
    for (const layer of laminate.layers) {
      const key = laminate.patterns[layer.pattern].shape;
      used.add(key);
      const { solid, lines } = this.geometry(key), kind = layer.mask ? "ptfe" : "tpe";
      const mesh = new THREE.Mesh(solid, this.material[kind]);
      mesh.userData = { layer, kind };
      mesh.add(new THREE.LineSegments(lines, this.lines[kind]));
      this.group.add(mesh);
    }
    for (const [key, { solid, lines }] of this.geometries) if (!used.has(key) && this.geometries.size > 60) { solid.dispose(); lines.dispose(); this.geometries.delete(key); }
    this.picker.max = laminate.layers.length;
    this.arrange();
    this.light();
  }
  lift(layer) { return layer.z + (layer.index - 1) * this.gap; }
  arrange() {
    const { laminate } = this.studio;
    if (!laminate || !this.stage) return;
    const [x0, y0, x1, y1] = laminate.bounds;
    const k = this.explode.input.value / 100;
    // At the end of the slider the stack is about as high as wide.
    this.gap = (k * k * 1.15 * Math.max(x1 - x0, y1 - y0)) / Math.max(6, laminate.layers.length);
    const top = this.upTo && this.studio.picked ? this.studio.picked.index : Infinity;
    for (const mesh of this.group.children) {
      const { layer } = mesh.userData;
      mesh.position.z = this.lift(layer);
      mesh.scale.z = layer.thickness;
      mesh.visible = layer.index <= top && !(this.noMasks && layer.mask);
    }
    this.plane();
    this.stage.box = this.box();
    if (!this.stage.touched) this.stage.fit(this.stage.box);
    this.stage.draw();
  }
  box() {
    const { laminate } = this.studio;
    if (!laminate) return null;
    const [x0, y0, x1, y1] = laminate.bounds, last = laminate.layers.at(-1);
    return new THREE.Box3(new THREE.Vector3(x0, y0, 0), new THREE.Vector3(x1, y1, this.lift(last) + last.thickness));
  }
  // The cut: what lies to the right of the section is taken away, and the cut faces are filled.
  plane() {
    if (!this.stage) return;
    const { laminate, cut } = this.studio;
    this.caps.clear();
    this.setClip();
    if (this.isCut && laminate && cut) {
      const { x, y, u, v } = cut;
      this.clip.set(new THREE.Vector3(-v, u, 0), v * x - u * y);
      const parts = { tpe: [], ptfe: [] };
      const known = new Map();
      for (const mesh of this.group.children) {
        if (!mesh.visible) continue;
        const { layer, kind } = mesh.userData, key = laminate.patterns[layer.pattern].shape;
        if (!known.has(key)) known.set(key, spans(this.studio.shape(key), x, y, u, v));
        const z0 = this.lift(layer), z1 = z0 + layer.thickness;
        for (const [a, b] of known.get(key)) {
          const p = [x + a * u, y + a * v], q = [x + b * u, y + b * v];
          parts[kind].push(...p, z0, ...q, z0, ...q, z1, ...p, z0, ...q, z1, ...p, z1);
        }
      }
      for (const [kind, places] of Object.entries(parts)) {
        const flat = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
        this.caps.add(new THREE.Mesh(flat, new THREE.MeshBasicMaterial({ color: css(`--${kind}-line`), side: THREE.DoubleSide })));
      }
    }
    if (this.mark) {
      const ball = new THREE.Mesh(new THREE.SphereGeometry(0.35, 16, 12), new THREE.MeshBasicMaterial({ color: css("--select"), depthTest: false, transparent: true, opacity: 0.9 }));
      ball.position.set(this.mark[0], this.mark[1], this.lift(this.mark[2]));
      ball.renderOrder = 5;
      this.caps.add(ball);
    }
    this.stage.draw();
  }
  light() {
    if (!this.stage) return;
    const { hovered, picked } = this.studio;
    for (const mesh of this.group.children) {
      const { layer, kind } = mesh.userData;
      mesh.material = layer.index === picked?.index || layer.index === hovered?.index ? this.material.lit : this.material[kind];
    }
    this.picker.value = picked?.index ?? 0;
    this.pickedWords.textContent = picked ? String(picked.index) : "all";
    if (this.upTo) this.arrange();
    this.stage.renderer.domElement.setAttribute("aria-label", picked ? `Solid, ${layerWords(picked)} picked` : `Solid of ${this.studio.laminate?.layers.length ?? 0} layers`);
    this.stage.draw();
  }
  hit(event) {
    const hits = this.stage.under(event).intersectObjects(this.group.children.filter((mesh) => mesh.visible), false);
    const seen = hits.find(({ point }) => !this.isCut || this.clip.distanceToPoint(point) >= -1e-6);
    this.hitPoint = seen?.point;
    return seen?.object.userData.layer ?? null;
  }
  point(event) {
    const layer = this.hit(event);
    this.studio.hover(layer, layer ? `${layerWords(layer)} · ${layer.thickness} mm thick` : "");
  }
  goto(layers, x, y) {
    const layer = this.studio.layer(layers[0]);
    if (!layer || !this.stage) return;
    this.gap ??= 0;
    this.mark = [x, y, layer];
    this.plane();
    const way = this.stage.camera.position.clone().sub(this.stage.controls.target);
    this.stage.touched = true;
    this.stage.controls.target.set(x, y, this.lift(layer));
    this.stage.camera.position.copy(this.stage.controls.target).add(way.setLength(Math.min(way.length(), 26)));
    this.stage.controls.update();
  }
  picture() { return this.stage.picture("solid.png"); }
}

function within(points, [x, y]) {
  let inside = false;
  for (let i = 0, j = points.length - 1; i < points.length; j = i++) {
    const [xi, yi] = points[i], [xj, yj] = points[j];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) inside = !inside;
  }
  return inside;
}
