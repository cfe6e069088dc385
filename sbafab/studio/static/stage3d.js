// A scene with camera, lights and a picture on demand: drawn when something changed, not always.
import * as THREE from "./vendor/three.module.js";
import { OrbitControls } from "./vendor/OrbitControls.js";
import { css } from "./dom.js";

// Without a graphics card frames are drawn coarser until nothing has changed for a while, in ms.
const COARSE = 0.6, QUICK = 300;

// Whether the browser draws without a graphics card.
function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const told = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = told ? gl.getParameter(told.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

export class Stage3D {
  constructor(surface, { up = 14 } = {}) {
    this.surface = surface;
    this.scene = new THREE.Scene();
    this.software = isSoftware();
    this.renderer = new THREE.WebGLRenderer({ antialias: !this.software, preserveDrawingBuffer: true });
    this.renderer.localClippingEnabled = true;
    this.camera = new THREE.PerspectiveCamera(28, 1, 0.1, 2000);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(26, -34, up);
    surface.append(this.renderer.domElement);
    this.renderer.domElement.setAttribute("role", "img");
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.enableDamping = false;
    this.controls.listenToKeyEvents?.(this.renderer.domElement);
    this.renderer.domElement.tabIndex = 0;
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => { this.touched = true; });
    this.lights();
    this.repaint();
    new ResizeObserver(() => this.resize()).observe(surface);
    this.renderer.domElement.addEventListener("dblclick", () => { this.touched = false; this.fit(this.box); });
  }
  lights() {
    this.sky = new THREE.HemisphereLight(0xffffff, 0x9aa4b0, 2.1);
    this.sun = new THREE.DirectionalLight(0xffffff, 1.7);
    this.sun.position.set(-0.6, -0.9, 1.6);
    const back = new THREE.DirectionalLight(0xffffff, 0.5);
    back.position.set(1, 1, 0.2);
    this.scene.add(this.sky, this.sun, back);
  }
  repaint() { this.renderer.setClearColor(css("--canvas")); this.draw(); }
  resize() {
    const { clientWidth: w, clientHeight: h } = this.surface;
    if (!w || !h) return;
    this.renderer.setPixelRatio(this.finest());
    this.renderer.setSize(w, h, false);
    this.renderer.domElement.style.width = "100%";
    this.renderer.domElement.style.height = "100%";
    this.camera.aspect = w / h;
    this.camera.updateProjectionMatrix();
    if (!this.touched && this.box) this.fit(this.box);
    else this.draw();
  }
  // The camera stands so far off that the box fills the picture; its direction stays.
  fit(box) {
    this.box = box;
    if (!box || box.isEmpty()) return;
    const ball = box.getBoundingSphere(new THREE.Sphere());
    const way = this.camera.position.clone().sub(this.controls.target).normalize();
    const half = (this.camera.fov * Math.PI) / 360;
    const fill = Math.min(1, this.camera.aspect);
    this.controls.target.copy(ball.center);
    let away = ball.radius / Math.sin(half) / fill;
    for (let round = 0; round < 4; round++) {
      this.camera.position.copy(ball.center).addScaledVector(way, away);
      this.controls.update();
      this.camera.updateMatrixWorld();
      const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => new THREE.Vector3(i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y, i & 4 ? box.max.z : box.min.z).project(this.camera));
      away *= Math.max(...corners.flatMap(({ x, y }) => [Math.abs(x), Math.abs(y)])) / 0.8;
    }
    this.draw();
  }
  look(x, y, z) {
    const way = new THREE.Vector3(x, y, z).normalize();
    const away = this.camera.position.distanceTo(this.controls.target);
    this.camera.position.copy(this.controls.target).addScaledVector(way, away);
    this.controls.update();
    this.draw();
  }
  // Without a graphics card twice as fine, for the edges that antialiasing would smooth.
  finest() { return this.software ? 1.5 : Math.min(devicePixelRatio || 1, 2); }
  draw() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = null;
      if (this.software) this.suit();
      if (this.surface.clientWidth) this.renderer.render(this.scene, this.camera);
      this.drawn?.();
    });
  }
  // What changed is seen at once, coarser; the last frame is drawn again as fine as it goes.
  suit() {
    const ratio = this.resting ? this.finest() : COARSE;
    this.resting = false;
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
    clearTimeout(this.rest);
    if (ratio === COARSE) this.rest = setTimeout(() => { this.resting = true; this.draw(); }, QUICK);
  }
  under(event) {
    const box = this.renderer.domElement.getBoundingClientRect();
    const at = new THREE.Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.camera);
    return ray;
  }
  async picture(name) { this.renderer.setPixelRatio(this.finest()); this.renderer.render(this.scene, this.camera); return { name, blob: await new Promise((done) => this.renderer.domElement.toBlob(done)) }; }
}
export { THREE };
