// A camera that goes round what it looks at: by mouse, by touch and by keys.
import { add, distance, scaled } from "./space.js";

// Pixels that a key is worth, and how much nearer one step of the wheel goes.
const STEP = 10, NEARER = 0.95;
// The camera never looks straight up or down, where no way is up, rad.
const LEVEL = 1e-6;

export class Orbit {
  // `changed` is called after each move, `begun` when a hand takes hold.
  constructor(camera, element, changed, begun) {
    Object.assign(this, { camera, element, changed, begun, pointers: new Map() });
    element.tabIndex = 0;
    element.style.touchAction = "none";
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    element.addEventListener("pointerdown", (event) => {
      if (event.defaultPrevented) return;
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
      element.setPointerCapture(event.pointerId);
      begun();
    });
    element.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, ({ pointerId }) => this.pointers.delete(pointerId));
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      const lines = [1, 16, 100][event.deltaMode], pinch = event.ctrlKey ? 10 : 1;
      begun();
      this.near(NEARER ** ((-event.deltaY * lines * pinch) / 100));
    }, { passive: false });
    element.addEventListener("keydown", (event) => this.key(event));
  }
  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY], [x, y] = [now[0] - before[0], now[1] - before[1]];
    this.pointers.set(event.pointerId, now);
    if (this.pointers.size === 2) {
      const [, other] = [...this.pointers].find(([id]) => id !== event.pointerId);
      const apart = (one) => Math.hypot(one[0] - other[0], one[1] - other[1]) || 1;
      this.shift(x / 2, y / 2);
      this.near(apart(before) / apart(now));
    } else if (event.buttons & 4) this.near(NEARER ** (-y / 100));
    else if (Boolean(event.buttons & 2) !== (event.ctrlKey || event.metaKey || event.shiftKey)) this.shift(x, y);
    else this.turn(x, y);
  }
  key(event) {
    const way = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    const nearer = { "+": NEARER ** 2, "=": NEARER ** 2, "-": NEARER ** -2 }[event.key];
    if (!way && !nearer) return;
    event.preventDefault();
    this.begun();
    if (nearer) this.near(nearer);
    else if (event.ctrlKey || event.metaKey || event.shiftKey) this.turn(STEP * way[0], STEP * way[1]);
    else this.shift(STEP * way[0], STEP * way[1]);
  }
  // Half a turn for a drag over half of the picture's height.
  turn(x, y) {
    const { camera, element } = this, [u, v, w] = add(camera.eye, camera.target, -1), r = Math.hypot(u, v, w), k = (2 * Math.PI) / element.clientHeight;
    const about = Math.atan2(v, u) - k * x, down = Math.min(Math.PI - LEVEL, Math.max(LEVEL, Math.acos(w / r) - k * y));
    this.from([Math.sin(down) * Math.cos(about), Math.sin(down) * Math.sin(about), Math.cos(down)], r);
  }
  // What is looked at goes with the hand.
  shift(x, y) {
    const { camera, element } = this, [right, head] = camera.ways, k = (2 * camera.half[1] * distance(camera.eye, camera.target)) / element.clientHeight;
    for (const end of ["eye", "target"]) camera[end] = add(add(camera[end], right, -k * x), head, k * y);
    this.changed();
  }
  near(share) {
    const { camera } = this;
    this.from(add(camera.eye, camera.target, -1), share);
  }
  // The camera this way from what it looks at, and so far.
  from(way, far = 1) {
    this.camera.eye = add(this.camera.target, scaled(way, far));
    this.changed();
  }
}
