// The parts of an assembly in space: a mesh a part, each surface built once and placed as the assembly places it.
import { THREE } from "./stage3d.js";
import { css } from "./dom.js";

const CREASE = Math.cos((32 * Math.PI) / 180);
// A face smaller than this, in mm², is a sliver whose way says nothing.
const SLIVER = 2e-4;
const MOST_KEPT = 40;
const built = new Map();

// Points, faces and creases of a surface as it came, in the part's own frame.
export function geometryOf(key, surface) {
  if (built.has(key)) return built.get(key);
  const points = new Float32Array(bytes(surface.points)), faces = new Uint32Array(bytes(surface.faces));
  const solid = new THREE.BufferGeometry();
  solid.setAttribute("position", new THREE.BufferAttribute(points, 3));
  solid.setIndex(new THREE.BufferAttribute(faces, 1));
  const lines = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(creases(points, faces), 3));
  solid.computeBoundingBox();
  solid.computeBoundingSphere();
  const made = { solid, lines };
  built.set(key, made);
  while (built.size > MOST_KEPT) { const [oldest, { solid, lines }] = built.entries().next().value; solid.dispose(); lines.dispose(); built.delete(oldest); }
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

// All parts as meshes; `inside` paints what a cut opens.
export class PartMeshes {
  constructor(studio) {
    this.studio = studio;
    this.group = new THREE.Group();
    this.planes = [];
  }
  update() {
    this.group.clear();
    const { parts, surfaces } = this.studio;
    for (const part of parts ?? []) {
      const { solid, lines } = geometryOf(part.surface, surfaces.get(part.surface));
      const holder = new THREE.Group(), [a, b, c] = part.rows, [x, y, z] = part.shift;
      holder.matrixAutoUpdate = false;
      holder.userData = { part, place: new THREE.Matrix4().set(...a, x, ...b, y, ...c, z, 0, 0, 0, 1) };
      holder.add(new THREE.Mesh(solid), new THREE.Mesh(solid), new THREE.LineSegments(lines));
      this.group.add(holder);
    }
    this.arrange(0);
    for (const holder of this.group.children) holder.userData.box = new THREE.Box3().setFromObject(holder.children[0], true);
    this.paint();
  }
  paint() {
    const { parts, pickedParts, marked } = this.studio, clippingPlanes = this.planes;
    for (const { children: [outside, inside, lines], userData: { part } } of this.group.children) {
      const colour = css(pickedParts.includes(part.name) ? "--select" : marked?.has(part.name) ? "--ghost" : paintOf(part, parts));
      for (const one of [outside, inside, lines]) one.material.dispose();
      outside.material = new THREE.MeshLambertMaterial({ color: colour, flatShading: true, clippingPlanes, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
      inside.material = new THREE.MeshBasicMaterial({ color: new THREE.Color(colour).multiplyScalar(0.62), side: THREE.BackSide, clippingPlanes });
      inside.visible = clippingPlanes.length > 0;
      lines.material = new THREE.LineBasicMaterial({ color: css("--part-ink"), clippingPlanes });
    }
  }
  // Each part away from what it is fixed on along its own axis, by a share of the whole.
  arrange(share) {
    const away = new Map();
    for (const holder of this.group.children) {
      const { part, place } = holder.userData;
      const from = away.get(part.on), move = new THREE.Vector3();
      if (from) move.copy(from).addScaledVector(new THREE.Vector3(part.rows[0][2], part.rows[1][2], part.rows[2][2]), share);
      away.set(part.name, move);
      holder.userData.move = move;
      holder.matrix.copy(place).premultiply(new THREE.Matrix4().makeTranslation(move));
      holder.matrixWorldNeedsUpdate = true;
    }
    this.group.updateMatrixWorld(true);
  }
  box(of = () => true) {
    const all = new THREE.Box3();
    for (const holder of this.group.children) if (of(holder.userData.part)) all.union(this.boxOf(holder));
    return all;
  }
  boxOf({ userData: { box, move } }) { return box.clone().translate(move); }
  under(ray) {
    const [plane] = this.planes;
    const hits = ray.intersectObjects(this.group.children.map(({ children }) => children[0]), false);
    return hits.find(({ point }) => !plane || plane.distanceToPoint(point) >= -1e-6)?.object.parent.userData.part ?? null;
  }
}
export { THREE };
