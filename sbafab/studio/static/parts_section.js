// The cut through an assembly's parts by a plane square to an axis: closed contours of each part, from its surface.
import { placedAll } from "./space.js";

// What lies this near to the plane, in mm, counts as beyond it: no corner lies on the plane itself.
const NEAR = 1e-6;

// Contours of a part's cut as lists of [across, up] in mm, at `value` along `axis`; axes are 0, 1 and 2.
export function contoursOf({ mesh, place }, axis, value, across, up) {
  const count = mesh.points.length / 3, points = new Array(count), sides = new Float64Array(count), { faces } = mesh, all = placedAll(place, mesh.points);
  for (let i = 0; i < count; i++) {
    points[i] = [all[3 * i + across], all[3 * i + up]];
    sides[i] = all[3 * i + axis] - value;
    if (Math.abs(sides[i]) < NEAR) sides[i] = NEAR;
  }
  // Each edge that crosses the plane belongs to two faces, so that its place leads from one to the next.
  const places = new Map(), next = new Map();
  const crossing = (a, b) => {
    const name = a < b ? a * count + b : b * count + a;
    if (!places.has(name)) { const t = sides[a] / (sides[a] - sides[b]); places.set(name, [0, 1].map((i) => points[a][i] + t * (points[b][i] - points[a][i]))); }
    return name;
  };
  for (let f = 0; f < faces.length; f += 3) {
    const ends = {};
    for (let i = 0; i < 3; i++) {
      const a = faces[f + i], b = faces[f + ((i + 1) % 3)];
      if (sides[a] < 0 !== sides[b] < 0) ends[sides[a] < 0 ? "to" : "from"] = crossing(a, b);
    }
    if ("from" in ends) { if (!next.has(ends.from)) next.set(ends.from, []); next.get(ends.from).push(ends.to); }
  }
  const loops = [];
  for (const start of next.keys()) {
    const loop = [];
    for (let at = start; next.get(at)?.length; at = next.get(at).pop()) loop.push(places.get(at));
    if (loop.length > 2) loops.push(loop);
  }
  return loops;
}
// The area that contours enclose, holes taken off, in mm².
export const areaOf = (loops) => Math.abs(loops.reduce((sum, loop) => sum + loop.reduce((twice, [x, y], i) => { const [u, v] = loop[(i + 1) % loop.length]; return twice + x * v - u * y; }, 0) / 2, 0));
