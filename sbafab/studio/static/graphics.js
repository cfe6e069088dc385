// Pictures in space by WebGL2: surfaces with their edges, under lights, as a camera sees them.
import { css, el } from "./dom.js";
import { HERE, unit } from "./space.js";

// How a surface is painted: in its tint alone, by the way of each facet, or by its normals and shining.
export const PLAIN = 0, FACETS = 1, SHINING = 2;
// From below the sky is grey; suns shine from somewhere, so brightly.
export const lightsOf = (sky, ground, ...suns) => ({ sky: [sky, sky, sky], ground: linear(ground).map((value) => sky * value), suns: [0, 1].flatMap((i) => (suns[i] ? [...unit(suns[i].from), suns[i].strength] : [0, 0, 1, 0])) });

// Light is reckoned in linear shares of red, green and blue; screens and CSS have them bent.
const numbers = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
export const linear = (hex) => numbers(hex).map((value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4));
export const tone = (name) => linear(css(name));

const VERTEX = `
layout(location = 0) in vec3 point;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 colour;
uniform mat4 place, lens;
out vec3 at, way, paint;
void main() {
  vec4 there = place * vec4(point, 1.0);
  at = there.xyz;
  way = mat3(place) * normal;
  paint = colour;
  gl_Position = lens * there;
}`;
// Diffuse light by Lambert, shining by Blinn and Phong with Schlick's fresnel.
const FRAGMENT = `
precision highp float;
in vec3 at, way, paint;
uniform vec3 eye, sky, ground;
uniform vec4 tint, plane, suns[2];
out vec4 pixel;
const float PI = 3.141592653589793, SHARP = 26.0;
const vec3 GLOSS = vec3(0.0331, 0.0423, 0.0545);
void main() {
#ifdef CUT
  if (dot(plane.xyz, at) + plane.w < 0.0) discard;
#endif
  vec3 tone = tint.rgb * paint;
#if LOOK > 0
  vec3 light = vec3(0.0), shine = vec3(0.0);
#if LOOK == 1
  vec3 n = normalize(cross(dFdx(at), dFdy(at)));
#else
  vec3 n = normalize(gl_FrontFacing ? way : -way), to = normalize(eye - at);
#endif
  for (int i = 0; i < 2; i++) {
    float lit = suns[i].w * max(dot(n, suns[i].xyz), 0.0);
    light += lit;
#if LOOK == 2
    vec3 h = normalize(suns[i].xyz + to);
    float f = exp2((-5.55473 * dot(to, h) - 6.98316) * dot(to, h));
    shine += lit * mix(GLOSS, vec3(1.0), f) * 0.25 * (0.5 * SHARP + 1.0) / PI * pow(max(dot(n, h), 0.0), SHARP);
#endif
  }
  tone = tone * (light + mix(ground, sky, 0.5 + 0.5 * n.y)) / PI + shine;
#endif
  pixel = vec4(mix(12.92 * tone, 1.055 * pow(tone, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, tone)), tint.a);
}`;

let engine;
// What draws here: a "card", "software", or nothing where the browser has no WebGL2.
export function engineHere() {
  if (engine !== undefined) return engine;
  const gl = document.createElement("canvas").getContext("webgl2"), told = gl?.getExtension("WEBGL_debug_renderer_info");
  engine = gl && (/swiftshader|llvmpipe|softpipe|software|basic render/i.test(gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER)) ? "software" : "card");
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return engine;
}
const without = (instead) => el("p", { class: "fallback" }, `This view needs WebGL2, which this browser does not provide. ${instead}`);
const heard = new Set();
// Calls with true when the pictures of the page are lost, and with false when they are there again.
export function onLoss(call) { heard.add(call); }

