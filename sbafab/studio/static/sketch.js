// A named shape of a design file while it is edited: its handles, its outline, what goes back into the text, and
// what a point snaps to. Shapes are tables as the file has them; functions return new ones.
import { plain } from "./dom.js";
import { arc } from "./shapes.js";

export const KINDS = {
  disc: "Circle", ring: "Ring", slot: "Slot with square ends", stadium: "Slot with round ends", polygon: "Straight edges", path: "Lines and arcs", file: "Drawing from a file",
  offset: "Another shape, grown", fillet: "Another shape, concave corners rounded", union: "Shapes joined", difference: "Shape with others cut out", pattern: "Shape repeated",
};
const QUARTER = Math.tan(Math.PI / 8);
const BULGES = [[0, "straight"], [1, "half circle"], [QUARTER, "quarter circle"], [Math.tan(Math.PI / 12), "60° arc"]];
const DIGITS = 6;

export const kindOf = (shape) => Object.keys(KINDS).find((kind) => shape?.[kind] !== undefined && shape[kind] !== null);
export const hasCorners = (shape) => ["polygon", "path"].includes(kindOf(shape));

// The shapes that a shape is made of, and all that change with it.
export function parts(shape) {
  const value = shape[kindOf(shape)];
  return ["offset", "fillet", "pattern"].includes(kindOf(shape)) ? [value] : ["union", "difference"].includes(kindOf(shape)) ? value : [];
}
export function dependents(shapes, name) {
  const all = new Set([name]);
  for (let size = 0; size < all.size;) {
    size = all.size;
    for (const [other, shape] of Object.entries(shapes)) if (parts(shape).some((part) => all.has(part))) all.add(other);
  }
  return all;
}

// From the shape's frame to the plane, and back.
const round = (value) => Number(value.toFixed(DIGITS)) || 0;
function turn(shape) {
  const t = ((shape.turned ?? 0) * Math.PI) / 180, [x, y] = shape.at ?? [0, 0];
  return { c: Math.cos(t), s: Math.sin(t), x, y };
}
export function outward(shape, [px, py]) { const { c, s, x, y } = turn(shape); return [c * px - s * py + x, s * px + c * py + y]; }
export function inward(shape, [px, py]) { const { c, s, x, y } = turn(shape); return [round(c * (px - x) + s * (py - y)), round(-s * (px - x) + c * (py - y))]; }

export function corners(shape) { return (shape.path ?? shape.polygon ?? []).map(([x, y, b = 0]) => ({ x, y, b })); }
// Straight edges stay a polygon; the first arc makes a path of it.
export function withCorners(shape, list) {
  const bent = shape.path !== undefined || list.some(({ b }) => b !== 0);
  const { polygon, path, ...rest } = shape;
  return { [bent ? "path" : "polygon"]: list.map(({ x, y, b }) => (b ? [x, y, b] : [x, y])), ...rest };
}

// Closed contours of x, y and bulge in the plane; none for a shape that is made of others.
export function outline(shape) {
  const circle = (d) => [1, 0, -1, 0].flatMap((x, i) => [(d / 2) * x, (d / 2) * [0, 1, 0, -1][i], QUARTER]);
  const kind = kindOf(shape), value = shape[kind];
  const flat = {
    disc: () => [circle(value)],
    ring: () => value.map(circle),
    slot: () => {
      const [[x0, y0], [x1, y1]] = value, l = Math.hypot(x1 - x0, y1 - y0) || 1, u = ((y1 - y0) / l) * (shape.width / 2), v = ((x1 - x0) / l) * (shape.width / 2);
      return [[x0 + u, y0 - v, 0, x1 + u, y1 - v, 0, x1 - u, y1 + v, 0, x0 - u, y0 + v, 0]];
    },
    stadium: () => { const [w, l] = value.map((size) => size / 2), y = l - w; return [[w, -y, 0, w, y, 1, -w, y, 0, -w, -y, 1]]; },
    polygon: () => [corners(shape).flatMap(({ x, y, b }) => [x, y, b])],
    path: () => [corners(shape).flatMap(({ x, y, b }) => [x, y, b])],
  }[kind]?.() ?? [];
  return flat.map((contour) => contour.flatMap((_, i) => (i % 3 ? [] : [...outward(shape, [contour[i], contour[i + 1]]), contour[i + 2]])));
}

