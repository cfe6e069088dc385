// An actuator's balloons and bonded films in a pose, as arcs of the film's own length between plates.
import { SHINING, tone } from "./graphics.js";
import { Mesh, sheet, smoothed } from "./meshes.js";
import { frame, meridian } from "./motion_drawing.js";
import { area, polygons } from "./shapes.js";
import { add, cross, placement, scaled, times, unit } from "./space.js";

export class Balloons {
  constructor(mesh) { Object.assign(this, { mesh, film: null, webs: [] }); }
  // What is drawn, moved from the actuator's own frame by a placement.
  things(place) { return [this.film && { ...this.film, place }, ...this.webs.map((web) => ({ ...web, place: times(place, web.place) }))]; }
  // Of a stack: its facets and colours; `wall` is the plate between its balloons, `paint` the name of its colour.
  shape(stack, { wall, lumen, paint = "--tpe" }) {
    this.stack = stack;
    const { axes, levels } = stack, { turn, rings } = this.mesh, count = levels.length * axes.length;
    const rows = 2 * rings + 2, each = rows * turn, colours = new Float32Array(count * each * 3), index = [];
    const own = tone(paint), other = tone("--bond");
    for (let b = 0; b < count; b++) {
      const share = 0.22 * (b % axes.length), shade = own.map((value, i) => value + share * (other[i] - value));
      for (let i = 0; i < each; i++) colours.set(shade, (b * each + i) * 3);
      for (let row = 0; row < rows - 1; row++) for (let t = 0; t < turn; t++) {
        const a = b * each + row * turn + t, c = b * each + row * turn + ((t + 1) % turn);
        index.push(a, c, a + turn, c, c + turn, a + turn);
      }
    }
    const points = new Float32Array(count * each * 3);
    this.film = { mesh: new Mesh(points, index, { normals: new Float32Array(points.length), colours }), look: SHINING, tint: [1, 1, 1] };
    this.web = axes.length > 1 ? this.plate(wall, lumen, own) : null;
    this.webs = [];
  }
  // The bonded films between the balloons of a level: the plate's outline, less balloons and lumen.
  plate(wall, lumen, tint) {
    const { stack } = this, outer = polygons(wall ?? [], 0.02).filter((points) => area(points) > 0).sort((a, b) => area(b) - area(a))[0];
    const round = (x, y, r) => Array.from({ length: 32 }, (_, t) => [x + r * Math.cos(-t * Math.PI / 16), y + r * Math.sin(-t * Math.PI / 16)]);
    const holes = [...stack.axes.map(([x, y]) => round(x, y, stack.balloons[0].pocket * 0.9)), ...(lumen ? [round(0, 0, lumen / 2)] : [])];
    return outer && { mesh: sheet([[outer, ...holes]]), tint };
  }
  clear() { Object.assign(this, { film: null, webs: [] }); }
  place(pose, level) {
    const { stack } = this, a = pose.origins[level], b = pose.origins[level + 1], u = pose.axes[level], v = pose.axes[level + 1];
    const x = unit([u[0] + v[0], u[3] + v[3], u[6] + v[6]]), z = unit([u[2] + v[2], u[5] + v[5], u[8] + v[8]]), y = unit(cross(z, x));
    // The rims draw the bonded films in as the balloons rise.
    const { pocket, neck } = stack.balloons[stack.levels[level]], rise = Math.max(...pose.gaps[level]) + stack.pitch;
    const k = 1 - (pocket - meridian(rise, pocket - neck, neck, 1)[1][0]) / stack.outline;
    return placement([0, 1, 2].map((i) => [k * x[i], k * y[i], z[i]]), scaled(add(a, b), 0.5));
  }
  draw(pose) {
    if (this.web) this.webs = this.stack.levels.map((_, level) => ({ ...this.web, place: this.place(pose, level) }));
    const { stack, film: { mesh: { points, faces, normals } } } = this, chambers = stack.axes.length, { turn, rings, cos, sin } = this.mesh;
    let at = 0;
    const put = (x, y, z) => { points[at++] = x; points[at++] = y; points[at++] = z; };
    stack.levels.forEach((kind, level) => {
      const { neck, pocket, ring } = stack.balloons[kind], low = frame(pose, level), high = frame(pose, level + 1);
      for (let c = 0; c < chambers; c++) {
        const [ax, ay] = stack.axes[c], bottom = low(ax, ay, 0), top = high(ax, ay, 0);
        const h = Math.max(0.02, Math.hypot(top[0] - bottom[0], top[1] - bottom[1], top[2] - bottom[2]));
        const wall = meridian(h, pocket - neck, neck, rings);
        // From the lower neck out to the rim, along the bonded ring and back to the upper neck.
        for (let half = 0; half < 2; half++) for (let k = 0; k <= rings; k++) {
          const j = half ? rings - k : k, z = wall[j][1];
          const r = j === rings ? wall[rings][0] + ring * 0.55 : wall[j][0];
          // Between the two plates the frames are blended by height.
          const s = half ? 1 - z / h : z / h;
          for (let t = 0; t < turn; t++) {
            const x = ax + r * cos[t], y = ay + r * sin[t], p = low(x, y, 0), q = high(x, y, 0);
            put(p[0] + (q[0] - p[0]) * s, p[1] + (q[1] - p[1]) * s, p[2] + (q[2] - p[2]) * s);
          }
        }
      }
    });
    smoothed(points, faces, normals);
    this.film.mesh.version++;
  }
}
