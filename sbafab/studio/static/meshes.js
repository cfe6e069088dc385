// Surfaces of triangles and rows of lines, and those made from outlines and by turning.
import { Box } from "./space.js";
import { area } from "./shapes.js";

// Points as x, y, z in a row. With `faces` triangles of them, as numbers of points; else lines, in pairs
// or (`joined`) in a row. Whoever moves points counts `version` up.
export class Mesh {
  constructor(points, faces = null, { normals = null, colours = null, joined = false } = {}) {
    Object.assign(this, { points: new Float32Array(points), faces: faces && new Uint32Array(faces), normals, colours, joined, version: 0 });
  }
  get box() { return (this.known ??= Box.of(this.points)); }
  // A place and a distance from it within which all points lie.
  get ball() { return [this.box.middle, Math.hypot(...this.box.size) / 2]; }
}

// Of each point the way that its faces look, large faces most; not of length 1.
export function smoothed(points, faces, normals) {
  normals.fill(0);
  for (let f = 0; f < faces.length; f += 3) {
    const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
    const ux = points[b] - points[a], uy = points[b + 1] - points[a + 1], uz = points[b + 2] - points[a + 2];
    const vx = points[c] - points[a], vy = points[c + 1] - points[a + 1], vz = points[c + 2] - points[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (const i of [a, b, c]) { normals[i] += x; normals[i + 1] += y; normals[i + 2] += z; }
  }
}

// A figure of radii and heights turned round z.
export function turned(figure, turn = 64) {
  const points = [], faces = [];
  figure.forEach(([r, z], row) => {
    for (let t = 0; t < turn; t++) {
      const angle = (2 * Math.PI * t) / turn, a = row * turn + t, b = row * turn + ((t + 1) % turn);
      points.push(r * Math.cos(angle), r * Math.sin(angle), z);
      if (row) faces.push(a - turn, b - turn, b, a - turn, b, a);
    }
  });
  return new Mesh(points, faces);
}
export const cylinder = (r, low, high) => turned([[0, low], [r, low], [r, high], [0, high]]);

// Outlines grouped: each outer one with the holes that lie in it.
export function grouped(loops) {
  const groups = loops.filter((points) => area(points) > 0).map((points) => [points]);
  for (const hole of loops.filter((points) => area(points) <= 0)) (groups.find(([outer]) => within(outer, hole[0])) ?? groups[0])?.push(hole);
  return groups;
}
// The flat region within loops, and the prism of height 1 on it with its edges.
export function sheet(groups) {
  const points = [], faces = [];
  for (const group of groups) {
    const first = points.length / 3;
    for (const [x, y] of group.flat()) points.push(x, y, 0);
    faces.push(...triangles(group).map((i) => first + i));
  }
  return new Mesh(points, faces);
}
export function prism(loops) {
  const groups = grouped(loops), flat = sheet(groups), count = flat.points.length / 3, faces = [], edges = [];
  const points = [...flat.points, ...flat.points.map((value, i) => (i % 3 === 2 ? 1 : value))];
  for (let f = 0; f < flat.faces.length; f += 3) { const [a, b, c] = flat.faces.slice(f, f + 3); faces.push(a, c, b, count + a, count + b, count + c); }
  let first = 0;
  for (const loop of groups.flat()) {
    loop.forEach(([x0, y0], i) => {
      const j = (i + 1) % loop.length, [x1, y1] = loop[j], a = first + i, b = first + j;
      faces.push(a, b, count + b, a, count + b, count + a);
      edges.push(x0, y0, 1, x1, y1, 1, x0, y0, 0, x1, y1, 0);
    });
    first += loop.length;
  }
  return { solid: new Mesh(points, faces), edges: new Mesh(edges) };
}

function within(points, [x, y]) {
  let inside = false;
  for (let i = 0, j = points.length - 1; i < points.length; j = i++) {
    const [xi, yi] = points[i], [xj, yj] = points[j];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) inside = !inside;
  }
  return inside;
}

// Triangles within an outline and round its holes, as numbers of their points in a row: each hole is
// joined to what is round it by a line that crosses nothing, then corners that hold no other are cut off.
export function triangles(group) {
  const all = group.flat(), found = [];
  const turn = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  let first = 0;
  const loops = group.map((points) => points.map(() => first++)), far = (loop) => loop.reduce((best, i) => (all[i][0] > all[best][0] ? i : best));
  let [ring, ...holes] = loops;
  // From the right on: what is still to be joined then leaves a way to the right.
  for (holes.sort((a, b) => all[far(b)][0] - all[far(a)][0]); holes.length; holes.shift()) {
    const [hole] = holes, start = hole.indexOf(far(hole)), p = all[hole[start]];
    const edges = [ring, ...holes].flatMap((loop) => loop.map((i, k) => [all[i], all[loop[(k + 1) % loop.length]]]));
    const isClear = (k) => {
      const q = all[ring[k]], u = all[ring.at(k - 1)], v = all[ring[(k + 1) % ring.length]];
      const inside = [turn(u, q, p) > 0, turn(q, v, p) > 0];
      return (turn(u, q, v) > 0 ? inside[0] && inside[1] : inside[0] || inside[1])
        && !edges.some(([s, t]) => [s, t].every((end) => !same(end, p) && !same(end, q)) && turn(p, q, s) * turn(p, q, t) <= 0 && turn(s, t, p) * turn(s, t, q) <= 0);
    };
    const near = ring.map((i, k) => [Math.hypot(all[i][0] - p[0], all[i][1] - p[1]), k]).sort(([a], [b]) => a - b).map(([, k]) => k);
    const at = near.find(isClear) ?? near[0];
    ring = [...ring.slice(0, at + 1), ...hole.slice(start), ...hole.slice(0, start + 1), ...ring.slice(at)];
  }
  // A corner that can lie in another's triangle is one that turns the other way.
  const corners = ring.map((i) => ({ i, p: all[i] })), blunt = new Set();
  const judge = (corner) => { corner.bend = turn(corner.before.p, corner.p, corner.after.p); if (corner.bend > 0) blunt.delete(corner); else blunt.add(corner); };
  corners.forEach((corner, k) => Object.assign(corner, { before: corners.at(k - 1), after: corners[(k + 1) % corners.length] }));
  corners.forEach(judge);
  for (let corner = corners[0], left = corners.length, missed = 0; left > 2; ) {
    const { before: a, after: c, p: q } = corner, p = a.p, r = c.p;
    const holds = ({ p: o }) => turn(p, q, o) >= 0 && turn(q, r, o) >= 0 && turn(r, p, o) >= 0 && !same(o, p) && !same(o, q) && !same(o, r);
    // Where rounding leaves no corner to cut off, the next one goes as it is.
    if (missed <= left && (corner.bend <= 0 || any(blunt, holds))) { corner = c; missed++; continue; }
    if (corner.bend > 0) found.push(a.i, corner.i, c.i);
    blunt.delete(corner);
    [a.after, c.before] = [c, a];
    judge(a);
    judge(c);
    // The corner after the next one: triangles stay compact.
    [corner, left, missed] = [c.after, left - 1, 0];
  }
  return found;
}
const same = (a, b) => a[0] === b[0] && a[1] === b[1];
const any = (set, of) => { for (const one of set) if (of(one)) return true; return false; };