// The edges of contours, each from its start to its end with its bulge.
export function edges(contours) {
  return contours.flatMap((contour) => {
    const count = contour.length / 3;
    return Array.from({ length: count }, (_, i) => { const j = ((i + 1) % count) * 3; return { x0: contour[3 * i], y0: contour[3 * i + 1], x1: contour[j], y1: contour[j + 1], b: contour[3 * i + 2] }; });
  });
}
export function apex({ x0, y0, x1, y1, b }) { return [(x0 + x1 + b * (y1 - y0)) / 2, (y0 + y1 - b * (x1 - x0)) / 2]; }
export function nearestOn({ x0, y0, x1, y1, b }, x, y) {
  if (b === 0) {
    const dx = x1 - x0, dy = y1 - y0, t = Math.max(0, Math.min(1, ((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy || 1)));
    return [x0 + t * dx, y0 + t * dy, t];
  }
  const { cx, cy, r, start, sweep } = arc(x0, y0, x1, y1, b);
  let t = (Math.sign(sweep) * (Math.atan2(y - cy, x - cx) - start)) % (2 * Math.PI);
  if (t < 0) t += 2 * Math.PI;
  const turn = Math.abs(sweep);
  if (t > turn) t = t - turn < 2 * Math.PI - t ? turn : 0;
  const angle = start + Math.sign(sweep) * t;
  return [cx + r * Math.cos(angle), cy + r * Math.sin(angle), t / turn];
}
// Length, and of an arc its radius and angle, in words.
export function edgeWords({ x0, y0, x1, y1, b }) {
  const chord = Math.hypot(x1 - x0, y1 - y0);
  if (!b) return `${plain(chord, 3)} mm`;
  return `R${plain((chord * (1 + b * b)) / (4 * Math.abs(b)), 3)}, ${plain((Math.abs(4 * Math.atan(b)) * 180) / Math.PI, 1)}°`;
}

// What can be dragged: where it lies, what it is called, and the shape once it is dragged to a place.
export function handles(shape) {
  const kind = kindOf(shape), value = shape[kind], at = (p) => outward(shape, p);
  const move = (p) => ({ ...shape, at: p.map(round) });
  const centre = { id: "centre", words: "centre", p: shape.at ?? [0, 0], move };
  const radius = (p) => round(2 * Math.hypot(...inward(shape, p)));
  if (hasCorners(shape)) {
    const list = corners(shape);
    return [
      ...edges(outline(shape)).map((edge, i) => ({ id: `edge-${i}`, edge: i, words: "arc: drag to bend", p: apex(edge), move: (p) => bend(shape, i, bulgeThrough(edge, p)) })),
      ...list.map(({ x, y, b }, i) => ({ id: `corner-${i}`, corner: i, words: `point ${i + 1}`, p: at([x, y]), move: (p) => { const [u, v] = inward(shape, p); return withCorners(shape, list.with(i, { x: u, y: v, b })); } })),
    ];
  }
  if (kind === "disc") return [centre, { id: "size", words: "diameter", p: at([value / 2, 0]), size: true, move: (p) => ({ ...shape, disc: radius(p) }) }];
  if (kind === "ring") return [centre, ...["outer", "inner"].map((name, i) => ({ id: name, words: `${name} diameter`, p: at([value[i] / 2, 0]), size: true, move: (p) => ({ ...shape, ring: value.with(i, radius(p)) }) }))];
  if (kind === "slot") {
    const [[x0, y0], [x1, y1]] = value, l = Math.hypot(x1 - x0, y1 - y0) || 1, side = [-(y1 - y0) / l, (x1 - x0) / l];
    const across = (p) => { const [x, y] = inward(shape, p); return round(2 * Math.abs((x - x0) * side[0] + (y - y0) * side[1])); };
    return [
      { id: "size", words: "width", size: true, p: at([(x0 + x1) / 2 + (side[0] * shape.width) / 2, (y0 + y1) / 2 + (side[1] * shape.width) / 2]), move: (p) => ({ ...shape, width: across(p) }) },
      ...value.map((end, i) => ({ id: `end-${i}`, words: `end ${i + 1}`, p: at(end), move: (p) => ({ ...shape, slot: value.with(i, inward(shape, p)) }) })),
    ];
  }
  if (kind === "stadium") return [centre, ...[[value[0] / 2, 0], [0, value[1] / 2]].map((p, i) => ({ id: ["width", "length"][i], words: ["width", "length"][i], size: true, p: at(p), move: (q) => ({ ...shape, stadium: value.with(i, round(2 * Math.abs(inward(shape, q)[i]))) }) }))];
  return [];
}

// Edges bent, points added and taken out.
export function bend(shape, i, b) { const list = corners(shape); return withCorners(shape, list.with(i, { ...list[i], b: Math.abs(b) < 1e-9 ? 0 : Math.max(-100, Math.min(100, Number(b.toPrecision(15)))) })); }
export function bulgeThrough({ x0, y0, x1, y1 }, [x, y]) {
  const dx = x1 - x0, dy = y1 - y0;
  return (2 * ((x - x0) * dy - (y - y0) * dx)) / (dx * dx + dy * dy || 1);
}
// A point on edge i at a share of it; an arc becomes two of the same circle.
export function inserted(shape, i, share = 0.5) {
  const list = corners(shape), { x, y, b } = list[i], next = list[(i + 1) % list.length];
  const [px, py] = b ? onArc({ x0: x, y0: y, x1: next.x, y1: next.y, b }, share) : [x + share * (next.x - x), y + share * (next.y - y)];
  const part = (t) => (b ? Math.tan(t * Math.atan(b)) : 0);
  return withCorners(shape, [...list.slice(0, i), { x, y, b: part(share) }, { x: round(px), y: round(py), b: part(1 - share) }, ...list.slice(i + 1)]);
}
function onArc(edge, share) {
  const { cx, cy, r, start, sweep } = arc(edge.x0, edge.y0, edge.x1, edge.y1, edge.b);
  return [cx + r * Math.cos(start + share * sweep), cy + r * Math.sin(start + share * sweep)];
}
export function without(shape, i) {
  const list = corners(shape).filter((_, j) => j !== i);
  return list.length < 2 || (list.length < 3 && !list.some(({ b }) => b)) ? null : withCorners(shape, list);
}

// The keys that change from one state of a shape to the next, as TOML writes them.
export function writes(name, before, after) {
  const changed = Object.keys(after).filter((key) => JSON.stringify(after[key]) !== JSON.stringify(before[key]));
  const gone = Object.keys(before).filter((key) => !(key in after));
  return [...gone.map((key) => [`shapes.${name}.${key}`, null]), ...changed.map((key) => [`shapes.${name}.${key}`, literal(after[key])])];
}
export function literal(value) {
  if (!Array.isArray(value)) return typeof value === "number" ? number(value) : JSON.stringify(value);
  const items = value.map(literal);
  return items.length > 6 ? `[\n  ${items.join(",\n  ")},\n]` : `[${items.join(", ")}]`;
}
const number = (value) => { const text = String(value); return text.includes("e") ? value.toFixed(15).replace(/\.?0+$/, "") : text; };
export const tableLiteral = (shape) => `{${Object.entries(shape).map(([key, value]) => `${key} = ${literal(value)}`).join(", ")}}`;

// Snapping. Targets are points and edges with words; guides are lines through a point with a direction.

export function targetsOf(named) {
  const points = [], lines = [];
  for (const { words, contours } of named) {
    for (const edge of edges(contours)) {
      points.push({ p: [edge.x0, edge.y0], words: `corner of ${words}` });
      if (edge.b) { const { cx, cy } = arc(edge.x0, edge.y0, edge.x1, edge.y1, edge.b); points.push({ p: [cx, cy], words: `centre of an arc of ${words}` }); }
      lines.push({ edge, words: `edge of ${words}` });
    }
  }
  return { points, lines };
}
// Where a point comes to lie: on a target within reach (mm), on a guide, on the grid, or as it is.
export function snapped([x, y], { reach, points = [], lines = [], guides = [], grid = 0 }) {
  const near = closest(points.map(({ p, words }) => ({ p, words, away: Math.hypot(p[0] - x, p[1] - y) })), reach);
  if (near) return near;
  const along = guides.map((guide) => { const t = (x - guide.x) * guide.u + (y - guide.y) * guide.v, p = [guide.x + t * guide.u, guide.y + t * guide.v]; return { guide, p, words: guide.words, away: Math.hypot(p[0] - x, p[1] - y) }; }).filter(({ away }) => away <= reach / 2);
  const meeting = closest(along.flatMap((one, i) => along.slice(i + 1).flatMap((other) => meet(one.guide, other.guide))).map(({ p, words }) => ({ p, words, away: Math.hypot(p[0] - x, p[1] - y) })), reach);
  if (meeting) return meeting;
  const edge = closest(lines.map(({ edge, words }) => { const [px, py] = nearestOn(edge, x, y); return { edge, p: [px, py], words, away: Math.hypot(px - x, py - y) }; }), reach);
  const step = (value) => (grid ? Math.round(value / grid) * grid : value);
  if (edge) return { ...edge, p: alongEdge(edge.edge, edge.p, step) };
  const guide = closest(along, reach);
  if (guide) {
    // Along the guide the grid still counts, where the guide follows it.
    const { u, v } = guide.guide;
    if (grid && Math.abs(v) < 1e-9) return { ...guide, p: [step(guide.p[0]), guide.p[1]] };
    if (grid && Math.abs(u) < 1e-9) return { ...guide, p: [guide.p[0], step(guide.p[1])] };
    return guide;
  }
  return { p: [step(x), step(y)], words: grid ? `grid of ${plain(grid)} mm` : "" };
}
// Along an edge that follows the grid, the grid still counts.
function alongEdge({ x0, y0, x1, y1, b }, [x, y], step) {
  const within = (value, a, c) => Math.min(Math.max(a, c), Math.max(Math.min(a, c), value));
  if (b || (x0 !== x1 && y0 !== y1)) return [x, y];
  return x0 === x1 ? [x, within(step(y), y0, y1)] : [within(step(x), x0, x1), y];
}
const closest = (list, reach) => list.filter(({ away }) => away <= reach).sort((a, b) => a.away - b.away)[0];
function meet(a, b) {
  const cross = a.u * b.v - a.v * b.u;
  if (Math.abs(cross) < 1e-9) return [];
  const t = ((b.x - a.x) * b.v - (b.y - a.y) * b.u) / cross;
  return [{ p: [a.x + t * a.u, a.y + t * a.v], words: `${a.words}, ${b.words}` }];
}
// Guides: the axes, and every 15 degrees through the neighbours of a point.
export function guidesThrough(neighbours, angles) {
  const axes = [{ x: 0, y: 0, u: 1, v: 0, words: "x axis" }, { x: 0, y: 0, u: 0, v: 1, words: "y axis" }];
  if (!angles) return axes;
  return [...axes, ...neighbours.flatMap(([x, y, words]) => Array.from({ length: 12 }, (_, i) => { const t = (i * Math.PI) / 12; return { x, y, u: i === 6 ? 0 : Math.cos(t), v: Math.sin(t), words: `${i * 15}° from ${words}` }; }))];
}
// A bulge near a known one takes it: straight, quarter, half, or going on smoothly from the edge before or after.
export function snappedBulge(shape, i, b, near) {
  const all = edges(outline(shape)), count = all.length, edge = all[i], chord = Math.atan2(edge.y1 - edge.y0, edge.x1 - edge.x0);
  const direction = ({ x0, y0, x1, y1, b: own }, end) => Math.atan2(y1 - y0, x1 - x0) + (end ? 2 : -2) * Math.atan(own);
  const wrapped = (t) => Math.atan2(Math.sin(t), Math.cos(t));
  const smooth = [[Math.tan(wrapped(chord - direction(all[(i + count - 1) % count], true)) / 2), "smooth with the edge before"], [Math.tan(wrapped(direction(all[(i + 1) % count], false) - chord) / 2), "smooth with the edge after"]];
  const known = [...BULGES.flatMap(([size, words]) => [[size, words], [-size, words]]), ...(count > 2 ? smooth : [])].filter(([size]) => Math.abs(size) <= 3);
  const best = known.map(([size, words]) => ({ b: size || 0, words, away: Math.abs(size - b) })).sort((p, q) => p.away - q.away)[0];
  return best.away <= near ? best : { b, words: "" };
}
