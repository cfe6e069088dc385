// A view of the plane in mm, y up: wheel zooms at the pointer, drag pans, keys do both.
export class PanZoom {
  constructor(element, changed, { stretch = () => 1 } = {}) {
    Object.assign(this, { element, changed, stretch, x: 0, y: 0, scale: 1, touched: false });
    element.tabIndex = 0;
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      const k = Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015));
      this.zoom(k, event.offsetX, event.offsetY);
    }, { passive: false });
    this.pointers = new Map();
    element.addEventListener("pointerdown", (event) => {
      if (event.defaultPrevented || event.button > 1) return;
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
      element.setPointerCapture(event.pointerId);
      this.dragged = 0;
    });
    element.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, (event) => this.pointers.delete(event.pointerId));
    element.addEventListener("dblclick", () => { this.touched = false; this.fit(); });
    element.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => { if (this.later) this.goto(...this.later); else if (!this.touched) this.fit(); else this.changed(); }).observe(element);
  }
  get width() { return this.element.clientWidth; }
  get height() { return this.element.clientHeight; }
  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    if (this.pointers.size === 2) {
      const [other] = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, p]) => p);
      const box = this.element.getBoundingClientRect();
      const k = Math.hypot(now[0] - other[0], now[1] - other[1]) / Math.hypot(before[0] - other[0], before[1] - other[1]);
      this.zoom(k, (now[0] + other[0]) / 2 - box.left, (now[1] + other[1]) / 2 - box.top);
    } else {
      this.dragged += Math.hypot(now[0] - before[0], now[1] - before[1]);
      if (this.dragged > 3) this.pan(now[0] - before[0], now[1] - before[1]);
    }
    this.pointers.set(event.pointerId, now);
  }
  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / (this.scale * this.stretch());
    this.touched = true;
    this.changed();
  }
  zoom(k, px, py) {
    const [x, y] = this.at(px, py);
    this.scale = Math.min(5000, Math.max(0.5, this.scale * k));
    this.x = x - (px - this.width / 2) / this.scale;
    this.y = y + (py - this.height / 2) / (this.scale * this.stretch());
    this.touched = true;
    this.changed();
  }
  // The place under a pixel, and the pixel of a place.
  at(px, py) { return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / (this.scale * this.stretch())]; }
  px(x, y) { return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale * this.stretch()]; }
  bounds(box, margin) { this.box = box; this.margin = margin; if (!this.touched) this.fit(); }
  fit() {
    if (!this.box || !this.width || !this.height) return;
    const [x0, y0, x1, y1] = this.box, [top, right, bottom, left] = this.margin ?? [24, 24, 24, 24];
    const w = Math.max(40, this.width - left - right), h = Math.max(40, this.height - top - bottom);
    this.scale = Math.min(w / (x1 - x0 || 1), h / ((y1 - y0 || 1) * this.stretch()));
    this.x = (x0 + x1) / 2 + (right - left) / 2 / this.scale;
    this.y = (y0 + y1) / 2 + (top - bottom) / 2 / (this.scale * this.stretch());
    this.changed();
  }
  goto(x, y, across) {
    // A view that is not shown has no size yet.
    this.later = this.width && this.height ? null : [x, y, across];
    if (this.later) return;
    this.scale = Math.min(this.width, this.height) / across;
    Object.assign(this, { x, y, touched: true });
    this.changed();
  }
  key(event) {
    const step = 40, moves = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    if (moves[event.key]) this.pan(...moves[event.key]);
    else if (event.key === "+" || event.key === "=") this.zoom(1.25, this.width / 2, this.height / 2);
    else if (event.key === "-") this.zoom(0.8, this.width / 2, this.height / 2);
    else if (event.key === "0") { this.touched = false; this.fit(); } else return;
    event.preventDefault();
  }
}

export function niceBar(scale, most = 110) {
  for (const step of [100, 50, 20, 10, 5, 2, 1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005]) if (step * scale <= most) return step;
  return 0.002;
}

// The eyes of two halves; when one moves, the other goes along, and both are drawn.
export function inStep(halves, draw) {
  let following = false;
  const eyes = halves.map(({ half }, i) => new PanZoom(half, () => {
    if (following) return;
    following = true;
    const { x, y, scale, touched } = eyes[i];
    Object.assign(eyes[1 - i], { x, y, scale, touched });
    draw();
    following = false;
  }));
  return eyes;
}
