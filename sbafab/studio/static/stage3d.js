// A scene with camera, lights and a picture on demand: drawn when something changed, not always.
import { Painter, engineHere, lightsOf } from "./graphics.js";
import { Orbit } from "./orbit.js";
import { Camera, add, distance, unit } from "./space.js";

// Without a graphics card frames are drawn coarser until nothing has changed for a while, in ms; then
// finer than the screen, for the edges that a card smooths.
const COARSE = 0.6, QUICK = 300, FINE = 1.5;
// Half of the height that the camera sees at a distance of 1.
const HALF = Math.tan((14 * Math.PI) / 180);
const LIGHTS = lightsOf(2.1, "#9aa4b0", { from: [-0.6, -0.9, 1.6], strength: 1.7 }, { from: [1, 1, 0.2], strength: 0.5 });

export class Stage3D {
  // On a surface, where `things()` returns what is seen; null where the browser lacks WebGL2, which the surface then says.
  static on(surface, options, instead) { return engineHere() ? new Stage3D(surface, options, instead) : Painter.on(surface, {}, null, instead); }
  constructor(surface, { up = 14, things }, instead) {
    Object.assign(this, { surface, things, software: engineHere() === "software" });
    this.painter = Painter.on(surface, { role: "img", smooth: !this.software }, () => this.draw(), instead);
    this.canvas = this.painter.canvas;
    this.camera = new Camera({ eye: [26, -34, up], perspective: true, half: [HALF, HALF] });
    this.orbit = new Orbit(this.camera, this.canvas, () => this.draw(), () => { this.touched = true; });
    new ResizeObserver(() => this.resize()).observe(surface);
    this.canvas.addEventListener("dblclick", () => this.whole());
    this.canvas.addEventListener("keydown", ({ key }) => { if (key === "0") this.whole(); });
  }
  resize() {
    const { clientWidth: w, clientHeight: h } = this.surface;
    if (!w || !h) return;
    this.camera.half = [(HALF * w) / h, HALF];
    if (!this.touched && this.box) this.fit(this.box);
    else this.draw();
  }
  // The camera stands so far off that the box fills the picture; its direction stays.
  fit(box) {
    this.box = box;
    if (!box || box.empty) return;
    const { camera } = this, way = unit(add(camera.eye, camera.target, -1)), fill = Math.min(1, camera.half[0] / camera.half[1]);
    camera.target = box.middle;
    let away = Math.hypot(...box.size) / 2 / Math.sin(Math.atan(HALF)) / fill;
    for (let round = 0; round < 4; round++) {
      camera.eye = add(camera.target, way, away);
      away *= Math.max(...box.corners.flatMap((corner) => camera.seen(corner)).map(Math.abs)) / 0.8;
    }
    this.draw();
  }
  // All that is shown, as a hand has not touched it; seen from this way, where one is given.
  whole(way) {
    this.touched = false;
    if (way) this.orbit.from(unit(way), distance(this.camera.eye, this.camera.target));
    this.fit(this.box);
  }
  // At a place of what is shown, from no farther than this.
  approach(place, most) {
    const { camera } = this, way = add(camera.eye, camera.target, -1);
    this.touched = true;
    camera.target = place;
    this.orbit.from(unit(way), Math.min(Math.hypot(...way), most));
  }
  draw() {
    this.asked ??= requestAnimationFrame(() => {
      this.asked = null;
      this.paint(this.software ? this.suit() : this.painter.finest);
    });
  }
  paint(ratio) { this.painter.paint({ things: this.things(), camera: this.camera, lights: LIGHTS }, ratio); }
  // What changed is seen at once, coarser; the last frame is drawn again as fine as it goes.
  suit() {
    const ratio = this.resting ? FINE : COARSE;
    this.resting = false;
    clearTimeout(this.rest);
    if (ratio === COARSE) this.rest = setTimeout(() => { this.resting = true; this.draw(); }, QUICK);
    return ratio;
  }
  ray(event) { return this.camera.under(event, this.canvas); }
  picture(name) {
    this.paint(this.software ? FINE : this.painter.finest);
    return this.painter.picture(name);
  }
}
