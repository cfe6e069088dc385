// Shapes: contours of x, y, bulge. An arc stays an arc in a path and in a section.

// Path data in mm, y up: of closed contours, and of points in a row with the bulges of the edges between them.
function along(c, count) {
  const n = c.length / 3;
  let d = `M${c[0]} ${c[1]}`;
  for (let i = 0; i < count; i++) {
    const j = ((i + 1) % n) * 3, b = c[i * 3 + 2];
    if (b === 0) d += `L${c[j]} ${c[j + 1]}`;
    else {
      const r = radius(c[i * 3], c[i * 3 + 1], c[j], c[j + 1], b);
      d += `A${r} ${r} 0 ${Math.abs(b) > 1 ? 1 : 0} ${b > 0 ? 1 : 0} ${c[j]} ${c[j + 1]}`;
    }
  }
  return d;
}
export function openPathOf(points) { return along(points.flatMap(([x, y, b = 0]) => [x, y, b]), points.length - 1); }
export function pathOf(shape) {
  let d = "";
  for (const c of shape) d += `${along(c, c.length / 3)}Z`;
  return d;
}
const radius = (x0, y0, x1, y1, b) => Math.hypot(x1 - x0, y1 - y0) * (1 + b * b) / (4 * Math.abs(b));

export function arc(x0, y0, x1, y1, b) {
  // Centre left of the chord by the DXF convention.
  const k = (1 / b - b) / 4;
  const cx = (x0 + x1) / 2 - (y1 - y0) * k, cy = (y0 + y1) / 2 + (x1 - x0) * k;
  return { cx, cy, r: Math.hypot(x0 - cx, y0 - cy), start: Math.atan2(y0 - cy, x0 - cx), sweep: 4 * Math.atan(b) };
}

// Points of every contour, arcs as chords at most `sag` mm off.
export function polygons(shape, sag = 0.01) {
  return shape.map((c) => {
    const n = c.length / 3, points = [];
    for (let i = 0; i < n; i++) {
      const j = ((i + 1) % n) * 3, x0 = c[i * 3], y0 = c[i * 3 + 1], b = c[i * 3 + 2];
      points.push([x0, y0]);
      if (b === 0) continue;
      const a = arc(x0, y0, c[j], c[j + 1], b);
      const step = 2 * Math.acos(Math.max(0, 1 - sag / a.r));
      const pieces = Math.max(2, Math.ceil(Math.abs(a.sweep) / Math.max(step, 0.02)));
      for (let k = 1; k < pieces; k++) {
        const t = a.start + (a.sweep * k) / pieces;
        points.push([a.cx + a.r * Math.cos(t), a.cy + a.r * Math.sin(t)]);
      }
    }
    return points;
  });
}

export const area = (points) => {
  let twice = 0;
  for (let i = 0; i < points.length; i++) {
    const [x0, y0] = points[i], [x1, y1] = points[(i + 1) % points.length];
    twice += x0 * y1 - x1 * y0;
  }
  return twice / 2;
};

// The stretches of a line inside a shape, as distances from (x, y) along the unit vector (u, v).
export function spans(shape, x, y, u, v) {
  const stops = [];
  for (const c of shape) {
    const n = c.length / 3;
    for (let i = 0; i < n; i++) {
      const j = ((i + 1) % n) * 3, b = c[i * 3 + 2];
      // In the frame of the line: s along it, t beside it.
      const ax = c[i * 3] - x, ay = c[i * 3 + 1] - y, bx = c[j] - x, by = c[j + 1] - y;
      const t0 = ay * u - ax * v, t1 = by * u - bx * v, s0 = ax * u + ay * v, s1 = bx * u + by * v;
      if (b === 0) {
        if ((t0 < 0) !== (t1 < 0)) stops.push(s0 + (s1 - s0) * (t0 / (t0 - t1)));
        continue;
      }
      // Between its highest and lowest points an arc crosses the line once or not at all, and which of
      // the two the ends alone decide: rounding cannot, nor an end on the line itself.
      const a = arc(s0, t0, s1, t1, b), way = Math.sign(a.sweep), end = a.start + a.sweep;
      const turns = [a.start];
      const quarter = way > 0 ? Math.ceil((a.start - Math.PI / 2) / Math.PI) : Math.floor((a.start - Math.PI / 2) / Math.PI);
      for (let k = quarter; way * (Math.PI / 2 + k * Math.PI) < way * end; k += way) turns.push(Math.PI / 2 + k * Math.PI);
      turns.push(end);
      for (let k = 0; k + 1 < turns.length; k++) {
        const from = k ? a.cy + a.r * Math.sin(turns[k]) : t0, to = k + 2 < turns.length ? a.cy + a.r * Math.sin(turns[k + 1]) : t1;
        if ((from < 0) === (to < 0)) continue;
        const half = Math.sqrt(Math.max(0, a.r * a.r - a.cy * a.cy));
        stops.push(a.cx + Math.sign(Math.cos((turns[k] + turns[k + 1]) / 2)) * half);
      }
    }
  }
  stops.sort((p, q) => p - q);
  const found = [];
  for (let i = 0; i + 1 < stops.length; i += 2) if (stops[i + 1] - stops[i] > 1e-9) found.push([stops[i], stops[i + 1]]);
  return found;
}

// What two lists of stretches share, and what the first has beside the second.
export function shared(own, other) {
  const found = [];
  for (const [a, b] of own) for (const [c, d] of other) if (Math.min(b, d) - Math.max(a, c) > 1e-9) found.push([Math.max(a, c), Math.min(b, d)]);
  return found;
}
export function without(own, other) {
  let rest = own;
  for (const [c, d] of other) rest = rest.flatMap(([a, b]) => [[a, Math.min(b, c)], [Math.max(a, d), b]].filter(([from, to]) => to - from > 1e-9));
  return rest;
}

export function contains(shape, x, y) {
  return spans(shape, x, y, 1, 0).some(([a, b]) => a <= 0 && b >= 0);
}

// Distance from a point to the nearest edge of a shape.
export function nearest(shape, x, y) {
  let best = Infinity;
  for (const points of polygons(shape, 0.02))
    for (let i = 0; i < points.length; i++) {
      const [x0, y0] = points[i], [x1, y1] = points[(i + 1) % points.length];
      const dx = x1 - x0, dy = y1 - y0, l = dx * dx + dy * dy;
      const t = l ? Math.max(0, Math.min(1, ((x - x0) * dx + (y - y0) * dy) / l)) : 0;
      best = Math.min(best, Math.hypot(x - x0 - t * dx, y - y0 - t * dy));
    }
  return best;
}
