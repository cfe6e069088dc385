// What the motion is drawn from: frames of plates, walls as arcs, plots.
import { el, plain } from "./dom.js";

// How finely a balloon is drawn; without a graphics card coarser, for more frames a second.
export const FINE = { turn: 28, rings: 7 }, COARSE = { turn: 20, rings: 4 };

export function meshOf(fineness) {
  const angles = Array.from({ length: fineness.turn }, (_, t) => (2 * Math.PI * t) / fineness.turn);
  return { ...fineness, cos: angles.map(Math.cos), sin: angles.map(Math.sin) };
}

export function frame(pose, i) {
  const [ox, oy, oz] = pose.origins[i], a = pose.axes[i];
  return (x, y, z) => [ox + a[0] * x + a[1] * y + a[2] * z, oy + a[3] * x + a[4] * y + a[5] * z, oz + a[6] * x + a[7] * y + a[8] * z];
}

// A wall as an arc of the film's length, level at the neck: radius and height above the lower plate.
export function meridian(h, length, neck, rings) {
  const ratio = Math.min(0.72, h / (2 * length));
  let low = 1e-6, high = 2.33;
  for (let i = 0; i < 30; i++) { const mid = (low + high) / 2; if ((1 - Math.cos(mid)) / mid < ratio) low = mid; else high = mid; }
  const turn = low, bow = length / turn;
  return Array.from({ length: rings + 1 }, (_, k) => { const t = (turn * k) / rings; return [neck + bow * Math.sin(t), Math.min(h / 2, bow * (1 - Math.cos(t)))]; });
}

export function chart(xs, ys, x, y, words, unit = "kPa") {
  const w = 268, h = 112, left = 34, low = 92, top = Math.max(...ys, y) || 1, far = Math.max(...xs, x) || 1;
  const px = (value) => left + ((w - left - 8) * value) / far, py = (value) => low - ((low - 12) * value) / top;
  const label = (text, ax, ay, anchor) => el("text", { x: ax, y: ay, "text-anchor": anchor, "font-size": 10.5, fill: "var(--soft)" }, text);
  return el("svg", { viewBox: `0 0 ${w} ${h}`, class: "plot", role: "img", "aria-label": `${words}: ${y.toFixed(1)} at ${x.toFixed(1)} ${unit}` },
    el("path", { d: `M${left} 8V${low}H${w - 6}`, stroke: "var(--strong)", fill: "none" }),
    el("path", { d: xs.map((value, i) => `${i ? "L" : "M"}${px(value).toFixed(1)} ${py(ys[i]).toFixed(1)}`).join(""), stroke: "var(--accent)", "stroke-width": 1.8, fill: "none" }),
    el("circle", { cx: px(x), cy: py(y), r: 4, fill: "var(--select)" }),
    label(words, left + 6, 16, "start"), label(plain(top, 1), left - 4, 16, "end"), label("0", left - 4, low + 3, "end"), label(`${plain(far, 1)} ${unit}`, w - 6, low + 14, "end"));
}
// What the paper measured beside heights and bends of the elastic stack, which is off by more than a quarter.
export const measured = (stack) => Object.entries(stack.measured ?? {}).map(([what, sentence]) => `${what[0].toUpperCase()}${what.slice(1)}: ${sentence}.`).join(" ");