export class Painter {
  // On a new canvas in a surface, `redraw` paints it; null where the browser cannot, which the surface then says, and what is there `instead`.
  static on(surface, attributes, redraw, instead) {
    if (!engineHere()) surface.append(without(instead));
    return engineHere() && new Painter(surface, attributes, redraw, instead);
  }
  constructor(surface, { smooth = true, ...attributes }, redraw, instead) {
    Object.assign(this, { smooth, instead, canvas: el("canvas", attributes) });
    surface.append(this.canvas);
    this.canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); for (const call of heard) call(true); });
    this.canvas.addEventListener("webglcontextrestored", () => { this.begin(); for (const call of heard) call(false); redraw(); });
    // A window that comes to a finer screen keeps its size.
    const finer = () => matchMedia(`(resolution: ${devicePixelRatio}dppx)`).addEventListener("change", () => { finer(); redraw(); }, { once: true });
    finer();
  }
  // As many dots a pixel as can be seen.
  get finest() { return Math.min(devicePixelRatio || 1, 2); }
  // A view that is never shown needs no context.
  open() {
    this.gl = this.canvas.getContext("webgl2", { antialias: this.smooth, alpha: false });
    if (this.gl) this.begin();
    else this.canvas.replaceWith(without(this.instead));
  }
  // All that a context holds; what was there before is gone with the last one.
  begin() {
    const { gl } = this;
    // What nothing refers to any more is freed with its mesh.
    Object.assign(this, { programs: new Map(), uploaded: new WeakMap() });
    gl.depthFunc(gl.LEQUAL);
    gl.polygonOffset(1, 1);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }
  // A program a way of painting: where there is no card, what it need not ask counts.
  program(look, isCut) {
    const { gl } = this, name = `${look} ${isCut}`;
    if (this.programs.has(name)) return this.programs.get(name);
    const program = gl.createProgram(), head = `#version 300 es\n#define LOOK ${look}\n${isCut ? "#define CUT\n" : ""}`;
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, head + source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    const at = Object.fromEntries(["place", "lens", "eye", "sky", "ground", "suns", "tint", "plane"].map((one) => [one, gl.getUniformLocation(program, one)]));
    this.programs.set(name, { program, at });
    return this.programs.get(name);
  }
  upload(mesh) {
    const { gl } = this;
    let known = this.uploaded.get(mesh);
    if (!known) {
      this.uploaded.set(mesh, (known = { array: gl.createVertexArray(), buffers: {} }));
      gl.bindVertexArray(known.array);
      ["points", "normals", "colours"].forEach((what, i) => {
        if (!mesh[what]) { gl.disableVertexAttribArray(i); return; }
        gl.bindBuffer(gl.ARRAY_BUFFER, (known.buffers[what] = gl.createBuffer()));
        gl.enableVertexAttribArray(i);
        gl.vertexAttribPointer(i, 3, gl.FLOAT, false, 0, 0);
      });
      if (mesh.faces) {
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.faces, gl.STATIC_DRAW);
      }
    }
    gl.bindVertexArray(known.array);
    if (known.version === mesh.version) return;
    for (const [what, buffer] of Object.entries(known.buffers)) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, mesh[what], gl.DYNAMIC_DRAW);
    }
    known.version = mesh.version;
  }
  // Paints things as a camera sees them, with so many dots a pixel.
  paint({ things, camera, lights }, ratio = this.finest) {
    const { canvas } = this, width = Math.floor(ratio * canvas.clientWidth), height = Math.floor(ratio * canvas.clientHeight);
    if (!width || !height) return;
    if (this.gl === undefined) this.open();
    const { gl } = this;
    if (!gl || gl.isContextLost()) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(...numbers(css("--canvas")), 1);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.vertexAttrib3f(2, 1, 1, 1);
    const all = things.filter((thing) => thing && !thing.hidden), isClear = ({ opacity = 1 }) => opacity < 1;
    const edges = all.filter((thing) => thing.edges).map(({ edges, ink, place, plane }) => ({ mesh: edges, tint: ink, place, plane }));
    this.view = { camera, lights, told: new Set() };
    for (const one of [...all.filter((thing) => !isClear(thing)), ...edges, ...all.filter(isClear)]) this.lay(one);
  }
  // A mesh at its place: `side` is 1 for the front of its faces alone, -1 for their back; of what has a
  // `plane` [x, y, z, w] only that is seen for which x, y, z times the place plus w is positive.
  lay({ mesh, edges, place = HERE, look = FACETS, side = 0, tint, opacity = 1, plane, above = false }) {
    const { gl, view } = this, { program, at } = this.program(mesh.faces ? look : PLAIN, Boolean(plane));
    const turn = (on, what) => (on ? gl.enable(what) : gl.disable(what));
    gl.useProgram(program);
    if (!view.told.has(program)) {
      view.told.add(program);
      gl.uniformMatrix4fv(at.lens, false, (view.lens ??= view.camera.lens));
      gl.uniform3fv(at.eye, view.camera.eye);
      gl.uniform3fv(at.sky, view.lights.sky);
      gl.uniform3fv(at.ground, view.lights.ground);
      gl.uniform4fv(at.suns, view.lights.suns);
    }
    gl.uniformMatrix4fv(at.place, false, place);
    gl.uniform4f(at.tint, ...tint, opacity);
    if (plane) gl.uniform4fv(at.plane, plane);
    turn(side, gl.CULL_FACE);
    gl.cullFace(side < 0 ? gl.FRONT : gl.BACK);
    turn(opacity < 1, gl.BLEND);
    turn(!above, gl.DEPTH_TEST);
    gl.depthMask(opacity === 1);
    // A surface lies behind its edges.
    turn(edges, gl.POLYGON_OFFSET_FILL);
    this.upload(mesh);
    if (mesh.faces) gl.drawElements(gl.TRIANGLES, mesh.faces.length, gl.UNSIGNED_INT, 0);
    else gl.drawArrays(mesh.joined ? gl.LINE_STRIP : gl.LINES, 0, mesh.points.length / 3);
  }
  // What was painted last, as a file of this name.
  async picture(name) { return { name, blob: await new Promise((done) => this.canvas.toBlob(done)) }; }
}
