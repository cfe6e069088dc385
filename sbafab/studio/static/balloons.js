// An actuator's balloons and bonded films in a pose, as arcs of the film's own length between plates.
import { css } from "./dom.js";
import { frame, meridian } from "./motion_drawing.js";
import { area, polygons } from "./shapes.js";
import { THREE } from "./stage3d.js";

export class Balloons {
  constructor(mesh) {
    this.mesh = mesh;
    this.group = new THREE.Group();
    this.group.matrixAutoUpdate = false;
    this.body = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshPhongMaterial({ side: THREE.DoubleSide, shininess: 26, specular: 0x333a42, vertexColors: true }));
    this.body.frustumCulled = false;
    this.group.add(this.body);
  }
  // Of a stack: its facets and colours; `wall` is the plate between its balloons, `tone` its colour.
  shape(stack, { wall, lumen, tone = "--tpe" }) {
    this.stack = stack;
    const { axes, levels } = stack, { turn, rings } = this.mesh, count = levels.length * axes.length;
    const rows = 2 * rings + 2, each = rows * turn, colours = new Float32Array(count * each * 3), index = [];
    this.points = new Float32Array(count * each * 3);
    const own = new THREE.Color(css(tone)), other = new THREE.Color(css("--bond"));
    for (let b = 0; b < count; b++) {
      const shade = own.clone().lerp(other, 0.22 * (b % axes.length));
      for (let i = 0; i < each; i++) shade.toArray(colours, (b * each + i) * 3);
      for (let row = 0; row < rows - 1; row++) for (let t = 0; t < turn; t++) {
        const a = b * each + row * turn + t, c = b * each + row * turn + ((t + 1) % turn);
        index.push(a, c, a + turn, c, c + turn, a + turn);
      }
    }
    const { geometry } = this.body;
    geometry.setAttribute("position", new THREE.BufferAttribute(this.points, 3).setUsage(THREE.DynamicDrawUsage));
    geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
    geometry.setIndex(index);
    geometry.setDrawRange(0, Infinity);
    this.webs(wall, lumen, own);
  }
  // The bonded films between the balloons of a level: the plate's outline, one a level.
  webs(wall, lumen, colour) {
    const { stack } = this;
    if (this.web) { this.group.remove(this.web); this.web.dispose(); this.web = null; }
    const outer = polygons(wall ?? [], 0.02).filter((points) => area(points) > 0).sort((a, b) => area(b) - area(a))[0];
    if (!outer || stack.axes.length < 2) return;
    const round = (x, y, r) => Array.from({ length: 32 }, (_, t) => new THREE.Vector2(x + r * Math.cos(-t * Math.PI / 16), y + r * Math.sin(-t * Math.PI / 16)));
    const shape = new THREE.Shape(outer.map(([x, y]) => new THREE.Vector2(x, y)));
    for (const [x, y] of stack.axes) shape.holes.push(new THREE.Path(round(x, y, stack.balloons[0].pocket * 0.9)));
    if (lumen) shape.holes.push(new THREE.Path(round(0, 0, lumen / 2)));
    this.web = new THREE.InstancedMesh(new THREE.ShapeGeometry(shape, 1), new THREE.MeshLambertMaterial({ color: colour, side: THREE.DoubleSide }), stack.levels.length);
    this.web.frustumCulled = false;
    this.group.add(this.web);
  }
  clear() { this.body.geometry.setDrawRange(0, 0); if (this.web) this.web.visible = false; }
  place(pose) {
    const { stack } = this, m = new THREE.Matrix4();
    this.web.visible = true;
    stack.levels.forEach((_, level) => {
      const a = pose.origins[level], b = pose.origins[level + 1], u = pose.axes[level], v = pose.axes[level + 1];
      const x = new THREE.Vector3(u[0] + v[0], u[3] + v[3], u[6] + v[6]).normalize(), z = new THREE.Vector3(u[2] + v[2], u[5] + v[5], u[8] + v[8]).normalize();
      const y = new THREE.Vector3().crossVectors(z, x).normalize();
      // The rims draw the bonded films in as the balloons rise.
      const { pocket, neck } = stack.balloons[stack.levels[level]], rise = Math.max(...pose.gaps[level]) + stack.pitch;
      const k = 1 - (pocket - meridian(rise, pocket - neck, neck, 1)[1][0]) / stack.outline;
      m.makeBasis(x.multiplyScalar(k), y.multiplyScalar(k), z).setPosition((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2);
      this.web.setMatrixAt(level, m);
    });
    this.web.instanceMatrix.needsUpdate = true;
  }
  draw(pose) {
    if (this.web) this.place(pose);
    const { stack, points } = this, chambers = stack.axes.length, { turn, rings, cos, sin } = this.mesh;
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
    this.body.geometry.attributes.position.needsUpdate = true;
    this.body.geometry.computeVertexNormals();
  }
}
