// The parts of an assembly in space: a mesh a part, each surface built once and placed as the assembly places it.
import { PLAIN, tone } from "./graphics.js";
import { Mesh } from "./meshes.js";
import { Box, add, met, placement, shifted, times } from "./space.js";

const CREASE = Math.cos((32 * Math.PI) / 180);
// A face smaller than this, in mm², is a sliver whose way says nothing.
const SLIVER = 2e-4;
const MOST_KEPT = 40;
const built = new Map();

// Points, faces and creases of a surface as it came, in the part's own frame.
export function geometryOf(key, surface) {
  if (built.has(key)) return built.get(key);
  const points = new Float32Array(bytes(surface.points)), faces = new Uint32Array(bytes(surface.faces));
  const made = { solid: new Mesh(points, faces), edges: new Mesh(creases(points, faces)) };
  built.set(key, made);
  if (built.size > MOST_KEPT) built.delete(built.keys().next().value);
  return made;
}
const bytes = (words) => Uint8Array.from(atob(words), (c) => c.charCodeAt(0)).buffer;

// The edges at which a surface turns sharply, as pairs of points.
function creases(points, faces) {
  const count = faces.length / 3, normals = new Float32Array(faces.length), size = points.length / 3;
  for (let f = 0; f < count; f++) {
    const [a, b, c] = [faces[3 * f] * 3, faces[3 * f + 1] * 3, faces[3 * f + 2] * 3];
    const ux = points[b] - points[a], uy = points[b + 1] - points[a + 1], uz = points[b + 2] - points[a + 2];
    const vx = points[c] - points[a], vy = points[c + 1] - points[a + 1], vz = points[c + 2] - points[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx, l = Math.hypot(x, y, z) || 1;
    if (l > 2 * SLIVER) normals.set([x / l, y / l, z / l], 3 * f);
    else normals[3 * f] = NaN;
  }
  const open = new Map(), found = [];
  for (let f = 0; f < count; f++) for (let i = 0; i < 3; i++) {
    const p = faces[3 * f + i], q = faces[3 * f + ((i + 1) % 3)], name = p < q ? p * size + q : q * size + p;
    const other = open.get(name);
    if (other === undefined) { open.set(name, f); continue; }
    const turn = normals[3 * f] * normals[3 * other] + normals[3 * f + 1] * normals[3 * other + 1] + normals[3 * f + 2] * normals[3 * other + 2];
    if (turn < CREASE) found.push(points[3 * p], points[3 * p + 1], points[3 * p + 2], points[3 * q], points[3 * q + 1], points[3 * q + 2]);
  }
  return new Float32Array(found);
}

// The colour of a part: one a design in their order, one a kind of what is bought.
export function paintOf(part, parts) {
  if (!part.design) return `--part-${part.kind}`;
  const designs = [...new Set(parts.filter(({ design }) => design).map(({ design }) => design.name))];
  return `--design-${designs.indexOf(part.design.name) % 4}`;
}
export const partWords = (part) => `${part.name}, ${part.design ? part.design.name : part.kind}${part.on ? `, on ${part.on} (${part.at})` : ""}`;

// All parts in their places; with a `plane` they are cut, and their insides painted as what it opens.
export class PartMeshes {
  constructor(studio) { Object.assign(this, { studio, bodies: [], plane: null }); }
  update() {
    const { parts, surfaces } = this.studio;
    this.bodies = (parts ?? []).map((part) => {
      const { solid, edges } = geometryOf(part.surface, surfaces.get(part.surface)), own = placement(part.rows, part.shift);
      return { part, mesh: solid, edges, own, box: Box.of(solid.points, own), side: 1 };
    });
    this.arrange(0);
    this.paint();
  }
  paint() {
    const { parts, pickedParts, marked } = this.studio, ink = tone("--part-ink");
    for (const body of this.bodies) {
      const { name } = body.part, tint = tone(pickedParts.includes(name) ? "--select" : marked?.has(name) ? "--ghost" : paintOf(body.part, parts));
      Object.assign(body, { tint, ink, plane: this.plane ?? undefined });
    }
  }
  // What is drawn: outsides with their edges, and in a cut insides without light, so that they read as cut faces.
  get things() {
    const insides = this.plane ? this.bodies.map((body) => ({ ...body, edges: null, side: -1, look: PLAIN, tint: body.tint.map((value) => 0.62 * value) })) : [];
    return [...this.bodies, ...insides];
  }
  // Each part away from what it is fixed on along its own axis, by a share of the whole.
  arrange(share) {
    const away = new Map();
    for (const body of this.bodies) {
      const { part, own } = body, from = away.get(part.on);
      body.move = from ? add(from, part.rows.map((row) => row[2]), share) : [0, 0, 0];
      away.set(part.name, body.move);
      body.place = times(shifted(body.move), own);
    }
  }
  box(of = () => true) { return this.bodies.filter(({ part }) => of(part)).reduce((all, body) => all.join(this.boxOf(body)), new Box()); }
  boxOf({ box, move }) { return box.moved(move); }
  under(ray) { return met(ray, this.bodies)?.thing.part ?? null; }
}
