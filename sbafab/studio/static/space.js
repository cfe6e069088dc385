// Places and ways in space as [x, y, z], boxes, placements as 16 numbers column by column, cameras.
export const add = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
export const scaled = (a, k) => [k * a[0], k * a[1], k * a[2]];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
export const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));

// The placement with these rows and this shift; it takes a place to rows times place plus shift.
export const placement = ([a, b, c], [x, y, z]) => [a[0], b[0], c[0], 0, a[1], b[1], c[1], 0, a[2], b[2], c[2], 0, x, y, z, 1];
export const raised = (z, height = 1) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, height, 0, 0, 0, z, 1];
export const shifted = ([x, y, z]) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];
export const HERE = raised(0);
// The placements one after the other, the last one first.
export function times(...all) {
  return all.reduce((a, b) => Array.from({ length: 16 }, (_, i) => { const r = i % 4, c = i - r; return a[r] * b[c] + a[4 + r] * b[c + 1] + a[8 + r] * b[c + 2] + a[12 + r] * b[c + 3]; }));
}
export const placed = (m, [x, y, z]) => [0, 1, 2].map((r) => m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r]);
// The same of many places, as x, y, z in a row.
export function placedAll(m, points) {
  const found = new Float64Array(points.length);
  for (let i = 0; i < points.length; i += 3) {
    const x = points[i], y = points[i + 1], z = points[i + 2];
    for (let r = 0; r < 3; r++) found[i + r] = m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r];
  }
  return found;
}
// What takes a placement without scale back.
export function back(m) {
  const columns = [m.slice(0, 3), m.slice(4, 7), m.slice(8, 11)];
  return placement(columns, columns.map((column) => -dot(column, m.slice(12, 15))));
}

export class Box {
  constructor(min = [Infinity, Infinity, Infinity], max = [-Infinity, -Infinity, -Infinity]) { Object.assign(this, { min, max }); }
  // Of points as x, y, z in a row, at a placement.
  static of(points, m = HERE) {
    const box = new Box(), { min, max } = box, all = placedAll(m, points);
    for (let i = 0; i < all.length; i++) { const k = i % 3; if (all[i] < min[k]) min[k] = all[i]; if (all[i] > max[k]) max[k] = all[i]; }
    return box;
  }
  get empty() { return this.min[0] > this.max[0]; }
  get size() { return this.empty ? [0, 0, 0] : add(this.max, this.min, -1); }
  get middle() { return this.empty ? [0, 0, 0] : scaled(add(this.max, this.min), 0.5); }
  get corners() { return [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [0, 1, 2].map((k) => (i & (1 << k) ? this.max[k] : this.min[k]))); }
  grow(point) {
    for (let k = 0; k < 3; k++) { this.min[k] = Math.min(this.min[k], point[k]); this.max[k] = Math.max(this.max[k], point[k]); }
    return this;
  }
  join(other) { return other.empty ? this : this.grow(other.min).grow(other.max); }
  moved(by) { return new Box(add(this.min, by), add(this.max, by)); }
}

// A camera looks from `eye` at `target`. `half` is half of what it sees, across and up: in mm, or, where it has perspective, at a distance of 1.
export class Camera {
  constructor(options) { Object.assign(this, { eye: [0, 0, 1], target: [0, 0, 0], up: [0, 0, 1], half: [1, 1], near: 0.1, far: 2000, perspective: false }, options); }
  // The ways to the right, up and towards the eye.
  get ways() {
    const to = unit(add(this.eye, this.target, -1)), right = unit(cross(this.up, to));
    return [right, cross(to, right), to];
  }
  // What takes a place into the picture, whose sides are at -1 and 1.
  get lens() {
    const { ways, eye, near, far, perspective, half: [w, h] } = this, deep = far - near;
    const own = placement(ways, ways.map((way) => -dot(way, eye)));
    const lens = perspective ? [1 / w, 0, 0, 0, 0, 1 / h, 0, 0, 0, 0, -(far + near) / deep, -1, 0, 0, (-2 * far * near) / deep, 0] : [1 / w, 0, 0, 0, 0, 1 / h, 0, 0, 0, 0, -2 / deep, 0, 0, 0, -(far + near) / deep, 1];
    return times(lens, own);
  }
  // Where a place is in the picture.
  seen([x, y, z]) {
    const m = this.lens, w = m[3] * x + m[7] * y + m[11] * z + m[15];
    return [0, 1].map((r) => (m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r]) / w);
  }
  // The line of sight through a place of the picture.
  ray(x, y) {
    const [right, head, to] = this.ways, aside = add(scaled(right, x * this.half[0]), head, y * this.half[1]);
    return this.perspective ? { from: this.eye, way: unit(add(aside, to, -1)) } : { from: add(this.eye, aside), way: scaled(to, -1) };
  }
  // The same through the place of a canvas at which a pointer is.
  under({ clientX, clientY }, canvas) {
    const { left, top, width, height } = canvas.getBoundingClientRect();
    return this.ray(((clientX - left) / width) * 2 - 1, 1 - ((clientY - top) / height) * 2);
  }
}

// The first of things that a ray meets where their planes leave them, and the place; null where it meets none.
export function met({ from, way }, things) {
  // In a frame that looks along the ray: aside, up, ahead.
  const aside = unit(cross(way, Math.abs(way[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0])), head = cross(aside, way), ways = [aside, head, way];
  const ahead = placement(ways, ways.map((one) => -dot(one, from)));
  let found = null, nearest = Infinity;
  for (const thing of things) {
    const { mesh: { points, faces, ball: [middle, radius] }, place = HERE, plane } = thing, m = times(ahead, place);
    const [u, v] = placed(m, middle), stretch = Math.max(1, ...[0, 4, 8].map((i) => Math.hypot(...place.slice(i, i + 3))));
    if (Math.hypot(u, v) > radius * stretch) continue;
    const seen = placedAll(m, points);
    for (let f = 0; f < faces.length; f += 3) {
      const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
      const wa = seen[b] * seen[c + 1] - seen[c] * seen[b + 1], wb = seen[c] * seen[a + 1] - seen[a] * seen[c + 1], wc = seen[a] * seen[b + 1] - seen[b] * seen[a + 1];
      if (!((wa >= 0 && wb >= 0 && wc >= 0) || (wa <= 0 && wb <= 0 && wc <= 0)) || wa + wb + wc === 0) continue;
      const far = (wa * seen[a + 2] + wb * seen[b + 2] + wc * seen[c + 2]) / (wa + wb + wc);
      if (far <= 0 || far >= nearest) continue;
      const point = add(from, way, far);
      if (plane && dot(plane, point) + plane[3] < -1e-6) continue;
      [found, nearest] = [{ thing, point }, far];
    }
  }
  return found;
}
